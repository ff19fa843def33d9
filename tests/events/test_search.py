"""The search for the time of an event by steps: few of them, and the last one at the time found."""

import math

import pytest

from msahl.events.search import time_of_zero

FUNCTIONS = {
    "smooth": (lambda t: math.exp(t) - 2.0, math.log(2.0), 8),
    "nearly tangent": (lambda t: 1e-6 - (t - 0.7) ** 2, 0.699, 12),
    "kinked": (lambda t: min(t - 0.3, 10.0 * (t - 0.3)), 0.3, 12),
    "a jump": (lambda t: 1.0 if t > 0.6 else -1.0, 0.6, 60),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_zero_is_found_to_round_off(name):
    function, zero, most = FUNCTIONS[name]
    calls = []

    def counted(t):
        calls.append(t)
        return function(t)

    high = 0.7 if name == "nearly tangent" else 1.0
    found = time_of_zero(counted, zero + 1e-4, 1.0, 0.0, high)
    # Near the maximum of 1e-6 round-off of the value, 1e-16, is divided by a slope of 2e-3.
    assert found == pytest.approx(zero, abs=1e-13)
    assert calls[-1] == found
    assert len(calls) <= most


def test_a_guess_outside_is_not_tried():
    calls = []

    def function(t):
        calls.append(t)
        return t - 0.25

    assert time_of_zero(function, 2.0, 1.0, 0.0, 0.5) == pytest.approx(0.25, abs=1e-16)
    assert max(calls) <= 0.5


def test_a_value_that_touches_zero_and_stays_is_found_where_it_touches():
    """As a gap whose corner slides on along a face: what is left of it is round-off."""

    def gap(t):
        return -(max(0.4 - t, 0.0) ** 2) - 1e-13

    # Where the square is less than the round-off, at the root of that, before it rests.
    assert time_of_zero(gap, 0.3, 0.2, 0.0, 1.0, 1e-12) == pytest.approx(0.4, abs=1e-6)


def test_a_steep_place_between_flat_ones_is_found():
    """As the gap of two edges that begin to cross: what they are beyond their ends goes to zero at
    once, and they have overlapped by little since.
    """

    def crossing(t):
        # Its slopes are such that a secant from the left ends near the right end, and back.
        return 2.6e-6 + 2e-5 * (t - 1.0) if t > 0.89 else 0.136 * (t - 1.0)

    found = time_of_zero(crossing, 0.99978, 0.68, 0.0, 0.99979, 1e-13)
    assert found == pytest.approx(0.89, abs=1e-12)
