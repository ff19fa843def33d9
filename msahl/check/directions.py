"""Directions and frames of joints, as they stand in the inertial axes at t = 0.

A frame is built in the inertial axes first and then expressed in the bodies' axes, so that a joint
along a coordinate direction has only zeros and ones there: a planar model stays exactly planar.
"""

import math
import sys

from msahl.algebra.vector import IDENTITY, Matrix, Vector, axpy, cross, dot, scale

EXACT = 4 * sys.float_info.epsilon
"""A component of a unit vector below this is the rounding error of a rotation, and zero."""

PARALLEL = 1e-6
"""Sine of the angle below which two directions count as one: decks are typed with 6-7 digits."""


def unit(a: Vector) -> Vector:
    """Return ``a`` with length one, exactly along a coordinate direction if it is so but for
    rounding."""
    # By the largest component first: the square of a tiny number is zero, of a huge one infinite.
    a = scale(1.0 / max(map(abs, a)), a)
    return clean(scale(1.0 / math.hypot(*a), a))


def clean(a: Vector) -> Vector:
    """Return a unit vector without components that are rounding errors; -0.0 becomes 0.0."""
    x, y, z = (component if abs(component) > EXACT else 0.0 for component in a)
    if sum(map(bool, (x, y, z))) == 1:
        return (float(round(x)), float(round(y)), float(round(z)))
    return (x, y, z)


def sine(a: Vector, b: Vector) -> float:
    """Return the sine of the angle between two unit vectors."""
    return math.hypot(*cross(a, b))


def frame(z: Vector, reference: Vector | None = None) -> Matrix:
    """Return the rows x, y, z: x is ``reference`` (a direction that is not z) made perpendicular to
    z, or by default the coordinate direction least along z."""
    if reference is None:
        reference = IDENTITY[min(range(3), key=lambda i: abs(z[i]))]
    x = unit(axpy(-dot(reference, z), z, reference))
    return (x, unit(cross(z, x)), z)


def facing_back(axes: Matrix) -> Matrix:
    """Return the frame with y and z reversed."""
    x, y, z = axes
    return (x, clean(scale(-1.0, y)), clean(scale(-1.0, z)))
