"""Bounds of the expressions of a tape over intervals of one input.

Each operation has the bounds of its result from those of its operands: exact where it is monotonic,
else never too narrow, up to round-off. Intervals of no width have the values themselves.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeAlias

import numpy as np

from msahl.algebra import functions, surfaces
from msahl.expressions import tape as codes
from msahl.expressions.tape import FIRST_BINARY, Tape

Bounds: TypeAlias = tuple[np.ndarray, np.ndarray]
"""Lower and upper bounds (n,)."""


class Piece(NamedTuple):
    """Pieces of a table, one for each of n arguments."""

    number: np.ndarray  # (n,) counted from the first of the first period
    low: np.ndarray  # (n,) where it begins
    high: np.ndarray  # (n,)


def bounds(tape: Tape, operations: list[int], place: int, of: Bounds) -> dict[int, Bounds]:
    """Return the bounds of the ``operations``, and of all that they use, by their places, where the
    input at a ``place`` is within ``of``.
    """
    first = tape.constant.size + tape.inputs
    found = {place: of}
    for k, number in enumerate(tape.constant):
        found[k] = np.full(of[0].shape, number), np.full(of[0].shape, number)
    with np.errstate(all="ignore"):
        for i in operations:
            found[first + i] = _operation(tape, i, found)
    return found


def _operation(tape: Tape, i: int, found: Mapping[int, Bounds]) -> Bounds:
    """Return the bounds of operation ``i``."""
    op, x = int(tape.op[i]), found[int(tape.a[i])]
    if op == codes.HELD:
        return x
    if op == codes.CURVE:
        return _curve(tape, int(tape.c[i]), x)
    if op < FIRST_BINARY:
        return _known(_UNARY[op](x), x)
    y = found[int(tape.b[i])]
    if op == codes.SURFACE:
        return _surface(tape, int(tape.c[i]), x, y)
    if op == codes.WHERE:
        return _where(x, y, found[int(tape.c[i])])
    return _known(_BINARY[op](x, y), x, y)


def _known(result: Bounds, *operands: Bounds) -> Bounds:
    """Return the ``result``, without bounds where it has none; no number stays none for values."""
    exact = np.logical_and.reduce([low == high for low, high in operands])
    low, high = result
    return (
        np.where(np.isnan(low) & ~exact, -math.inf, low),
        np.where(np.isnan(high) & ~exact, math.inf, high),
    )


def _rising(function: Callable[..., np.ndarray]) -> Callable[[Bounds], Bounds]:
    return lambda x: (function(x[0]), function(x[1]))


def _falling(function: Callable[..., np.ndarray]) -> Callable[[Bounds], Bounds]:
    return lambda x: (function(x[1]), function(x[0]))


def _even(function: Callable[..., np.ndarray]) -> Callable[[Bounds], Bounds]:
    """Return the bounds of a function of the size of its argument, which rises with it."""

    def found(x: Bounds) -> Bounds:
        small, large = _size(x)
        return function(small), function(large)

    return found


def _size(x: Bounds) -> Bounds:
    low, high = np.abs(x[0]), np.abs(x[1])
    inside = (x[0] < 0.0) & (x[1] > 0.0)
    return np.where(inside, 0.0, np.minimum(low, high)), np.maximum(low, high)


def _wave(phase: float) -> Callable[[Bounds], Bounds]:
    """Return the bounds of sin(x + phase): its largest value is at 1/4 of each period."""

    def found(x: Bounds) -> Bounds:
        function = np.cos if phase else np.sin
        a, b = function(x[0]), function(x[1])
        periods = [(part + phase) / (2.0 * math.pi) for part in x]
        low, high = np.minimum(a, b), np.maximum(a, b)
        largest = np.floor(periods[1] - 0.25) > np.floor(periods[0] - 0.25)
        least = np.floor(periods[1] + 0.25) > np.floor(periods[0] + 0.25)
        return np.where(least, -1.0, low), np.where(largest, 1.0, high)

    return found


def _tangent(x: Bounds) -> Bounds:
    low, high = np.tan(x[0]), np.tan(x[1])
    pole = np.floor(x[0] / math.pi + 0.5) != np.floor(x[1] / math.pi + 0.5)
    return np.where(pole, -math.inf, low), np.where(pole, math.inf, high)


def _limited(
    function: Callable[[Bounds], Bounds], low: float, high: float
) -> Callable[[Bounds], Bounds]:
    """Return ``function`` on the part of an interval that is within its domain, if there is one."""

    def found(x: Bounds) -> Bounds:
        outside = (x[1] < low) | (x[0] > high)
        exact = x[0] == x[1]
        a, b = (np.where(exact, part, np.clip(part, low, high)) for part in x)
        a, b = function((a, b))
        return np.where(outside, math.nan, a), np.where(outside, math.nan, b)

    return found


def _product(x: Bounds, y: Bounds) -> Bounds:
    corners = [np.where((a == 0.0) | (b == 0.0), 0.0, a * b) for a in x for b in y]
    return np.minimum.reduce(corners), np.maximum.reduce(corners)


def _quotient(x: Bounds, y: Bounds) -> Bounds:
    corners = [a / b for a in x for b in y]
    low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
    pole = (y[0] <= 0.0) & (y[1] >= 0.0) & (y[0] < y[1])
    return np.where(pole, -math.inf, low), np.where(pole, math.inf, high)


def _power(x: Bounds, y: Bounds) -> Bounds:
    corners = [a**b for a in x for b in y]
    low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
    even = (y[0] == y[1]) & (y[0] % 2.0 == 0.0) & (y[0] > 0.0)
    odd = (y[0] == y[1]) & (y[0] % 2.0 == 1.0) & (y[0] > 0.0)
    inside = (x[0] < 0.0) & (x[1] > 0.0)
    low = np.where(even & inside, 0.0, low)
    unknown = (x[0] < 0.0) & ~even & ~odd & ((x[0] < x[1]) | (y[0] < y[1]))
    return np.where(unknown, -math.inf, low), np.where(unknown, math.inf, high)


def _hypotenuse(x: Bounds, y: Bounds) -> Bounds:
    a, b = _size(x), _size(y)
    return np.hypot(a[0], b[0]), np.hypot(a[1], b[1])


def _angle(y: Bounds, x: Bounds) -> Bounds:
    """Return the bounds of atan2(y, x), without those where x may not be positive."""
    corners = [np.arctan2(b, a) for b in y for a in x]
    unknown = (x[0] <= 0.0) & ((x[0] < x[1]) | (y[0] < y[1]))
    low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
    return np.where(unknown, -math.pi, low), np.where(unknown, math.pi, high)


def _truth(surely: np.ndarray, possibly: np.ndarray) -> Bounds:
    return surely.astype(float), possibly.astype(float)


def _holds(x: Bounds) -> Bounds:
    """Return whether a condition holds, for sure and possibly."""
    return (x[0] > 0.0) | (x[1] < 0.0), (x[0] != 0.0) | (x[1] != 0.0)


def _where(condition: Bounds, a: Bounds, b: Bounds) -> Bounds:
    surely, possibly = _holds(condition)
    low, high = np.fmin(a[0], b[0]), np.fmax(a[1], b[1])
    low = np.where(surely, a[0], np.where(possibly, low, b[0]))
    return low, np.where(surely, a[1], np.where(possibly, high, b[1]))


def _smallest(x: Bounds, y: Bounds) -> Bounds:
    return np.minimum(x[0], y[0]), np.minimum(x[1], y[1])


def _largest(x: Bounds, y: Bounds) -> Bounds:
    return np.maximum(x[0], y[0]), np.maximum(x[1], y[1])


def _both(x: Bounds, y: Bounds) -> Bounds:
    (a, b), (c, d) = _holds(x), _holds(y)
    return _truth(a & c, b & d)


def _either(x: Bounds, y: Bounds) -> Bounds:
    (a, b), (c, d) = _holds(x), _holds(y)
    return _truth(a | c, b | d)


def _not(x: Bounds) -> Bounds:
    surely, possibly = _holds(x)
    return _truth(~possibly, ~surely)


def _same(x: Bounds, y: Bounds) -> Bounds:
    return _truth((x[0] == y[1]) & (x[1] == y[0]) & (x[0] == x[1]), (x[0] <= y[1]) & (x[1] >= y[0]))


_UNARY: Mapping[int, Callable[[Bounds], Bounds]] = {
    codes.NEGATE: _falling(np.negative),
    codes.NOT: _not,
    codes.SIN: _wave(0.0),
    codes.COS: _wave(0.5 * math.pi),
    codes.TAN: _tangent,
    codes.ASIN: _limited(_rising(np.arcsin), -1.0, 1.0),
    codes.ACOS: _limited(_falling(np.arccos), -1.0, 1.0),
    codes.ATAN: _rising(np.arctan),
    codes.SINH: _rising(np.sinh),
    codes.COSH: _even(np.cosh),
    codes.TANH: _rising(np.tanh),
    codes.EXP: _rising(np.exp),
    codes.LOG: _limited(_rising(np.log), 0.0, math.inf),
    codes.SQRT: _limited(_rising(np.sqrt), 0.0, math.inf),
    codes.SIGN: _rising(np.sign),
    codes.FLOOR: _rising(np.floor),
}
_BINARY: Mapping[int, Callable[[Bounds, Bounds], Bounds]] = {
    codes.ADD: lambda x, y: (x[0] + y[0], x[1] + y[1]),
    codes.SUBTRACT: lambda x, y: (x[0] - y[1], x[1] - y[0]),
    codes.MULTIPLY: _product,
    codes.DIVIDE: _quotient,
    codes.POWER: _power,
    codes.LESS: lambda x, y: _truth(x[1] < y[0], x[0] < y[1]),
    codes.AT_MOST: lambda x, y: _truth(x[1] <= y[0], x[0] <= y[1]),
    codes.GREATER: lambda x, y: _truth(x[0] > y[1], x[1] > y[0]),
    codes.AT_LEAST: lambda x, y: _truth(x[0] >= y[1], x[1] >= y[0]),
    codes.EQUAL: _same,
    codes.UNEQUAL: lambda x, y: _not(_same(x, y)),
    codes.AND: _both,
    codes.OR: _either,
    codes.ATAN2: _angle,
    codes.HYPOT: _hypotenuse,
    codes.BOTH: _smallest,
    codes.EITHER: _largest,
}


def piece_of(tape: Tape, curve: int, x: np.ndarray) -> Piece:
    """Return the pieces of a table at the arguments ``x`` (n,)."""
    first, numbers = tape.laws.first[curve], tape.laws.numbers
    count, period = int(numbers[first]), numbers[first + 1]
    breaks = numbers[first + 2 : first + 3 + count]
    periods = np.floor((x - breaks[0]) / period) if period > 0.0 else np.zeros(x.shape)
    i = np.searchsorted(breaks, x - period * periods, side="right") - 1
    if period > 0.0:
        i = np.clip(i, 0, count - 1)
    low = np.where(i < 0, -math.inf, breaks[np.maximum(i, 0)])
    high = np.where(i == count, math.inf, breaks[np.minimum(i + 1, count)])
    return Piece(i + count * periods, low + period * periods, high + period * periods)


def _curve(tape: Tape, curve: int, x: Bounds) -> Bounds:
    """Return the bounds of a table of one variable, where its argument is within one piece."""
    middle = np.where(x[0] == x[1], x[0], 0.5 * (x[0] + x[1]))
    middle = np.where(np.isfinite(middle), middle, 0.0)
    piece = piece_of(tape, curve, middle)
    first, numbers = tape.laws.first[curve], tape.laws.numbers
    count = int(numbers[first])
    i = (piece.number % count if numbers[first + 1] > 0.0 else piece.number).astype(int)
    inside, width = (i >= 0) & (i < count), functions.DEGREE + 1
    terms = numbers[first + 3 + count : first + 3 + count + width * count].reshape(count, width)
    own = terms[np.clip(i, 0, count - 1)]
    own = np.where(inside[:, None], own, 0.0)
    own[i < 0, 0], own[i == count, 0] = terms[0, 0], numbers[first + 3 + count + width * count]
    since = np.where(inside, piece.low, 0.0)
    # An end beyond the piece by round-off belongs to it; others make the interval unbounded.
    slack = 1e-9 * np.where(inside, piece.high - piece.low, 1.0)
    known = (x[0] >= piece.low - slack) & (x[1] <= piece.high + slack)
    a, b = (np.where(inside, part - since, 0.0) for part in x)
    low = high = np.zeros(middle.shape)
    for k in range(functions.DEGREE, -1, -1):
        low, high = _product((low, high), (a, b))
        low, high = low + own[:, k], high + own[:, k]
    return np.where(known, low, -math.inf), np.where(known, high, math.inf)


def _surface(tape: Tape, surface: int, x: Bounds, y: Bounds) -> Bounds:
    """Return the values of a table of two variables; it has no bounds over intervals."""
    low, high = np.full(x[0].shape, -math.inf), np.full(x[0].shape, math.inf)
    for k in np.flatnonzero((x[0] == x[1]) & (y[0] == y[1])):
        given = float(x[0][k]), float(y[0][k])
        low[k] = high[k] = surfaces.evaluate(tape.surfaces, surface, *given)[0]
    return low, high
