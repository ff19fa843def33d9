"""Times of pulses and narrow transitions of functions of the time."""

import numpy as np
import pytest

from msahl.expressions.known_times import dependent, users
from msahl.expressions.pulses import pulse_times, terms
from msahl.expressions.syntax import parse
from msahl.expressions.tape import build_tape

SLOW = (
    *("5", "t", "sin(t)", "sin(40*t)", "sin(400*t)", "sin(300*t^2)", "exp(-t)*sin(40*t)"),
    *("t^20", "exp(10*t)", "sqrt(t)", "1/(t + .1)", "t*(1 - t)", "sin(t)^2 + cos(t)^2"),
    *("tanh((t - .5)/.1)", "exp(-((t - .5)/.05)^2)", "1/(1 + ((t - .5)/.1)^2)"),
    *("sqrt((t - .5)^2 + 1e-10)", "exp(1000*t)*exp(-1000*t)"),
)
"""Smooth, or equally fast from beginning to end: steps of any size meet them."""
PULSES = {
    "exp(-((t - .4567)/W)^2)": [0.4567],
    "1/cosh((t - .3)/W)^2": [0.3],
    "1/((t - .3)^2 + W^2)": [0.3],
    "tanh((t - .2)/W)": [0.2],
    "1/(1 + exp(-(t - .5)/W))": [0.5],
    "1000*sin(t) + exp(-((t - .5)/W)^2)": [0.5],
    "(2 + sin(9*t) + t)*(t - .5)*exp(-((t - .5)/W)^2)": [0.5],
    "exp(-((t - .1)/W)^2) + exp(-((t - .9)/W)^2)": [0.1, 0.9],
    "exp(-t/W)": [0.0],
    "exp((t - 1)/W)": [1.0],
}


def times(text, step=0.0):
    """Return the times of the pulses in a second of a function of ``t``."""
    tape, places = build_tape([parse(text)], ["t"], {}, {})
    found, timed = [np.zeros(0)], dependent(tape, np.array([0]))
    for term in terms(tape, places.tolist(), timed):
        needed = users(tape, np.array([term]))
        given = term, tape.constant.size, np.array([0.0, 1.0]), step
        found.append(pulse_times(tape, needed, *given))
    return np.sort(np.concatenate(found))


@pytest.mark.parametrize("text", SLOW)
@pytest.mark.parametrize("step", [0.0, 0.01])
def test_slow_functions_have_none(text, step):
    assert times(text, step).size == 0


@pytest.mark.parametrize("width", [5e-3, 1e-3, 1e-5, 1e-8])
@pytest.mark.parametrize("text", PULSES)
def test_pulses_of_any_width_are_found(text, width):
    found, centres = times(text.replace("W", str(width))), PULSES[text]
    # Some on the flanks of each, and tails that double: not many for the shortest ones either.
    assert 8 * len(centres) <= found.size <= 60 * len(centres)
    for centre in centres:
        assert np.count_nonzero(abs(found - centre) < 4.0 * width) >= 4


def test_pulses_that_given_steps_resolve_have_none():
    assert times("exp(-((t - .4567)/.02)^2)", 0.01).size == 0
    assert times("exp(-((t - .4567)/.02)^2)", 0.1).size > 0
