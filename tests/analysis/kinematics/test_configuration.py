"""Positions, velocities and accelerations by the constraint equations alone."""

import numpy as np
import pytest

from msahl.analysis.kinematics.configuration import (
    close,
    copied,
    displace,
    jacobian,
    new_equations,
    predict,
    set_accelerations,
    set_velocities,
    solve,
    violations,
)
from msahl.analysis.linearised.point import at_start
from tests.support.models import deck


def at(name):
    """The equations of a deck and its state at t = 0."""
    point = at_start(deck(name))
    return new_equations(point.system, point.state), point.state


def test_motion_of_a_four_bar_is_that_of_the_index_1_problem():
    of, state = at("four_bar_by_angle")
    v, w, a, alpha = (x.copy() for x in (state.v, state.w, state.a, state.alpha))
    assert close(of, state).converged
    assert solve(jacobian(of, state), np.zeros(21)).rank == of.coordinate.size
    G = jacobian(of, state)
    set_accelerations(of, state, G, set_velocities(of, state, G))
    # Condition number 5, velocities up to 6 rad/s, accelerations up to 40 rad/s^2.
    assert np.abs([state.v - v, state.w - w]).max() <= 1e-13
    assert np.abs([state.a - a, state.alpha - alpha]).max() <= 1e-12


def test_predicted_positions_are_of_order_three():
    of, state = at("four_bar_by_angle")
    errors = []
    for h in (0.004, 0.002):
        moved = copied(state)
        predict(of, moved, h)
        errors.append(close(of, moved).first)
    assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.05)  # h^4 terms at 2 pi rad/s
    assert moved.time[0] == 0.002


def test_redundant_equations_are_counted_by_rank():
    of, state = at("four_bar_by_angle")
    assert of.equation.size == 21  # four revolutes and a motion
    assert solve(jacobian(of, state), np.zeros(21)).rank == 18


def test_positions_far_from_closed_joints_are_closed():
    of, state = at("four_bar_by_angle")
    rng = np.random.default_rng(1)
    x = state.x.copy()
    displace(of, state, 1e-2 * rng.normal(size=of.coordinate.size))
    assert close(of, state).converged
    violation, _ = violations(of, state)
    assert np.abs(violation).max() <= 1e-15
    assert np.abs(state.x - x).max() <= 1e-14
