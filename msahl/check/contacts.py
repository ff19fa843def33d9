"""Rules about contacts: what they act between, their ranges, and that nothing overlaps at t = 0."""

import math
from collections.abc import Iterator

from msahl.algebra.vector import dot, sub
from msahl.check.context import INERTIAL, Context
from msahl.check.directions import PARALLEL
from msahl.check.ends import FIT, ROUNDING, ends_findings, is_placed, points
from msahl.check.faults import Finding, negative
from msahl.check.joints import coordinate_findings
from msahl.model.contacts import (
    Contact,
    ContactSide,
    DistanceLimit,
    JointLimit,
    PlaneContact,
    friction_of,
    sides_of,
)

OVERLAP = 1e-9
"""Overlap at t = 0, over the size of what touches, that is that of the digits a deck omits."""


def contact_findings(contact: Contact, context: Context) -> Iterator[Finding]:
    """Find ends, ranges and coefficients of which no contact can be made."""
    if isinstance(contact, JointLimit):
        yield from coordinate_findings("joint", contact.joint, contact.coordinate, context)
    else:
        yield from ends_findings(contact, context)
    if not 0.0 <= contact.restitution <= 1.0:
        message = f"it is {contact.restitution:g}; give a coefficient from 0 to 1"
        yield Finding("restitution", message)
    if isinstance(contact, PlaneContact):
        yield from negative("radius", contact.radius)
        if abs(math.hypot(*contact.normal) - 1.0) > PARALLEL:
            yield Finding("normal", "it is no unit vector; divide it by its length")
        yield from _friction_findings(contact, context)
    else:
        yield from _range_findings(contact)


def _friction_findings(contact: PlaneContact, context: Context) -> Iterator[Finding]:
    yield from negative("friction", contact.friction)
    friction, grip = friction_of(contact)
    if grip < friction:
        message = f"it is {grip:g}, and friction {friction:g}; it must not be less than friction"
        yield Finding("staticFriction", message)
    moves = contact.parent in context.axes and contact.parent not in context.grounds
    if grip > 0.0 and contact.radius > 0.0 and moves:
        message = (
            f"a sphere has friction on a plane of a ground only, and '{contact.parent}' is a body; "
            "give a point (no radius), or the plane to a ground"
        )
        yield Finding("friction", message)


def _range_findings(contact: JointLimit | DistanceLimit) -> Iterator[Finding]:
    lower, upper = contact.lower, contact.upper
    if lower is None and upper is None:
        yield Finding("", "it has neither <lower> nor <upper>, so it limits nothing; give one")
    if lower is not None and upper is not None and not lower < upper:
        message = f"lower is {lower:g}, and upper {upper:g}; lower must be less than upper"
        yield Finding("lower", message)
    if isinstance(contact, DistanceLimit):
        for part, value in (("lower", lower), ("upper", upper)):
            if value is not None and not value > 0.0:
                yield Finding(part, f"the distance is {value:g} m; it must be greater than zero")


def overlap_findings(contact: Contact, context: Context) -> Iterator[Finding]:
    """Find a gap that is less than zero at t = 0; of limits of joints the run finds it."""
    if contact.name in context.released:
        return
    if isinstance(contact, JointLimit) or not is_placed(contact, context):
        return
    here, there = points(contact, context)
    D = sub(there, here)
    if isinstance(contact, PlaneContact):
        value = dot(D, context.rotated(contact.normal, contact.parent, INERTIAL))
    else:
        value = math.hypot(*D)
        if value <= FIT * (contact.upper or contact.lower or 0.0):
            yield Finding("", "its points coincide at t = 0, which leaves it without a direction")
            return
    size = max(math.hypot(*here), math.hypot(*there), context.extent)
    for side in sides_of(contact):
        depth = -side.sign * (value - side.limit)
        if depth > max(OVERLAP * abs(side.limit), ROUNDING * size, OVERLAP * math.hypot(*D)):
            yield Finding("", _overlap(side, depth))


def _overlap(side: ContactSide, depth: float) -> str:
    if isinstance(side.contact, PlaneContact):
        return f"it is {depth:.4g} m below the plane at t = 0; move one of the bodies apart"
    end, way = ("lower", "below") if side.is_lower else ("upper", "above")
    return (
        f"the distance is {depth:.4g} m {way} its {end} limit at t = 0; move one of the bodies, or "
        "change the limit"
    )
