"""Events of expressions: where those that the motion depends on change their formulas."""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Law, Laws, build_laws, joined
from msahl.algebra.surfaces import axes_of
from msahl.elements.signals.group import REACTION, TIME, Signals
from msahl.expressions.intervals import bounds
from msahl.expressions.known_times import (
    KnownTimes,
    dependent,
    known_times,
    operands,
    users,
    with_times,
)
from msahl.expressions.pulses import BETWEEN, INWARDS, MET, PARABOLA, pulse_times, terms
from msahl.expressions.tape import CURVE, HELD, SURFACE, Tape

KEPT = 8
"""Searches for known times whose results are kept: the runs of one deck have the same."""
NO_TIMES = KnownTimes(np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((1, 0)))
MOST_EXAMINED = 200_000
"""Steps, and parts of them, that are looked at for fast inputs."""
UNRESOLVED, CONSTANT = 0.3, 1e-9
"""A step does not resolve an input that deviates from the parabola by this fraction of its change
within the step, and of its largest value."""
PARTS, UNEVEN, GOLDEN = 64, 0.3, 0.6180339887498949
"""Parts of a step with a fast input: uneven, so that none meets the same phase in all of them."""


class Place(NamedTuple):
    """A value on the tape that may reach a level within a step."""

    place: int
    switch: int = -1
    law: int = -1  # table of the tape, or axis of one, whose breaks are the levels: see all_laws


def operations_of_motion(signals: Signals) -> list[int]:
    """Return the operations of the tape that the motion depends on."""
    return users(signals.tape, np.concatenate([signals.rate, signals.result]))


def places_in_motion(signals: Signals) -> Iterator[Place]:
    """Yield the places of switches and tables that depend on the motion within a step; joints'
    reactions are those of the step before.
    """
    tape = signals.tape
    moving, held = (dependent(tape, of) for of in _inputs(signals)[1:])
    for i in operations_of_motion(signals):
        op, number, found = tape.op[i], int(tape.c[i]), list[Place]()
        if op == HELD:
            found = [Place(int(tape.switches.margin[number]), switch=number)]
        elif op == CURVE:
            found = [Place(int(tape.a[i]), law=number)]
        elif op == SURFACE:
            axes = tape.laws.kind.size + 2 * number
            found = [Place(int(tape.a[i]), law=axes), Place(int(tape.b[i]), law=axes + 1)]
        yield from (one for one in found if moving[one.place] and not held[one.place])


def used_switches(signals: Signals) -> list[tuple[int, bool]]:
    """Return the switches that the motion depends on, each with whether it depends on joints'
    reactions, so that it changes from one step to the next and not within one.
    """
    tape = signals.tape
    late = dependent(tape, _inputs(signals)[2])
    used = [int(tape.c[i]) for i in operations_of_motion(signals) if tape.op[i] == HELD]
    return [(k, bool(late[tape.switches.margin[k]])) for k in used]


def jumps_by_reactions(signals: Signals | None) -> list[int]:
    """Return the switches that depend on joints' reactions and at which an expression may jump."""
    if signals is None:
        return []
    return [k for k, late in used_switches(signals) if late and signals.tape.switches.jumps[k]]


def known_to(signals: Signals | None, end: float, step: float) -> KnownTimes | None:
    """Return what expressions of the time alone change until ``end`` [s], in steps of a size
    ``step`` [s] if this is given, else 0; None without these.
    """
    if signals is None:
        return None
    tape, (times, *others) = signals.tape, _inputs(signals)
    if not times.size:
        return None
    first, moving = tape.constant.size + tape.inputs, dependent(tape, np.concatenate(others))
    operations = operations_of_motion(signals)
    found = [i for i in operations if not moving[first + i]]
    # A table of the time and of the motion changes at known times by one of its axes.
    maps = [i for i in operations if tape.op[i] == SURFACE and moving[first + i]]
    given = tuple(found), tuple(maps), tape.constant.size + int(times[0]), end
    known = _with_pulses(_Key(tape), given, tuple(_timed_places(signals)), step)
    return known if known.time.size or known.switch.size else None


def depends_on_reactions(signals: Signals) -> np.ndarray:
    """Return whether each value on the tape depends on joints' reactions."""
    return dependent(signals.tape, _inputs(signals)[2])


