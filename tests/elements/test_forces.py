"""Every force acts, with its own law, in every scheme.

A pendulum in a revolute joint bears a force of every kind. Its closed equation, written here from
the laws alone and integrated by DOP853, gives the motion and the work of each force. Every scheme
must approach them with its order. Runs are in plain Python: nothing is compiled.

A new kind of force needs a load in ``PENDULUM`` and a line in ``Exact.forces``.
"""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from msahl.algebra.functions import Law
from msahl.algebra.rotation import compose, from_axis_angle, from_increment
from msahl.algebra.vector import ZERO
from msahl.elements.constraints import scalar
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.expressions.syntax import parse
from msahl.laws.registry import JOINT_LAWS, POINT_LAWS
from msahl.model import (
    Bushing,
    ConcentratedLoad,
    Joint,
    JointActuator,
    JointLoad,
    JointSpring,
    Marker,
    MarkerActuator,
    PointLoad,
    SpringDamper,
)
from msahl.model.loads import Load
from msahl.model.scheme import EXPLICIT, choices, split
from msahl.ports import forces
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.collocation import newton as collocation
from msahl.schemes.collocation import step_control
from msahl.schemes.collocation import stepper as collocation_stepper
from msahl.schemes.midpoint import newton as midpoint
from msahl.schemes.stepper import Chunk
from msahl.system import evaluate
from msahl.system.arrays import new_system_workspace, node_count
from msahl.system.build import build_system
from msahl.system.diagnostics import energy_balance
from msahl.system.state import build_state
from tests.support.element_samples import LOADS, random_vector, sample_parameters
from tests.support.evaluation import dense_matrix
from tests.support.models import GROUND, body, build_model, friction
from tools.validation.reference import JOINT_LOADS, POINT_FORCES

MASS, INERTIA, ARM, GRAVITY = 2.0, 0.3, 0.5, 9.81
START, RATE, T = 0.4, 4.0, 0.24
"""Angle [rad] and angular velocity [rad/s] at t = 0; time of the comparison [s].
The bob does not come to rest until then: drag is not smooth there."""
SINE = (1.0, 5.0, 0.3, 0.5)
"""Amplitude, angular frequency [rad/s], phase [rad] and offset of the law of time."""
Y_AXES = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Axes of a joint frame whose z axis is the y axis of its body."""
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
TIP, SIDE, HOOK = (0.1, 0.0, 0.3), (0.05, 0.0, 0.4), (0.6, 0.0, 0.2)
"""Points on the bob, from its mass centre, and on the ground [m]."""

OTHERS = {name: law for name, law in JOINT_LAWS.items() if not law.by_reaction}
"""Laws of forces along a joint's coordinate that do not depend on its reaction."""

PENDULUM = {
    "push": ConcentratedLoad(
        *("push", "Bob", TIP, (3.0, 0.0, 4.0), "Bob"),
        *((0.0, 0.8, 0.0), GROUND.name, Law("sine", SINE)),
    ),
    **{
        law.name: PointLoad(law.name, law.name, "Bob", SIDE, sample_parameters(law))
        for law in POINT_LAWS.values()
    },
    "line": SpringDamper("line", GROUND.name, "Bob", HOOK, SIDE, 30.0, 1.2, 0.5, 2.0),
    "coil": JointSpring("coil", "Pivot", "angle", 6.0, 0.3, 0.2, 0.7),
    "mount": Bushing(
        *("mount", GROUND.name, "Bob", (0.0, 0.0, 0.8), (0.0, 0.0, 0.3), AXES, AXES),
        *((9.0, 0.0, 5.0, 0.0, 3.0, 0.0), (0.4, 0.0, 0.0, 0.0, 0.2, 0.0)),
        compliance=True,
    ),
    "steer": ConcentratedLoad(
        *("steer", "Bob", TIP, (2.0, 0.0, 1.0), GROUND.name),
        *((0.0, 0.3, 0.0), GROUND.name),
        expression=parse("0.5*cos(2*t) + 0.4*Pivot.angle"),
    ),
    "motor": JointActuator(
        "motor", "Pivot", "angle", parse("2.5*sin(3*t) - 0.8*Pivot.angle - 0.2*Pivot.angleRate")
    ),
    "ram": MarkerActuator("ram", "Eye", "Tip", parse("1.5 + 0.5*Tip.x - 0.1*Tip.vz")),
    "rub": friction("rub", "Pivot", "angle", 0.3, 0.1, 3.0),
    **{
        name: JointLoad(name, name, "Pivot", "angle", sample_parameters(law, "angle"))
        for name, law in OTHERS.items()
    },
}
"""A load of each kind, by its name; all act in the plane of the motion, and one is in the
compliance form.
"""
WORKING = [*PENDULUM]
MARKERS = (Marker("Eye", GROUND.name, HOOK), Marker("Tip", "Bob", SIDE))


