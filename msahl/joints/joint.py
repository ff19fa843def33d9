"""A joint as the deck gives it, and the words in which each kind states its equations.

A joint has a point and a frame on either body. z of the frame is the joint's axis (the normal of a
plane, the direction of an edge); x and y complete it. A kind is a list of equations between the
two, built from coinciding points and from coordinates (``elements.constraints``); its multipliers
make up the reaction. Sources: Hainge 2010, figure 1.2, for the names; Nikravesh, Computer-Aided
Analysis of Mechanical Systems (1988), chapter 7, for equations of this form.
"""

from collections.abc import Callable
from typing import NamedTuple

from msahl.algebra.vector import IDENTITY, Matrix, Vector, scale
from msahl.elements.constraints.coordinate_kinds import ANGLE, PLAIN, RADIUS, ROUND, SKEW
from msahl.elements.constraints.curves import CURVE, CURVE_SLIP
from msahl.elements.constraints.products import DOT, ROLL, SLIDE, SLIP
from msahl.elements.constraints.segments import SEGMENTS
from msahl.model.curves import Curve
from msahl.model.joints import Joint
from msahl.records import record

X, Y, Z = range(3)
PARENT, CHILD, GROUND = "parent", "child", "ground"


@record
class Surface:
    """A sphere of the child of this ``radius`` [m], less than zero inside of what is hollow, and
    the ``shape`` of the parent, of a box with ``half`` sizes [m]; ``second`` marks the second
    tangent: see ``surfaces``. Or the rim of a disk of that radius."""

    shape: int
    radius: float
    second: bool
    half: Vector | None = None


@record
class Product:
    """A scalar product between the joint's points; ``n`` is fixed in ``owner``, ``e`` in the child.

    ``up`` takes the parent's point's place in a ROLL, ``surface`` belongs to a SURFACE.
    """

    kind: int
    n: Vector
    owner: str = PARENT
    e: Vector = (0.0, 0.0, 0.0)
    up: Vector | None = None
    surface: Surface | None = None


@record
class Coordinate:
    """A coordinate between parent and child, of some products; ``angular`` if it is in radians.

    ``curve`` is the one from which a distance, or along which a slip, is measured, and ``ends``
    are the half lengths of two segments [m].
    """

    kind: int
    products: tuple[Product, ...]
    angular: bool = False
    radius: float = 0.0
    curve: Curve | None = None
    ends: tuple[float, float] = (0.0, 0.0)


@record
class Equation:
    """A constraint equation: ``first`` + ``coefficient`` ``second`` = ``value``; None is its value
    at t = 0.

    ``rate`` marks an equation between rates, which has no position law to be checked or assembled.
    """

    first: Coordinate
    value: float | None = 0.0
    second: Coordinate | None = None
    coefficient: float = 0.0
    rate: bool = False


class TreeAxis(NamedTuple):
    """An axis of the joint's frame along which, or about which, the child moves."""

    slides: bool
    axis: int  # X, Y or Z
    owner: str = PARENT  # in whose frame it is fixed


@record
class Coincide:
    """The joint's two points are one."""


Equations = list[Coincide | Equation]


@record
class Kind:
    """A kind of joint.

    ``axes`` says which the deck must give: 0 none, 1 one that both sides share at t = 0 (the
    equations keep the two parallel or use only one of them), 2 one a side; ``faces`` whether the
    child's points against the parent's at t = 0.
    ``parameters`` are (name, unit, default or None, lower bound); ``coordinates`` are those that
    prescribed motions, springs, couplings and friction can act along; ``pose`` are those that
    determine where the child is relative to the parent (see ``joints.coordinates``), None if the
    joint has no such coordinates. ``on_ground`` marks equations
    between rates that are valid only if the parent is a ground; ``bearing`` marks those whose
    friction follows from their reaction. ``glyph`` is what pictures draw, "" by what the equations
    prevent (see ``joints.kind_properties``): ``contact`` is a ring about the child's point,
    ``knife`` a blade at a right angle to the axis, ``roll`` nothing. ``solid`` is the round part
    that a side has whose radius is a parameter, ``parentRadius``, or ``childRadius`` or
    ``radius``: "cylinder", "sphere" or "disc", "" for none. ``tree`` lists the axes of joint
    coordinates, in the order in which they act: their motions satisfy all equations, and no others
    do. None if the joint has no such coordinates.
    """

    name: str
    equations: Callable[[Joint], Equations]
    axes: int = 0
    parameters: tuple[tuple[str, str, float | None, float], ...] = ()
    coordinates: tuple[str, ...] = ()
    pose: tuple[str, ...] | None = None
    moment: bool = True
    on_ground: bool = False
    faces: bool = False
    bearing: bool = False
    glyph: str = ""
    solid: str = ""
    tree: tuple[TreeAxis, ...] | None = None


HINGE, SLIDE_AXIS = TreeAxis(False, Z), TreeAxis(True, Z)


def perpendicular(d: Vector, e: Vector) -> Equation:
    """A direction ``d`` of the parent stays at a right angle to a direction ``e`` of the child."""
    return Equation(Coordinate(PLAIN, (Product(DOT, d, e=e),), angular=True))


def parallel_axes(joint: Joint) -> Equations:
    """The axes stay parallel: two equations."""
    axis = joint.child_axes[Z]
    return [perpendicular(joint.parent_axes[X], axis), perpendicular(joint.parent_axes[Y], axis)]


