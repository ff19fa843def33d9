"""MuJoCo: a tree of joints in minimal coordinates, loops closed by its soft equality constraints.

A ball joint closes by one ``connect``, a hinge by one (in a plane) or by two on its axis; a gear is
an equality of two joints. The constraints are as stiff as MuJoCo allows: an impedance of 0.9999
and a time constant of two steps, so that their violation falls with the step. The solver's
tolerance is zero. Constraints are switched off in a tree.
"""

from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from benchmarks.mechanisms.layout import Gear, Hinge, Layout, Spring, layout
from benchmarks.motion import Motion, observe_outputs
from msahl.model import Model

VERSION = mujoco.__version__
INTEGRATORS = {
    "mujoco RK4": mujoco.mjtIntegrator.mjINT_RK4,
    "mujoco implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
}
VARIANTS = tuple(INTEGRATORS)
ORDERS = {"mujoco RK4": 4, "mujoco implicit": 1}
_COMMON = (
    "equality constraints with solimp 0.9999 and solref (2 steps, 1), Newton solver with tolerance "
    "0; constraints disabled in trees; springs between points are tendons"
)
SETTINGS = {
    "mujoco RK4": f"Runge-Kutta of order 4; {_COMMON}",
    "mujoco implicit": "its implicit integrator of order 1; the same otherwise",
}
IMPEDANCE = 0.9999
"""The largest that MuJoCo accepts."""
# Warnings are read from its data; it would write them into a file.
mujoco.set_mju_user_warning(lambda message: None)
_WARNINGS = mujoco.mjtWarning
_UNSTABLE = (_WARNINGS.mjWARN_BADQPOS, _WARNINGS.mjWARN_BADQVEL, _WARNINGS.mjWARN_BADQACC)
STEPS = 2.0
"""Time constant of the constraints in steps; shorter ones are refused."""


def cannot(model: Model, variant: str) -> str:
    """Return why MuJoCo cannot take the model, empty if it can."""
    return ""


def motion(model: Model, h: float, steps: int, variant: str, every: int = 1) -> Motion:
    """Run ``steps`` steps; mass centres are stored ``every`` so many."""
    compiled = _compile(model)
    compiled.opt.integrator, compiled.opt.timestep = INTEGRATORS[variant], h
    compiled.eq_solref[:] = (STEPS * h, 1.0)
    data = _start(compiled, layout(model))
    rows, seconds = observe_outputs(
        lambda k: mujoco.mj_step(compiled, data, nstep=every),
        lambda: _look(compiled, data),
        steps // every,
    )
    none = np.zeros(0)
    t = h * every * np.arange(len(rows))
    return Motion(t, _of_bodies(compiled, model, np.array(rows)), none, none, none, seconds, steps)


def check_stable(data: mujoco.MjData) -> None:
    """Raise ArithmeticError if the motion has diverged."""
    if any(data.warning[kind].number for kind in _UNSTABLE):
        raise ArithmeticError("unstable")


def _look(compiled: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    check_stable(data)
    mujoco.mj_kinematics(compiled, data)
    return data.xipos.copy()


def _of_bodies(compiled: mujoco.MjModel, model: Model, x: np.ndarray) -> np.ndarray:
    order = [compiled.body(body.name).id for body in model.bodies]
    return x[:, order]


@lru_cache(maxsize=1)
def _compile(model: Model) -> mujoco.MjModel:
    given = layout(model)
    spec = mujoco.MjSpec()
    spec.option.gravity = given.gravity
    spec.option.iterations, spec.option.ls_iterations = 100, 100
    spec.option.tolerance = spec.option.ls_tolerance = 1e-16
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    if not given.closing and not given.gears:
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    nodes = {"": spec.worldbody}
    for hinge in given.tree:
        nodes[hinge.outer] = _add_body(nodes[hinge.inner], given, hinge)
    for number, spring in enumerate(given.springs):
        _add_spring(spec, nodes, given, spring, number)
    for hinge in given.closing:
        _close(spec, given, hinge)
    for gear in given.gears:
        _add_gear(spec, gear)
    return spec.compile()


def _add_body(inner: mujoco.MjsBody, given: Layout, hinge: Hinge) -> mujoco.MjsBody:
    mass = given.masses[hinge.outer]
    inertia = mass.inertia
    node = inner.add_body(
        name=mass.name,
        pos=given.local(hinge.inner, mass.x),
        mass=mass.mass,
        fullinertia=[*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]],
        ipos=[0.0, 0.0, 0.0],
        explicitinertial=True,
    )
    point = given.local(mass.name, hinge.point)
    if hinge.kind == "spherical":
        node.add_joint(type=mujoco.mjtJoint.mjJNT_BALL, pos=point, name=hinge.name)
    kind = mujoco.mjtJoint.mjJNT_SLIDE if hinge.kind == "prismatic" else mujoco.mjtJoint.mjJNT_HINGE
    for number, axis in enumerate(hinge.axes):
        name = hinge.name if number == 0 else f"{hinge.name} {number}"
        added = node.add_joint(type=kind, pos=point, axis=axis, name=name)
        added.damping = _like(added.damping, hinge.damping)
    return node


def _like(sample: Any, value: float) -> Any:
    """Versions differ in whether a joint's damping is one number or a polynomial of the rate."""
    if np.ndim(sample) == 0:
        return value
    return [value, *np.zeros(np.size(sample) - 1)]


def _add_spring(
    spec: mujoco.MjSpec,
    nodes: dict[str, mujoco.MjsBody],
    given: Layout,
    spring: Spring,
    number: int,
) -> None:
    tendon = spec.add_tendon(name=f"spring {number}", springlength=[spring.free, spring.free])
    tendon.stiffness = _like(tendon.stiffness, spring.stiffness)
    tendon.damping = _like(tendon.damping, spring.damping)
    for end, (name, point) in enumerate(zip(spring.pair, spring.points, strict=True)):
        site = f"spring {number} end {end}"
        nodes[name].add_site(name=site, pos=given.local(name, point))
        tendon.wrap_site(site)


def _close(spec: mujoco.MjSpec, given: Layout, hinge: Hinge) -> None:
    """By one common point, or by two on the axis of a hinge outside a plane."""
    for point in given.closing_points(hinge):
        equality = spec.add_equality(
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1=hinge.outer,
            name2=hinge.inner or "world",
            solimp=[IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0],
        )
        equality.data[:3] = given.local(hinge.outer, point)


def _add_gear(spec: mujoco.MjSpec, gear: Gear) -> None:
    equality = spec.add_equality(
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=gear.second,
        name2=gear.first,
        solimp=[IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0],
    )
    equality.data[:5] = [0.0, gear.ratio, 0.0, 0.0, 0.0]


def _start(compiled: mujoco.MjModel, given: Layout) -> mujoco.MjData:
    data = mujoco.MjData(compiled)
    rates = [given.rates(hinge) for hinge in given.tree]
    for hinge, rate in zip(given.tree, rates, strict=True):
        first = compiled.joint(hinge.name).dofadr[0]
        data.qvel[first : first + len(rate)] = rate
    for name, moment in given.moments.items():
        data.xfrc_applied[compiled.body(name).id, 3:] = moment
    return data
