"""Newton's method on places and multipliers: closed forms, and its matrix against differences."""

import numpy as np
import pytest

from msahl.algebra.vector import ZERO
from msahl.analysis.equilibria.load_path import scaled_loads
from msahl.analysis.equilibria.static_equations import Spin, Statics
from msahl.analysis.equilibria.static_matrix import factorise, solve
from msahl.analysis.equilibria.static_newton import newton, stepped
from msahl.analysis.linearised.coefficients import holonomic
from msahl.analysis.linearised.point import at_start
from msahl.model import Joint, SpringDamper
from msahl.system.build import build_system
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
    rest = newton(Statics(point.system, point.state, spin), point.state)
    assert rest.converged
    r = 200.0 * 0.5 / (200.0 - 2.0 * 16.0)
    assert np.linalg.norm(rest.state.x[1]) == pytest.approx(r, abs=ROUND_OFF)


def test_newton_finds_a_hanging_chain_from_a_level_one_in_few_iterations():
    point = at_start(deck("long_chain"))
    rest = newton(Statics(point.system, point.state), point.state)
    assert rest.converged
    assert rest.iterations <= 15
    assert np.abs(rest.state.x[:-1, :2] - rest.state.x[0, :2]).max() <= 10.0 * ROUND_OFF


@pytest.mark.parametrize("name", ["spatial_slider_crank", "suspension", "gyroscope", "spin_up"])
def test_the_matrix_is_the_derivative_of_the_residual(name):
    """By differences of order 4 along random motions, with multipliers that change as well."""
    point, rng = at_start(deck(name)), np.random.default_rng(3)
    spin = Spin(rng.normal(size=3), rng.normal(size=3))
    state = point.state._replace(force=rng.normal(size=point.state.force.shape))
    statics = Statics(point.system, state, spin)
    now = statics.balance(state)
    step, multipliers = rng.normal(size=now.force.size), rng.normal(size=now.violation.size)

    def residual(share):
        moved = stepped(point.system, state, now, share * step, share * multipliers)
        there = statics.balance(moved)
        return np.concatenate([there.force, there.violation])

    pairs = ((1, 2.0 / 3.0), (2, -1.0 / 12.0))
    change = sum(w * (residual(k * STEP) - residual(-k * STEP)) for k, w in pairs) / STEP
    layout, k = now.layout, now.layout.stiff
    n, c, G = step.size, multipliers.size, now.values[k:]
    by_force = np.bincount(layout.row[:k], now.values[:k] * step[layout.column[:k]], n)
    by_force += np.bincount(layout.column[k:], G * multipliers[layout.row[k:]], n)
    by_place = np.bincount(layout.row[k:], G * step[layout.column[k:]], c)
    rows, columns, compliance = layout.soft
    by_place += np.bincount(rows, compliance * multipliers[columns], c)
    expected = np.concatenate([by_force, by_place])
    places = np.concatenate([np.ones(n, dtype=bool), holonomic(point.system)])
    size = np.abs(expected).max()
    assert np.abs(change - expected)[places].max() <= 1e-8 * size


@pytest.mark.parametrize("name", ["snap_through", "concentrated_expression", "bend45"])
def test_loads_times_a_factor_are_those_of_a_deck_with_such_loads(name):
    """In a random configuration with random multipliers: the same products, to rounding."""
    model, rng = deck(name), np.random.default_rng(4)
    point = at_start(model)
    state = point.state._replace(
        p=rng.normal(size=point.state.p.shape), force=rng.normal(size=point.state.force.shape)
    )
    statics = Statics(point.system, state)
    found = statics.balance(state, 0.3)
    expected = Statics(build_system(scaled_loads(model, 0.3)), state).balance(state)
    for ours, theirs in ((found.force, expected.force), (found.values, expected.values)):
        assert np.abs(ours - theirs).max() <= ROUND_OFF * np.abs(theirs).max()
    loads = (statics.balance(state, 1.0).force - found.force) / 0.7
    assert np.abs(statics.loads(state) - loads).max() <= ROUND_OFF * found.largest


def test_a_wide_matrix_has_the_same_solution_by_another_factorisation(monkeypatch):
    point, rng = at_start(deck("bend45")), np.random.default_rng(5)
    now = Statics(point.system, point.state).balance(point.state)
    given = rng.normal(size=now.force.size), rng.normal(size=now.violation.size)
    banded = np.concatenate(solve(factorise(now), *given))
    monkeypatch.setattr("msahl.analysis.equilibria.static_matrix.MANY", 0.0)
    sparse = np.concatenate(solve(factorise(now), *given))
    # The condition number is some 1e6.
    assert np.abs(banded - sparse).max() <= 1e-8 * np.abs(sparse).max()
