"""Which inputs and states the rates of auxiliary states, and the results, depend on.

Found once for a system. Of hundreds of states each depends on a few: derivatives are computed along
the operations that a value needs, and the equations of a step are solved by a sparse factorisation.
"""

from typing import NamedTuple

import numpy as np

from msahl.expressions.tape import CURVE, FIRST_BINARY, HELD, WHERE, Tape
from msahl.linalg.row_lu import Plan, plan
from msahl.linalg.symbolic import Lists, transposed


class Coupling(NamedTuple):
    """Of the n rates and the results, in this order."""

    operations: Lists  # (n + r) of the tape that each needs for its derivatives
    inputs: Lists  # (n) inputs y, then states, that each rate depends on; sorted
    users: Lists  # (y + n) rates that depend on each of these
    entry: np.ndarray  # where these have it in ``inputs``
    plan: Plan  # of the states in 1 - h A f_s


def coupling(tape: Tape, rates: np.ndarray, results: np.ndarray) -> Coupling:
    """Return what the values at these places on the tape depend on; of its inputs the last are the
    states.
    """
    n, y = rates.size, tape.inputs - rates.size
    operands = _operands(tape)
    needed = _lists([_needed(operands, place) for place in (*rates.tolist(), *results.tolist())])
    begin = tape.constant.size
    first = begin + tape.inputs
    inputs = _part(needed, n, begin, first)
    # The transpose has as many lists as there are lists: those after the rates are empty.
    square = Lists(np.append(inputs.first, np.full(y, inputs.items.size)), inputs.items)
    users, entry = transposed(square)
    return Coupling(
        operations=_part(needed, n + results.size, first, first + tape.op.size),
        inputs=inputs,
        users=users,
        entry=entry,
        plan=plan(_part(needed, n, begin + y, first)),
    )


def _operands(tape: Tape) -> list[tuple[int, ...]]:
    """Return, for each value of the tape, those other than constants that its derivative comes
    from: of a switch none, of a choice the values to choose from.
    """
    constants = tape.constant.size
    found: list[tuple[int, ...]] = [()] * (constants + tape.inputs)
    columns = (column.tolist() for column in (tape.op, tape.a, tape.b, tape.c))
    for op, a, b, c in zip(*columns, strict=True):
        places: tuple[int, ...] = (b, c) if op == WHERE else (a, b)
        if op == HELD:
            places = ()
        elif op < FIRST_BINARY or op == CURVE:
            places = (a,)
        found.append(tuple(k for k in places if k >= constants))
    return found


def _needed(operands: list[tuple[int, ...]], place: int) -> list[int]:
    """Return the inputs and operations, by their places, that the value at ``place`` needs."""
    found, waiting = {place}, [place]
    while waiting:
        new = [k for k in operands[waiting.pop()] if k not in found]
        found.update(new)
        waiting += new
    return sorted(found)


def _lists(lists: list[list[int]]) -> Lists:
    items = [np.array(one, dtype=np.int64) for one in lists]
    first = np.cumsum([0, *map(len, lists)]).astype(np.int64)
    return Lists(first, np.concatenate([np.zeros(0, dtype=np.int64), *items]))


def _part(lists: Lists, count: int, begin: int, end: int) -> Lists:
    """Return, of the first ``count`` lists, the numbers from ``begin`` to ``end``, counted from
    ``begin``.
    """
    wanted = (lists.items >= begin) & (lists.items < end)
    before = np.append(0, np.cumsum(wanted)).astype(np.int64)
    last = lists.first[count]
    first = before[lists.first[: count + 1]]
    return Lists(first, lists.items[:last][wanted[:last]] - begin)
