"""Sides of contacts: the ends of the ranges that coordinates of the motion do not leave.

Each has a gap that is zero at the end and never negative:

    lower:  q - limit >= 0        upper:  limit - q >= 0

A contact of two boxes has one for each pair of corners, edges and boxes that may touch.
"""

from collections import Counter
from collections.abc import Iterable

from msahl.model.box_parts import parts_of
from msahl.model.contacts import (
    BoxContact,
    BoxesContact,
    CapsuleContact,
    Contact,
    JointLimit,
    PinContact,
    PlaneContact,
    SphereContact,
)
from msahl.records import record

ENDS = ("lower", "upper")
OF_A_FACE = 3
"""Contacts between two bodies that may share their forces in many ways: three in a plane do where
they are on a line, four in space where they are in a plane."""


@record
class ContactSide:
    """One side of a ``contact``, which belongs to the one of the model that is called ``of``. Of a
    range with two ends the name has the end behind a point. ``between_edges`` says that it is that
    of two edges of boxes, whose corners have sides as well.
    """

    name: str
    contact: Contact
    is_lower: bool
    limit: float  # [m or rad]
    of: str
    between_edges: bool = False

    @property
    def sign(self) -> float:
        """Return 1 if the gap is larger where the coordinate is, -1 if it is smaller."""
        return 1.0 if self.is_lower else -1.0

    @property
    def is_angle(self) -> bool:
        """Return whether the coordinate is an angle."""
        return isinstance(self.contact, JointLimit) and self.contact.coordinate == "angle"


def sides_of(contact: Contact) -> tuple[ContactSide, ...]:
    """Return the sides of a contact, the lower one first."""
    if isinstance(contact, BoxesContact):
        limit = contact.parent_radius + contact.radius
        return tuple(
            ContactSide(
                *(part.name, part, True, limit, contact.name), isinstance(part, CapsuleContact)
            )
            for part in parts_of(contact)
        )
    given = [(lower, limit) for lower, limit in _limits(contact) if limit is not None]
    names = [contact.name] if len(given) == 1 else [f"{contact.name}.{end}" for end in ENDS]
    return tuple(
        ContactSide(name, contact, *end, contact.name)
        for name, end in zip(names, given, strict=False)
    )


def _limits(contact: Contact) -> tuple[tuple[bool, float | None], ...]:
    """Return whether each end is a lower one, and where it is [m or rad]."""
    if isinstance(contact, PlaneContact):
        return ((True, contact.radius if contact.axis is None else 0.0),)
    if isinstance(contact, SphereContact):
        limit = abs(contact.parent_radius + contact.radius)
        return ((contact.parent_radius >= 0.0, limit),)
    if isinstance(contact, BoxContact | CapsuleContact | BoxesContact):
        return ((True, contact.parent_radius + contact.radius),)
    if isinstance(contact, PinContact):
        return ((True, contact.radius),)
    return (True, contact.lower), (False, contact.upper)


def may_share(sides: Iterable[ContactSide]) -> bool:
    """Return whether two bodies touch at so many of the ``sides`` as faces do."""
    contacts = [side.contact for side in sides]
    pairs = Counter(
        frozenset((c.parent, c.child)) for c in contacts if not isinstance(c, JointLimit)
    )
    return max(pairs.values(), default=0) >= OF_A_FACE