def pendulum(loads, **simulation):
    """The bob below a pivot at the origin; gravity along +z, rotation about y."""
    rotation = from_axis_angle((0.0, 1.0, 0.0), START)
    place = (ARM * np.sin(START), 0.0, ARM * np.cos(START))
    velocity = (RATE * place[2], 0.0, -RATE * place[0])
    R = np.array([[np.cos(START), 0, np.sin(START)], [0, 1, 0], [-np.sin(START), 0, np.cos(START)]])
    bob = body(
        mass=MASS,
        inertia=INERTIA,
        position=place,
        orientation=rotation,
        velocity=tuple(R.T @ velocity),
        angular_velocity=(0.0, RATE, 0.0),
    )
    # The joint's frames coincide at t = 0, from where its angle counts.
    own_axes = tuple(tuple(R.T @ axis) for axis in Y_AXES)
    pivot = Joint(
        *("Pivot", "revolute", GROUND.name, "Bob", ZERO, (0.0, 0.0, -ARM), Y_AXES, own_axes)
    )
    model = build_model([bob], [pivot], loads, gravity=(0.0, 0.0, GRAVITY), markers=MARKERS)
    return replace(model, simulation=replace(model.simulation, t_final=T, **simulation))


class Exact:
    """The pendulum's equation in its angle, with the work of each force beside it."""

    def __init__(self, names):
        self.names = set(names)
        self.first = self.lengths(START)

    def at(self, theta, s):
        """Position [m] of a point of the bob and its derivative by the angle, in the plane x, z."""
        x, z = s[0], s[2] + ARM
        c, s = np.cos(theta), np.sin(theta)
        return np.array([c * x + s * z, -s * x + c * z]), np.array([-s * x + c * z, -c * x - s * z])

    def lengths(self, theta):
        """What the springs' coordinates are at an angle: line, coil, and three of the mount."""
        line = np.linalg.norm(self.at(theta, SIDE)[0] - np.array(HOOK)[[0, 2]])
        P, _ = self.at(theta, (0.0, 0.0, 0.3))
        return line, theta, P[0], P[1], np.sin(theta)

    def forces(self, t, theta, rate):
        """Name: (force in the plane [N], moment of all of it [N m], power [W])."""
        c, s = np.cos(theta), np.sin(theta)
        factor = SINE[0] * np.sin(SINE[1] * t + SINE[2]) + SINE[3]
        force = factor * np.array([c * 3.0 + s * 4.0, -s * 3.0 + c * 4.0])
        moment = self.at(theta, TIP)[1] @ force + 0.8 * factor
        all_of_it = {"push": (force, moment, moment * rate)}

        P, dP = self.at(theta, SIDE)
        V = np.array([dP[0] * rate, 0.0, dP[1] * rate])
        for name, law in POINT_LAWS.items():
            force = POINT_FORCES[name](V, **dict(sample_parameters(law)))[[0, 2]]
            all_of_it[name] = (force, dP @ force, force @ dP * rate)

        D = P - np.array(HOOK)[[0, 2]]
        length = np.linalg.norm(D)
        speed = D @ dP * rate / length
        force = -(2.0 + 30.0 * (length - 0.5) + 1.2 * speed) * D / length
        all_of_it["line"] = (force, dP @ force, -1.2 * speed**2)

        moment = -(0.7 + 6.0 * (theta - START - 0.2) + 0.3 * rate)
        all_of_it["coil"] = (np.zeros(2), moment, -0.3 * rate**2)

        factor = 0.5 * np.cos(2.0 * t) + 0.4 * (theta - START)
        moment = factor * (self.at(theta, TIP)[1] @ np.array([2.0, 1.0]) + 0.3)
        all_of_it["steer"] = (factor * np.array([2.0, 1.0]), moment, moment * rate)

        moment = 2.5 * np.sin(3.0 * t) - 0.8 * (theta - START) - 0.2 * rate
        all_of_it["motor"] = (np.zeros(2), moment, moment * rate)

        push = 1.5 + 0.5 * P[0] - 0.1 * dP[1] * rate
        force = push * D / length
        all_of_it["ram"] = (force, dP @ force, push * speed)

        for name in OTHERS:
            moment, tension = (self.along(name, theta - START, of) for of in (rate, 0.0))
            all_of_it[name] = (np.zeros(2), moment, (moment - tension) * rate)

        P, dP = self.at(theta, (0.0, 0.0, 0.3))
        move = P - self.first[2:4]
        force = -np.array([9.0 * move[0] + 0.4 * dP[0] * rate, 5.0 * move[1]])
        rotation_rate = c * rate
        moment = -(3.0 * (s - self.first[4]) + 0.2 * rotation_rate) * c
        power = -0.4 * (dP[0] * rate) ** 2 - 0.2 * rotation_rate**2
        all_of_it["mount"] = (force, dP @ force + moment, power)
        return {name: all_of_it[name] for name in all_of_it if name in self.names}

    def along(self, name, angle, rate):
        """Moment [N m] by a law of the angle, from t = 0, and of its rate."""
        return JOINT_LOADS[name](angle, rate, 0.0, **dict(sample_parameters(OTHERS[name], "angle")))

    def acceleration(self, t, theta, rate):
        """Angular acceleration [rad/s^2] and power of each force [W]."""
        G, dG = self.at(theta, ZERO)
        weight = np.array([0.0, MASS * GRAVITY])
        acting = self.forces(t, theta, rate)
        force = weight + sum(f for f, _, _ in acting.values())
        moment = dG @ weight + sum(m for _, m, _ in acting.values())
        about_pivot, rubbing = INERTIA + MASS * ARM**2, 0.0
        for _ in range(60):  # the joint's reaction depends on friction, and friction on it
            alpha = (moment + rubbing) / about_pivot
            reaction = MASS * (alpha * dG - rate**2 * G) - force
            if "rub" in self.names:
                rubbing = -0.3 * 0.1 * np.linalg.norm(reaction) * np.tanh(rate / 3.0)
        powers = {name: power for name, (_, _, power) in acting.items()} | {"rub": rubbing * rate}
        return alpha, np.array([powers.get(name, 0.0) for name in WORKING])

    def energies(self, theta):
        """Elastic energies [J] of line, coil, mount, and of laws with a potential."""
        elastic = [name for name, law in OTHERS.items() if law.is_elastic]
        others = [
            -quad(lambda q, of=of: self.along(of, q, 0.0), 0.0, theta - START)[0] for of in elastic
        ]
        line, _, x, z, rotation = self.lengths(theta)
        dx, dz, drotation = x - self.first[2], z - self.first[3], rotation - self.first[4]
        stretch, twist = line - 0.5, theta - START - 0.2
        return np.array(
            [
                2.0 * stretch + 15.0 * stretch**2,
                0.7 * twist + 3.0 * twist**2,
                4.5 * dx**2 + 2.5 * dz**2 + 1.5 * drotation**2,
                *others,
            ]
        )

    def solve(self):
        """Angle, angular velocity and work of each force at ``T``."""

        def slope(t, y):
            alpha, powers = self.acceleration(t, y[0], y[1])
            return np.concatenate([[y[1], alpha], powers])

        start = np.concatenate([[START, RATE], np.zeros(len(WORKING))])
        given = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13}
        return solve_ivp(slope, (0.0, T), start, **given).y[:, -1]