def no_rotation(joint: Joint) -> Equations:
    """No relative rotation: three equations."""
    twist = perpendicular(joint.parent_axes[X], joint.child_axes[Y])
    return [*parallel_axes(joint), twist]


def on_axis(joint: Joint) -> Equations:
    """The child's point stays on the parent's axis: two equations."""
    return [in_plane(joint.parent_axes[X]), in_plane(joint.parent_axes[Y])]


def in_plane(normal: Vector, offset: float = 0.0) -> Equation:
    """The child's point stays at ``offset`` [m] above a plane of the parent through its point."""
    return Equation(Coordinate(PLAIN, (Product(SLIDE, normal),)), offset)


def slide(joint: Joint) -> Coordinate:
    """Displacement of the child's point along the parent's axis [m]."""
    return Coordinate(PLAIN, (Product(SLIDE, joint.parent_axes[Z]),))


def angle(joint: Joint) -> Coordinate:
    """Rotation of the child about the parent's axis, counted over all revolutions [rad]."""
    sine = Product(DOT, joint.parent_axes[Y], e=joint.child_axes[X])
    cosine = Product(DOT, joint.parent_axes[X], e=joint.child_axes[X])
    return Coordinate(ANGLE, (sine, cosine), angular=True)


def distance() -> Coordinate:
    """Distance of the two points [m]."""
    return Coordinate(RADIUS, tuple(Product(SLIDE, axis, GROUND) for axis in IDENTITY))


def axis_distance(joint: Joint) -> Coordinate:
    """Distance of the child's point from the parent's axis [m]."""
    x, y, _ = joint.parent_axes
    return distance_across(x, y)


def distance_across(x: Vector, y: Vector) -> Coordinate:
    """Distance of the child's point from the line through the parent's point that is normal to the
    perpendicular unit vectors ``x`` and ``y`` of the parent [m].
    """
    return Coordinate(RADIUS, (Product(SLIDE, x), Product(SLIDE, y)))


def box_distance(axes: Matrix, half: Vector) -> Coordinate:
    """Distance of the child's point from a box about the parent's, along its ``axes``, of these
    ``half`` sizes [m]; it is zero inside.
    """
    sides = zip(axes, half, strict=True)
    return Coordinate(RADIUS, tuple(Product(SLIDE, a, e=(h, 0.0, 0.0)) for a, h in sides))


def skew_distance(joint: Joint, distance: float) -> Coordinate:
    """Distance of the two axes less ``distance`` [m], times the square of their angle's sine."""
    products = _of_two_axes(joint.parent_axes[Z], joint.child_axes[Z])
    return Coordinate(SKEW, products, radius=distance)


def segment_distance(d: Vector, e: Vector, ends: tuple[float, float]) -> Coordinate:
    """Distance of two segments about the points, along the axes ``d`` of the parent and ``e`` of
    the child, ``ends`` from their middles to their ends [m].
    """
    return Coordinate(SEGMENTS, _of_two_axes(d, e), ends=ends)


def _of_two_axes(d: Vector, e: Vector) -> tuple[Product, ...]:
    """Products between the points, and an axis ``d`` of the parent and ``e`` of the child."""
    across = tuple(Product(SLIDE, axis, GROUND) for axis in IDENTITY)
    return (*across, Product(SLIDE, d), Product(SLIDE, e, CHILD), Product(DOT, d, e=e))


def rim_height(normal: Vector, axis: Vector, radius: float) -> Coordinate:
    """Height of the lowest point of a disk about the child's ``axis`` above the parent's plane with
    this ``normal`` [m].
    """
    products = (Product(SLIDE, normal), Product(DOT, normal, e=axis))
    return Coordinate(ROUND, products, radius=radius)


def curve_distance(x: Vector, y: Vector, curve: Curve) -> Coordinate:
    """Distance of the child's point from a ``curve`` of the parent about the parent's point, in the
    plane of its perpendicular unit vectors ``x`` and ``y`` [m].
    """
    return Coordinate(CURVE, (Product(SLIDE, x), Product(SLIDE, y)), curve=curve)


def curve_slip(axes: Matrix, curve: Curve, radius: float, reference: Vector) -> Equation:
    """A pin of this ``radius`` about the child's point does not slip along a ``curve`` of the
    parent in the plane of the first two ``axes``; ``reference`` is a direction of the child in it.
    """
    x, y, _ = axes
    products: tuple[Product, ...] = (Product(SLIDE, x), Product(SLIDE, y))
    if radius > 0.0:
        products += (Product(DOT, y, e=reference), Product(DOT, x, e=reference))
    return Equation(Coordinate(CURVE_SLIP, products, radius=radius, curve=curve), rate=True)


def slip(direction: Vector, owner: str = PARENT) -> Equation:
    """The child's point does not move along ``direction`` relative to the parent's."""
    return Equation(Coordinate(PLAIN, (Product(SLIP, direction, owner),)), rate=True)


def roll(normal: Vector, axis: Vector, direction: Vector, radius: float) -> Equation:
    """The lowest point of a disk about the child's ``axis`` does not move along ``direction`` in
    the parent's plane with this ``normal``. A sphere is a disk without an axis: ``ZERO``.
    """
    product = Product(ROLL, direction, e=axis, up=scale(radius, normal))
    return Equation(Coordinate(PLAIN, (product,)), rate=True)
