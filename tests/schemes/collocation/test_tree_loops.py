"""Closed loops in joint coordinates: the motion is that of absolute coordinates, to the order."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.model import JointSpring, SpringDamper
from msahl.schemes.collocation import newton
from msahl.schemes.collocation.tree import loop_matrix
from msahl.schemes.collocation.tree import step as tree_step
from msahl.schemes.collocation.tree.stages import ITERATIONS, SLOPES, STIFF
from msahl.system import evaluate
from tests.support.loops import PLANAR, SPATIAL, bennett, random_loop
from tests.support.models import deck
from tests.support.trees import TreeSteps

LOOPS = [(kind, seed) for kind in (PLANAR, SPATIAL) for seed in range(3)]
CLOSED = {
    "four_bar": 0.01,
    "spatial_slider_crank": 0.005,
    "bricard": 0.02,
    "universal": 0.02,
    "gear": 0.02,
    "rack_and_pinion": 0.02,
    "cam_follower_flat": 0.002,
    "joint_motion_sine": 0.01,
}
"""Decks with cut joints, redundant ones among them, couplings, a cam and a motion, and steps [s] in
which gauss4 has no error but round-off."""


def passive(model):
    """The model without what absolute coordinates alone have: expressions with states."""
    loads = tuple(load for load in model.loads if isinstance(load, SpringDamper | JointSpring))
    return replace(model, loads=loads, signals=(), markers=())


def both(model, degree):
    """The model in joint and in absolute coordinates."""
    return TreeSteps(model, degree), TreeSteps(model, degree, full=True)


def take(steps, h):
    """Take a step of size ``h``; return whether it converged in joint coordinates."""
    return tree_step.take_step(*steps.arguments(h))


def distance(one, other):
    """Largest difference of positions, velocities and works, relative to their size or 1."""
    names = ("x", "v", "w", "work")
    pairs = [(getattr(one.state, name), getattr(other.state, name)) for name in names]
    return max(np.max(np.abs(a - b), initial=0) / np.max(np.abs(b), initial=1) for a, b in pairs)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), LOOPS)
def test_a_random_loop_moves_as_in_absolute_coordinates(kind, seed):
    tree, absolute = both(passive(random_loop(np.random.default_rng(seed), kind)), 4)
    for _ in range(2):
        assert take(tree, 1e-3)
        assert newton.take_step(absolute.subsystem, 1e-3)
    # The error of a step is (h times a rate of 5 rad/s)^9 = 2e-21 and round-off.
    assert distance(tree, absolute) < 1e-13


@pytest.mark.sampled
@pytest.mark.parametrize("name", CLOSED)
def test_a_deck_moves_as_in_absolute_coordinates(name):
    tree, absolute = both(deck(name), 4)
    assert tree.integrator.formulation.cut is not None
    for _ in range(3):
        assert take(tree, CLOSED[name])
        assert newton.take_step(absolute.subsystem, CLOSED[name])
    assert distance(tree, absolute) < 1e-12


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("kind", [PLANAR, SPATIAL])
def test_slopes_of_loads_change_no_step_of_a_loop(kind, degree):
    """Loops with springs, by both iterations: the same rates and multipliers, to round-off."""
    model = passive(random_loop(np.random.default_rng(1), kind))
    plain, with_slopes = TreeSteps(model, degree), TreeSteps(model, degree)
    for _ in range(3):
        with_slopes.tree.figures[STIFF] = 0.0
        assert take(plain, 1e-3)
        assert take(with_slopes, 1e-3)
    assert plain.tree.figures[SLOPES] == 0.0 < with_slopes.tree.figures[SLOPES]
    assert with_slopes.tree.figures[ITERATIONS] <= plain.tree.figures[ITERATIONS]
    assert distance(plain, with_slopes) < 1e-13


def test_redundant_equations_follow_from_those_that_are_independent():
    steps = TreeSteps(bennett(), 3)
    loops = steps.tree.loops
    for _ in range(3):
        assert take(steps, 0.01)
    # Of the five equations of a hinge, two keep three coordinates to one degree of freedom.
    assert loops.cut.scale.size == 5
    assert np.count_nonzero(loops.independent) == 2
    violation, rate = np.zeros((2, *steps.state.violation.shape))
    evaluate.observe(steps.workspace.system, steps.state, steps.workspace.start, violation, rate)
    # Round-off of lengths and speeds of 1.
    assert np.max(np.abs(violation)) < 1e-14
    assert np.max(np.abs(rate)) < 1e-13


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_the_order_is_twice_the_degree(degree):
    model, last = replace(deck("four_bar"), motions=()), 0.08
    found = []
    for count in (2, 4, 8):
        steps = TreeSteps(model, degree)
        for _ in range(count):
            assert take(steps, last / count)
        found.append(steps.configuration())
    exact = TreeSteps(model, 4)
    for _ in range(8):
        assert take(exact, last / 8)
    for part in (0, 2, 3):
        errors = [np.max(np.abs(f[part] - exact.configuration()[part])) for f in found]
        if errors[-1] > 1e-13:  # else round-off
            order = np.log2(errors[0] / errors[1]), np.log2(errors[1] / errors[2])
            # The next term of the error is smaller by the square of h times 6 rad/s: up to 0.06.
            assert order == pytest.approx((2 * degree, 2 * degree), abs=0.4)


def test_velocities_satisfy_the_constraints_after_each_step():
    steps = TreeSteps(passive(random_loop(np.random.default_rng(1), SPATIAL)), 2)
    violation, rate = np.zeros((2, *steps.state.violation.shape))
    for _ in range(3):
        assert take(steps, 0.02)
        given = steps.workspace.system, steps.state, steps.workspace.start
        evaluate.observe(*given, violation, rate)
        assert np.max(np.abs(rate)) < 1e-13 * max(1.0, np.max(np.abs(steps.state.v)))
        assert np.max(np.abs(violation)) < 1e-14


def test_a_step_that_violates_a_dependent_equation_is_left_to_newton(monkeypatch):
    steps = TreeSteps(bennett(), 3)
    # No equation counts as independent, so none is satisfied.
    monkeypatch.setattr(loop_matrix, "INDEPENDENT", 2.0)
    before = steps.state.x.copy()
    assert not take(steps, 0.01)
    assert np.array_equal(steps.state.x, before)
