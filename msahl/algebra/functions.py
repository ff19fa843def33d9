"""Evaluate laws, which are functions of one variable that a deck gives.

The variable is the time for motions and loads, and a length or an angle for springs and cams.

    polynomial  c_0 + c_1 t + c_2 t^2 + ...          a constant is its first term
    sine        offset + amplitude sin(omega t + phase)
    pieces      polynomials of degree five between breaks; constant outside, or periodic

Ramps and tables are pieces. Each kind has its value, its first two derivatives, and its exact
moments over an interval, against Legendre's polynomials P_k:

    m_k = integral over [0, 1] of law(a + d x) P_k(2 x - 1)          k = 0..4; m_0 is the mean

polynomial, pieces   Gauss quadrature, exact for them, of each piece's part of the interval; the
                     complete periods within it are three weighted ones, see ``_repeats``
sine                 m_k + i (...) = amplitude exp(i phase) i^k j_k(omega d/2), with the phase in
                     the middle and the spherical Bessel functions j_k

All are sums of values of the law, without differences of large numbers: errors are of the size of
the machine epsilon times the law's largest value in the interval.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from msahl.jit.kernel import apart, kernel

POLYNOMIAL, SINE, PIECES = range(3)
DEGREE = 5
"""Of the pieces: a smooth ramp needs five."""
MOMENTS = 5
"""As many as the schemes of the highest degree need."""
PAST = 1e-9
"""Fraction of a run's duration within which a law ends with it: times of steps are sums, and a
million of them round by 1e-10."""

Moments = tuple[float, float, float, float, float]
NONE: Moments = (0.0, 0.0, 0.0, 0.0, 0.0)


NEARBY = 2.0**-26
"""Relative change of a number for the derivative by it: half of the digits."""


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
    """All laws of a model: their numbers one after the other."""

    kind: np.ndarray  # (l,)
    first: np.ndarray  # (l + 1,) into numbers
    numbers: np.ndarray
    node: np.ndarray  # (g,) of a Gauss quadrature over [0, 1] that is exact for all moments
    weight: np.ndarray  # (g,)


def build_laws(laws: Sequence[Law]) -> Laws:
    """Return the laws as arrays; PIECES hold the number of pieces, period, breaks, six coefficients
    of each piece and the value at the end.
    """
    parts = [_numbers(law) for law in laws]
    sizes = [len(numbers) for _, numbers in parts]
    degrees = [len(numbers) - 1 for kind, numbers in parts if kind == POLYNOMIAL]
    points = (max([DEGREE, *degrees]) + MOMENTS - 1) // 2 + 1
    x, weight = np.zeros(points), np.zeros(points)
    if laws:  # numpy.polynomial is imported by its first use only, in 5 ms
        x, weight = np.polynomial.legendre.leggauss(points)
    return Laws(
        kind=np.array([kind for kind, _ in parts], dtype=np.int64),
        first=np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)]).astype(np.int64),
        numbers=np.array([number for _, numbers in parts for number in numbers], dtype=float),
        node=0.5 * (x + 1.0),
        weight=0.5 * weight,
    )


def joined(laws: Laws, more: Laws) -> Laws:
    """Return ``laws`` and after them ``more``, for their values and pieces."""
    return laws._replace(
        kind=np.append(laws.kind, more.kind),
        first=np.append(laws.first, more.first[1:] + laws.first[-1]),
        numbers=np.append(laws.numbers, more.numbers),
    )


def continue_past(laws: Laws, law: int, end: float) -> None:
    """Let a table or ramp over time that ends where a run does, up to round-off, go on past the
    ``end``: the last step is before it, and its end has the slope of the last piece.
    """
    if laws.kind[law] == PIECES and laws.numbers[laws.first[law] + 1] == 0.0:
        last = laws.first[law] + 2 + int(laws.numbers[laws.first[law]])
        if abs(laws.numbers[last] - end) <= PAST * end:
            laws.numbers[last] = end * (1.0 + 2.0 * PAST)


def _numbers(law: Law) -> tuple[int, list[float]]:
    if law.kind in ("constant", "polynomial"):
        return POLYNOMIAL, list(law.numbers)
    if law.kind == "sine":
        return SINE, list(law.numbers)
    if law.kind == "ramp":
        start_value, end_value, start, end = law.numbers
        # A numpy number gives inf where powers of a short span vanish; the deck check reports it.
        rise, span = end_value - start_value, np.float64(end - start)
        quintic = [start_value, 0.0, 0.0, 10.0, -15.0, 6.0]
        pieces = quintic[:3] + [c * rise / span**k for k, c in enumerate(quintic[3:], start=3)]
        return PIECES, [1.0, 0.0, start, end, *map(float, pieces), end_value]
    return PIECES, _table(law)


def _table(law: Law) -> list[float]:
    half = len(law.numbers) // 2
    x, y = np.array(law.numbers[:half]), np.array(law.numbers[half:])
    pieces = np.zeros((half - 1, DEGREE + 1))
    if law.kind == "linear":
        pieces[:, 0], pieces[:, 1] = y[:-1], np.diff(y) / np.diff(x)
    else:
        # Half a second to import: only models with splines pay.
        from scipy.interpolate import CubicSpline

        ends = "periodic" if law.kind == "periodic" else "not-a-knot"
        pieces[:, :4] = CubicSpline(x, y, bc_type=ends).c[::-1].T
    period = x[-1] - x[0] if law.kind == "periodic" else 0.0
    return [float(half - 1), float(period), *x.tolist(), *pieces.reshape(-1).tolist(), float(y[-1])]


@apart
def evaluate(laws: Laws, law: int, t: float) -> tuple[float, float, float]:
    """Return the value and the first two derivatives of ``law`` at ``t``."""
    numbers, first, last = laws.numbers, laws.first[law], laws.first[law + 1]
    if laws.kind[law] == POLYNOMIAL:
        return _polynomial(numbers, first, last, t)
    if laws.kind[law] == SINE:
        amplitude, omega, offset = numbers[first], numbers[first + 1], numbers[first + 3]
        phase = omega * t + numbers[first + 2]
        s, c = amplitude * math.sin(phase), amplitude * math.cos(phase)
        return offset + s, omega * c, -omega * omega * s
    start, x, inside = _piece(numbers, first, t)
    value, rate, second = _polynomial(numbers, start, start + DEGREE + 1, x)
    return (value, rate, second) if inside else (value, 0.0, 0.0)


def steepest(laws: Laws, law: int) -> float:
    """Return the largest slope that a table has at one of its entries."""
    first = laws.first[law]
    breaks = laws.numbers[first + 2 : first + 3 + int(laws.numbers[first])]
    return max(abs(evaluate(laws, law, float(x))[1]) for x in breaks)


@apart
def extent(laws: Laws, law: int, t: float) -> float:
    """Return the sum of the sizes of the terms in the value of ``law`` at ``t``: the round-off of
    the value is that of these terms.
    """
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
    return total + abs(t * _polynomial(numbers, first, last, x)[1])


def rate_round_off(laws: Laws, law: int, t: float) -> float:
    """Return how much the rate of ``law`` at ``t`` changes by the round-off of its numbers: a rate
    below that, as of a sine at its crest, may be zero.
    """
    numbers = laws.numbers.copy()
    changed = laws._replace(numbers=numbers)
    rate, total = evaluate(laws, law, t)[1], 0.0
    for k in range(laws.first[law], laws.first[law + 1]):
        numbers[k] *= 1.0 + NEARBY
        total += abs(evaluate(changed, law, t)[1] - rate)
        numbers[k] = laws.numbers[k]
    return float(np.finfo(float).eps / NEARBY * total)


@kernel
def mean(laws: Laws, law: int, a: float, d: float) -> float:
    """Return the mean of ``law`` from ``a`` to ``a + d``."""
    return moments(laws, law, a, d)[0]


@apart
def moments(laws: Laws, law: int, a: float, d: float) -> Moments:
    """Return the moments of ``law`` from ``a`` to ``a + d``, as the module defines them."""
    numbers, first, last = laws.numbers, laws.first[law], laws.first[law + 1]
    if d == 0.0:
        return evaluate(laws, law, a)[0], 0.0, 0.0, 0.0, 0.0
    if laws.kind[law] == POLYNOMIAL:
        return _part(laws, first, last, a, 0.0, 1.0, d, 0.0, 1.0, NONE)
    if laws.kind[law] == SINE:
        amplitude, omega, offset = numbers[first], numbers[first + 1], numbers[first + 3]
        phase = omega * (a + 0.5 * d) + numbers[first + 2]
        s, c = amplitude * math.sin(phase), amplitude * math.cos(phase)
        j = _bessel(0.5 * omega * d)
        return offset + s * j[0], c * j[1], -s * j[2], -c * j[3], s * j[4]
    if d < 0.0:
        # The same interval from its other end.
        m = moments_of_pieces(laws, first, a + d, -d)
        return m[0], -m[1], m[2], -m[3], m[4]
    return moments_of_pieces(laws, first, a, d)


@kernel
def moments_of_pieces(laws: Laws, first: int, a: float, d: float) -> Moments:
    """Return the moments from ``a`` to ``a + d``, d > 0, of the pieces whose numbers start at
    ``first``.
    """
    numbers = laws.numbers
    low, period = numbers[first + 2], numbers[first + 1]
    if not period > 0.0:
        return _stretch(laws, first, a, 0.0, 1.0, d, 0.0, 1.0, NONE)
    x = a - period * np.floor((a - low) / period)
    head, length = max(0.0, min(1.0, (low + period - x) / d)), period / d
    total = _stretch(laws, first, x, 0.0, head, d, 0.0, 1.0, NONE)
    n = np.floor((1.0 - head) / length)
    if n > 0.0:
        shift, outer = _repeats(n)
        middle = 0.5 * (n - 1.0)
        for k in range(-1, 2):
            weight = n - 2.0 * outer if k == 0 else outer
            away = length * (middle + k * shift)
            end = head + length
            total = _stretch(laws, first, low, head, end, d, away, weight, total)
    return _stretch(laws, first, low, head + n * length, 1.0, d, 0.0, 1.0, total)


@kernel
def _repeats(n: float) -> tuple[float, float]:
    """Return place r and weight w of the outer two of three periods that stand for ``n``.

    A sum over the periods of what is a polynomial of the fifth degree in their place is w times
    those at the places -r and r from the middle and n - 2 w times that in the middle: so the second
    and the fourth moments of the places are right.
    """
    second = n * (n * n - 1.0) / 12.0
    square = (3.0 * n * n - 7.0) / 20.0  # the fourth moment over the second
    return (math.sqrt(square), 0.5 * second / square) if n > 1.0 else (0.0, 0.0)


@kernel
def _stretch(
    laws: Laws,
    first: int,
    x: float,
    left: float,
    right: float,
    d: float,
    away: float,
    weight: float,
    total: Moments,
) -> Moments:
    """Add to ``total`` the moments, ``weight`` times, of pieces that do not repeat, over the part
    from ``left`` to ``right`` of the interval of length ``d``; it begins at the argument ``x``.
    """
    numbers = laws.numbers
    count, breaks = int(numbers[first]), first + 2
    coefficients = breaks + count + 1
    i, begin = index(numbers, first, x), left
    while begin < right:
        end = right
        if i < count:
            end = min(right, max(begin, left + (numbers[breaks + i + 1] - x) / d))
        # Before the first break the value there, after the last one the value there.
        start = coefficients + (DEGREE + 1) * max(i, 0)
        size = DEGREE + 1 if 0 <= i < count else 1
        here = x + (begin - left) * d - numbers[breaks + max(i, 0)]
        total = _part(laws, start, start + size, here, begin, end, d, away, weight, total)
        i, begin = i + 1, end
    return total


@kernel
def _part(
    laws: Laws,
    first: int,
    last: int,
    x: float,
    left: float,
    right: float,
    d: float,
    away: float,
    weight: float,
    total: Moments,
) -> Moments:
    """Add to ``total`` the moments, ``weight`` times, of one polynomial over the part from
    ``left`` to ``right`` of an interval of length ``d``; its argument there begins at ``x``.
    Legendre's polynomials are taken ``away`` from there.
    """
    size = right - left
    for g in range(laws.node.size):
        x_g = x + size * d * laws.node[g]
        value, _, _ = _polynomial(laws.numbers, first, last, x_g)
        p = 2.0 * (left + away + size * laws.node[g]) - 1.0
        total = _add(total, weight * size * laws.weight[g] * value, p)
    return total


@kernel
def _add(total: Moments, value: float, x: float) -> Moments:
    """Return ``total`` plus ``value`` times Legendre's polynomials at ``x``."""
    x2 = x * x
    return (
        total[0] + value,
        total[1] + value * x,
        total[2] + value * (1.5 * x2 - 0.5),
        total[3] + value * (2.5 * x2 - 1.5) * x,
        total[4] + value * ((4.375 * x2 - 3.75) * x2 + 0.375),
    )


