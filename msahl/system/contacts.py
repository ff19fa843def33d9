"""Contacts of a system: which constraint equations are those of its one-sided constraints.

A contact is open or closed. The equation of a closed one is like all others, and its multiplier is
an unknown. That of an open one has the coefficient 0, so that it holds for any motion and pushes
nothing; its multiplier is no unknown. Which of them are closed is in these numbers alone: they are
the only ones of a system that change during a run, and all systems are built with open contacts.
"""

from typing import NamedTuple

import numpy as np

from msahl.elements.constraints.equations import ConstraintEquations, is_active
from msahl.joints.coordinates import angle_offset
from msahl.model import ContactSide, JointLimit, Model
from msahl.model.contacts import friction_of
from msahl.system.arrays import State, System
from msahl.system.state import work_of_contacts

NEAR = 1e-13
"""Gap over the size of the model that counts as none: positions leave a thousandth of it."""


class Contacts(NamedTuple):
    """The contacts of a system, one for each side of a range."""

    row: np.ndarray  # (c,) its constraint equation
    sign: np.ndarray  # (c,) 1 if the gap is coordinate - limit, -1 if it is limit - coordinate
    limit: np.ndarray  # (c,) [m or rad]
    restitution: np.ndarray  # (c,)
    round_off: np.ndarray  # (c,) gap that counts as none [m or rad]
    column: np.ndarray  # (c,) of the table of work
    friction: np.ndarray  # (c,) coefficient while it slides
    sliding: np.ndarray  # (c,) its number among the contacts with friction; -1 without
    acts: np.ndarray  # (c,) whether it can close: events may release it; changes during a run
    between_edges: np.ndarray  # (c,) closes only where two edges of boxes cross


def contacts_of(model: Model, system: System, state: State) -> Contacts | None:
    """Return the contacts of a ``system`` of the ``model``, at its start; None if it has none."""
    sides = model.contact_sides
    if not sides or system.scalar is None:
        return None
    row = system.shown.load_equation[-len(sides) :]
    scale = system.scalar.equations.scale[row]
    size = max(float(system.frames.length.max()), float(np.abs(state.x).max()))
    column = work_of_contacts(model) + np.arange(len(sides))
    number, group = np.full(len(sides), -1), system.forces.sliding
    if group is not None:
        number[group.column - column[0]] = np.arange(group.row.size)
    return Contacts(
        row=row,
        sign=np.array([side.sign for side in sides]),
        limit=np.array([_limit(model, side) for side in sides]),
        restitution=np.array([side.contact.restitution for side in sides]),
        round_off=NEAR * size / scale,
        column=column,
        friction=np.array([friction_of(side.contact)[0] for side in sides]),
        sliding=number,
        acts=np.array([side.of not in model.released for side in sides]),
        between_edges=np.array([side.between_edges for side in sides]),
    )


def _limit(model: Model, side: ContactSide) -> float:
    """Return the limit of a coordinate as the equations of motion count it."""
    contact = side.contact
    if not isinstance(contact, JointLimit) or contact.coordinate != "angle":
        return side.limit
    return side.limit - angle_offset({joint.name: joint for joint in model.joints}[contact.joint])


def closed(system: System, contacts: Contacts) -> np.ndarray:
    """(c,) which contacts are closed."""
    assert system.scalar is not None
    found: np.ndarray = is_active(system.scalar.equations)[contacts.row]
    return found


def sticking(system: System) -> np.ndarray:
    """(k,) which contacts with friction stick."""
    assert system.scalar is not None
    group = system.forces.sliding
    if group is None:
        return np.zeros(0, dtype=bool)
    found: np.ndarray = is_active(system.scalar.equations)[group.tangent[:, 0]]
    return found


def set_closed(system: System, contacts: Contacts, which: np.ndarray, value: np.ndarray) -> None:
    """Close the contacts ``which`` (c,), at these ``value`` (q,) of all coordinates, and open all
    others; those with friction slide without it.
    """
    assert system.scalar is not None
    rows, group = system.scalar.equations, system.forces.sliding
    _set(rows, contacts.row, which, value)
    _let_idle(system)
    if group is not None:
        _set(rows, group.tangent.reshape(-1), np.zeros(2 * group.row.size, dtype=bool), value)
        group.friction[:] = 0.0


def _let_idle(system: System) -> None:
    """Let the coordinates rest along which nothing but open contacts acts; the slips of a closed
    one are needed whether it sticks or slides.
    """
    assert system.scalar is not None
    rows, group, coords = (
        system.scalar.equations,
        system.forces.sliding,
        system.scalar.coordinates,
    )
    active, used = is_active(rows), np.zeros(coords.kind.size, dtype=bool)
    used[rows.coordinate[active, 0]] = True
    if group is not None:
        used[group.along[active[group.row]]] = True
    coords.idle[:] = coords.of_contacts & ~used


def set_sticking(system: System, which: np.ndarray, value: np.ndarray) -> None:
    """Let the contacts with friction ``which`` (k,) stick, at these ``value`` (q,) of all
    coordinates.
    """
    assert system.scalar is not None
    group = system.forces.sliding
    if group is not None:
        _set(system.scalar.equations, group.tangent.reshape(-1), np.repeat(which, 2), value)


def _set(rows: ConstraintEquations, row: np.ndarray, which: np.ndarray, value: np.ndarray) -> None:
    """Let those of the equations ``row`` (n,) hold which ``which`` (n,) says."""
    rows.coefficient[row, 0] = np.where(which, 1.0, 0.0)
    rows.offset[row] = np.where(which, value[rows.coordinate[row, 0]], 0.0)
