"""Reader of sets of bodies that may touch each other: one element -> a contact for each pair."""

from collections.abc import Iterator
from itertools import combinations

from msahl.algebra.vector import Vector, axpy
from msahl.check.context import INERTIAL
from msahl.check.directions import frame
from msahl.deck.faults import Element, text
from msahl.deck.values import Reader
from msahl.model.contacts import (
    BoxContact,
    CapsuleContact,
    Compliance,
    Contact,
    PlaneContact,
    SphereContact,
)
from msahl.records import record

CONTACT_SET = "contactSet"
"""Tag of a set."""


@record
class _Member:
    """A sphere of a ``body`` with a ``radius`` [m], a capsule with an ``axis`` and the ``half``
    length [m] as well, or a plane with a ``normal``, by its ``point`` [m]; all in the axes of the
    body.
    """

    element: Element
    label: str
    body: str
    point: Vector
    radius: float = 0.0
    normal: Vector | None = None
    axis: Vector | None = None
    half: float = 0.0

    @property
    def rank(self) -> int:
        """Which of two members is the parent: planes before capsules, and these before spheres."""
        return 0 if self.normal is not None else 1 if self.axis is not None else 2


@record
class Touch:
    """What all contacts of a set do when they touch."""

    restitution: float
    compliance: Compliance | None
    friction: float
    static_friction: float | None


def pairs_of(element: Element, touch: Touch, reader: Reader) -> Iterator[tuple[Element, Contact]]:
    """Yield the contacts of a set, of all pairs of different bodies but planes, each with the
    element of its second member.
    """
    name, members = text(element.find("name")), [*_members(element, reader)]
    if not any(member.radius > 0.0 for member in members):
        reader.faults.add(element, "no <sphere> in it has a radius, so nothing touches; give one")
    for one, other in combinations(members, 2):
        if one.body == other.body or (one.normal and other.normal):
            continue
        if one.rank > other.rank:
            one, other = other, one
        for contact in _contacts(f"{name}.{one.label}.{other.label}", one, other, touch):
            yield other.element, contact


def _contacts(label: str, one: _Member, other: _Member, touch: Touch) -> Iterator[Contact]:
    """Yield the contacts of two members, the first of which has the lower rank."""
    law = (touch.restitution, touch.compliance, touch.friction, touch.static_friction)
    ends = (one.body, other.body, one.point, other.point)
    if one.normal is not None and other.axis is not None:
        for k, sign in ((1, -1.0), (2, 1.0)):
            end = axpy(sign * other.half, other.axis, other.point)
            at_end = (one.body, other.body, one.point, end)
            yield PlaneContact(f"{label}.{k}", *at_end, one.normal, other.radius, *law)
    elif one.normal is not None:
        yield PlaneContact(label, *ends, one.normal, other.radius, *law)
    elif one.axis is None:
        yield SphereContact(label, *ends, one.radius, other.radius, None, *law)
    elif other.axis is None:
        half, axes = (0.0, 0.0, one.half), frame(one.axis)
        yield BoxContact(label, *ends, half, one.radius, other.radius, *law, axes)
    else:
        sizes = (one.half, other.half, one.radius, other.radius)
        yield CapsuleContact(label, *ends, one.axis, other.axis, *sizes, *law)


def _members(element: Element, reader: Reader) -> Iterator[_Member]:
    """Yield the spheres, capsules and planes of a set whose bodies are known."""
    found = [one for tag in ("sphere", "capsule", "plane") for one in element.iterfind(tag)]
    bodies = [text(one.find("name")) for one in found]
    for k, (one, body) in enumerate(zip(found, bodies, strict=True)):
        if not reader.is_known(body):
            continue
        label = body if bodies.count(body) == 1 else f"{body}.{bodies[:k].count(body) + 1}"
        point = reader.vector(one.find("position"), own=body, wanted=body)
        direction = None
        if one.tag != "sphere":
            direction = reader.direction(
                one.find("axis" if one.tag == "capsule" else "normal"), body
            )
            if direction is None:
                continue
            direction = reader.context.rotated(direction, INERTIAL, body)
        if one.tag == "plane":
            yield _Member(one, label, body, point, normal=direction)
            continue
        radius = reader.number(one.find("radius"), "length")
        if radius <= 0.0:
            reader.faults.add(one, f"radius: it is {radius:g} m; it must be greater than zero")
        half = 0.0
        if one.tag == "capsule":
            half = 0.5 * reader.number(one.find("length"), "length")
            if half <= 0.0:
                message = f"length: it is {2.0 * half:g} m; it must be greater than zero"
                reader.faults.add(one, message)
        yield _Member(one, label, body, point, radius, axis=direction, half=half)