@kernel
def _bessel(x: float) -> Moments:
    """Return the spherical Bessel functions j_0..j_4 with an absolute error of a few machine
    epsilons.
    """
    if abs(x) >= 2.0:
        # Upwards, which costs digits below the order: 1e-15 at 2.
        j0 = math.sin(x) / x
        j1 = (j0 - math.cos(x)) / x
        j2 = 3.0 / x * j1 - j0
        j3 = 5.0 / x * j2 - j1
        return j0, j1, j2, j3, 7.0 / x * j3 - j2
    # g_k = j_k (2 k + 1)!!/x^k; downwards from its series for k = 4 and 5.
    z = x * x
    g5, g4 = _series(5, z), _series(4, z)
    g3 = g4 - z / 99.0 * g5
    g2 = g3 - z / 63.0 * g4
    g1 = g2 - z / 35.0 * g3
    g0 = g1 - z / 15.0 * g2
    return g0, x / 3.0 * g1, z / 15.0 * g2, z * x / 105.0 * g3, z * z / 945.0 * g4


@kernel
def _series(k: int, z: float) -> float:
    """Return j_k (2 k + 1)!!/x^k for z = x^2 below 4, where terms alternate and fall at once."""
    total, term, n = 1.0, 1.0, 0
    while abs(term) > 1e-17:
        n += 1
        term *= -0.5 * z / (n * (2 * k + 2 * n + 1))
        total += term
    return total