def _inputs(signals: Signals) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the inputs of the tape: time, those that change with the motion, and reactions."""
    number, kind = np.arange(signals.tape.inputs), signals.kind
    kind = np.append(kind, np.full(number.size - kind.size, -1))  # of states
    moving = (kind != TIME) & (kind != REACTION)
    return number[kind == TIME], number[moving], number[kind == REACTION]


class _Key:
    """A tape that is equal to others with the same numbers."""

    def __init__(self, tape: Tape) -> None:
        self.tape = tape
        parts = tape.constant, tape.op, tape.a, tape.b, tape.c, tape.laws.numbers
        self._bytes = b"".join(part.tobytes() for part in (*parts, tape.surfaces.numbers))

    def __hash__(self) -> int:
        return hash(self._bytes)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self._bytes == other._bytes


@lru_cache(maxsize=KEPT)
def _known(
    key: _Key, operations: tuple[int, ...], maps: tuple[int, ...], time: int, end: float
) -> KnownTimes:
    return known_times(key.tape, list(operations), list(maps), time, end)


@lru_cache(maxsize=KEPT)
def _with_pulses(
    key: _Key,
    given: tuple[tuple[int, ...], tuple[int, ...], int, float],
    places: tuple[int, ...],
    step: float,
) -> KnownTimes:
    """Return the times known by what is ``given``, and those of pulses of the values at
    ``places``, which depend on the time alone.
    """
    tape, known, (_, _, time, end) = key.tape, _known(key, *given), given
    borders = np.concatenate([[0.0], known.time, [end]])
    timed = dependent(tape, np.array([time - tape.constant.size]))
    found = [
        pulse_times(tape, users(tape, np.array([term])), term, time, borders, step)
        for term in terms(tape, places, timed)
    ]
    return with_times(known, np.concatenate([np.zeros(0), *found]), end)


def all_laws(signals: Signals | None, laws: Laws) -> Laws:
    """Return the ``laws`` of a system, after them the tables of its expressions, and after these
    laws with the breaks of either axis of those of two variables.
    """
    if signals is None:
        return laws
    axes = [Law("linear", (*axis, *axis)) for axis in axes_of(signals.tape.surfaces)]
    return joined(joined(laws, signals.tape.laws), build_laws(axes))


def with_fast_inputs(
    signals: Signals | None, known: KnownTimes | None, step: float, end: float
) -> KnownTimes | None:
    """Return ``known`` and times that divide those steps, of a size ``step`` [s] until ``end``, in
    which expressions of the time change too fast for them: a companion then sees other phases of an
    oscillation than its run does.
    """
    places = [] if signals is None else _timed_places(signals)
    if signals is None or not places:
        return known
    known = known or NO_TIMES
    grid = step * np.arange(1, min(math.ceil(end / step), MOST_EXAMINED))
    borders = np.unique(np.concatenate([[0.0], known.time, grid, [min(end, grid.size * step)]]))
    begin, size = borders[:-1], np.diff(borders)
    fast = size * 0.0 > 1.0
    for met, between in _samples(signals, places, begin, size):
        deviation = np.abs(between - met @ PARABOLA).max(axis=1)
        change = np.ptp(np.hstack([met, between]), axis=1)
        fast |= deviation > np.maximum(UNRESOLVED * change, CONSTANT * np.abs(between).max())
    if not fast.any():
        return known if known.time.size or known.switch.size else None
    parts = max(2, min(PARTS, MOST_EXAMINED // int(np.count_nonzero(fast))))
    number = np.arange(1, parts)
    share = (number + UNEVEN * (number * GOLDEN % 1.0)) / parts
    more = (begin[fast, None] + size[fast, None] * share).ravel()
    times = np.union1d(known.time, more)
    rows = np.searchsorted(known.time, np.append(times[0] / 2.0, times), side="right")
    return KnownTimes(times, known.switch, known.side[rows])


def _timed_places(signals: Signals) -> list[int]:
    """Return the places whose values depend on the time alone, and which the motion depends on
    directly.
    """
    tape, (times, *others) = signals.tape, _inputs(signals)
    timed = dependent(tape, times) & ~dependent(tape, np.concatenate(others))
    first = tape.constant.size + tape.inputs
    used = {
        place
        for i in operations_of_motion(signals)
        if not timed[first + i]
        for place in operands(tape, i)
    }
    used |= {int(place) for place in (*signals.rate, *signals.result)}
    return sorted(place for place in used if timed[place] and place >= first)


def _samples(
    signals: Signals, places: list[int], begin: np.ndarray, size: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the values (n, 3) and (n, 4) of each of the ``places`` at ``MET`` and ``BETWEEN``, in
    steps from ``begin`` (n,).
    """
    tape, time = signals.tape, signals.tape.constant.size + int(_inputs(signals)[0][0])
    shares = np.concatenate([INWARDS + (1.0 - 2.0 * INWARDS) * MET, BETWEEN])
    t = (begin[:, None] + size[:, None] * shares).ravel()
    values = bounds(tape, users(tape, np.array(places)), time, (t, t))
    for place in places:
        found = values[place][0].reshape(-1, shares.size)
        yield found[:, : MET.size], found[:, MET.size :]
