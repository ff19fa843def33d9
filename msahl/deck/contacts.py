"""Reader of contacts: elements -> records."""

from msahl.check.contacts import contact_findings, overlap_findings
from msahl.check.context import INERTIAL
from msahl.deck.ends import is_placed, read_ends, side_direction
from msahl.deck.faults import Element, text
from msahl.deck.motions import UNIT
from msahl.deck.values import Reader
from msahl.model.contacts import Contact, DistanceLimit, JointLimit, PlaneContact

CONTACTS = ("jointLimit", "distanceLimit", "planeContact")
"""Tags of contacts."""


def read_contact(element: Element, reader: Reader) -> Contact:
    """Return the record of a contact of any kind."""
    if element.tag == "jointLimit":
        contact: Contact = _joint_limit(element, reader)
        reader.add(element, contact_findings(contact, reader.context))
        return contact
    ends, name = read_ends(element, reader), text(element.find("name"))
    points = (ends.parent, ends.child, ends.parent_point, ends.child_point)
    restitution = reader.number(element.find("restitution"))
    if element.tag == "distanceLimit":
        lower, upper = _range(element, "length", reader)
        contact = DistanceLimit(name, *points, lower, upper, restitution)
    else:
        normal = side_direction(element, "parent", "normal", reader) or (0.0, 0.0, 1.0)
        if reader.is_known(ends.parent):
            normal = reader.context.rotated(normal, INERTIAL, ends.parent)
        radius = reader.number(element.find("radius"), "length")
        contact = PlaneContact(
            *(name, *points, normal, radius, restitution),
            friction=reader.number(element.find("friction")),
            static_friction=_number_or_none(element, "staticFriction", reader),
        )
    reader.add(element, contact_findings(contact, reader.context))
    if is_placed(element, ends, reader):
        reader.add(element, overlap_findings(contact, reader.context))
    return contact


def _joint_limit(element: Element, reader: Reader) -> JointLimit:
    coordinate = text(element.find("coordinate"))
    lower, upper = _range(element, UNIT[coordinate], reader)
    return JointLimit(
        name=text(element.find("name")),
        joint=text(element.find("joint")),
        coordinate=coordinate,
        lower=lower,
        upper=upper,
        restitution=reader.number(element.find("restitution")),
    )


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
