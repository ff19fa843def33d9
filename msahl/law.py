"""Laws: functions of one variable that a deck gives, of time for motions and loads, of length or
angle for springs and cams.

    polynomial  c_0 + c_1 t + c_2 t^2 + ...          a constant is its first term
    sine        offset + amplitude sin(omega t + phase)
    pieces      polynomials of degree five between breaks; constant outside, or periodic

Ramps and tables are pieces. A law knows its value and its first two derivatives, a table its mean.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from msahl.kernel import kernel

POLYNOMIAL, SINE, PIECES = range(3)
DEGREE = 5
"""Of the pieces: a smooth ramp needs five."""


@dataclass(frozen=True, slots=True)
class Law:
    """A law as the deck gives it; ``numbers`` by kind:

    constant: value. polynomial: c_0, c_1, ... sine: amplitude, omega [rad/s], phase [rad], offset.
    ramp: from, to, start, end (smooth: no jump in velocity or acceleration).
    linear, cubic, periodic: the arguments of a table, increasing, then as many values; ``periodic``
    is a cubic spline whose last value repeats the first.
    """

    kind: str
    numbers: tuple[float, ...]


class Laws(NamedTuple):
    """All laws of a scene: their numbers one after the other."""

    kind: np.ndarray  # (l,)
    first: np.ndarray  # (l + 1,) into numbers
    numbers: np.ndarray


def build_laws(laws: Sequence[Law]) -> Laws:
    """The laws as arrays; PIECES hold count, period, breaks, then six coefficients a piece."""
    parts = [_numbers(law) for law in laws]
    sizes = [len(numbers) for _, numbers in parts]
    return Laws(
        kind=np.array([kind for kind, _ in parts], dtype=np.int64),
        first=np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)]).astype(np.int64),
        numbers=np.array([number for _, numbers in parts for number in numbers], dtype=float),
    )


def _numbers(law: Law) -> tuple[int, list[float]]:
    if law.kind in ("constant", "polynomial"):
        return POLYNOMIAL, list(law.numbers)
    if law.kind == "sine":
        return SINE, list(law.numbers)
    if law.kind == "ramp":
        start_value, end_value, start, end = law.numbers
        # A numpy number gives inf where powers of a short span vanish; the deck tells of it.
        rise, span = end_value - start_value, np.float64(end - start)
        quintic = [start_value, 0.0, 0.0, 10.0, -15.0, 6.0]
        pieces = quintic[:3] + [c * rise / span**k for k, c in enumerate(quintic[3:], start=3)]
        return PIECES, [1.0, 0.0, start, end, *map(float, pieces)]
    return PIECES, _table(law)


def _table(law: Law) -> list[float]:
    half = len(law.numbers) // 2
    x, y = np.array(law.numbers[:half]), np.array(law.numbers[half:])
    pieces = np.zeros((half - 1, DEGREE + 1))
    if law.kind == "linear":
        pieces[:, 0], pieces[:, 1] = y[:-1], np.diff(y) / np.diff(x)
    else:
        # Half a second to import: only scenes with splines pay.
        from scipy.interpolate import CubicSpline

        ends = "periodic" if law.kind == "periodic" else "not-a-knot"
        pieces[:, :4] = CubicSpline(x, y, bc_type=ends).c[::-1].T
    period = x[-1] - x[0] if law.kind == "periodic" else 0.0
    return [float(half - 1), float(period), *x.tolist(), *pieces.reshape(-1).tolist()]


@kernel
def evaluate(laws: Laws, law: int, t: float) -> tuple[float, float, float]:
    """Value and first two derivatives of ``law`` at ``t``."""
    numbers, first, last = laws.numbers, laws.first[law], laws.first[law + 1]
    if laws.kind[law] == POLYNOMIAL:
        return _horner(numbers, first, last, t)
    if laws.kind[law] == SINE:
        amplitude, omega, offset = numbers[first], numbers[first + 1], numbers[first + 3]
        phase = omega * t + numbers[first + 2]
        s, c = amplitude * math.sin(phase), amplitude * math.cos(phase)
        return offset + s, omega * c, -omega * omega * s
    start, x, inside = _piece(numbers, first, t)
    value, rate, second = _horner(numbers, start, start + DEGREE + 1, x)
    return (value, rate, second) if inside else (value, 0.0, 0.0)


@kernel
def extent(laws: Laws, law: int, t: float) -> float:
    """Size of the largest terms in the value of ``law`` at ``t``, whose round-off the value has."""
    numbers, first, last, x = laws.numbers, laws.first[law], laws.first[law + 1], t
    if laws.kind[law] == SINE:
        phase = abs(numbers[first + 1] * t) + abs(numbers[first + 2])
        return abs(numbers[first + 3]) + abs(numbers[first]) * (1.0 + phase)
    if laws.kind[law] == PIECES:
        first, x, _ = _piece(numbers, first, t)
        last = first + DEGREE + 1
    total, power = 0.0, 1.0
    for i in range(first, last):
        total += abs(numbers[i] * power)
        power *= x
    # The argument itself has the round-off of t.
    return total + abs(t * _horner(numbers, first, last, x)[1])


@kernel
def mean(laws: Laws, law: int, a: float, d: float) -> float:
    """Mean of a table that does not repeat, from ``a`` to ``a + d``.

    Each piece's share by Gauss's rule with three points, which is exact for them, and as a
    difference from the value at ``a``: over a short way nothing large is subtracted.
    """
    reference, _, _ = evaluate(laws, law, a)
    if d == 0.0:
        return reference
    numbers, first = laws.numbers, laws.first[law]
    count, breaks = int(numbers[first]), first + 2
    low, high = min(a, a + d), max(a, a + d)
    total = 0.0
    for i in range(-1, count + 1):
        left = low if i < 0 else max(low, numbers[breaks + i])
        right = high if i == count else min(high, numbers[breaks + i + 1])
        if right > left:
            part = _mean_of_piece(laws, law, left, right) - reference
            total += part * ((right - left) / abs(d))
    return reference + total


@kernel
def _mean_of_piece(laws: Laws, law: int, left: float, right: float) -> float:
    """Mean of a law between two places within one of its pieces."""
    middle, reach = 0.5 * (left + right), 0.5 * math.sqrt(0.6) * (right - left)
    ends = evaluate(laws, law, middle - reach)[0] + evaluate(laws, law, middle + reach)[0]
    return (8.0 * evaluate(laws, law, middle)[0] + 5.0 * ends) / 18.0


@kernel
def _piece(numbers: np.ndarray, first: int, t: float) -> tuple[int, float, bool]:
    """Where the coefficients of the piece at ``t`` start, the argument in it, and if inside."""
    count, period = int(numbers[first]), numbers[first + 1]
    breaks = first + 2
    low, high = numbers[breaks], numbers[breaks + count]
    x = t
    if period > 0.0:
        x = t - period * math.floor((t - low) / period)
    inside = low <= x <= high
    x = min(max(x, low), high)
    left, right = 0, count
    while right - left > 1:
        middle = (left + right) // 2
        if x < numbers[breaks + middle]:
            right = middle
        else:
            left = middle
    return breaks + count + 1 + (DEGREE + 1) * left, x - numbers[breaks + left], inside


@kernel
def _horner(numbers: np.ndarray, first: int, last: int, x: float) -> tuple[float, float, float]:
    """Value and two derivatives of the polynomial with ascending coefficients."""
    value, rate, second = 0.0, 0.0, 0.0
    for i in range(last - 1, first - 1, -1):
        second = second * x + 2.0 * rate
        rate = rate * x + value
        value = value * x + numbers[i]
    return value, rate, second