@pytest.fixture(scope="module")
def exact():
    return Exact(PENDULUM).solve()


@pytest.fixture
def plain(monkeypatch):
    """Let the adaptive stepper call its kernels uncompiled."""
    monkeypatch.setattr(collocation_stepper, "_take_pairs", step_control.take_pairs)


def run(word, steps, accuracy=None):
    """Angle, angular velocity, work of each force and drift of the energy balance at ``T``; elastic
    energies there.
    """
    scheme, degree = split(word)
    how = {"scheme": scheme, "dt": T / steps} | ({"degree": degree} if degree else {})
    how |= {"local_tolerance": accuracy} if accuracy else {}
    chunk = 2 * steps + 64
    integrator = SubsystemIntegrator(pendulum(PENDULUM.values(), **how), "newton", False, chunk)
    workspace, h = integrator.workspace, T / steps
    balance = balance_of(workspace)
    nothing_due = np.zeros(steps + 1, dtype=np.int64)
    if word == "auto":
        while workspace.state.time[0] < T * (1.0 - 1e-12):
            assert integrator.advance(Chunk(last=steps, times=np.array([T]))).steps > 0
    elif degree:
        subsystem = integrator.stepper.method.subsystem
        assert collocation.take_steps(subsystem, h, 0, steps, nothing_due, np.zeros(0)) == steps
    else:
        assert midpoint.take_steps(workspace, h, 0, steps, nothing_due - 1) == steps
    state = workspace.state
    angle = 4.0 * np.arctan(state.p[0, 1] / 4.0)
    drift = abs(balance_of(workspace) - balance)
    work = state.work[: len(WORKING)]
    return np.array([angle, state.w[0, 1], *work]), drift, elastic_of(workspace)


