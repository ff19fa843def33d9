"""MuJoCo: soft contacts whose springs are so stiff that a contact lasts a given number of steps.

Only the pairs of the model are tested for contact, by analytical functions (plane and sphere, two
spheres). A contact without rebound is critically damped (``solref`` positive: a time constant in
steps and a damping ratio of 1), one with rebound is given its stiffness and damping (``solref``
negative), the latter such that it has this coefficient of restitution. The impedance is as large as
MuJoCo accepts.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np

from benchmarks.contact.layout import Ball, Pair, damping_ratio, pairs
from benchmarks.mechanisms.layout import Layout, layout
from benchmarks.mechanisms.mujoco_models import IMPEDANCE, check_stable
from benchmarks.motion import Motion, observe_outputs
from msahl.model import Model

VERSION = mujoco.__version__


class _Variant(NamedTuple):
    integrator: int
    steps: float  # that a contact lasts
    noslip: bool = False
    ratio: float = 1.0  # impedance of friction over that of normal forces


_EULER, _RK4 = mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtIntegrator.mjINT_RK4
_FAST = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
VARIANTS = {
    "mujoco Euler, 10": _Variant(_EULER, 10),
    "mujoco implicitfast, 4, noslip": _Variant(_FAST, 4, noslip=True),
    "mujoco implicitfast, 10, impratio": _Variant(_FAST, 10, ratio=100.0),
    "mujoco RK4, 2": _Variant(_RK4, 2),
    "mujoco RK4, 4": _Variant(_RK4, 4),
    "mujoco RK4, 10": _Variant(_RK4, 10),
    "mujoco RK4, 10, noslip": _Variant(_RK4, 10, noslip=True),
    "mujoco RK4, 40": _Variant(_RK4, 40),
}
ORDERS = dict.fromkeys(VARIANTS, 1)
_NAMES = {_EULER: "semi-implicit Euler", _RK4: "Runge-Kutta of order 4", _FAST: "implicitfast"}
SETTINGS = {
    code: f"{_NAMES[v.integrator]}, contacts last {v.steps:g} steps, elliptic cone, Newton solver "
    "with tolerance 1e-16"
    + (", noslip solver" if v.noslip else "")
    + (f", impratio {v.ratio:g}" if v.ratio != 1.0 else "")
    for code, v in VARIANTS.items()
}
NOSLIP = 100
"""Iterations of its correction that removes slip, at most."""
POINT = 1e-9
"""Radius of a sphere that is a corner [m]: MuJoCo takes none without."""


def cannot(model: Model, variant: str) -> str:
    """Return why MuJoCo cannot take the model, empty if it can."""
    return ""


def motion(model: Model, h: float, steps: int, variant: str, every: int = 1) -> Motion:
    """Run ``steps`` steps; mass centres are stored ``every`` so many."""
    compiled, chosen = _compile(model), VARIANTS[variant]
    compiled.opt.integrator, compiled.opt.timestep = chosen.integrator, h
    compiled.opt.noslip_iterations = NOSLIP if chosen.noslip else 0
    compiled.opt.impratio = chosen.ratio
    for number, pair in enumerate(pairs(model)):
        compiled.pair_solref[number] = _solref(pair, chosen.steps * h)
    data = _start(compiled, model)
    rows, seconds = observe_outputs(
        lambda k: mujoco.mj_step(compiled, data, nstep=every),
        lambda: _look(compiled, data, model),
        steps // every,
    )
    none = np.zeros(0)
    t = h * every * np.arange(len(rows))
    return Motion(t, np.array(rows), none, none, none, seconds, steps)


def _solref(pair: Pair, lasts: float) -> tuple[float, float]:
    if pair.restitution == 0.0:
        return lasts, 1.0
    ratio = damping_ratio(pair.restitution)
    frequency = math.pi / lasts / math.sqrt(1.0 - ratio * ratio)
    return -((frequency * IMPEDANCE) ** 2), -2.0 * ratio * frequency * IMPEDANCE


def _look(compiled: mujoco.MjModel, data: mujoco.MjData, model: Model) -> np.ndarray:
    check_stable(data)
    mujoco.mj_kinematics(compiled, data)
    order = [compiled.body(body.name).id for body in model.bodies]
    x: np.ndarray = data.xipos[order]
    return x


@lru_cache(maxsize=1)
def _compile(model: Model) -> mujoco.MjModel:
    given = layout(model)
    spec = mujoco.MjSpec()
    spec.option.gravity = given.gravity
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.iterations, spec.option.ls_iterations = 100, 100
    spec.option.tolerance = spec.option.ls_tolerance = 1e-16
    spec.option.noslip_tolerance = 1e-16
    nodes = {"": spec.worldbody}
    hinges = {hinge.outer: hinge for hinge in given.tree}
    for name in [*hinges, *(name for name in given.masses if name not in hinges)]:
        nodes[name] = _add_body(nodes, given, name)
    for number, pair in enumerate(pairs(model)):
        _add_pair(spec, nodes, pair, number)
    return spec.compile()


def _add_body(nodes: dict[str, mujoco.MjsBody], given: Layout, name: str) -> mujoco.MjsBody:
    mass = given.masses[name]
    hinge = next((hinge for hinge in given.tree if hinge.outer == name), None)
    inner = hinge.inner if hinge else ""
    J = mass.inertia
    node = nodes[inner].add_body(
        name=name,
        pos=given.local(inner, mass.x),
        mass=mass.mass,
        fullinertia=[*np.diag(J), J[0, 1], J[0, 2], J[1, 2]],
        ipos=[0.0, 0.0, 0.0],
        explicitinertial=True,
    )
    if hinge is None:
        node.add_freejoint(name=name)
    else:
        node.add_joint(
            type=mujoco.mjtJoint.mjJNT_HINGE,
            pos=given.local(name, hinge.point),
            axis=hinge.axis,
            name=name,
        )
    return node


def _add_pair(
    spec: mujoco.MjSpec, nodes: dict[str, mujoco.MjsBody], pair: Pair, number: int
) -> None:
    names = [f"{number} ball", f"{number} other"]
    _add_ball(nodes, pair.ball, names[0])
    if isinstance(pair.other, Ball):
        _add_ball(nodes, pair.other, names[1])
    else:
        nodes[""].add_geom(
            name=names[1],
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0.0, 0.0, 1.0],
            pos=pair.other.point,
            zaxis=pair.other.normal,
            contype=0,
            conaffinity=0,
        )
    spec.add_pair(
        geomname1=names[1],
        geomname2=names[0],
        condim=3 if pair.friction else 1,
        friction=[pair.friction, pair.friction, 0.0, 0.0, 0.0],
        solimp=[IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0],
    )


def _add_ball(nodes: dict[str, mujoco.MjsBody], ball: Ball, name: str) -> None:
    nodes[ball.body].add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[max(ball.radius, POINT), 0.0, 0.0],
        pos=ball.point,
        mass=0.0,
        contype=0,
        conaffinity=0,
    )


def _start(compiled: mujoco.MjModel, model: Model) -> mujoco.MjData:
    """Velocities of free bodies: linear ones in inertial axes, angular ones in those of the body,
    which are inertial at t = 0.
    """
    data, given = mujoco.MjData(compiled), layout(model)
    for hinge in given.tree:
        first = compiled.joint(hinge.outer).dofadr[0]
        data.qvel[first] = given.rates(hinge)[0]
    hinged = {hinge.outer for hinge in given.tree}
    for name, mass in given.masses.items():
        if name not in hinged:
            first = compiled.joint(name).dofadr[0]
            data.qvel[first : first + 6] = [*mass.v, *mass.w]
    return data
