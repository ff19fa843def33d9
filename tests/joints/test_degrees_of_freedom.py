"""Every joint leaves its degrees of freedom, and no others."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.rotation import compose, from_axis_angle, from_increment, matrix
from msahl.elements.constraints import coordinates
from msahl.joints.registry import KINDS
from msahl.run.subsystem import SubsystemIntegrator
from msahl.start.redundancy import constraint_matrix, constraint_rank
from msahl.start.velocities import StartError
from msahl.system import evaluate
from msahl.system.arrays import multiplier_count, new_system_workspace
from msahl.system.build import build_system
from msahl.system.state import build_state
from tests.support.element_samples import JOINTS, joint_between, random_frame, vector
from tests.support.models import GROUND, build_model, random_body, simulate

every_joint = pytest.mark.parametrize("kind", JOINTS)
every_seed = pytest.mark.parametrize("seed", range(3))


class Held:
    """A body at rest, joined to the ground, and what opens when it is moved."""

    def __init__(self, kind, seed):
        rng = np.random.default_rng(seed)
        self.sample, self.frame = JOINTS[kind], random_frame(rng)
        own = random_body(rng, "B")
        self.body = replace(own, velocity=(0.0, 0.0, 0.0), angular_velocity=(0.0, 0.0, 0.0))
        self.joint = joint_between([self.body], kind, "J", GROUND.name, "B", self.frame)

    def model(self, body=None, **others):
        return build_model([body or self.body], [self.joint], **others)

    def opened(self, body):
        """Violations and rates of all the joint's equations."""
        system = build_system(self.model())
        state = build_state(self.model(body), system)
        start = new_system_workspace(system, state)
        evaluate.prepare(system, state, start)
        if system.scalar:
            coordinates.count_rotations(
                system.scalar.coordinates, start.scalar.coordinates, state.angle
            )
        violation, rate = np.zeros_like(state.violation), np.zeros_like(state.violation)
        evaluate.observe(system, state, start, violation, rate)
        return violation, rate

    def moving(self, twist):
        """The body with the velocity field of a (6,) twist in the axes of the joint's frame."""
        v, w = self.frame.R @ twist[:3], self.frame.R @ twist[3:]
        R = np.array(matrix(self.body.orientation))
        v = v + np.cross(w, np.array(self.body.position) - self.frame.point)
        return replace(self.body, velocity=vector(R.T @ v), angular_velocity=vector(R.T @ w))

    def moved(self, A, c):
        """The body displaced by x -> A x + c in the axes of the joint's frame."""
        R, point = self.frame.R, self.frame.point
        place = point + R @ (A @ (R.T @ (np.array(self.body.position) - point)) + c)
        rotation = R @ A @ R.T
        axis = np.array(
            [
                rotation[2, 1] - rotation[1, 2],
                rotation[0, 2] - rotation[2, 0],
                rotation[1, 0] - rotation[0, 1],
            ]
        )
        angle = np.arctan2(np.linalg.norm(axis), np.trace(rotation) - 1.0)
        rotated = from_axis_angle(vector(axis), angle) if axis.any() else (0.0, 0.0, 0.0)
        return replace(
            self.body,
            position=vector(place),
            orientation=compose(rotated, self.body.orientation),
        )

    def twists(self):
        """Free and locked twists, each a row; orthonormal among themselves."""
        free = np.array([screw.twist() for screw in self.sample.free]).reshape(-1, 6)
        _, values, rows = np.linalg.svd(free)
        rank = int(np.count_nonzero(values > 1e-9))
        return rows[:rank], rows[rank:]


def test_the_table_of_degrees_of_freedom_is_complete():
    assert {*JOINTS} == {*KINDS}


@every_joint
def test_a_joint_between_two_bodies_takes_away_what_it_should(kind):
    held, free = Held(kind, 0), len(JOINTS[kind].free)
    assert len(held.twists()[0]) == free
    rng = np.random.default_rng(1)
    ends = [held.body] if held.sample.on_ground else [held.body, random_body(rng, "A")]
    parent = GROUND.name if held.sample.on_ground else "A"
    joint = joint_between(ends, kind, "J", parent, "B", held.frame)
    model = build_model(ends, [joint])
    system = build_system(model)
    state = build_state(model, system)
    coordinates = 6 * len(ends) - constraint_rank(system, state)
    assert coordinates == free + 6 * (len(ends) - 1)
    assert multiplier_count(system) == 6 - free
    G = constraint_matrix(system, state).toarray()[:, : 6 * len(ends)]
    values = np.linalg.svd(G, compute_uv=False)
    # Nothing on the verge: what counts, counts.
    assert values[5 - free] > 1e-3 * values[0]


@every_joint
@every_seed
def test_free_velocities_open_nothing_and_the_rest_do(kind, seed):
    held = Held(kind, seed)
    free, locked = held.twists()
    for twist in free:
        body = held.moving(twist)
        assert np.abs(held.opened(body)[1]).max(initial=0.0) < 1e-13
        assert (
            SubsystemIntegrator(
                held.model(body, velocity="refuse"), "newton", True, 1
            ).change.method
            == "none"
        )
    rates = np.array([held.opened(held.moving(twist))[1].ravel() for twist in locked])
    # Any mixture of them as well: their rates are independent.
    assert np.linalg.svd(rates, compute_uv=False).min() > 1e-2
    with pytest.raises(StartError, match="initial velocities open a joint"):
        SubsystemIntegrator(
            held.model(held.moving(locked[0]), velocity="refuse"), "newton", True, 1
        )


@pytest.mark.parametrize("kind", [kind for kind in JOINTS if not JOINTS[kind].of_rates])
@every_seed
def test_degrees_of_freedom_open_nothing_and_the_rest_do(kind, seed):
    held = Held(kind, seed)
    for screw in held.sample.free:
        for amount in (0.6, -0.5):
            violation, _ = held.opened(held.moved(*screw.displacement(amount)))
            assert np.abs(violation).max(initial=0.0) < 1e-13
    for twist in held.twists()[1]:
        small = 1e-3 * twist
        A = np.array(matrix(from_increment(vector(small[3:]))))
        violation, _ = held.opened(held.moved(A, small[:3]))
        assert np.abs(violation).max() > 1e-5


@every_joint
@every_seed
def test_a_body_set_going_along_its_degree_of_freedom_goes_on(kind, seed):
    """Left alone, along any mixture of them: energy is kept, nothing opens, and it gets away."""
    held = Held(kind, seed)
    free, _ = held.twists()
    if not len(free):
        run = simulate(held.model(gravity=(0.0, 0.0, 9.8)), dt=0.01, t_final=0.5, solver="newton")
        assert np.ptp(run.states[:, 1:], axis=0).max() < 1e-14
        return
    mixture = np.random.default_rng(seed).normal(size=len(free)) @ free
    run = simulate(held.model(held.moving(mixture)), dt=0.01, t_final=0.5, solver="newton")
    extremes = run.report.extremes
    assert run.report.status == "completed"
    assert (run.report.warnings, run.report.subdivisions) == ([], 0)
    # Fifty steps, each solved to 1e-14 of its motion.
    assert extremes["energyErrorMaxRelative"] < 1e-11
    assert extremes["constraintViolationMax"] < 1e-12
    assert np.linalg.norm(run.states[-1, 1:7] - run.states[0, 1:7]) > 1e-2