def balance_of(workspace):
    """Energy less all work [J]."""
    arrays = np.zeros((2, *workspace.state.violation.shape))
    return energy_balance(workspace.system, workspace.state, workspace.start, *arrays)


def elastic_of(workspace):
    """Elastic energy [J] of each load that has one."""
    group, start = workspace.system.forces, workspace.start.forces
    forces.elastic_energy(group, start, workspace.system.scalar)
    table = np.zeros((1, forces.energy_columns(group)))
    forces.publish_energy(group, start, 0, table, 0)
    return table[0]


def test_there_is_a_load_of_every_kind():
    assert {type(load) for load in PENDULUM.values()} == set(get_args(Load))
    groups = build_system(pendulum(PENDULUM.values())).forces
    loads = groups._asdict()
    del loads["sliding"], loads["rubbing"]  # friction of contacts
    empty = [kind for kind, group in loads.items() if not len(group[0])]
    assert empty == []


@pytest.mark.parametrize("name", PENDULUM)
def test_every_force_changes_the_motion(exact, name):
    """By more than the errors allowed below, so that no scheme can do without it."""
    without = Exact(set(PENDULUM) - {name}).solve()
    assert abs(without[:2] - exact[:2]).max() > 3.0 * LIMIT


STEPS = {
    "preserving": (20, 2),
    "decaying": (20, 2),
    "gauss1": (10, 2),
    "gauss2": (4, 4),
    "gauss3": (3, 6),
    "gauss4": (2, 8),
    "gauss5": (1, 10),
    "radau1": (20, 1),
    "radau2": (5, 3),
    "radau3": (2, 5),
    "auto": (8, 0),
}
"""Steps of the coarser of two runs, and the order of the scheme."""
LIMIT = 6e-3
"""Largest error of the two runs' limit; radau1 with its order 1 comes near it."""
SMALLEST = 1e-10
"""Error that counts as round-off: the sums of some ten steps, each solved to 1e-12."""


def test_there_is_an_entry_for_every_scheme():
    """But for the explicit ones, which have no springs in the compliance form."""
    assert set(STEPS) == set(choices()) - set(EXPLICIT)


SLOW_WORDS = ("auto", "radau1")
"""Schemes that take the most steps here."""


@pytest.mark.sampled
@pytest.mark.parametrize(
    "word",
    [pytest.param(w, marks=pytest.mark.slow) if w in SLOW_WORDS else w for w in STEPS],
)
def test_every_scheme_follows_the_laws_of_all_forces(exact, plain, word):
    steps, order = STEPS[word]
    if word == "auto":
        found, drift, elastic = run(word, steps, accuracy=1e-4)
        assert abs(found - exact).max() < 1e-3
    else:
        coarse, _, _ = run(word, steps)
        found, drift, elastic = run(word, 2 * steps)
        errors = abs(coarse - exact).max(), abs(found - exact).max()
        assert errors[1] < max(SMALLEST, errors[0] / 2.0 ** (order - 0.5))
        limit = found + (found - coarse) / (2.0**order - 1.0)
        assert abs(limit - exact).max() < LIMIT
    error = max(abs(found - exact).max(), SMALLEST)
    # What the energy loses is the work in the columns.
    assert drift < (1e-10 if order == 2 and word != "gauss1" else 30.0 * error)
    energies = Exact(PENDULUM).energies(exact[0])
    assert abs(elastic - energies).max() < 30.0 * error


