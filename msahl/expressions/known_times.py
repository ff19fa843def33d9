"""Times at which expressions of the time alone change their formulas.

Where the margin of a switch (``tape.Switches``), or the argument of a table, depends on no other
input than the time, the times at which it is at one of its levels are known before the motion is.
They are found by bounds over intervals (``intervals``), which are halved as long as they may hold a
level, down to round-off: no spike is too short to be seen. Operations are taken in the order of the
tape, each between the times that those before it have, so every interval has one formula.
"""

import math
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.surfaces import axes_of
from msahl.expressions.intervals import Bounds, bounds, piece_of
from msahl.expressions.tape import CURVE, FIRST_BINARY, HELD, SURFACE, WHERE, Tape

FIRST_PARTS, BATCH = 256, 4096
"""Intervals at first, at least; and how many of these are halved together."""
BISECTIONS = 50
"""Until an interval is as short as the round-off of the time."""
SAME = 1e-13
"""Difference of two times, as a fraction of the run, that is round-off."""
MOST_INTERVALS = 50_000
"""Of one part, that may hold a level. Where there are more, a function is at its level all the
time, but for round-off: only changes of its side from one end to the other are located then."""


class KnownTimes(NamedTuple):
    """What changes at known times."""

    time: np.ndarray  # (k,) increasing, within the run [s]
    switch: np.ndarray  # (n,) the switches that depend on the time alone
    side: np.ndarray  # (k + 1, n) their values before the first of the times, and after each


def with_times(known: KnownTimes, more: np.ndarray, end: float) -> KnownTimes:
    """Return what changes at ``known`` times, and ``more`` times until ``end`` [s] at which no
    switch does.
    """
    more, near = _merged(more, end), 4.0 * SAME * end
    below, above = (np.searchsorted(known.time, more + by) for by in (-near, near))
    times = np.union1d(known.time, more[below == above])
    rows = np.searchsorted(known.time, np.append(-1.0, times), side="right")
    return KnownTimes(times, known.switch, known.side[rows])


def operands(tape: Tape, i: int) -> tuple[int, ...]:
    """Return the places of the values that operation ``i`` depends on."""
    a, b, op = int(tape.a[i]), int(tape.b[i]), tape.op[i]
    if op == HELD:
        return a, int(tape.switches.margin[tape.c[i]])
    if op < FIRST_BINARY or op == CURVE:
        return (a,)
    return (a, b, int(tape.c[i])) if op == WHERE else (a, b)


def users(tape: Tape, places: np.ndarray) -> list[int]:
    """Return the operations that the values at the ``places`` depend on, in order."""
    first = tape.constant.size + tape.inputs
    needed = set(places.tolist())
    for i in range(tape.op.size - 1, -1, -1):
        if first + i in needed:
            needed.update(operands(tape, i))
    return [i for i in range(tape.op.size) if first + i in needed]


def dependent(tape: Tape, inputs: np.ndarray) -> np.ndarray:
    """Return whether each value of the tape depends on one of the ``inputs`` (numbers)."""
    first = tape.constant.size + tape.inputs
    found = np.zeros(first + tape.op.size, dtype=bool)
    found[tape.constant.size + inputs] = True
    for i in range(tape.op.size):
        found[first + i] = any(found[place] for place in operands(tape, i))
    return found


def known_times(
    tape: Tape, operations: list[int], maps: list[int], time: int, end: float
) -> KnownTimes:
    """Return what changes between 0 and ``end`` [s] by ``operations`` that depend on the input at
    the place ``time`` alone, and by tables of two variables, ``maps``, of which one does so.
    """
    first = tape.constant.size + tape.inputs
    timed = {time, *(first + i for i in operations)}
    found = np.zeros(0)
    switches = [int(tape.c[i]) for i in operations if tape.op[i] == HELD]
    for i in sorted({*operations, *maps}):
        for place, cell in _levels(tape, i):
            if place not in timed:
                continue
            needed = [k for k in operations if first + k <= place]

            def cell_of(of: Bounds) -> Bounds:
                values = bounds(tape, needed, time, of)[place]  # noqa: B023 - called here only
                return cell(values[0]), cell(values[1])  # noqa: B023

            new = [_sharp(cell_of, times, end) for times in _changes(cell_of, found, end)]
            found = _merged(np.concatenate([found, *new]), end)
    middles = 0.5 * np.diff([0.0, *found, end]) + np.array([0.0, *found])
    values = bounds(tape, operations, time, (middles, middles))
    side = [values[int(tape.switches.free[k])][0] for k in switches]
    return KnownTimes(
        found, np.array(switches, dtype=np.int64), np.array(side).reshape(-1, middles.size).T.copy()
    )


