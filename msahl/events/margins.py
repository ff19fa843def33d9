"""Margins: scalars of the motion, and the levels that they must not pass unseen.

An event is that a scalar y of the motion reaches a level:

    EXPRESSION   y is an expression of the motion, a place on the system's tape
    COORDINATE   y is the coordinate of a joint                                 [m or rad]
    RATE         y is its rate                                              [m/s or rad/s]

Levels are the breaks of a law of y, counted from an origin, or else ``-level`` and ``level``, which
may be one. An event counts in one ``direction`` (1: y rises, -1: y falls) or in both (0). What
follows is its ``action``:

    END     the run ends there
    SPLIT   the step ends there, and the next one begins: a law is not smooth there

A margin that is at a level, to within ``near`` times the size of its piece or level, is free to
leave to either side: so a step can begin at an event. With ``near`` 0 it never is.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import PIECES, Laws, piece_of
from msahl.elements.constraints import scalar
from msahl.jit.kernel import apart, kernel
from msahl.ports import forces
from msahl.system.arrays import System, SystemWorkspace

EXPRESSION, COORDINATE, RATE = range(3)
END, SPLIT = range(2)
NEAR = 1e-9
"""Fraction of a table's piece (beyond its ends: of a metre or radian), or of a friction law's
width, within which a coordinate or a rate counts as being at the level."""
AT_ENDS = 1e-6
"""Fraction of the change over a step that a margin may pass a level by, if it can be at a level:
steps do not end for what happens in so small a part at their ends."""


class Margin(NamedTuple):
    """One margin; see the top of this module."""

    kind: int
    item: int  # place on the tape, or coordinate
    action: int
    direction: int = 0
    law: int = -1
    origin: float = 0.0
    level: float = 0.0
    near: float = 0.0


class Margins(NamedTuple):
    """The margins of a system."""

    kind: np.ndarray  # (m,)
    item: np.ndarray  # (m,)
    action: np.ndarray  # (m,)
    direction: np.ndarray  # (m,)
    law: np.ndarray  # (m,) -1 where the levels are given
    origin: np.ndarray  # (m,)
    level: np.ndarray  # (m,)
    near: np.ndarray  # (m,)
    has_expressions: bool
    coordinate: np.ndarray  # (q,) all coordinates, if margins depend on them
    rate: np.ndarray  # (q,) their rates


def build_margins(system: System, splits: bool) -> Margins | None:
    """Return the margins that the elements of a ``system`` have, those of breakpoints only if they
    ``split`` steps; None if there are none.
    """
    found = [*_of_stops(system), *(_of_breakpoints(system) if splits else ())]
    if not found:
        return None
    kinds, count = {margin.kind for margin in found}, 0
    if system.scalar is not None and kinds != {EXPRESSION}:
        count = system.scalar.coordinates.kind.size
    return Margins(
        kind=np.array([margin.kind for margin in found]),
        item=np.array([margin.item for margin in found]),
        action=np.array([margin.action for margin in found]),
        direction=np.array([margin.direction for margin in found]),
        law=np.array([margin.law for margin in found]),
        origin=np.array([margin.origin for margin in found]),
        level=np.array([margin.level for margin in found]),
        near=np.array([margin.near for margin in found]),
        has_expressions=EXPRESSION in kinds,
        coordinate=np.zeros(count),
        rate=np.zeros(count),
    )


def _of_stops(system: System) -> Iterator[Margin]:
    """Yield the margins of the conditions that end the run."""
    for place in forces.places_of_stops(system.forces):
        yield Margin(EXPRESSION, place, END, direction=1)


def _of_breakpoints(system: System) -> Iterator[Margin]:
    """Yield the margins of tables of springs and cams, and of friction."""
    tables = [*forces.laws_of_coordinates(system.forces)]
    if system.scalar is not None:
        rows = system.scalar.equations
        tables += zip(rows.function, rows.coordinate[:, 1], np.zeros(len(rows.law)), strict=True)
    for law, coordinate, origin in tables:
        if law >= 0 and system.laws.kind[law] == PIECES:
            yield Margin(COORDINATE, coordinate, SPLIT, law=law, origin=origin, near=NEAR)
    for coordinate, width in zip(*forces.rate_breakpoints(system.forces), strict=True):
        yield Margin(RATE, coordinate, SPLIT, level=width, near=NEAR)


def laws_of_time(system: System) -> np.ndarray:
    """Return the (l,) piecewise laws of time: their breaks are known beforehand."""
    timed = set(forces.laws_of_time(system.forces))
    if system.scalar is not None:
        timed |= set(system.scalar.equations.law.tolist())
    pieces = [law for law in sorted(timed) if law >= 0 and system.laws.kind[law] == PIECES]
    return np.array(pieces, dtype=np.int64)


@kernel
def next_break(timed: np.ndarray, laws: Laws, t: float, near: float) -> float:
    """Time of the first break of the ``timed`` laws after ``t``, by more than ``near``."""
    first = math.inf
    for k in range(timed.size):
        _, end = piece_of(laws, timed[k], t + near)
        first = min(first, end)
    return first


@apart
def set_values(margins: Margins, system: System, start: SystemWorkspace, value: np.ndarray) -> None:
    """Set ``value`` (m,) to the margins of the prepared state."""
    if margins.has_expressions:
        forces.set_expressions(system.forces.signals, start.forces, system.scalar)
    if margins.coordinate.size > 0:
        scalar.values(system.scalar, start.scalar, start.frames, margins.coordinate, margins.rate)
    for k in range(value.size):
        kind, item = margins.kind[k], margins.item[k]
        if kind == EXPRESSION:
            value[k] = forces.expression_at(system.forces.signals, start.forces, item)
        elif kind == COORDINATE:
            value[k] = margins.coordinate[item]
        else:
            value[k] = margins.rate[item]


@kernel
def levels_around(margins: Margins, laws: Laws, k: int, y: float) -> tuple[float, float, float]:
    """Return the levels of margin ``k`` below and above ``y``, and the size of what lies between
    them, of which ``near`` is a fraction.
    """
    law, level, origin = margins.law[k], margins.level[k], margins.origin[k]
    size = level
    if law >= 0:
        low, high = piece_of(laws, law, y - origin)
        size = high - low if high - low < math.inf else 1.0
        low, high = low + origin, high + origin
    elif y < -level:
        low, high = -math.inf, -level
    elif y > level:
        low, high = level, math.inf
    else:
        low, high = -level, level
    if margins.direction[k] > 0:
        low = -math.inf
    elif margins.direction[k] < 0:
        high = math.inf
    return low, high, size


@kernel
def free_range(
    margins: Margins, laws: Laws, k: int, y: float, change: float
) -> tuple[float, float, float]:
    """Return between which levels margin ``k`` may move from ``y`` without an event, and by how
    much it may pass them; infinite ones if it is at a level. ``change`` is what it moves by in the
    step.
    """
    low, high, size = levels_around(margins, laws, k, y)
    slack = 0.0
    if margins.near[k] > 0.0:
        slack = margins.near[k] * size + AT_ENDS * change
    if y - low < slack or high - y < slack:
        return -math.inf, math.inf, slack
    return low, high, slack
