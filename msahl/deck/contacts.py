"""Reader of contacts: elements -> records."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

from msahl.algebra.vector import Vector, add
from msahl.check.contacts import LARGEST_EXPONENT, contact_findings, overlap_findings
from msahl.check.context import INERTIAL
from msahl.check.loads import UNIT_LENGTH
from msahl.deck.ends import Ends, is_placed, read_ends, side_direction
from msahl.deck.faults import Element, text
from msahl.deck.motions import UNIT
from msahl.deck.springs import QUANTITIES
from msahl.deck.units import DEFAULTS, to_si
from msahl.deck.values import Reader
from msahl.model.contacts import (
    BetweenPoints,
    Compliance,
    Contact,
    DistanceLimit,
    JointLimit,
    PlaneContact,
    SphereContact,
)

COMPLIANT = ("exponent", "impactSpeed")
"""Tags of what only compliant contacts have."""
SPEED = {"angle": "angularVelocity", "slide": "velocity"}
LOAD = {"angle": "moment", "slide": "force"}
"""Physical quantities along each coordinate."""
CONTACTS = ("jointLimit", "distanceLimit", "planeContact", "sphereContact", "cylinderContact")
"""Tags of contacts."""


def read_contacts(elements: Sequence[Element], reader: Reader) -> Iterator[Contact]:
    """Yield the records of contacts of any kind; a box or a capsule has several."""
    names = {text(element.find("name")) for element in elements}
    for element in elements:
        for contact in _read_contact(element, reader):
            if contact.name != text(element.find("name")) and contact.name in names:
                message = (
                    f"its part '{contact.name}' has the name of another contact; choose another"
                )
                reader.faults.add(element, message)
            yield contact


def is_switchable(element: Element) -> bool:
    """Return whether events may name an element: it is no force, and has no parts."""
    return not any(element.find(tag) is not None for tag in ("stiffness", "capsuleEnd", "box"))


def _read_contact(element: Element, reader: Reader) -> list[Contact]:
    if element.tag == "jointLimit":
        limit = _joint_limit(element, reader)
        reader.add(element, contact_findings(limit, reader.context))
        return [limit]
    ends = read_ends(element, reader)
    contact = _between_points(element, ends, reader)
    reader.add(element, contact_findings(contact, reader.context))
    points = _points(element, ends, reader)
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


def _points(element: Element, ends: Ends, reader: Reader) -> list[Vector]:
    """Return the points of a capsule's ends or of a box's corners, child's axes [m]; none of a
    sphere.
    """
    other, box = element.find("capsuleEnd"), element.find("box")
    if other is not None and box is not None:
        reader.faults.add(box, "it is a capsule as well by <capsuleEnd>; delete one of them")
    if other is not None and reader.is_known(ends.child):
        return [ends.child_point, reader.vector(other, own=ends.child, wanted=ends.child)]
    if box is None:
        return []
    sizes = reader.numbers(box, ("x", "y", "z"), "length")
    for tag, size in zip(("x", "y", "z"), sizes, strict=True):
        if size < 0.0:
            reader.faults.add(box, f"{tag} is {size:g} m; it must not be less than zero")
    corners = product(*(sorted({-0.5 * size, 0.5 * size}) for size in sizes))
    return [add(ends.child_point, (x, y, z)) for x, y, z in corners]


def _between_points(element: Element, ends: Ends, reader: Reader) -> BetweenPoints:
    name, law = text(element.find("name")), _law(element, "slide", reader)
    points = (ends.parent, ends.child, ends.parent_point, ends.child_point)
    if element.tag == "distanceLimit":
        return DistanceLimit(name, *points, *_range(element, "length", reader), *law)
    radius = reader.number(element.find("radius"), "length")
    if element.tag == "planeContact":
        normal = _parents_direction(element, "normal", ends, reader)
        friction = reader.number(element.find("friction"))
        return PlaneContact(
            *(name, *points, normal, radius, *law),
            friction=friction,
            static_friction=_number_or_none(element, "staticFriction", reader),
        )
    axis = None
    if element.tag == "cylinderContact":
        axis = _parents_direction(element, "axis", ends, reader)
    parent_radius = reader.number(element.find("parentRadius"), "length")
    return SphereContact(name, *points, parent_radius, radius, axis, *law)


def _parents_direction(element: Element, tag: str, ends: Ends, reader: Reader) -> Vector:
    """Return a unit vector of the parent's end, in the parent's axes; one that is given as such,
    to the last digit.
    """
    direction = side_direction(element, "parent", tag, reader)
    if direction is None or not reader.is_known(ends.parent):
        return (0.0, 0.0, 1.0)
    given = reader.vector(element.find(f"parent/{tag}"), own=ends.parent, wanted=ends.parent)
    if abs(math.hypot(*given) - 1.0) <= UNIT_LENGTH:
        return given
    return reader.context.rotated(direction, INERTIAL, ends.parent)


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
    if stiffness is None:
        for tag in COMPLIANT:
            place = element.find(tag)
            if place is not None:
                message = f"<{tag}> is that of a compliant contact; add a <stiffness>, or delete it"
                reader.faults.add(place, message)
        return reader.number(given), None
    speed, exponent = element.find("impactSpeed"), element.find("exponent")
    power = 1.0 if exponent is None else reader.number(exponent)
    compliance = Compliance(
        stiffness=_stiffness(stiffness, power, coordinate, reader),
        exponent=power,
        impact_speed=None if speed is None else reader.number(speed, SPEED[coordinate]),
    )
    return 1.0 if given is None else reader.number(given), compliance


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


def _number_or_none(element: Element, tag: str, reader: Reader) -> float | None:
    part = element.find(tag)
    return None if part is None else reader.number(part)


def _range(element: Element, quantity: str, reader: Reader) -> tuple[float | None, float | None]:
    """Return both ends of a range; None where one is not given."""
    lower, upper = element.find("lower"), element.find("upper")
    return (
        None if lower is None else reader.number(lower, quantity),
        None if upper is None else reader.number(upper, quantity),
    )
