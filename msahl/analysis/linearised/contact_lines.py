"""Contacts of a configuration in words."""

import numpy as np

from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.touching import Touching

MOST = 20
"""Contacts that are named; reactions.csv has all."""
NOT_UNIQUE = "their forces are not unique: contacts share them in many ways, of which this is one"
RANGE = (
    "contacts that stick hold the model in a range of places; this is the one that was reached from "
    "where the deck has it"
)


def contact_lines(point: Point) -> list[str]:
    """Return what the contacts of a ``point`` do; nothing of a model without."""
    touching = point.touching
    if touching is None:
        return []
    which = np.flatnonzero(touching.touches)
    shown = [f"{touching.names[k]} {_does(touching, k)}" for k in which[:MOST].tolist()]
    if which.size > MOST:
        shown.append(f"{which.size - MOST} more touch")
    if opened := touching.names and len(touching.names) - which.size:
        shown.append(f"{opened} open")
    lines = ["contacts: " + "; ".join(shown)]
    return lines if touching.unique else [*lines, NOT_UNIQUE]


def sticks(point: Point) -> bool:
    """Return whether friction holds a contact."""
    return point.touching is not None and bool(point.touching.sticks.any())


def _does(touching: Touching, k: int) -> str:
    """Return what contact ``k`` does, which touches."""
    if not touching.closed[k]:
        return "touches without a force"
    force, own = f"{touching.force[k]:.6g}", int(touching.contacts.sliding[k])
    if own < 0:
        return f"presses with {force} (N or N m)"
    if touching.sticks[own]:
        return f"sticks, {force} N and {touching.friction[k]:.6g} N across"
    return f"slides, {force} N"
