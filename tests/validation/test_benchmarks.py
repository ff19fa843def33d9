"""What the benchmarks judge by: references beside closed forms, and how seconds are read off."""

import math

import numpy as np
import pytest

from benchmarks import curves, extended, problems, reference
from tests.support.closed_forms import recognise

EXTENDED = np.finfo(np.longdouble).eps < np.finfo(float).eps


@pytest.mark.parametrize("name", ["single 45", "top 1"])
def test_a_reference_is_where_the_closed_form_is(name):
    model = next(s.model for s in problems.all_problems(quick=True) if s.name == name)
    solution = reference.known(model, 0.5, 4)
    exact = recognise(model).states(0.5 * np.arange(5))
    x = exact.reshape(5, 1, 4, 3)[:, :, 0]
    # Elliptic functions in double precision: some hundred roundings of metres.
    np.testing.assert_allclose(solution.x, x, atol=3e-12)
    assert solution.apart < 1e-11


@pytest.mark.skipif(not EXTENDED, reason="longdouble is double on this machine")
def test_extrapolation_goes_beyond_double_precision():
    """An oscillator through two periods: all that is left is rounding the results to doubles."""
    start = np.array([1, 0], dtype=np.longdouble)

    def rate(y):
        return np.array([y[1], -y[0]])

    found = extended.refine(rate, lambda y: y[:, None, :1], start, 0.5, 24, 1e-15)
    np.testing.assert_allclose(found.x[:, 0, 0], np.cos(0.5 * np.arange(25)), atol=4e-16)


@pytest.fixture
def curve():
    """Errors h^4 of runs whose seconds go as 1/h, as a code of order 4 has."""
    code = curves.Code("any", curves, 4)
    problem = problems.Problem("any", problems.chain(10), (), 10.0, 10.0)
    made = curves.Curve(problem, code)
    for rung in range(2, 9):
        h = curves.knob(problem, code, rung)
        made.points[rung] = curves.Point(rung, h**4, [1.0 / h], round(10.0 / h))
    return made


def test_seconds_are_read_off_between_two_runs(curve):
    target = 1.7 * curve.points[5].error
    worse, good = curve.bracket(target)
    assert (worse.rung, good.rung) == (4, 5)
    seconds, how, _ = curve.reach(target)
    assert how == ""
    assert seconds == pytest.approx(target**-0.25, rel=1e-12)


def test_what_was_not_reached_is_a_lower_bound_by_the_order(curve):
    finest = curve.points[8].error
    seconds, how, _ = curve.reach(1e-3 * finest)
    assert how == ">="
    assert seconds == pytest.approx(curve.points[8].seconds * 1e3**0.25)
    assert curve.reach(0.6 * finest).how == ""


def test_a_coarsest_run_that_is_better_is_an_upper_bound(curve):
    assert curve.reach(1.0).how == "<="
    curve.points[1] = curves.Point(1, math.inf)
    assert curve.reach(1.0).seconds == curve.points[2].seconds


def test_a_ladder_climbs():
    steps = [curves.per_interval(rung) for rung in range(9)]
    assert steps == [1, 2, 3, 4, 6, 8, 12, 16, 24]
