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
        return -((max(0.4 - t, 0.0)) ** 2) - 1e-13 * math.sin(1e5 * t)

    # Where the square is round-off: at its root, 3e-7, before it rests.
    assert time_of_zero(gap, 0.3, 0.2, 0.0, 1.0, 1e-12) == pytest.approx(0.4, abs=1e-5)


def test_a_steep_place_between_flat_ones_is_found():
    """As the gap of two edges that begin to cross: what they are beyond their ends goes to zero at
    once, and they have overlapped by little since.
    """
    calls = []

    def crossing(t):
        calls.append(t)
        return 1e-6 * (t - 0.3) ** 2 if t > 0.3 else 30.0 * (t - 0.3)

    # The secant alone spends 60 steps at the end where it is flat.
    assert time_of_zero(crossing, 0.9999, 30.0, 0.0, 1.0, 1e-13) == pytest.approx(0.3, abs=1e-3)
    assert len(calls) < 50
