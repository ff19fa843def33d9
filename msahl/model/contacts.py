"""Records of contacts: one-sided constraints with impacts, in SI units.

Each says that a coordinate q of the motion does not leave a range (``contact_sides``). A contact
with a ``compliance`` gives way instead: a gap of less than zero is a depth, by which it pushes
(``laws.contact``).
"""

from typing import TypeAlias

from msahl.algebra.functions import Law
from msahl.algebra.vector import IDENTITY, Matrix, Vector
from msahl.model.curves import Curve
from msahl.records import record

POISSON, NEWTON, STRONGE = IMPACT_LAWS = ("poisson", "newton", "stronge")


@record
class Compliance:
    """The force of a contact is ``stiffness`` [N/m^n, or N m/rad^n] times depth^``exponent``, or
    that of a linear ``table`` over the depth, which begins with zero at zero. In an impact at
    ``impact_speed`` [m/s or rad/s] it has the contact's restitution; None: it is not damped, and
    the restitution is 1. ``friction_width`` is the slip [m/s] at which three quarters of its
    friction act, None without friction."""

    stiffness: float
    exponent: float = 1.0
    impact_speed: float | None = None
    friction_width: float | None = None
    table: Law | None = None


@record
class JointLimit:
    """The ``coordinate`` ("angle" [rad] or "slide" [m]) of ``joint`` is between ``lower`` and
    ``upper``; None: it has no such end. ``restitution`` is that of its impacts, 0 to 1."""

    name: str
    joint: str
    coordinate: str
    lower: float | None = None
    upper: float | None = None
    restitution: float = 0.0
    compliance: Compliance | None = None


@record
class DistanceLimit:
    """The distance of ``parent_point`` and ``child_point`` [m], each from the B of its body in its
    axes, is between ``lower`` and ``upper`` [m]; None: it has no such end."""

    name: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
    lower: float | None = None
    upper: float | None = None
    restitution: float = 0.0
    compliance: Compliance | None = None


@record
class PlaneContact:
    """A sphere of the child, or a point (``radius`` 0), is above a plane of the parent, through
    ``parent_point`` and with the unit vector ``normal`` (parent's axes); its centre is
    ``child_point`` [m]. With an ``axis``, a unit vector in the child's axes, it is not a sphere but
    the rim of a disk about that. ``friction`` is the coefficient of Coulomb's friction while it
    slides, ``static_friction`` that up to which it sticks, None: the same."""

    name: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
    normal: Vector
    radius: float = 0.0
    restitution: float = 0.0
    compliance: Compliance | None = None
    friction: float = 0.0
    static_friction: float | None = None
    axis: Vector | None = None


@record
class SphereContact:
    """A sphere of the child, or a point (``radius`` 0), is outside of a sphere of the parent about
    ``parent_point``; with an ``axis``, a unit vector in the parent's axes, of a cylinder about the
    line through that point. If ``parent_radius`` is negative they are hollow, and the child is
    inside. Points, radii [m] and friction as above."""

    name: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
    parent_radius: float
    radius: float = 0.0
    axis: Vector | None = None
    restitution: float = 0.0
    compliance: Compliance | None = None
    friction: float = 0.0
    static_friction: float | None = None


@record
class BoxContact:
    """A sphere of the child is outside of a box of the parent about ``parent_point``, along the
    rows of ``axes`` (parent's axes), with these ``half`` sizes and edges rounded by
    ``parent_radius``; a capsule is one with one size. Points, sizes [m] and friction as above."""

    name: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
    half: Vector
    parent_radius: float = 0.0
    radius: float = 0.0
    restitution: float = 0.0
    compliance: Compliance | None = None
    friction: float = 0.0
    static_friction: float | None = None
    axes: Matrix = IDENTITY


@record
class CapsuleContact:
    """A capsule of the child is outside of one of the parent. Each is a segment about its point,
    from one end to the other twice ``parent_half`` or ``half`` [m], along ``parent_axis`` or
    ``axis``, unit vectors in the axes of its body, with ``parent_radius`` or ``radius`` about it.
    Points, sizes [m] and friction as above."""

    name: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
    parent_axis: Vector
    axis: Vector
    parent_half: float
    half: float
    parent_radius: float
    radius: float
    restitution: float = 0.0
    compliance: Compliance | None = None
    friction: float = 0.0
    static_friction: float | None = None


@record
class BoxesContact:
    """A box of the child is outside of a box of the parent. Each is about its point, the parent's
    along the parent's axes and the child's along the rows of ``axes`` (child's axes), with half
    sizes ``parent_half`` and ``half`` between the middles of its corners, and edges and corners
    rounded by ``parent_radius`` and ``radius``; a capsule is one with one size. It is made of
    contacts between corners, edges and boxes (``box_parts``). Points, sizes [m] and friction as
    above; it is rigid.
    """

    name: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
    parent_half: Vector
    half: Vector
    parent_radius: float
    radius: float
    restitution: float = 0.0
    compliance: Compliance | None = None
    friction: float = 0.0
    static_friction: float | None = None
    axes: Matrix = IDENTITY


@record
class PinContact:
    """A pin of the child about ``child_point``, or a point (``radius`` 0), is on the free side of a
    planar ``curve`` of the parent about ``parent_point``, in the plane of the first two rows of
    ``axes`` (parent's axes). ``reference`` is a unit vector of the child in that plane, in its
    axes: the pin rotates about the plane's normal only. Points and friction as above."""

    name: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
    curve: Curve
    radius: float = 0.0
    restitution: float = 0.0
    compliance: Compliance | None = None
    friction: float = 0.0
    static_friction: float | None = None
    axes: Matrix = IDENTITY
    reference: Vector = IDENTITY[0]


WithFriction: TypeAlias = (
    PlaneContact | SphereContact | BoxContact | CapsuleContact | BoxesContact | PinContact
)
BetweenPoints: TypeAlias = DistanceLimit | WithFriction
Contact: TypeAlias = JointLimit | BetweenPoints


def friction_of(contact: Contact) -> tuple[float, float]:
    """Return the coefficients of friction of a contact that slides and of one that sticks."""
    if isinstance(contact, JointLimit | DistanceLimit):
        return 0.0, 0.0
    grip = contact.static_friction
    return contact.friction, contact.friction if grip is None else grip
