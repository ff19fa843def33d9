"""Series of rebounds that follow each other ever faster, an infinite number in a finite time.

By the speed v after an impact and the acceleration -a of the gap all further rebounds take the time
2 v/(a (1 - e)). They end where that time and the next one's height v^2/(2 a) are below the accuracy
asked for, or the height is below the round-off of positions: then the contact closes, and the
height is added to the error estimate.
"""

import math

import numpy as np

from msahl.contact.state import UNSEEN, After

SHARE = 0.1
"""Share of the accuracy asked for that omitted rebounds may take."""
ACCURACY = 1e-9
"""Accuracy [m and s] of the end of a series of rebounds if none is asked for."""
BEYOND = 1.5
"""Time, over that of the next rebound, in which a step looks for it."""


def accuracy_of_end(asked: float | None) -> float:
    """Return the accuracy [m and s] of the end of a series, of that ``asked`` for in the run."""
    return ACCURACY if asked is None else SHARE * asked


def rebounds(after: After, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (k,) [s] that all further rebounds take, and the heights of the next ones [m
    or rad]; infinite where there is none.
    """
    left, height = np.full((2, e.size), math.inf)
    falls, v, a = _rising(after, e.size)
    height[falls] = 0.5 * v * v / a
    with np.errstate(divide="ignore"):
        left[falls] = 2.0 * v / (a * (1.0 - e[falls]))
    return left, height


def unseen(height: np.ndarray, round_off: np.ndarray) -> np.ndarray:
    """(k,) whether rebounds of this ``height`` (k,) are too small to be resolved."""
    found: np.ndarray = height <= UNSEEN * round_off
    return found


def time_to_next(after: After, count: int) -> float:
    """Return a time [s] shortly after the next rebound of ``count`` contacts, infinite without."""
    _, v, a = _rising(after, count)
    return BEYOND * float((2.0 * v / a).min(initial=math.inf))


def _rising(after: After, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which of ``count`` contacts open and will fall back (k,), their speeds v and the
    accelerations a by which they come back.
    """
    v, a = after.speed[:count], -after.acceleration[:count]
    falls = (v > 0.0) & (a > 0.0)
    return falls, v[falls], a[falls]
