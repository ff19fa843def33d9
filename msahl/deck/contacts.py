"""Reader of contacts: elements -> records."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from msahl.algebra.functions import Law
from msahl.algebra.vector import IDENTITY, Matrix, Vector, add, axpy
from msahl.check.contacts import LARGEST_EXPONENT, contact_findings, overlap_findings
from msahl.check.context import INERTIAL
from msahl.check.directions import PARALLEL, frame, sine
from msahl.check.ends import is_placed as is_placed_as
from msahl.check.loads import UNIT_LENGTH
from msahl.deck.contact_sets import CONTACT_SET, Touch, half_sizes, pairs_of
from msahl.deck.curves import read_curve
from msahl.deck.ends import REFERENCE_PARALLEL, Ends, is_placed, read_ends, side_direction
from msahl.deck.faults import Element, text
from msahl.deck.laws import read_table
from msahl.deck.motions import UNIT
from msahl.deck.springs import QUANTITIES
from msahl.deck.units import DEFAULTS, to_si
from msahl.deck.values import Reader
from msahl.model.box_parts import corners_of
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
)

COMPLIANT = ("exponent", "impactSpeed", "frictionWidth")
"""Tags of what only compliant contacts have."""
SPEED = {"angle": "angularVelocity", "slide": "velocity"}
LOAD = {"angle": "moment", "slide": "force"}
"""Physical quantities along each coordinate."""
CONTACTS = (
    *("jointLimit", "distanceLimit", "planeContact"),
    *("sphereContact", "cylinderContact", "boxContact", "capsuleContact", "pinContact"),
)
"""Tags of contacts."""


def read_contacts(elements: Sequence[Element], reader: Reader) -> Iterator[Contact]:
    """Yield the records of contacts of any kind; a box or a capsule has several."""
    names = {text(element.find("name")) for element in elements}
    for element in elements:
        read = _read_set if element.tag == CONTACT_SET else _read_contact
        for contact in read(element, reader):
            if contact.name != text(element.find("name")) and contact.name in names:
                message = (
                    f"its part '{contact.name}' has the name of another contact; choose another"
                )
                reader.faults.add(element, message)
            yield contact


def is_switchable(element: Element) -> bool:
    """Return whether events may name an element: it is no force, and has no parts."""
    many = ("capsuleEnd", "box", "length") if element.tag == "planeContact" else ()
    if element.tag == CONTACT_SET:
        return False
    return not any(element.find(tag) is not None for tag in ("stiffness", "table", *many))


def _read_set(element: Element, reader: Reader) -> Iterator[Contact]:
    """Yield the contacts of a set; the first one stands for what all of them have."""
    restitution, compliance = _law(element, "slide", reader)
    touch = Touch(restitution, compliance, *_friction(element, reader))
    for k, (place, contact) in enumerate(pairs_of(element, touch, reader)):
        if k == 0:
            reader.add(element, contact_findings(contact, reader.context))
        assert not isinstance(contact, JointLimit)
        if is_placed_as(contact, reader.context) and reader.faults.sound(element):
            for part, message in overlap_findings(contact, reader.context):
                reader.faults.add(place, f"{contact.name}: {part}{message}")
        yield contact


def _read_contact(element: Element, reader: Reader) -> list[Contact]:
    if element.tag == "jointLimit":
        limit = _joint_limit(element, reader)
        reader.add(element, contact_findings(limit, reader.context))
        return [limit]
    ends = read_ends(element, reader)
    contact = _between_points(element, ends, reader)
    reader.add(element, contact_findings(contact, reader.context))
    is_plane = isinstance(contact, PlaneContact)
    points = _points(element, ends, contact, reader) if is_plane else []
    parts: list[Contact] = [contact]
    if points:
        parts = [
            replace(contact, name=f"{contact.name}.{k}", child_point=point)
            for k, point in enumerate(points, start=1)
        ]
    if is_placed(element, ends, reader):
        findings = [overlap_findings(part, reader.context) for part in parts]
        reader.add(element, [finding for found in findings for finding in found])
    return parts


def _points(element: Element, ends: Ends, contact: BetweenPoints, reader: Reader) -> list[Vector]:
    """Return the points of a capsule's ends, of a box's corners or of the centres of a cylinder's
    ends, child's axes [m]; none of a sphere or a disk.
    """
    length = element.find("length")
    if length is not None:
        return _ends_of_cylinder(length, contact, reader)
    other, box = element.find("capsuleEnd"), element.find("box")
    if other is not None and box is not None:
        reader.faults.add(box, "it is a capsule as well by <capsuleEnd>; delete one of them")
    if other is not None and reader.is_known(ends.child):
        return [ends.child_point, reader.vector(other, own=ends.child, wanted=ends.child)]
    if box is None:
        return []
    corners = corners_of(half_sizes(box, reader))
    return [add(ends.child_point, corner) for corner in corners]


def _childs_box(element: Element, ends: Ends, reader: Reader) -> tuple[Vector, Matrix] | None:
    """Return half the sizes of the child's box, or capsule, of a ``boxContact`` [m], and its axes;
    None of a sphere.
    """
    box, length = element.find("childBox"), element.find("length")
    if box is not None:
        for other in (length, element.find("child/axis")):
            if other is not None:
                reader.faults.add(other, "the child is a box; delete it, or <childBox>")
        return half_sizes(box, reader), IDENTITY
    if length is None:
        axis = element.find("child/axis")
        if axis is not None:
            reader.faults.add(axis, "it is that of a capsule; add its <length>, or delete it")
        return None
    half = 0.5 * reader.number(length, "length")
    if half <= 0.0:
        message = f"it is {2.0 * half:g} m; it must be greater than zero; delete it for a sphere"
        reader.faults.add(length, message)
    if element.find("child/axis") is None:
        reader.faults.add(length, "a capsule has an axis; give the child an <axis>, or delete it")
    return (0.0, 0.0, half), frame(_childs_axis(element, ends, reader))


def _ends_of_cylinder(element: Element, contact: BetweenPoints, reader: Reader) -> list[Vector]:
    """Return the centres of both ends of a cylinder about the child's position, child's axes."""
    half = 0.5 * reader.number(element, "length")
    if not isinstance(contact, PlaneContact) or contact.axis is None:
        reader.faults.add(element, "a cylinder has an axis; give the child an <axis>, or delete it")
        return []
    if half <= 0.0:
        reader.faults.add(element, "it must be greater than zero; delete it for a disk")
    return [axpy(sign * half, contact.axis, contact.child_point) for sign in (-1.0, 1.0)]


def _between_points(element: Element, ends: Ends, reader: Reader) -> BetweenPoints:
    name, law = text(element.find("name")), _law(element, "slide", reader)
    points = (ends.parent, ends.child, ends.parent_point, ends.child_point)
    if element.tag == "distanceLimit":
        return DistanceLimit(name, *points, *_range(element, "length", reader), *law)
    radius = reader.number(element.find("radius"), "length")
    friction = _friction(element, reader)
    if element.tag == "planeContact":
        normal = _parents_direction(element, "normal", ends, reader)
        axis = _rim_axis(element, ends, reader)
        return PlaneContact(name, *points, normal, radius, *law, *friction, axis)
    if element.tag == "pinContact":
        return _pin_contact(element, ends, radius, law, friction, reader)
    parent_radius = reader.number(element.find("parentRadius"), "length")
    if (box := element.find("box")) is not None:
        half, radii = half_sizes(box, reader), (parent_radius, radius)
        childs = _childs_box(element, ends, reader)
        if childs is not None:
            sides = (half, childs[0])
            return BoxesContact(name, *points, *sides, *radii, *law, *friction, childs[1])
        return BoxContact(name, *points, half, *radii, *law, *friction)
    if element.tag == "capsuleContact":
        axis = _parents_direction(element, "axis", ends, reader)
        other = _childs_axis(element, ends, reader)
        lengths = [element.find(tag) for tag in ("parentLength", "length")]
        ends_at, own = (0.5 * reader.number(length, "length") for length in lengths)
        sizes = (ends_at, own, parent_radius, radius)
        return CapsuleContact(name, *points, axis, other, *sizes, *law, *friction)
    about = None
    if element.tag == "cylinderContact":
        about = axis = _parents_direction(element, "axis", ends, reader)
        if (length := element.find("length")) is not None:
            if parent_radius < 0.0:
                message = "a hollow cylinder has no ends; delete <length>, or give a radius > 0"
                reader.faults.add(element, message)
            half = (0.0, 0.0, 0.5 * reader.number(length, "length"))
            return BoxContact(
                *(name, *points, half, parent_radius, radius, *law, *friction), frame(axis)
            )
    return SphereContact(name, *points, parent_radius, radius, about, *law, *friction)


def _pin_contact(
    element: Element,
    ends: Ends,
    radius: float,
    law: tuple[float, Compliance | None],
    friction: tuple[float, float | None],
    reader: Reader,
) -> PinContact:
    """Return the contact of a pin and a curve in the plane of the parent's frame, whose z is the
    ``axis`` and whose x is the ``reference``; that of the child is the same by default.
    """
    axis = _parents_direction(element, "axis", ends, reader)
    axes = frame(axis, _reference(element, "parent", ends.parent, axis, reader))
    reference, rotated = IDENTITY[0], reader.context.rotated
    if reader.is_known(ends.parent) and reader.is_known(ends.child):
        normal = rotated(axis, ends.parent, ends.child)
        own = _reference(element, "child", ends.child, normal, reader)
        reference = own or rotated(axes[0], ends.parent, ends.child)
    points = (ends.parent, ends.child, ends.parent_point, ends.child_point)
    name, curve = text(element.find("name")), read_curve(element, reader)
    return PinContact(name, *points, curve, radius, *law, *friction, axes, reference)


def _reference(
    element: Element, side: str, body: str, axis: Vector, reader: Reader
) -> Vector | None:
    """Return the ``reference`` of one end in the axes of its ``body``, if it has one that is not
    along the ``axis``.
    """
    direction = side_direction(element, side, "reference", reader)
    if direction is None:
        return None
    found = _own_direction(element, f"{side}/reference", direction, body, reader)
    if sine(axis, found) < PARALLEL:
        reader.faults.add(element, REFERENCE_PARALLEL)
        return None
    return found


def _rim_axis(element: Element, ends: Ends, reader: Reader) -> Vector | None:
    """Return the axis of the child's disk, in the child's axes; None of a sphere."""
    direction = side_direction(element, "child", "axis", reader)
    if direction is None or not reader.is_known(ends.child):
        return None
    for tag in ("capsuleEnd", "box"):
        other = element.find(tag)
        if other is not None:
            reader.faults.add(
                other, "it is a disk as well by the child's <axis>; delete one of them"
            )
    return _own_direction(element, "child/axis", direction, ends.child, reader)


def _parents_direction(element: Element, tag: str, ends: Ends, reader: Reader) -> Vector:
    """Return a unit vector of the parent's end, in the parent's axes; one that is given as such,
    to the last digit.
    """
    direction = side_direction(element, "parent", tag, reader)
    if direction is None or not reader.is_known(ends.parent):
        return (0.0, 0.0, 1.0)
    return _own_direction(element, f"parent/{tag}", direction, ends.parent, reader)


def _childs_axis(element: Element, ends: Ends, reader: Reader) -> Vector:
    """Return the unit vector along the child's axis, in the child's axes."""
    direction = side_direction(element, "child", "axis", reader)
    if direction is None or not reader.is_known(ends.child):
        return (0.0, 0.0, 1.0)
    return _own_direction(element, "child/axis", direction, ends.child, reader)


def _own_direction(
    element: Element, path: str, direction: Vector, body: str, reader: Reader
) -> Vector:
    """Return the unit vector ``direction`` (inertial axes) in the axes of ``body``, to the last
    digit if it is given as such.
    """
    given = reader.vector(element.find(path), own=body, wanted=body)
    if abs(math.hypot(*given) - 1.0) <= UNIT_LENGTH:
        return given
    return reader.context.rotated(direction, INERTIAL, body)


def _joint_limit(element: Element, reader: Reader) -> JointLimit:
    coordinate = text(element.find("coordinate"))
    lower, upper = _range(element, UNIT[coordinate], reader)
    restitution, compliance = _law(element, coordinate, reader)
    return JointLimit(
        name=text(element.find("name")),
        joint=text(element.find("joint")),
        coordinate=coordinate,
        lower=lower,
        upper=upper,
        restitution=restitution,
        compliance=compliance,
    )


def _law(element: Element, coordinate: str, reader: Reader) -> tuple[float, Compliance | None]:
    """Return the restitution of a contact along a coordinate, and its compliance if it has one."""
    stiffness, given = element.find("stiffness"), element.find("restitution")
    table = element.find("table")
    if stiffness is None and table is None:
        for tag in COMPLIANT:
            place = element.find(tag)
            if place is not None:
                message = f"<{tag}> is that of a compliant contact; add a <stiffness>, or delete it"
                reader.faults.add(place, message)
        return reader.number(given), None
    speed, exponent = element.find("impactSpeed"), element.find("exponent")
    power = 1.0 if exponent is None else reader.number(exponent)
    compliance = Compliance(
        stiffness=0.0 if stiffness is None else _stiffness(stiffness, power, coordinate, reader),
        exponent=power,
        impact_speed=None if speed is None else reader.number(speed, SPEED[coordinate]),
        friction_width=_number_or_none(element, "frictionWidth", reader, "velocity"),
        table=None if table is None else _force_table(table, coordinate, reader),
    )
    return 1.0 if given is None else reader.number(given), compliance


def _force_table(element: Element, coordinate: str, reader: Reader) -> Law:
    """Return the force over the depth of a contact along a ``coordinate``."""
    along, load = UNIT[coordinate], LOAD[coordinate]
    if any({part.tag for part in entry} != {along, load} for entry in element):
        message = f"along this coordinate its entries have <{along}> and <{load}>; give these"
        reader.faults.add(element, message)
        return Law("linear", (0.0, 1.0, 0.0, 0.0))
    return read_table(element, (along, along), (load, load), reader)


def _stiffness(element: Element, power: float, coordinate: str, reader: Reader) -> float:
    """Return the stiffness [N/m^n, or N m/rad^n] of a contact with the exponent n = ``power``."""
    if power == 1.0:
        return reader.number(element, QUANTITIES[coordinate][0])
    load, along = DEFAULTS[reader.unit_system][LOAD[coordinate]], UNIT[coordinate]
    base = DEFAULTS[reader.unit_system][along]
    if element.get("units"):
        message = f"with the exponent {power:g} it is in {load}/{base}^{power:g}; delete units"
        reader.faults.add(element, message)
        return 1.0
    if abs(power) > LARGEST_EXPONENT:
        return 1.0  # the exponent is a fault
    value = reader.number(element) * to_si(1.0, load, LOAD[coordinate])
    return reader.limited(element, value / to_si(1.0, base, along) ** power)


def _friction(element: Element, reader: Reader) -> tuple[float, float | None]:
    """Return the coefficients of friction of a contact that slides and of one that sticks."""
    grip = _number_or_none(element, "staticFriction", reader)
    return reader.number(element.find("friction")), grip


def _number_or_none(element: Element, tag: str, reader: Reader, quantity: str = "") -> float | None:
    part = element.find(tag)
    return None if part is None else reader.number(part, quantity)


def _range(element: Element, quantity: str, reader: Reader) -> tuple[float | None, float | None]:
    """Return both ends of a range; None where one is not given."""
    lower, upper = element.find("lower"), element.find("upper")
    return (
        None if lower is None else reader.number(lower, quantity),
        None if upper is None else reader.number(upper, quantity),
    )
