"""Times at which smooth functions of the time have pulses and transitions that a step may miss.

The run is divided into cells until bounds over each of them (``intervals``) say that it hides
nothing beside its samples, and a parabola describes these: so no pulse is too short to be found.
Times at which the function has changed by another ``SHARE`` of its range show where it changes
fast. Where many follow each other closely after or before a long time without any, steps are to end
at some of them, and on both sides at distances that double until the function is constant.

Each term of a sum has a range of its own: a small pulse beside a large slow term matters, too.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from msahl.expressions.intervals import Bounds, bounds
from msahl.expressions.tape import ADD, DIVIDE, MULTIPLY, NEGATE, SUBTRACT, SURFACE, Tape

FIRST_CELLS, MOST_CELLS = 256, 20_000
"""Cells at first, at least, and at most: a fast oscillation needs some ten for each period."""
MANY = 16
"""Cells at first between two known times, from which they may show a pulse without being halved."""
ROUNDS = 100
"""In each of which cells are divided in two: enough for those of the shortest size."""
SHORTEST = 1e-13
"""Size of a cell that is not halved, as a fraction of the run: round-off of the time."""
MET, BETWEEN = np.array([0.0, 0.5, 1.0]), np.array([0.21, 0.36, 0.64, 0.79])
"""Samples of a cell or a step, as fractions of it: those of a parabola, and others."""
PARABOLA = np.array(
    [(1 - 2 * BETWEEN) * (1 - BETWEEN), 4 * BETWEEN * (1 - BETWEEN), BETWEEN * (2 * BETWEEN - 1)]
)
"""Weights of the values at ``MET`` in the parabola's values at ``BETWEEN``."""
INWARDS = 1e-9
"""Fraction of a cell or a step, from its ends, at which a function has its values within it."""
HIDDEN, BENT = 0.02, 0.05
"""What bounds may exceed the samples of a cell by, and these a parabola, as fractions of the
function's range: pulses that are smaller than this are not sought."""
CONSTANT, NOTHING = 1e-9, 1e-50
"""Range of a function, as a fraction of its largest value and in SI units, that is no change: the
tail of a pulse that is never reached changes by many powers of ten, and nothing follows from it."""
SHARE = 0.05
"""Change of a function, as a fraction of its range, from one of the times to the next."""
NEIGHBOURS, QUIET = 8, 16.0
"""A time without changes is long if it exceeds the least of so many distances beside it by this
factor: 6 at the turning points of a sine, and more where nothing happens."""
SHORT, SHORT_OF_STEP = 1 / 500, 0.03
"""Fractions of the run, and of a given step, from which distances are short enough to be missed.
The shortest one of exp(-(t/w)^2) is w/17: w is up to 1/30 of the run, or half of a step."""
EVERY, MOST = 4, 24
"""One of so many times is taken, and so many of one pulse: of a burst of oscillations the first
ones, from which the step-size control sees it."""
TAIL = 1e-10
"""Change beside a pulse, as a fraction of the function's range, that is left to one step."""

Function = Callable[[Bounds], Bounds]
"""The bounds of a function of the time over intervals."""


class Cells(NamedTuple):
    """Cells (n,) of the time, and a function in them."""

    low: np.ndarray
    high: np.ndarray
    value: np.ndarray  # (n, 7) samples, in their order
    hidden: np.ndarray  # (n,) what the bounds exceed the samples by
    bent: np.ndarray  # (n,) what a parabola deviates from the samples by


def terms(tape: Tape, places: Sequence[int], timed: np.ndarray) -> list[int]:
    """Return the places of the terms of which the values at ``places`` consist, and of the factors
    of products that have sums; ``timed`` says which values depend on the time.
    """
    first, found, waiting = tape.constant.size + tape.inputs, set[int](), list(places)
    seen = set[int]()
    while waiting:
        place = waiting.pop()
        if place < first or place in seen:
            continue
        seen.add(place)
        parts = _parts(tape, place, timed)
        waiting += parts
        if not parts:
            found.add(place)
    return sorted(found)


