"""Margins: scalars of the motion, and the levels that they must not pass unseen.

An event is that a scalar y of the motion reaches a level:

    EXPRESSION   y is an expression of the motion, a place on the system's tape
    COORDINATE   y is the coordinate of a joint                                 [m or rad]
    RATE         y is its rate                                              [m/s or rad/s]
    SLIP         y is the amount of the slip of a compliant contact with friction    [m/s]
    FORCE        y is a multiplier, by its place                                  [N or N m]
    FRICTION     y is the slip or the grip of a contact with friction             [m/s or N]
    REACTING     y is an expression of joints' reactions at the same time, a place on the tape
    KINK         y is the kink of a distance (``curves``, ``segments``, boxes)    [m or rad]
    CROSSING     y is the distance of two edges of boxes, and what their nearest points are
                 beyond their ends: corners stand for edges that do not cross            [m]

Levels are the breaks of a law of y, counted from an origin, or else ``-level`` and ``level``, which
may be one; of a switch of an expression (``expressions.tape``) zero or the integers. An event
counts in one ``direction`` (1: y rises, -1: y falls) or in both (0). What follows is its
``action``:

    END     the run ends there
    SPLIT   the step ends there, and the next one begins: a law is not smooth there
    CONTACT likewise, and before the next one begins contacts open or close, stick or slide
            (``contact``), or an event of the deck releases and engages constraints (``switching``)

A margin that is at a level, to within ``near`` times the size of its piece or level, is free to
leave to either side: so a step can begin at an event. With ``near`` 0 it never is. The margin of a
switch that is held has its range on the side where it is held. That of a contact has it where its
``direction`` comes from, however near it is, and may be beyond by ``near``, which is round-off. So
has that of the condition of an event, which waits for the condition to become true, or false again.

What changes at times that are known before the motion is (``expressions.known_times``) has no
margin: steps end there, and each switch holds its value between them.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.functions import PIECES, Law, Laws, build_laws, joined, piece_of
from msahl.elements.constraints import scalar
from msahl.elements.constraints.edges import past_ends
from msahl.elements.constraints.equations import is_active
from msahl.elements.constraints.kinks import has_kinks
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace
from msahl.events.expressions import (
    NO_TIMES,
    all_laws,
    depends_on_reactions,
    known_to,
    places_in_motion,
    with_fast_inputs,
)
from msahl.expressions.known_times import KnownTimes
from msahl.expressions.tape import FREE, SIGN
from msahl.jit.kernel import apart, kernel, optional
from msahl.ports import forces, rubbing
from msahl.system.arrays import System, SystemWorkspace
from msahl.system.contacts import Contacts
from msahl.system.switches import FALLS, NEVER, Conditions

EXPRESSION, COORDINATE, RATE, SLIP, FORCE, REACTING, FRICTION, KINK, CROSSING = range(9)
END, SPLIT, CONTACT = range(3)
ENDS_AT_KINKS = 3
"""Order of schemes from which steps end where a force has a kink; order 2 is kept in any case."""
FAST = 8.0
"""Widths of a friction law, tanh(rate/width), within which it changes: 4e-7 of it is beyond. A
step up to one width would miss, as its halves would, how the rate falls to there."""
NEAR = 1e-9
"""Fraction of a table's piece (beyond its ends: of a metre or radian), or of a friction law's
width, within which a coordinate or a rate counts as being at the level."""
AT_ENDS = 1e-6
"""Fraction of the change over a step that a margin may pass a level by, if it can be at a level:
steps do not end for what happens in so small a part at their ends."""


AT_ZERO = Law("linear", (0.0, 0.0))
"""A table of one entry, at zero: a law with one break."""


class Span(NamedTuple):
    """The time of a run: its ``end`` [s], and the size of its steps where it is given, else 0; the
    companion of one with given steps resolves inputs that change fast in these.
    """

    end: float
    step: float = 0.0
    resolves_inputs: bool = False


class Changing(NamedTuple):
    """What changes constraints during a run."""

    contacts: Contacts | None = None
    conditions: Conditions | None = None  # of events of the deck


UNCHANGING = Changing()
"""Constraints are the same throughout a run."""


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
    width: float = 0.0  # of a friction law [m/s or rad/s]
    switch: int = -1  # of an expression
    integers: bool = False  # whether the levels of the switch are all integers
    least: float = 0.0  # what the switch is below its level; above it is 1
    jumps: bool = False  # whether an expression may jump there


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
    width: np.ndarray  # (m,) 0 for other laws
    switch: np.ndarray  # (m,) or -1
    integers: np.ndarray  # (m,)
    least: np.ndarray  # (m,)
    jumps: np.ndarray  # (m,)
    laws: Laws  # those of the system, and tables of expressions
    held: np.ndarray  # (s,) of the tape: held values of its switches
    known: KnownTimes
    has_expressions: bool
    coordinate: np.ndarray  # (q,) all coordinates, if margins depend on them
    rate: np.ndarray  # (q,) their rates


def build_margins(
    system: System,
    order: int,
    span: Span,
    contacts: Contacts | None = None,
    conditions: Conditions | None = None,
) -> Margins | None:
    """Return the margins that the elements of a ``system`` have in steps of an ``order``; None if
    there is nothing to be examined.

    Steps of order 2 keep it where a force has a kink, and do not end there. Those of ``contacts``
    are the last, and those which are open or closed now; before them are those of the
    ``conditions`` of events, for which ``await_conditions`` sets what they wait for.
    """
    signals = system.forces.signals
    found = [*_of_stops(system), *_of_expressions(system, jumps_only=order < ENDS_AT_KINKS)]
    found += _of_breakpoints(system) if order >= ENDS_AT_KINKS else ()
    laws = all_laws(signals, system.laws)
    kinks = [*_of_compliant_contacts(system, laws.kind.size)]
    if order >= ENDS_AT_KINKS:
        kinks += _of_distances(system, laws.kind.size, contacts)
    if kinks:
        found, laws = [*found, *kinks], joined(laws, build_laws([AT_ZERO]))
    if conditions is not None:
        found += _of_conditions(system, conditions)
    found += _of_contacts(system, contacts) if contacts is not None else ()
    known = known_to(signals, span.end, span.step)
    if span.resolves_inputs:
        known = with_fast_inputs(signals, known, span.step, span.end)
    if not found and known is None:
        return None
    kinds, count = {margin.kind for margin in found}, 0
    if system.scalar is not None and kinds - {EXPRESSION, REACTING}:
        count = system.scalar.coordinates.kind.size
    columns: dict[str, Any] = {
        name: np.array([getattr(margin, name) for margin in found], dtype=type(default))
        for name, default in Margin(0, 0, 0)._asdict().items()
    }
    return Margins(
        **columns,
        laws=laws,
        held=np.zeros(0) if signals is None else signals.tape.held,
        known=known or NO_TIMES,
        has_expressions=bool(kinds & {EXPRESSION, REACTING}),
        coordinate=np.zeros(count),
        rate=np.zeros(count),
    )


def _of_stops(system: System) -> Iterator[Margin]:
    """Yield the margins of the conditions that end the run."""
    for place in forces.places_of_stops(system.forces):
        yield Margin(EXPRESSION, place, END, direction=1)


def _of_expressions(system: System, jumps_only: bool) -> Iterator[Margin]:
    """Yield the margins of switches and tables in expressions of the motion."""
    signals, first = system.forces.signals, system.laws.kind.size
    if signals is None:
        return
    for place in places_in_motion(signals):
        margin = Margin(EXPRESSION, place.place, SPLIT, near=NEAR)
        if place.switch >= 0:
            tape, k = signals.tape, place.switch
            signed = tape.op[tape.switches.free[k] - tape.constant.size - tape.inputs] == SIGN
            margin = margin._replace(
                switch=k,
                integers=bool(tape.switches.integers[k]),
                least=-1.0 if signed else 0.0,
                jumps=bool(tape.switches.jumps[k]),
            )
        else:
            margin = margin._replace(law=first + place.law)
        if margin.jumps or not jumps_only:
            yield margin


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
        yield from _of_width(Margin(RATE, coordinate, SPLIT, width=width, near=NEAR))
    for k, width in enumerate(forces.slip_breakpoints(system.forces)):
        yield from _of_width(Margin(SLIP, k, SPLIT, width=width, near=NEAR))


def _of_width(margin: Margin) -> Iterator[Margin]:
    """Yield the ``margin`` of a friction law at the rates from which and up to which it changes
    fast.
    """
    for widths in (1.0, FAST):
        yield margin._replace(level=widths * margin.width)


def _of_conditions(system: System, conditions: Conditions) -> Iterator[Margin]:
    """Yield the margins of the conditions of events."""
    signals = system.forces.signals
    assert signals is not None
    reacting = depends_on_reactions(signals)
    for place in conditions.place.tolist():
        yield Margin(REACTING if reacting[place] else EXPRESSION, place, CONTACT)


def _of_contacts(system: System, contacts: Contacts) -> Iterator[Margin]:
    """Yield the margins of contacts: gaps of open ones, forces of closed ones; then those of
    friction.
    """
    assert system.scalar is not None
    rows = system.scalar.equations
    closed = is_active(rows)[contacts.row]
    for k, r in enumerate(contacts.row):
        direction = -int(contacts.sign[k])
        if closed[k]:
            place = 3 * int(rows.place[r, 0]) + int(rows.place[r, 1])
            yield Margin(FORCE, place, CONTACT, direction=direction)
        else:
            kind = CROSSING if contacts.between_edges[k] else COORDINATE
            gap = Margin(kind, int(rows.coordinate[r, 0]), CONTACT, direction=direction)
            level = float(contacts.limit[k]) if contacts.acts[k] else direction * math.inf
            yield gap._replace(level=level, near=float(contacts.round_off[k]))
    group = system.forces.sliding
    if group is None:
        return
    for k in range(group.row.size):
        if group.friction[k] != 0.0:
            yield Margin(FRICTION, k, CONTACT, direction=-1, near=float(group.still[k]))
        elif is_active(rows)[group.tangent[k]].any():
            yield Margin(FRICTION, k, CONTACT, direction=-1)


def await_conditions(margins: Margins, first: int, conditions: Conditions) -> None:
    """Let the margins from the number ``first`` on wait for what the ``conditions`` wait for."""
    own = slice(first, first + conditions.place.size)
    margins.direction[own] = np.where(conditions.awaits == FALLS, -1, 1)
    margins.level[own] = np.where(conditions.awaits == NEVER, math.inf, 0.0)
    margins.near[own] = conditions.near


def _of_compliant_contacts(system: System, kink: int) -> Iterator[Margin]:
    """Yield the margins of compliant contacts: where they touch, and how fast they open where their
    force ends before; ``kink`` is the number of a law with a break at zero.
    """
    for coordinate, limit, rate in forces.kinks_of_contacts(system.forces):
        yield Margin(COORDINATE, coordinate, SPLIT, law=kink, origin=limit, near=NEAR)
        if rate != 0.0:
            yield Margin(RATE, coordinate, SPLIT, law=kink, origin=rate, near=NEAR)


def _of_distances(system: System, kink: int, contacts: Contacts | None) -> Iterator[Margin]:
    """Yield the margins of distances from boxes and curves and between segments, but for those of
    contacts that are open.
    """
    if system.scalar is None:
        return
    rows, group, opened = system.scalar.equations, system.scalar.coordinates, set()
    if contacts is not None:
        opened = {*rows.coordinate[contacts.row, 0][~is_active(rows)[contacts.row]].tolist()}
    for q in np.flatnonzero(has_kinks(group)).tolist():
        if q not in opened:
            yield Margin(KINK, q, SPLIT, law=kink, near=NEAR)


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
    """Set ``value`` (m,) to the margins of the prepared state, but for those of forces."""
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
        elif kind == RATE:
            value[k] = margins.rate[item]
        elif kind == SLIP:
            value[k] = rubbing.slip(system.forces.rubbing, margins.rate, item)
        elif kind == CROSSING:
            value[k] = margins.coordinate[item] + _past_ends(system.scalar, start.scalar, item)
        elif kind == KINK:
            value[k] = scalar.kink(system.scalar, start.scalar, item)


@optional(0.0)
def _past_ends(group: ScalarConstraints, start: ScalarWorkspace, q: int) -> float:
    """Return what the nearest points of the lines of two edges are beyond their ends [m]."""
    of = group.coordinates
    return past_ends(of.ends, q, start.coordinates.products.value, of.first[q])


@kernel
def next_known(known: KnownTimes, t: float, near: float) -> int:
    """Return the number of known times up to ``t`` [s], and ``near`` after it."""
    return int(np.searchsorted(known.time, t + near, side="right"))


@kernel
def hold_known(margins: Margins, t: float, near: float) -> bool:
    """Hold the switches that depend on the time alone at what they are from ``t`` [s] on; return
    whether one has changed.
    """
    known, changed = margins.known, False
    if known.switch.size == 0:
        return False
    row = next_known(known, t, near)
    for j in range(known.switch.size):
        s, side = known.switch[j], known.side[row, j]
        changed = changed or margins.held[s] != side
        margins.held[s] = side
    return changed


@kernel
def side_of(margins: Margins, k: int, y: float) -> float:
    """Return what the switch of margin ``k`` is at ``y``; free at a level."""
    if margins.integers[k]:
        side = float(np.floor(y))
        return FREE if side == y else side
    if y == 0.0:
        return FREE
    return 1.0 if y > 0.0 else margins.least[k]


@kernel
def other_side(margins: Margins, k: int, level: float) -> float:
    """Return what the switch of margin ``k`` is beyond a ``level``."""
    held = margins.held[margins.switch[k]]
    if margins.integers[k]:
        return held + 1.0 if level > held else held - 1.0
    return margins.least[k] if held > 0.0 else 1.0


@kernel
def is_held(margins: Margins, k: int) -> bool:
    """Whether margin ``k`` belongs to a switch that is held."""
    return margins.switch[k] >= 0 and margins.held[margins.switch[k]] != FREE


@kernel
def held_range(margins: Margins, k: int) -> tuple[float, float]:
    """Return the levels between which a switch has the held value."""
    held = margins.held[margins.switch[k]]
    if margins.integers[k]:
        return held, held + 1.0
    return (0.0, math.inf) if held > 0.0 else (-math.inf, 0.0)


@kernel
def levels_around(margins: Margins, k: int, y: float) -> tuple[float, float, float]:
    """Return the levels of margin ``k`` below and above ``y``, and the size of what lies between
    them, of which ``near`` is a fraction.
    """
    law, level, origin = margins.law[k], margins.level[k], margins.origin[k]
    size = level
    if law >= 0:
        low, high = piece_of(margins.laws, law, y - origin)
        size = high - low if high - low < math.inf else 1.0
        low, high = low + origin, high + origin
    elif margins.integers[k]:
        size, low = 1.0, float(np.floor(y))
        high = low + 1.0
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
def free_range(margins: Margins, k: int, y: float, change: float) -> tuple[float, float, float]:
    """Return between which levels margin ``k`` may move from ``y`` without an event, and by how
    much it may pass them; infinite ones if it is at a level. ``change`` is what it moves by in the
    step.
    """
    if margins.action[k] == CONTACT:
        level, slack = margins.level[k], margins.near[k]
        return (level, math.inf, slack) if margins.direction[k] < 0 else (-math.inf, level, slack)
    if is_held(margins, k):
        low, high = held_range(margins, k)
        return low, high, AT_ENDS * change
    low, high, size = levels_around(margins, k, y)
    slack = 0.0
    if margins.near[k] > 0.0:
        slack = margins.near[k] * size + AT_ENDS * change
    if y - low < slack or high - y < slack:
        return -math.inf, math.inf, slack
    return low, high, slack
