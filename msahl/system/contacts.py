"""Contacts of a system: which constraint equations are those of its one-sided constraints.

A contact is open or closed. The equation of a closed one is like all others, and its multiplier is
an unknown. That of an open one has the coefficient 0, so that it holds for any motion and pushes
nothing; its multiplier is no unknown. Which of them are closed is in these numbers alone: they are
the only ones of a system that change during a run, and all systems are built with open contacts.
"""

from typing import NamedTuple

import numpy as np

from msahl.elements.constraints.equations import is_active
from msahl.joints.coordinates import angle_offset
from msahl.model import ContactSide, JointLimit, Model
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
    acts: np.ndarray  # (c,) whether it can close: events may release it; changes during a run


def contacts_of(model: Model, system: System, state: State) -> Contacts | None:
    """Return the contacts of a ``system`` of the ``model``, at its start; None if it has none."""
    sides = model.contact_sides
    if not sides or system.scalar is None:
        return None
    row = system.shown.load_equation[-len(sides) :]
    scale = system.scalar.equations.scale[row]
    size = max(float(system.frames.length.max()), float(np.abs(state.x).max()))
    return Contacts(
        row=row,
        sign=np.array([side.sign for side in sides]),
        limit=np.array([_limit(model, side) for side in sides]),
        restitution=np.array([side.contact.restitution for side in sides]),
        round_off=NEAR * size / scale,
        column=work_of_contacts(model) + np.arange(len(sides)),
        acts=np.array([side.contact.name not in model.released for side in sides]),
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


def set_closed(system: System, contacts: Contacts, which: np.ndarray, value: np.ndarray) -> None:
    """Close the contacts ``which`` (c,) at these ``value`` (c,) of their coordinates, and open all
    others.
    """
    assert system.scalar is not None
    rows = system.scalar.equations
    rows.coefficient[contacts.row, 0] = np.where(which, 1.0, 0.0)
    rows.offset[contacts.row] = np.where(which, value, 0.0)