def _parts(tape: Tape, place: int, timed: np.ndarray) -> list[int]:
    """Return the places of terms and factors that a value consists of, none if it is one itself."""
    i = place - tape.constant.size - tape.inputs
    if i < 0:
        return []
    op, both = int(tape.op[i]), [int(tape.a[i]), int(tape.b[i])]
    if op == NEGATE or (op == DIVIDE and not timed[both[1]]):
        return both[:1]
    if op not in (ADD, SUBTRACT, MULTIPLY):
        return []
    varying = [part for part in both if timed[part]]
    if op == MULTIPLY and len(varying) == 2:
        return both if any(len(_parts(tape, part, timed)) == 2 for part in both) else []
    return varying


def pulse_times(
    tape: Tape, needed: list[int], place: int, time: int, borders: np.ndarray, step: float
) -> np.ndarray:
    """Return times at which pulses of the function at a ``place`` of the tape begin and change.

    The value needs the operations ``needed``, depends on the input at the place ``time`` alone,
    and has one formula between the ``borders``, of which the last is the end of the run. If steps
    are given their size is ``step`` [s], else 0; pulses that they resolve have no times.
    """

    def function(of: Bounds) -> Bounds:
        return bounds(tape, needed, time, of)[place]

    with np.errstate(all="ignore"):
        return _pulse_times(function, borders, step, bool(np.any(tape.op[needed] == SURFACE)))


def _pulse_times(function: Function, borders: np.ndarray, step: float, opaque: bool) -> np.ndarray:
    """See ``pulse_times``; an ``opaque`` function has no bounds over intervals."""
    low, high, value, _, _ = _cells(function, borders, opaque)
    size, found = _range(value), [np.zeros(0)]
    if not size > max(NOTHING, CONSTANT * np.fmax.reduce(np.abs(value), axis=None)):
        return found[0]
    t = _times(low, high)
    first = np.searchsorted(low, borders)
    count = np.diff(first)
    for k in np.flatnonzero((count > _first_count(borders)) | (count >= MANY)):
        own = slice(first[k], first[k + 1])
        inner = _times_of_change(t[own].ravel(), value[own].ravel(), SHARE * size)
        times = np.concatenate([borders[k, None], inner, borders[k + 1, None]])
        short = SHORT_OF_STEP * step if step > 0.0 else SHORT * (times[-1] - times[0])
        for before, pulse, after in _pulses(times, short):
            found.append(pulse)
            found += [_tail(function, pulse[[0, 1]], before, step, TAIL * size)]
            found += [_tail(function, pulse[[-1, -2]], after, step, TAIL * size)]
    return np.concatenate(found)