@pytest.mark.parametrize("make", LOADS.values(), ids=LOADS)
def test_derivatives_at_one_configuration_are_those_of_the_forces(make):
    rng = np.random.default_rng(3)
    point = Point(make(rng), rng)
    for by, derivative in zip(("place", "rate"), point.derivatives(), strict=True):
        direction = rng.normal(size=(node_count(point.system), 3))
        wanted = point.difference(by, direction, 1e-5)
        found = (derivative @ direction.reshape(-1)).reshape(wanted.shape)
        np.testing.assert_allclose(found, wanted, atol=1e-7 * max(1.0, np.abs(wanted).max()))


class Point:
    """The forces of a model at one random configuration."""

    def __init__(self, model, rng):
        self.system = build_system(model)
        self.state = build_state(model, self.system)
        self.state.time[0] = 0.3
        self.state.reaction[:] = rng.normal(size=self.state.reaction.shape)
        moving = len(model.bodies)
        self.state.x[:moving] += 0.3 * rng.normal(size=(moving, 3))
        self.v, self.W = np.zeros((2, moving + 1, 3))
        self.v[:moving], self.W[:moving] = rng.normal(size=(2, moving, 3))
        for f in range(moving):
            rotation = from_increment(random_vector(rng, 0.4))
            self.state.p[f] = compose(rotation, tuple(self.state.p[f]))
        self.start = new_system_workspace(self.system, self.state)
        self.still = np.zeros((node_count(self.system), 3))

    def forces(self, x, p, v, W):
        """(nodes, 3) accelerations by the forces, with velocities in inertial axes."""
        system, start = self.system, self.start
        state = self.state._replace(x=x, p=p)
        evaluate.prepare(system, state, start)
        start.frames.v[:], start.frames.W[:] = v, W
        scalar.count_rotations(system.scalar, start.scalar, state.angle)
        scalar.rates(system.scalar, start.scalar, system.frames, start.frames, self.still)
        forces.set_time(system.forces, start.forces, 0.3)
        F = np.zeros_like(self.still)
        frames, reaction = system.frames, state.reaction
        forces.add_forces(system.forces, start.forces, system.scalar, frames, reaction, F)
        return F

    def here(self):
        return self.forces(self.state.x, self.state.p, self.v, self.W)

    def derivatives(self):
        """Dense derivatives by places and by rates."""
        self.here()
        system, start = self.system, self.start
        by_place, by_rate, scratch = np.zeros((3, system.constant.size))
        out = Derivatives(by_place, by_rate, scratch, self.still)
        scalar.differentiate(system.scalar, start.scalar, system.frames, self.still)
        given = (system.forces, start.forces, system.scalar, system.frames, self.state.reaction)
        forces.add_derivatives(*given, out)
        return dense_matrix(system, by_place), dense_matrix(system, by_rate)

    def difference(self, by, direction, step):
        """Derivative along a ``direction`` of the unknowns, by central differences."""
        frames = self.system.frames
        u, rotation = direction[frames.displacement], direction[frames.rotation]
        rotation = rotation / frames.length[:, None]
        u[-1], rotation[-1] = 0.0, 0.0
        values = []
        for s in (step, -step):
            if by == "rate":
                values.append(
                    self.forces(self.state.x, self.state.p, self.v + s * u, self.W + s * rotation)
                )
                continue
            p = np.array(
                [
                    compose(from_increment(tuple(s * rotation[f])), tuple(self.state.p[f]))
                    for f in range(len(rotation))
                ]
            )
            values.append(self.forces(self.state.x + s * u, p, self.v, self.W))
        return (values[0] - values[1]) / (2.0 * step)