@kernel
def _piece(numbers: np.ndarray, first: int, t: float) -> tuple[int, float, bool]:
    """Return where the coefficients of the piece at ``t`` start, the argument in the piece, and
    whether ``t`` is inside the table.
    """
    count, period = int(numbers[first]), numbers[first + 1]
    breaks = first + 2
    low, high = numbers[breaks], numbers[breaks + count]
    x = t
    if period > 0.0:
        x = t - period * math.floor((t - low) / period)
    inside = low <= x <= high
    x = min(max(x, low), high)
    i = min(max(index(numbers, first, x), 0), count - 1)
    return breaks + count + 1 + (DEGREE + 1) * i, x - numbers[breaks + i], inside


@kernel
def index(numbers: np.ndarray, first: int, x: float) -> int:
    """Return the number of the piece with ``x`` in it or at its beginning: -1 before the first
    piece, their count from the end of the last one on.
    """
    count, breaks = int(numbers[first]), first + 2
    return interval_of(numbers, breaks - 1, breaks + count + 1, x) - breaks


@kernel
def interval_of(numbers: np.ndarray, left: int, right: int, x: float) -> int:
    """Return the last place from ``left`` on, before ``right``, whose number is not above ``x``, of
    increasing numbers; that at ``left`` is not looked at.
    """
    while right - left > 1:
        middle = (left + right) // 2
        if x < numbers[middle]:
            right = middle
        else:
            left = middle
    return left


@kernel
def piece_of(laws: Laws, law: int, x: float) -> tuple[float, float]:
    """Return the breaks between which a law is smooth at ``x``; a break belongs to the piece that
    begins there.
    """
    if laws.kind[law] != PIECES:
        return -math.inf, math.inf
    numbers, first = laws.numbers, laws.first[law]
    count, period, breaks = int(numbers[first]), numbers[first + 1], first + 2
    away = 0.0
    if period > 0.0:
        away = period * np.floor((x - numbers[breaks]) / period)
    i = index(numbers, first, x - away)
    if period > 0.0:
        i = min(max(i, 0), count - 1)
    low = -math.inf if i < 0 else numbers[breaks + i] + away
    high = math.inf if i == count else numbers[breaks + i + 1] + away
    return low, high


@kernel
def _polynomial(numbers: np.ndarray, first: int, last: int, x: float) -> tuple[float, float, float]:
    """Return the value at ``x`` of the polynomial with the ascending coefficients
    ``numbers[first:last]``, and two derivatives.
    """
    value, rate, second = 0.0, 0.0, 0.0
    for i in range(last - 1, first - 1, -1):
        second = second * x + 2.0 * rate
        rate = rate * x + value
        value = value * x + numbers[i]
    return value, rate, second
