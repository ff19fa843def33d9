"""Reader of sets of bodies that may touch each other: one element -> a contact for each pair."""

from collections.abc import Iterator
from itertools import combinations

from msahl.algebra.vector import IDENTITY, Vector, add, axpy
from msahl.check.context import INERTIAL
from msahl.check.directions import frame
from msahl.deck.faults import Element, text
from msahl.deck.values import Reader
from msahl.model.box_parts import corners_of
from msahl.model.contacts import (
    BoxContact,
    BoxesContact,
    CapsuleContact,
    Compliance,
    Contact,
    PlaneContact,
    SphereContact,
)
from msahl.records import record

CONTACT_SET = "contactSet"
"""Tag of a set."""
_SPHERE = 3
"""Rank of a sphere."""


@record
class _Member:
    """A sphere of a ``body`` with a ``radius`` [m], a capsule with an ``axis`` and the ``half``
    length [m] as well, a box with half ``sizes`` [m], or a plane with a ``normal``, by its
    ``point`` [m]; all in the axes of the body.
    """

    element: Element
    label: str
    body: str
    point: Vector
    radius: float = 0.0
    normal: Vector | None = None
    axis: Vector | None = None
    half: float = 0.0
    sizes: Vector | None = None

    @property
    def rank(self) -> int:
        """Which of two members is the parent: planes before boxes, these before capsules, and
        these before spheres.
        """
        given = (self.normal, self.sizes, self.axis)
        return next((k for k, one in enumerate(given) if one is not None), len(given))

    @property
    def ends(self) -> list[Vector]:
        """Where the middles of the spheres are that are nearest to a plane (body's axes) [m]."""
        if self.sizes is not None:
            return [add(self.point, corner) for corner in corners_of(self.sizes)]
        if self.axis is None:
            return [self.point]
        return [axpy(sign * self.half, self.axis, self.point) for sign in (-1.0, 1.0)]


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
    if one.normal is not None:
        points = other.ends
        for k, point in enumerate(points, start=1):
            at_end = (one.body, other.body, one.point, point)
            name = label if len(points) == 1 else f"{label}.{k}"
            yield PlaneContact(name, *at_end, one.normal, other.radius, *law)
    elif one.sizes is not None and other.rank == _SPHERE:
        yield BoxContact(label, *ends, one.sizes, one.radius, other.radius, *law)
    elif one.sizes is not None:
        own = other.sizes or (0.0, 0.0, other.half)
        axes = IDENTITY if other.axis is None else frame(other.axis)
        yield BoxesContact(label, *ends, one.sizes, own, one.radius, other.radius, *law, axes)
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
    found = [one for tag in ("sphere", "capsule", "box", "plane") for one in element.iterfind(tag)]
    bodies = [text(one.find("name")) for one in found]
    for k, (one, body) in enumerate(zip(found, bodies, strict=True)):
        if not reader.is_known(body):
            continue
        label = body if bodies.count(body) == 1 else f"{body}.{bodies[:k].count(body) + 1}"
        point = reader.vector(one.find("position"), own=body, wanted=body)
        direction = None
        if one.tag in ("capsule", "plane"):
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
        half, sizes = 0.0, None
        if one.tag == "box":
            sizes = half_sizes(one, reader)
        if one.tag == "capsule":
            half = 0.5 * reader.number(one.find("length"), "length")
            if half <= 0.0:
                message = f"length: it is {2.0 * half:g} m; it must be greater than zero"
                reader.faults.add(one, message)
        yield _Member(*(one, label, body, point), radius, axis=direction, half=half, sizes=sizes)


def half_sizes(box: Element, reader: Reader) -> Vector:
    """Return half the sizes of a box [m]."""
    x, y, z = sizes = reader.numbers(box, ("x", "y", "z"), "length")
    for tag, size in zip(("x", "y", "z"), sizes, strict=True):
        if size < 0.0:
            reader.faults.add(box, f"{tag} is {size:g} m; it must not be less than zero")
    return 0.5 * x, 0.5 * y, 0.5 * z
