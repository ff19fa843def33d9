"""Parts of a contact of two boxes: corners against boxes, and edges against edges.

Where two convex bodies with rounded edges are nearest to each other, a corner of one is nearest to
the other box, or two edges cross. So the least of the distances of all parts is that of the boxes,
and a face on a face or an edge on a face touches at the corners, and where edges cross, that span
what they have in common.

Where two edges are nearest at an end of one, or are parallel, the corner there is as near, and
these edges add nothing: contacts of theirs close where they cross only.
"""

from collections.abc import Iterator
from itertools import product
from typing import Any

from msahl.algebra.vector import IDENTITY, Matrix, Vector, add, times, transpose
from msahl.model.contacts import BoxContact, BoxesContact, CapsuleContact

Part = BoxContact | CapsuleContact
Edge = tuple[Vector, Vector, float]
"""Middle and direction (axes of the box), and half length [m]."""


def parts_of(contact: BoxesContact) -> Iterator[Part]:
    """Yield the parts, called ``NAME.corner1`` of the child's corners, ``NAME.parentCorner1`` of
    the parent's, and ``NAME.edge1.edge1`` of an edge of the parent and one of the child.
    """
    name, law = contact.name, _law(contact)
    own, of_parent = (contact.child_point, contact.axes), (contact.parent_point, IDENTITY)
    radii = (contact.parent_radius, contact.radius)
    ends = (contact.parent, contact.child, contact.parent_point)
    for k, corner in enumerate(corners_of(contact.half), start=1):
        at = _placed(corner, *own)
        yield BoxContact(f"{name}.corner{k}", *ends, at, contact.parent_half, *radii, **law)
    ends = (contact.child, contact.parent, contact.child_point)
    for k, corner in enumerate(corners_of(contact.parent_half), start=1):
        at, given = _placed(corner, *of_parent), {**law, "axes": contact.axes}
        yield BoxContact(f"{name}.parentCorner{k}", *ends, at, contact.half, *radii[::-1], **given)
    bodies = (contact.parent, contact.child)
    for i, one in enumerate(edges_of(contact.parent_half), start=1):
        for j, other in enumerate(edges_of(contact.half), start=1):
            points = _placed(one[0], *of_parent), _placed(other[0], *own)
            axes, sizes = (one[1], _rotated(other[1], contact.axes)), (one[2], other[2])
            label = f"{name}.edge{i}.edge{j}"
            yield CapsuleContact(label, *bodies, *points, *axes, *sizes, *radii, **law)


def corners_of(half: Vector) -> list[Vector]:
    """Return the different corners of a box of these ``half`` sizes about its middle [m]."""
    return [(x, y, z) for x, y, z in product(*(sorted({-h, h}) for h in half))]


def edges_of(half: Vector) -> list[Edge]:
    """Return its edges, those along its x first."""
    found = []
    for i, axis in enumerate(IDENTITY):
        x, y, z = (0.0 if k == i else h for k, h in enumerate(half))
        if half[i] > 0.0:
            found += [(middle, axis, half[i]) for middle in corners_of((x, y, z))]
    return found


def _law(contact: BoxesContact) -> dict[str, Any]:
    names = ("restitution", "friction", "static_friction")
    return {name: getattr(contact, name) for name in names}


def _placed(a: Vector, point: Vector, axes: Matrix) -> Vector:
    """Return a place in a box, from its middle along its axes, in those of the body."""
    return add(point, _rotated(a, axes))


def _rotated(a: Vector, axes: Matrix) -> Vector:
    """Return a vector along the axes of a box in those of the body, to the last digit where these
    are the same.
    """
    return a if axes == IDENTITY else times(transpose(axes), a)