def _levels(tape: Tape, i: int) -> list[tuple[int, Callable[..., Any]]]:
    """Return the places whose levels matter to operation ``i``, each with a function that says
    between which levels values are.
    """
    op, number = tape.op[i], int(tape.c[i])
    if op == HELD:
        integers = tape.switches.integers[number]
        return [(int(tape.switches.margin[number]), np.floor if integers else np.sign)]
    if op == CURVE:
        return [(int(tape.a[i]), lambda x: piece_of(tape, number, x).number)]
    if op == SURFACE:
        axes = islice(axes_of(tape.surfaces), 2 * number, 2 * number + 2)
        return [
            (int(place), lambda values, axis=axis: np.searchsorted(axis, values, side="right"))
            for place, axis in zip((tape.a[i], tape.b[i]), axes, strict=True)
        ]
    return []


def _changes(
    cell_of: Callable[[Bounds], Bounds], found: np.ndarray, end: float
) -> Iterator[np.ndarray]:
    """Yield the times until ``end`` at which a function of the time passes or touches a level, by
    the cells between the levels that the bounds of its values are in; it has one formula between
    the times that were ``found``.
    """
    borders = np.concatenate([[0.0], found, [end]])
    count = -(-FIRST_PARTS // (borders.size - 1))
    share = np.arange(count) / count
    low = (borders[:-1, None] + np.diff(borders)[:, None] * share).ravel()
    high = np.append(low[1:], end)
    for batch in range(0, low.size, BATCH):
        part = slice(batch, batch + BATCH)
        yield _halved(cell_of, low[part], high[part], SAME * end)


def _halved(
    cell_of: Callable[[Bounds], Bounds], low: np.ndarray, high: np.ndarray, shortest: float
) -> np.ndarray:
    """Return the times in intervals at which the cell changes, to within the ``shortest`` one."""
    for _ in range(BISECTIONS):
        least, most = cell_of((low, high))
        low, high = low[least != most], high[least != most]
        if not low.size or low.size > MOST_INTERVALS or (high - low).max() <= shortest:
            break
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    if low.size > MOST_INTERVALS:
        low, high = _located(cell_of, low, high)
    return 0.5 * (low + high)


def _located(cell_of: Callable[[Bounds], Bounds], low: np.ndarray, high: np.ndarray) -> Bounds:
    """Return the intervals in which the cell changes from one end to the other, made short."""
    before, after = cell_of((low, low))[0], cell_of((high, high))[0]
    low, high, before = (part[before != after] for part in (low, high, before))
    return _bisected(cell_of, low, high, before)


def _bisected(
    cell_of: Callable[[Bounds], Bounds], low: np.ndarray, high: np.ndarray, before: np.ndarray
) -> Bounds:
    """Return the intervals halved, at whose lower ends alone the cell is the one ``before``."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        same = cell_of((middle, middle))[0] == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low, high


def _sharp(cell_of: Callable[[Bounds], Bounds], times: np.ndarray, end: float) -> np.ndarray:
    """Return the ``times`` to the last bit, where the cell differs on both sides: the first time
    that is beyond the level. A step that ends later has a part of what follows.
    """
    low, high = times - SAME * end, times + SAME * end
    before = cell_of((low, low))[0]
    crosses = before != cell_of((high, high))[0]
    return np.where(crosses, _bisected(cell_of, low, high, before)[1], times)


def _merged(times: np.ndarray, end: float) -> np.ndarray:
    """Return the ``times`` in order, each once, without those at the ends of the run."""
    near = 4.0 * SAME * end
    times = np.sort(times[(times > near) & (times < end - near)])
    return times[np.diff(times, prepend=-math.inf) > near]
