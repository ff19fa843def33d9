"""Contacts of a configuration in words."""

import numpy as np

from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.touching import Touching
from msahl.model.contacts import Contact, JointLimit

MOST = 20
"""Contacts that are named; reactions.csv has all."""
ROUND_OFF = 1e-12
"""Force over the largest that is shown as zero."""
NOT_UNIQUE = "their forces are not unique: contacts share them in many ways, of which this is one"
RANGE = (
    "contacts that stick hold the model in a range of places; this is the one that was reached "
    "from where the deck has it"
)


def contact_lines(point: Point) -> list[str]:
    """Return what the contacts of a ``point`` do; nothing of a model without."""
    touching = point.touching
    if touching is None:
        return []
    which = np.flatnonzero(touching.touches)
    units = [_unit(side.contact) for side in point.model.contact_sides]
    shown = [f"{touching.names[k]} {_does(touching, k, units[k])}" for k in which[:MOST].tolist()]
    if which.size > MOST:
        shown.append(f"{which.size - MOST} more touch")
    if opened := len(touching.names) - which.size:
        shown.append(f"{opened} open")
    lines = ["contacts: " + "; ".join(shown)]
    return lines if touching.unique else [*lines, NOT_UNIQUE]


def sticks(point: Point) -> bool:
    """Return whether friction holds a contact."""
    return point.touching is not None and bool(point.touching.sticks.any())


def slides(point: Point) -> bool:
    """Return whether a contact slides with friction."""
    group = point.system.forces.sliding
    return point.touching is not None and group is not None and bool(group.friction.any())


def _unit(contact: Contact) -> str:
    rotates = isinstance(contact, JointLimit) and contact.coordinate == "angle"
    return "N m" if rotates else "N"


def _does(touching: Touching, k: int, unit: str) -> str:
    """Return what contact ``k`` does, which touches."""
    largest = float(max(touching.force.max(), touching.friction.max()))
    normal, across = (
        f"{0.0 if size <= ROUND_OFF * largest else size:.6g}"
        for size in (touching.force[k], touching.friction[k])
    )
    own = int(touching.contacts.sliding[k])
    if not touching.closed[k]:
        return "touches without a force"
    if own >= 0 and touching.sticks[own]:
        return f"sticks with {normal} N, {across} N across"
    return f"{'presses' if own < 0 else 'slides'} with {normal} {unit}"
