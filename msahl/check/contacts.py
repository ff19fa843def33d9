"""Rules about contacts: what they act between, their ranges, and that nothing overlaps at t = 0."""

import math
from collections.abc import Iterator
from itertools import pairwise

from msahl.algebra.functions import Law
from msahl.algebra.vector import Vector, axpy, cross, dot, sub
from msahl.check.box_gaps import gap_of_boxes
from msahl.check.context import INERTIAL, Context
from msahl.check.directions import PARALLEL
from msahl.check.ends import FIT, ROUNDING, ends_findings, is_placed, points
from msahl.check.faults import Finding, negative, number_findings
from msahl.check.joints import coordinate_findings
from msahl.check.laws import law_findings
from msahl.elements.constraints import curves, segments
from msahl.elements.constraints.outlines import NoCurve, corners, curves_of, segments_of
from msahl.laws.restitution import LEAST_RESTITUTION
from msahl.model.contact_sides import ContactSide, sides_of
from msahl.model.contacts import (
    BetweenPoints,
    BoxContact,
    BoxesContact,
    CapsuleContact,
    Compliance,
    Contact,
    DistanceLimit,
    JointLimit,
    PinContact,
    PlaneContact,
    SphereContact,
    WithFriction,
    friction_of,
)

Round = SphereContact | BoxContact | CapsuleContact | PinContact
LARGEST_EXPONENT = 10.0
_COINCIDE = "its points coincide at t = 0, which leaves it without a direction"
_FLAT = (
    "it is along the plane's normal at t = 0: a disk that lies flat has no lowest point; tilt it, "
    "or give points of its rim or the corners of a <box> instead"
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
    elif contact.compliance is not None:
        yield from _compliance_findings(contact, contact.compliance)
    if isinstance(contact, PlaneContact):
        yield from negative("radius", contact.radius)
        if abs(math.hypot(*contact.normal) - 1.0) > PARALLEL:
            yield Finding("normal", "it is no unit vector; divide it by its length")
        if contact.axis is not None:
            yield from _rim_findings(contact, contact.axis)
        yield from _friction_findings(contact)
    elif isinstance(contact, SphereContact):
        yield from _radius_findings(contact)
        yield from _friction_findings(contact)
    elif isinstance(contact, BoxContact):
        yield from _box_findings(contact)
        yield from _friction_findings(contact)
    elif isinstance(contact, CapsuleContact):
        yield from _capsule_findings(contact)
        yield from _friction_findings(contact)
    elif isinstance(contact, BoxesContact):
        yield from _boxes_findings(contact)
        yield from _friction_findings(contact)
    elif isinstance(contact, PinContact):
        yield from _pin_findings(contact)
        yield from _friction_findings(contact)
    else:
        yield from _range_findings(contact)


def _rim_findings(contact: PlaneContact, axis: Vector) -> Iterator[Finding]:
    if abs(math.hypot(*axis) - 1.0) > PARALLEL:
        yield Finding("axis", "it is no unit vector; divide it by its length")
    if contact.radius == 0.0:
        yield Finding("radius", "a disk has a radius; give it, or delete the child's <axis>")


def _box_findings(contact: BoxContact) -> Iterator[Finding]:
    yield from negative("radius", contact.radius)
    yield from negative("parentRadius", contact.parent_radius)
    for tag, half in zip(("x", "y", "z"), contact.half, strict=True):
        yield from negative(tag, 2.0 * half)
    if not any(contact.half):
        yield Finding("", "the parent has no size, so it is a sphere: use a sphereContact")
    if contact.radius + contact.parent_radius == 0.0:
        message = (
            "it is zero, as parentRadius is: a point on a box with sharp edges has no direction "
        )
        yield Finding("radius", f"{message}of contact there; give one of them")


def _boxes_findings(contact: BoxesContact) -> Iterator[Finding]:
    yield from negative("radius", contact.radius)
    yield from negative("parentRadius", contact.parent_radius)
    for part, half in (("box", contact.parent_half), ("childBox", contact.half)):
        for size in half:
            yield from negative(part, 2.0 * size)
    for whose, half in (("parent", contact.parent_half), ("child", contact.half)):
        if not any(half):
            yield Finding("", f"the {whose} has no size, so it is a sphere: give a size or no box")
    if contact.radius + contact.parent_radius == 0.0:
        message = "it is zero, as parentRadius is: boxes with sharp edges have no direction of "
        yield Finding("radius", f"{message}contact there; give one of them")
    if contact.compliance is not None:
        message = "the contact of two boxes is rigid; delete it, or let corners be spheres of "
        yield Finding("stiffness", f"{message}boxContacts of their own")


def _capsule_findings(contact: CapsuleContact) -> Iterator[Finding]:
    yield from negative("radius", contact.radius)
    yield from negative("parentRadius", contact.parent_radius)
    for tag, axis in (("parent/axis", contact.parent_axis), ("child/axis", contact.axis)):
        if abs(math.hypot(*axis) - 1.0) > PARALLEL:
            yield Finding(tag, "it is no unit vector; divide it by its length")
    for tag, half in (("parentLength", contact.parent_half), ("length", contact.half)):
        if not half > 0.0:
            message = f"it is {2.0 * half:g} m; it must be greater than zero: a capsule without "
            yield Finding(
                tag, f"{message}length is a sphere, use a cylinderContact or sphereContact"
            )
    if contact.radius + contact.parent_radius == 0.0:
        yield Finding("radius", "it is zero, as parentRadius is; give one of them")


def _pin_findings(contact: PinContact) -> Iterator[Finding]:
    """Find points that make no curve, and places where the pin touches a curve twice."""
    yield from negative("radius", contact.radius)
    try:
        segments = segments_of(contact.curve)
    except NoCurve as error:
        yield Finding("curve", str(error))
        return
    for (x, y), angle in corners(segments, contact.curve.closed):
        place = f"the corner at ({x:.7g}, {y:.7g}) m"
        if angle < 0.0:
            message = (
                f"{place} is hollow, where the pin touches both sides at once; round it by an arc "
                "of more than its radius, or give the sides as curves of two contacts"
            )
            yield Finding("curve", message)
        elif contact.radius == 0.0:
            message = f"{place} has no direction for a point; give a radius, or round it by an arc"
            yield Finding("curve", message)
    hollow = min(segment.hollow for segment in segments)
    if hollow <= contact.radius * (1.0 + OVERLAP):
        message = (
            f"it is {contact.radius:g} m and does not fit the hollow of radius {hollow:.4g} m of "
            "the curve; give a smaller one, or a rounder curve"
        )
        yield Finding("radius", message)


def _radius_findings(contact: SphereContact) -> Iterator[Finding]:
    yield from negative("radius", contact.radius)
    outer, inner = contact.parent_radius, contact.radius
    if outer == 0.0:
        yield Finding(
            "parent_radius", "it is zero; give the radius, less than zero if it is hollow"
        )
    if outer < 0.0 and not inner < -outer:
        message = f"it is {inner:g} m, and that of the hollow parent {-outer:g} m; give less"
        yield Finding("radius", message)
    if contact.axis is not None and abs(math.hypot(*contact.axis) - 1.0) > PARALLEL:
        yield Finding("axis", "it is no unit vector; divide it by its length")


def _compliance_findings(contact: Contact, compliance: Compliance) -> Iterator[Finding]:
    """Find numbers of which no force of a compliant contact can be made."""
    found = [*number_findings(compliance)]
    yield from found
    if found:
        return
    e, speed = contact.restitution, compliance.impact_speed
    if compliance.table is not None:
        yield from _table_findings(compliance.table)
        if compliance.stiffness != 0.0 or compliance.exponent != 1.0:
            message = (
                "<table> has the force over the depth already; delete <stiffness> and <exponent>"
            )
            yield Finding("table", message)
    elif not compliance.stiffness > 0.0:
        message = f"it is {compliance.stiffness:g}; it must be greater than zero, or delete it: a "
        yield Finding("stiffness", f"{message}contact without stiffness is rigid")
    if not 1.0 <= compliance.exponent <= LARGEST_EXPONENT:
        message = f"it is {compliance.exponent:g}; give 1 (linear), 1.5 (Hertz) or another up to "
        yield Finding("exponent", f"{message}{LARGEST_EXPONENT:g}")
    if e < LEAST_RESTITUTION:
        message = f"it is {e:g}; damping of a compliant contact gives {LEAST_RESTITUTION:g} to 1: "
        yield Finding("restitution", f"{message}give more, or delete <stiffness>: it is rigid then")
    if speed is not None and not speed > 0.0:
        yield Finding("impact_speed", f"it is {speed:g}; it must be greater than zero")
    if speed is None and e < 1.0:
        message = f"with a damping by which the restitution is {e:g} at one speed of impact, it is "
        message += "another at others; add <impactSpeed>, the speed at which it is that"
        yield Finding("restitution", message)


def _table_findings(table: Law) -> Iterator[Finding]:
    """Find a table that is no force of a contact."""
    found = [*law_findings(table, "the depth")]
    for finding in found:
        yield Finding("table", finding.message)
    half = len(table.numbers) // 2
    depth, force = table.numbers[:half], table.numbers[half:]
    if found:
        return
    if table.kind != "linear":
        message = f"it is {table.kind}, which may pull between its entries; make it linear"
        yield Finding("table", message)
    if depth[0] != 0.0 or force[0] != 0.0:
        message = (
            f"it begins with {force[0]:g} at the depth {depth[0]:g}; the first entry is 0 at 0"
        )
        yield Finding("table", message)
    if any(after < before for before, after in pairwise(force)):
        message = "its force falls with the depth, so that a contact jumps; let it rise"
        yield Finding("table", message)


def _friction_findings(contact: WithFriction) -> Iterator[Finding]:
    yield from negative("friction", contact.friction)
    friction, grip = friction_of(contact)
    if grip < friction:
        message = f"it is {grip:g}, and friction {friction:g}; it must not be less than friction"
        yield Finding("staticFriction", message)
    if contact.compliance is not None:
        yield from _compliant_friction_findings(contact, contact.compliance.friction_width)


def _compliant_friction_findings(contact: WithFriction, width: float | None) -> Iterator[Finding]:
    if width is not None and not width > 0.0:
        yield Finding("frictionWidth", f"it is {width:g}; it must be greater than zero")
    if contact.static_friction is not None:
        message = "a compliant contact creeps instead of sticking; delete it, or <stiffness>"
        yield Finding("staticFriction", message)
    if contact.friction > 0.0 and width is None:
        message = (
            "a compliant contact creeps where a rigid one sticks; add <frictionWidth>, the slip "
        )
        yield Finding("friction", f"{message}at which three quarters of friction act")
    if contact.friction == 0.0 and width is not None:
        yield Finding("frictionWidth", "it is that of friction; add <friction>, or delete it")


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
    if isinstance(contact, BoxesContact):
        yield from _deepest(contact, context)
        return
    here, there = points(contact, context)
    D = sub(there, here)
    if isinstance(contact, PlaneContact):
        normal = context.rotated(contact.normal, contact.parent, INERTIAL)
        value = dot(D, normal)
        if contact.axis is not None:
            axis = context.rotated(contact.axis, contact.child, INERTIAL)
            value -= contact.radius * math.sqrt(max(0.0, 1.0 - dot(axis, normal) ** 2))
            if math.hypot(*cross(axis, normal)) < PARALLEL:
                yield Finding("axis", _FLAT)
                return
    elif isinstance(contact, PinContact):
        try:
            curve = curves_of([contact.curve])
        except NoCurve:
            return
        x, y = (dot(D, context.rotated(a, contact.parent, INERTIAL)) for a in contact.axes[:2])
        value = curves.value(curve, 0, x, y)
    else:
        D = _nearest(contact, D, context)
        value = math.hypot(*D)
        if value <= FIT * max(side.limit for side in sides_of(contact)):
            yield Finding("", _COINCIDE)
            return
    if contact.compliance is not None:
        return  # it may begin with a depth
    size = max(math.hypot(*here), math.hypot(*there), context.extent)
    for side in sides_of(contact):
        depth = -side.sign * (value - side.limit)
        if depth > max(OVERLAP * abs(side.limit), ROUNDING * size, OVERLAP * math.hypot(*D)):
            yield Finding("", _overlap(side, depth))


def _nearest(contact: BetweenPoints, D: Vector, context: Context) -> Vector:
    """Return the distance of what is nearest of both bodies, from that of their points ``D``."""
    if isinstance(contact, SphereContact) and contact.axis is not None:
        axis = context.rotated(contact.axis, contact.parent, INERTIAL)
        D = axpy(-dot(axis, D), axis, D)
    elif isinstance(contact, CapsuleContact):
        axis = context.rotated(contact.parent_axis, contact.parent, INERTIAL)
        other = context.rotated(contact.axis, contact.child, INERTIAL)
        half, places = (contact.parent_half, contact.half), (dot(axis, D), dot(other, D))
        u, w, _, _ = segments.feet(half, (*places, dot(axis, other)))
        D = axpy(w, other, axpy(-u, axis, D))
    if isinstance(contact, BoxContact):
        own = (dot(D, context.rotated(a, contact.parent, INERTIAL)) for a in contact.axes)
        pairs = zip(own, contact.half, strict=True)
        D = tuple(max(abs(p) - half, 0.0) for p, half in pairs)  # type: ignore[assignment]
    return D


def _deepest(contact: BoxesContact, context: Context) -> Iterator[Finding]:
    """Find boxes that overlap at t = 0."""
    gap = gap_of_boxes(contact, context)
    size = max(*(math.hypot(*point) for point in points(contact, context)), context.extent)
    limit = contact.parent_radius + contact.radius
    if -gap > max(OVERLAP * limit, ROUNDING * size):
        yield Finding("", _overlap(next(iter(sides_of(contact))), -gap))


def _overlap(side: ContactSide, depth: float) -> str:
    if isinstance(side.contact, PlaneContact):
        return f"it is {depth:.4g} m below the plane at t = 0; move one of the bodies apart"
    if isinstance(side.contact, Round):
        return f"it overlaps by {depth:.4g} m at t = 0; move one of the bodies, or change a radius"
    end, way = ("lower", "below") if side.is_lower else ("upper", "above")
    return (
        f"the distance is {depth:.4g} m {way} its {end} limit at t = 0; move one of the bodies, or "
        "change the limit"
    )
