"""Newton's method on places and multipliers: closed forms, and its matrix against differences."""

import numpy as np
import pytest

from msahl.algebra.vector import ZERO
from msahl.analysis.equilibria.static_newton import Spin, balance, newton, stepped
from msahl.analysis.linearised.point import at_start
from msahl.model import Joint, SpringDamper
from tests.support.models import GROUND, body, build_model, deck

ROUND_OFF = 1e-12
"""Of lengths of about 1, after a solution to the last digits."""
STEP = 1e-4
"""The differences of order 4 are wrong by STEP^4, and by round-off over STEP: 1e-12 of 1e3 N."""


def rotor():
    """A ball of 2 kg on an arm that rotates freely about z, held by a spring of 200 N/m that is 0.5
    m long when it is unloaded.
    """
    bodies = [body("Arm", 1.0, 0.1), body("Ball", 2.0, 1e-3, (0.55, 0.0, 0.0))]
    along_x = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    joints = [
        Joint("Bearing", "revolute", GROUND.name, "Arm", ZERO, ZERO),
        Joint("Guide", "prismatic", "Arm", "Ball", ZERO, ZERO, along_x, along_x),
    ]
    spring = SpringDamper("Spring", "Arm", "Ball", ZERO, ZERO, 200.0, 1.0, 0.5)
    return build_model(bodies, joints, [spring])


def test_a_rotating_ball_stretches_its_spring():
    """k (r - 0.5) = m w^2 r."""
    point, spin = at_start(rotor()), Spin(np.array([0.0, 0.0, 4.0]), np.zeros(3))
    rest = newton(point.system, point.state, lambda now: balance(point.system, now, spin))
    assert rest.converged
    r = 200.0 * 0.5 / (200.0 - 2.0 * 16.0)
    assert np.linalg.norm(rest.state.x[1]) == pytest.approx(r, abs=ROUND_OFF)


def test_newton_finds_a_hanging_chain_from_a_level_one_in_few_iterations():
    point = at_start(deck("long_chain"))
    rest = newton(point.system, point.state)
    assert rest.converged
    assert rest.iterations <= 15
    assert np.abs(rest.state.x[:-1, :2] - rest.state.x[0, :2]).max() <= 10.0 * ROUND_OFF


@pytest.mark.parametrize("name", ["spatial_slider_crank", "suspension", "gyroscope"])
def test_the_matrix_is_the_derivative_of_the_residual(name):
    """By differences of order 4 along random motions, with multipliers that change as well."""
    point, rng = at_start(deck(name)), np.random.default_rng(3)
    spin = Spin(rng.normal(size=3), rng.normal(size=3))
    state = point.state._replace(force=rng.normal(size=point.state.force.shape))
    now = balance(point.system, state, spin)
    step, multipliers = rng.normal(size=now.force.size), rng.normal(size=now.violation.size)

    def residual(share):
        moved = stepped(point.system, state, now, share * step, share * multipliers)
        there = balance(point.system, moved, spin)
        return np.concatenate([there.force, there.violation])

    pairs = ((1, 2.0 / 3.0), (2, -1.0 / 12.0))
    change = sum(w * (residual(k * STEP) - residual(-k * STEP)) for k, w in pairs) / STEP
    dq = step / now.found.length
    holonomic = np.concatenate([np.ones(step.size, dtype=bool), now.found.holonomic])
    expected = np.concatenate(
        [
            (now.found.by_place @ dq + now.found.constraint.T @ multipliers) / now.found.length,
            now.found.constraint @ dq,
        ]
    )
    size = np.abs(expected).max()
    assert np.abs(change - expected)[holonomic].max() <= 1e-8 * size