def _first_count(borders: np.ndarray) -> int:
    """Return the number of cells at first between two ``borders``."""
    return -(-FIRST_CELLS // (borders.size - 1))


def _cells(function: Function, borders: np.ndarray, opaque: bool) -> Cells:
    """Return cells, in their order, that resolve a ``function``, by bounds unless it is
    ``opaque``.
    """
    share = np.arange(_first_count(borders)) / _first_count(borders)
    low = (borders[:-1, None] + np.diff(borders)[:, None] * share).ravel()
    cells = _examined(function, low, np.append(low[1:], borders[-1]), opaque)
    for _ in range(ROUNDS):
        halved = _unresolved(cells, SHORTEST * borders[-1])
        if not halved.size:
            break
        low, high = cells.low[halved], cells.high[halved]
        middle = 0.5 * (low + high)
        ends = np.concatenate([low, middle]), np.concatenate([middle, high])
        new, rest = (
            _examined(function, *ends, opaque),
            [np.delete(part, halved, 0) for part in cells],
        )
        cells = Cells(*(np.concatenate(pair) for pair in zip(rest, new, strict=True)))
    order = np.argsort(cells.low)
    return Cells(*(part[order] for part in cells))


def _unresolved(cells: Cells, shortest: float) -> np.ndarray:
    """Return the numbers of the cells to be halved, the worst if they are too many."""
    size, hidden = _range(cells.value), cells.hidden
    # The range of a function whose pulses are not found yet may be as large as what is hidden.
    largest = max(size, np.max(hidden[np.isfinite(hidden)], initial=0.0))
    excess = np.fmax(hidden / (HIDDEN * largest), cells.bent / (BENT * size))
    halved = np.flatnonzero((excess > 1.0) & (cells.high - cells.low > shortest))
    more = max(0, MOST_CELLS - cells.low.size)
    return halved if halved.size <= more else halved[np.argsort(-excess[halved])[:more]]


def _times(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the times (n, 7) of samples in cells, in their order."""
    shares = np.sort(np.concatenate([INWARDS + (1.0 - 2.0 * INWARDS) * MET, BETWEEN]))
    return low[:, None] + (high - low)[:, None] * shares


def _examined(function: Function, low: np.ndarray, high: np.ndarray, opaque: bool) -> Cells:
    """Return the cells between ``low`` and ``high``."""
    t = _times(low, high)
    value = function((t.ravel(), t.ravel()))[0].reshape(t.shape)
    value = np.where(np.isfinite(value), value, math.nan)
    met, between = value[:, [0, 3, 6]], value[:, [1, 2, 4, 5]]
    bent = np.abs(between - met @ PARABOLA).max(axis=1)
    if opaque:
        return Cells(low, high, value, np.zeros(low.size), bent)
    least, most = function((t[:, 0], t[:, -1]))
    return Cells(low, high, value, (most - least) - np.ptp(value, axis=1), bent)


def _range(value: np.ndarray) -> float:
    """Return the range of all values that are numbers."""
    return float(np.fmax.reduce(value, axis=None) - np.fmin.reduce(value, axis=None))


def _times_of_change(t: np.ndarray, value: np.ndarray, change: float) -> np.ndarray:
    """Return the times at which a value, that is ``value`` at ``t``, has changed by another
    ``change``.
    """
    changed = np.append(0.0, np.cumsum(np.nan_to_num(np.abs(np.diff(value)))))
    return np.interp(change * np.arange(0.5, changed[-1] / change), changed, t)


def _pulses(times: np.ndarray, short: float) -> Iterator[tuple[float, np.ndarray, float]]:
    """Yield the times of pulses that have distances below ``short``, each between the times before
    and after it. The first and the last of the ``times`` are ends.
    """
    distance = np.maximum(np.diff(times), SHORTEST * times[-1])
    padded = np.pad(distance, NEIGHBOURS, constant_values=math.inf)
    near = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1).min(axis=1)
    quiet = distance > QUIET * near
    ends = np.unique([1, *(np.flatnonzero(quiet) + 1), times.size - 1])
    groups = [(i, j) for i, j in pairwise(ends.tolist()) if 1 <= i < j - 1]
    before = [0, *(j - 1 for _, j in groups)]
    after = [*(i for i, _ in groups[1:]), times.size - 1]
    for (i, j), k, n in zip(groups, before, after, strict=False):
        taken = np.append(times[i : j - 1 : EVERY], times[j - 1])
        if distance[i : j - 1].min() >= short or not (quiet[i - 1] or quiet[j - 1]):
            continue
        if taken.size > MOST:
            if not quiet[i - 1]:  # An oscillation from the start is met by the first steps.
                continue
            taken = np.append(taken[: MOST - 1], taken[-1])
        yield float(times[k]), taken, float(times[n])


def _tail(
    function: Function, pulse: np.ndarray, border: float, step: float, least: float
) -> np.ndarray:
    """Return times from the outermost time of a ``pulse`` (2,) half the way to the ``border``, at
    distances that double, to where the function no longer changes by more than the ``least``, or
    where they reach a ``step`` that is given.
    """
    away = pulse[0] - pulse[1]
    most = 0.5 * (border - pulse[0]) / away if away else 0.0
    if step > 0.0:
        most = min(most, 2.0 * step / abs(away))
    count = int(math.log2(most + 1.0)) if most > 0.0 else 0
    t = pulse[0] + away * (2.0 ** np.arange(count + 1) - 1.0)
    change = np.abs(np.diff(function((t, t))[0]))
    return t[1 : 1 + np.max(np.flatnonzero(change > least) + 1, initial=0)]
