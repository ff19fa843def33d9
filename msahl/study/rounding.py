"""Round step sizes and tolerances to numbers of one to three digits."""

import math
from bisect import bisect_right

MANTISSAS = (1.0, 1.2, 1.25, 1.5, 1.6, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
"""Round numbers of a decade; neighbours differ by at most a third."""
SERIES = (1, 2, 5)
"""Numbers of a decade that the curve of a scheme consists of."""


def round_down(x: float, mantissas: tuple[float, ...] = MANTISSAS) -> float:
    """Return the largest round number that does not exceed ``x``, up to rounding errors."""
    x *= 1.0 + 1e-9
    decade = math.floor(math.log10(x))
    place = bisect_right(mantissas, x / 10.0**decade) - 1
    return float(f"{mantissas[max(place, 0)]:g}e{decade}")


def next_round(x: float) -> float:
    """Return the smallest round number above ``x``."""
    decade = math.floor(math.log10(x * (1.0 + 1e-9)))
    place = bisect_right(MANTISSAS, x / 10.0**decade * (1.0 + 1e-9))
    if place == len(MANTISSAS):
        return float(f"1e{decade + 1}")
    return float(f"{MANTISSAS[place]:g}e{decade}")


def series_value(k: int) -> float:
    """Return number ``k`` of the series ... 0.1, 0.2, 0.5, 1, 2, 5 ...; number 0 is 1."""
    return float(f"{SERIES[k % 3]}e{k // 3}")


def series_index(x: float) -> int:
    """Return the largest ``k`` for which ``series_value(k)`` does not exceed ``x``."""
    k = 3 * math.floor(math.log10(x))
    while series_value(k + 1) <= x * (1.0 + 1e-9):
        k += 1
    return k
