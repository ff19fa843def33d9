"""Finds the time of an event by steps that are taken up to it."""

import math
from collections.abc import Callable
from typing import NamedTuple

MOST = 60
"""Most steps that are tried for one event: enough for bisection to the last digit."""
ROUND_OFF = 4e-16
"""Fraction of a time that is round-off."""
NOISE = 1e-10
"""Fraction of what a margin changes by in the interval, by its rate. A smaller value that is more
than half the last one is round-off: the secant gains more."""


STALLED = 3
"""Values after which one that is more than half of what it was calls for bisection: the secant
does not find a place where the function is steep between two where it is flat."""


class NoStep(Exception):  # noqa: N818 - an outcome of the search
    """A step to a time that was tried could not be solved."""


class Event(NamedTuple):
    """An event within a step, by its dense output: times are those of the run [s]."""

    margin: int  # its number
    ends_run: bool
    guess: float  # time
    after: float  # time at which the margin is beyond the level
    level: float
    rate: float  # of the margin
    at_start: bool = False  # whether the margin leaves its range at once


def time_of_zero(
    function: Callable[[float], float],
    guess: float,
    rate: float,
    low: float,
    high: float,
    round_off: float = 0.0,
) -> float:
    """Return the time between ``low`` and ``high`` at which ``function`` is zero, by the secant
    from a ``guess`` and the ``rate`` there, and by bisection where that leaves the interval in
    which the sign changes. The function is negative at ``low`` and positive at ``high``, up to the
    error of the dense output, and was called for the returned time last. Values have a
    ``round_off``: one that touches zero and stays there does so at the first place found.
    """
    t, best = guess, (guess, math.inf)
    noise = max(NOISE * abs(rate) * (high - low), round_off)
    last: tuple[float, float] | None = None
    sizes: list[float] = []
    if not low < guess <= high:
        t = high
    for _ in range(MOST):
        value = function(t)
        sizes.append(abs(value))
        at_noise = last is not None and 0.5 * abs(last[1]) <= abs(value) <= noise
        if abs(value) <= abs(best[1]):
            best = t, value
        if value == 0.0 or at_noise:
            break
        low, high = (t, high) if value < 0.0 else (low, t)
        if last is not None and last[0] != t and last[1] != value:
            rate = (value - last[1]) / (t - last[0])
        last = t, value
        new = t - value / rate if rate != 0.0 else low
        stalls = len(sizes) > STALLED and sizes[-1] > 0.5 * sizes[-1 - STALLED]
        if stalls or not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - t) <= ROUND_OFF * abs(t) or not low < new < high:
            break
        t = new
    if best[0] != t:
        function(best[0])
    return best[0]
