"""Round numbers: steps and tolerances that are written in a digit or three."""

import math
from bisect import bisect_right

MANTISSAS = (1.0, 1.2, 1.25, 1.5, 1.6, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
"""Round numbers of a decade, at most a third apart."""
SERIES = (1, 2, 5)
"""Those along which a curve is drawn."""


def round_down(x: float, mantissas: tuple[float, ...] = MANTISSAS) -> float:
    """The largest round number that is no larger than ``x``, but for round-off."""
    x *= 1.0 + 1e-9
    decade = math.floor(math.log10(x))
    place = bisect_right(mantissas, x / 10.0**decade) - 1
    return float(f"{mantissas[max(place, 0)]:g}e{decade}")


def next_round(x: float) -> float:
    """The next round number above ``x``."""
    decade = math.floor(math.log10(x * (1.0 + 1e-9)))
    place = bisect_right(MANTISSAS, x / 10.0**decade * (1.0 + 1e-9))
    if place == len(MANTISSAS):
        return float(f"1e{decade + 1}")
    return float(f"{MANTISSAS[place]:g}e{decade}")


def rung(k: int) -> float:
    """The numbers ... 0.1, 0.2, 0.5, 1, 2, 5 ..., 1 by ``k`` = 0."""
    return float(f"{SERIES[k % 3]}e{k // 3}")


def rung_below(x: float) -> int:
    """The largest ``k`` whose ``rung`` is no larger than ``x``."""
    k = 3 * math.floor(math.log10(x))
    while rung(k + 1) <= x * (1.0 + 1e-9):
        k += 1
    return k
