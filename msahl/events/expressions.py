"""Events of expressions: where those that the motion depends on change their formulas."""

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws, joined
from msahl.elements.signals.group import REACTION, TIME, Signals
from msahl.expressions.known_times import KnownTimes, dependent, known_times, users
from msahl.expressions.tape import CURVE, HELD, SURFACE, Tape

KEPT = 8
"""Searches for known times whose results are kept: the runs of one deck have the same."""


class Place(NamedTuple):
    """A value on the tape that may reach a level within a step."""

    place: int
    switch: int = -1
    law: int = -1  # table of the tape whose breaks are the levels


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
        op, number = tape.op[i], int(tape.c[i])
        if op == HELD:
            place = Place(int(tape.switches.margin[number]), switch=number)
        elif op == CURVE:
            place = Place(int(tape.a[i]), law=number)
        else:
            continue
        if moving[place.place] and not held[place.place]:
            yield place


def known_to(signals: Signals | None, end: float) -> KnownTimes | None:
    """Return what expressions of the time alone change until ``end`` [s]; None without these."""
    if signals is None:
        return None
    tape, (times, *others) = signals.tape, _inputs(signals)
    if not times.size:
        return None
    first, moving = tape.constant.size + tape.inputs, dependent(tape, np.concatenate(others))
    found = [i for i in operations_of_motion(signals) if not moving[first + i]]
    if not any(tape.op[i] in (HELD, CURVE, SURFACE) for i in found):
        return None
    return _known(_Key(tape), tuple(found), tape.constant.size + int(times[0]), end)


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
def _known(key: _Key, operations: tuple[int, ...], time: int, end: float) -> KnownTimes:
    return known_times(key.tape, list(operations), time, end)


def all_laws(signals: Signals | None, laws: Laws) -> Laws:
    """Return the ``laws`` of a system, and after them the tables of its expressions."""
    return laws if signals is None else joined(laws, signals.tape.laws)
