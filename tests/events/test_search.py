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
