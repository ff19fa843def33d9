"""Reader of sets of bodies that may touch each other: one element -> a contact for each pair."""

from collections.abc import Iterator
from itertools import combinations

from msahl.algebra.vector import Vector
from msahl.check.context import INERTIAL
from msahl.deck.faults import Element, text
from msahl.deck.values import Reader
from msahl.model.contacts import Compliance, Contact, PlaneContact, SphereContact
from msahl.records import record

CONTACT_SET = "contactSet"
"""Tag of a set."""


@record
class _Member:
    """A sphere of a ``body`` with a ``radius`` [m], or a plane with a ``normal``, by its ``point``
    [m]; all in the axes of the body."""

    element: Element
    label: str
    body: str
    point: Vector
    radius: float = 0.0
    normal: Vector | None = None


@record
class Touch:
    """What all contacts of a set do when they touch."""

    restitution: float
    compliance: Compliance | None
    friction: float
    static_friction: float | None


def pairs_of(element: Element, touch: Touch, reader: Reader) -> Iterator[tuple[Element, Contact]]:
    """Yield the contacts of a set, of all pairs of spheres and of spheres and planes of different
    bodies, each with the element of its sphere.
    """
    name, members = text(element.find("name")), [*_members(element, reader)]
    if not any(member.radius > 0.0 for member in members):
        reader.faults.add(element, "no <sphere> in it has a radius, so nothing touches; give one")
    law = (touch.restitution, touch.compliance, touch.friction, touch.static_friction)
    for one, other in combinations(members, 2):
        if one.body == other.body or (one.normal and other.normal):
            continue
        if one.normal is None and other.normal is not None:
            one, other = other, one
        ends = (one.body, other.body, one.point, other.point)
        label = f"{name}.{one.label}.{other.label}"
        if one.normal is not None:
            yield other.element, PlaneContact(label, *ends, one.normal, other.radius, *law)
        else:
            ball = SphereContact(label, *ends, one.radius, other.radius, None, *law)
            yield other.element, ball


def _members(element: Element, reader: Reader) -> Iterator[_Member]:
    """Yield the spheres and planes of a set whose bodies are known."""
    found = [*element.iterfind("sphere"), *element.iterfind("plane")]
    bodies = [text(one.find("name")) for one in found]
    for k, (one, body) in enumerate(zip(found, bodies, strict=True)):
        if not reader.is_known(body):
            continue
        label = body if bodies.count(body) == 1 else f"{body}.{bodies[:k].count(body) + 1}"
        point = reader.vector(one.find("position"), own=body, wanted=body)
        if one.tag == "sphere":
            radius = reader.number(one.find("radius"), "length")
            if radius <= 0.0:
                reader.faults.add(one, f"radius: it is {radius:g} m; it must be greater than zero")
            yield _Member(one, label, body, point, radius)
            continue
        direction = reader.direction(one.find("normal"), body)
        if direction is not None:
            normal = reader.context.rotated(direction, INERTIAL, body)
            yield _Member(one, label, body, point, normal=normal)
