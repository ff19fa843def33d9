"""A condition that holds between the ends of two steps only ends the run where it begins to."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ellipkinc

from msahl.deck import read_deck
from msahl.expressions.conditions import margin
from msahl.expressions.syntax import parse
from msahl.model import Stop
from msahl.run.time_grid import TimeGrid
from tests.support.models import ROOT, simulate

DECKS = ROOT / "decks"
G, SPEED, HEIGHT = 9.80665, 6.0, 2.0
APEX = SPEED / G, HEIGHT + SPEED**2 / (2.0 * G)
NEAR_TOP = 1e-4
"""Distance below the highest point at which the run ends: the body is above for 9 ms, less than
half of a step of 20 ms."""


def stopped(condition, deck):
    """The model of a ``deck`` that stops where the ``condition`` begins to hold."""
    return replace(read_deck(DECKS / deck), stops=(Stop(condition, margin(parse(condition))),))


def thrown(condition):
    """A body thrown upwards, with its mass centre as the marker 'End'."""
    model = stopped(condition, "basics/stop.xml")
    (end,) = model.markers
    return replace(model, markers=(replace(end, point=(0.0, 0.0, 0.0)),))


@pytest.mark.parametrize("scheme", ["preserving", "gauss2", "gauss3", "radau2", "radau3", "auto"])
def test_the_top_of_a_throw_between_two_steps_is_seen(scheme):
    model = thrown(f"End.z > {APEX[1] - NEAR_TOP!r}")
    result = simulate(model, dt=0.02, scheme=scheme, solver="newton")
    # These schemes are exact for a parabola. Round-off of the margin, a few times 4e-16 m, is
    # divided by its rate, 0.044 m/s.
    top = APEX[0] - math.sqrt(2.0 * NEAR_TOP / G)
    assert result.report.stop["time"] == pytest.approx(top, abs=2e-13)
    assert result.states[-1, 3] == pytest.approx(APEX[1] - NEAR_TOP, abs=2e-14)
    assert result.states[:-1, 3].max() < APEX[1] - NEAR_TOP


def test_a_throw_that_stays_below_does_not_end():
    """The margin comes as near as its distance of two steps from the top, and not to zero."""
    model = thrown(f"End.z > {APEX[1] + 1e-9!r}")
    for scheme in ("preserving", "gauss3", "auto"):
        result = simulate(model, dt=0.02, t_final=1.0, scheme=scheme, solver="newton")
        assert result.report.stop is None
        assert result.states[-1, 0] == 1.0


LENGTH, RATE = 2.0 / 3.0, 2.0
HIGHEST = math.acos(math.cos(math.pi / 6) - RATE**2 * LENGTH / (2.0 * 9.81))
NEAR_HIGHEST = 1e-3
"""Angle [rad] before the end of the swing at which the run ends: 28 ms around it are beyond."""


def time_from_bottom(angle):
    """Time [s] of the pendulum of ``pendulum_by_angle.xml`` from its lowest point, by the elliptic
    integral of the first kind."""
    k = math.sin(0.5 * HIGHEST)
    return ellipkinc(math.asin(math.sin(0.5 * angle) / k), k * k) * math.sqrt(LENGTH / 9.81)


def time_of_stop(scheme, dt):
    """Time [s] at which the swing ends, and the sum of h^(p+1) over the steps but for a factor."""
    model = stopped(f"Hinge.angle > {HIGHEST - NEAR_HIGHEST!r}", "basics/pendulum_by_angle.xml")
    result = simulate(model, dt=dt, scheme=scheme, solver="newton")
    assert result.others["joints"][-1, 1] == pytest.approx(HIGHEST - NEAR_HIGHEST, abs=1e-15)
    time = result.report.stop["time"]
    grid = TimeGrid.with_interval(dt, 2.0).until(time)
    return time, np.array([grid.step(k) for k in range(1, grid.n + 1)])


@pytest.mark.parametrize(
    ("scheme", "order", "dt"), [("preserving", 2, 0.04), ("gauss2", 4, 0.12), ("gauss3", 6, 0.16)]
)
def test_the_end_of_a_swing_has_the_order_of_the_scheme(scheme, order, dt):
    exact = time_from_bottom(HIGHEST - NEAR_HIGHEST) - time_from_bottom(math.pi / 6)
    times, steps = zip(*(time_of_stop(scheme, h) for h in (dt, 0.5 * dt)), strict=True)
    errors = [abs(time - exact) for time in times]
    sums = [np.sum(sizes ** (order + 1)) for sizes in steps]
    # A local error is C h^(p+1), with C by the place in the swing: within a third of their ratio.
    assert errors[0] / errors[1] == pytest.approx(sums[0] / sums[1], rel=1.0 / 3.0)


def test_a_tolerance_finds_the_end_of_a_swing():
    exact = time_from_bottom(HIGHEST - NEAR_HIGHEST) - time_from_bottom(math.pi / 6)
    model = stopped(f"Hinge.angle > {HIGHEST - NEAR_HIGHEST!r}", "basics/pendulum_by_angle.xml")
    result = simulate(model, dt=0.1, scheme="auto", solver="newton")
    # By ``auto`` the local errors add up to 1e-9 m; near the end the rod's end moves at 0.14 m/s.
    assert result.report.stop["time"] == pytest.approx(exact, abs=1e-8)


def test_a_kinked_margin_between_two_steps_is_seen():
    """The pendulum passes its lowest point within a step, where an absolute value is smallest."""
    model = stopped("abs(Hinge.angle) < 1e-3", "basics/pendulum_by_angle.xml")
    given = {"dt": 0.05, "t_final": 0.8, "solver": "newton"}
    for scheme in ("preserving", "gauss3"):
        plain = simulate(replace(model, stops=()), scheme=scheme, **given)
        angle = plain.others["joints"][:, 1]
        assert np.abs(angle).min() > 1e-3
        result = simulate(model, scheme=scheme, **given)
        assert abs(result.others["joints"][-1, 1]) == pytest.approx(1e-3, abs=1e-14)
        (passed,) = np.flatnonzero(np.diff(np.sign(angle)))
        before, after = plain.states[passed : passed + 2, 0]
        assert before < result.report.stop["time"] < after
