"""Directions and frames of joints, as they stand in the inertial axes at t = 0.

A frame is built in the inertial axes first and then expressed in the bodies' axes, so that a joint
along a coordinate direction has only zeros and ones there: a planar model stays exactly planar.
"""

import sys
from functools import lru_cache

from msahl.algebra.many import hypot, largest, nearest
from msahl.algebra.vector import IDENTITY, Matrix, Vector, axpy, cross, dot, scale

EXACT = 4 * sys.float_info.epsilon
"""A component of a unit vector below this is the rounding error of a rotation, and zero."""

PARALLEL = 1e-6
"""Sine of the angle below which two directions count as one: decks are typed with 6-7 digits."""


SIMILAR = 100
"""Results that are kept: many joints have the same axes."""


def unit(a: Vector) -> Vector:
    """Return ``a`` with length one, exactly along a coordinate direction if it is so but for
    rounding."""
    # By the largest component first: the square of a tiny number is zero, of a huge one infinite.
    a = scale(1.0 / largest(*map(abs, a)), a)
    return clean(scale(1.0 / hypot(*a), a))


def clean(a: Vector) -> Vector:
    """Return a unit vector without components that are rounding errors; -0.0 becomes 0.0."""
    x, y, z = a
    x = x if abs(x) > EXACT else 0.0
    y = y if abs(y) > EXACT else 0.0
    z = z if abs(z) > EXACT else 0.0
    if (x, y, z).count(0.0) == 2:
        return (nearest(x), nearest(y), nearest(z))
    return (x, y, z)


def sine(a: Vector, b: Vector) -> float:
    """Return the sine of the angle between two unit vectors."""
    found: float = hypot(*cross(a, b))
    return found


def frame(z: Vector, reference: Vector | None = None) -> Matrix:
    """Return the rows x, y, z: x is ``reference`` (a direction that is not z) made perpendicular to
    z, or by default the coordinate direction least along z."""
    if reference is None:
        reference = IDENTITY[min(range(3), key=lambda i: abs(z[i]))]
    x = unit(axpy(-dot(reference, z), z, reference))
    return (x, unit(cross(z, x)), z)


def smallest_rotation(a: Vector, b: Vector, x: Vector) -> Vector:
    """Return ``x`` rotated by the smallest rotation that takes the unit vector ``a`` to ``b``.

    Where they are opposite it is the half revolution about the x of ``frame(b)``.
    """
    if a == b:
        return x
    axis = cross(a, b)
    if dot(a, b) < 0.0 and hypot(*axis) < PARALLEL:
        n = frame(b)[0]
        return axpy(2.0 * dot(n, x), n, scale(-1.0, x))
    once = cross(axis, x)
    return axpy(1.0 / (1.0 + dot(a, b)), cross(axis, once), axpy(1.0, once, x))


def perpendicular_part(a: Vector, z: Vector) -> Vector | None:
    """Return the unit vector along ``a`` made perpendicular to ``z``; None if they are parallel."""
    return None if sine(a, z) < PARALLEL else unit(axpy(-dot(a, z), z, a))


@lru_cache(SIMILAR)
def shared_references(
    parent_axis: Vector, child_axis: Vector, parent: Vector | None, child: Vector | None
) -> tuple[Vector, Vector]:
    """Return the reference directions of a joint whose axes stay parallel, each in its own body's
    axes as all arguments are; ``parent`` and ``child`` are those given.

    Unless both are given, coordinates are zero where the smallest rotation that makes the axes
    parallel takes the child's own axes to the parent's. If the axis has the same components on both
    sides, the bodies' own axes are parallel there.
    """
    if parent is None and child is not None:
        parent = smallest_rotation(child_axis, parent_axis, child)
    if parent is None:
        parent = frame(parent_axis)[0]
    if child is None:
        child = smallest_rotation(parent_axis, child_axis, parent)
    return frame(parent_axis, parent)[0], frame(child_axis, child)[0]


@lru_cache(SIMILAR)
def crossed_references(
    parent_axis: Vector, child_axis: Vector, parent: Vector | None, child: Vector | None
) -> tuple[Vector, Vector]:
    """Return the reference directions of a universal joint, as ``shared_references`` does.

    A direction that is not given is that of the other side's axis where the smallest rotation of
    the child makes the axes perpendicular. If they are perpendicular by their components, both
    angles are zero where the bodies' own axes are parallel.
    """
    parent = parent or perpendicular_part(child_axis, parent_axis)
    child = child or perpendicular_part(parent_axis, child_axis)
    return frame(parent_axis, parent)[0], frame(child_axis, child)[0]


def facing_back(axes: Matrix) -> Matrix:
    """Return the frame with y and z reversed."""
    x, y, z = axes
    return (x, clean(scale(-1.0, y)), clean(scale(-1.0, z)))
