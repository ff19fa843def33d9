"""Vectors, matrices and rotations whose components are lanes (``jit.lanes``), as tuples of them.

The functions of ``vector`` again, for components of another type. Rotations are unit quaternions
(cos(phi/2), u sin(phi/2)), which need no trigonometric function but those of half an angle.
"""

import math

import numpy as np

from msahl.algebra.vector import Vector
from msahl.jit.kernel import kernel
from msahl.jit.lanes import Lanes, load, spread, store

LaneVector = tuple[Lanes, Lanes, Lanes]
LaneMatrix = tuple[LaneVector, LaneVector, LaneVector]
LaneQuaternion = tuple[Lanes, Lanes, Lanes, Lanes]

MAX_ANGLE = 3.2
"""Largest angle [rad] of which ``half_angle`` computes sine and cosine to round-off."""
SINE = tuple(1.0 / math.factorial(n) for n in (15, 13, 11, 9, 7, 5, 3, 1))
COSINE = tuple(1.0 / math.factorial(n) for n in (16, 14, 12, 10, 8, 6, 4, 2, 0))
"""Coefficients of their series, the last ones first; the next terms are below 1e-16 there."""


@kernel
def vector_at(array: np.ndarray, k: int) -> LaneVector:
    """Rows ``k`` to ``k + 2`` of an array (n, LANES) as a vector."""
    return (load(array, k), load(array, k + 1), load(array, k + 2))


@kernel
def put_vector(array: np.ndarray, k: int, a: LaneVector) -> None:
    """Store the vector ``a`` in array ``k`` to ``k + 2``."""
    store(array, k, a[0])
    store(array, k + 1, a[1])
    store(array, k + 2, a[2])


@kernel
def accumulate_vector(array: np.ndarray, k: int, a: LaneVector) -> None:
    """Add the vector ``a`` to array ``k`` to ``k + 2``."""
    put_vector(array, k, sum_of(vector_at(array, k), a))


@kernel
def matrix_at(array: np.ndarray, k: int) -> LaneMatrix:
    """Rows ``k`` to ``k + 8`` as a matrix."""
    return (vector_at(array, k), vector_at(array, k + 3), vector_at(array, k + 6))


@kernel
def quaternion_at(array: np.ndarray, k: int) -> LaneQuaternion:
    """Rows ``k`` to ``k + 3`` as a quaternion."""
    return (load(array, k), load(array, k + 1), load(array, k + 2), load(array, k + 3))


@kernel
def put_quaternion(array: np.ndarray, k: int, e: LaneQuaternion) -> None:
    """Store the quaternion ``e`` in array ``k`` to ``k + 3``."""
    store(array, k, e[0])
    store(array, k + 1, e[1])
    store(array, k + 2, e[2])
    store(array, k + 3, e[3])


@kernel
def integral(rates: np.ndarray, k: int, weights: np.ndarray, h: float) -> Lanes:
    """``h`` times the sum over j of the entries (k, j) of ``rates``, each with row j of the
    ``weights`` (s, LANES).
    """
    value = (h * rates[k, 0]) * load(weights, 0)
    for j in range(1, weights.shape[0]):
        value = value + (h * rates[k, j]) * load(weights, j)
    return value


@kernel
def sum_of(a: LaneVector, b: LaneVector) -> LaneVector:
    """``a + b``."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def difference(a: LaneVector, b: LaneVector) -> LaneVector:
    """``a - b``."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def multiple(c: Lanes, a: LaneVector) -> LaneVector:
    """``c a``."""
    return (c * a[0], c * a[1], c * a[2])


@kernel
def dot(a: LaneVector, b: LaneVector) -> Lanes:
    """``a . b``."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: LaneVector, b: LaneVector) -> LaneVector:
    """``a x b``."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def times(M: LaneMatrix, a: LaneVector) -> LaneVector:
    """``M a``; either may be of plain numbers."""
    return (dot(M[0], a), dot(M[1], a), dot(M[2], a))


@kernel
def transposed_times(M: LaneMatrix, a: LaneVector) -> LaneVector:
    """``M^T a``."""
    return (
        M[0][0] * a[0] + M[1][0] * a[1] + M[2][0] * a[2],
        M[0][1] * a[0] + M[1][1] * a[1] + M[2][1] * a[2],
        M[0][2] * a[0] + M[1][2] * a[1] + M[2][2] * a[2],
    )


@kernel
def spread_vector(a: Vector) -> LaneVector:
    """The vector ``a`` of plain numbers in every lane."""
    return (spread(a[0]), spread(a[1]), spread(a[2]))


@kernel
def half_angle(angle: Lanes) -> tuple[Lanes, Lanes]:
    """Sine and cosine of half the ``angle``, up to ``MAX_ANGLE``, by their series at a quarter."""
    x = 0.25 * angle
    z = x * x
    s = spread(SINE[0])
    for coefficient in SINE[1:]:
        s = coefficient - z * s
    c = spread(COSINE[0])
    for coefficient in COSINE[1:]:
        c = coefficient - z * c
    s = x * s
    return 2.0 * s * c, 1.0 - 2.0 * s * s


@kernel
def rotated(e: LaneQuaternion, a: Vector, sine: Lanes, cosine: Lanes) -> LaneQuaternion:
    """The rotation ``e`` after one about the unit vector ``a``, of the half angle whose ``sine``
    and ``cosine`` are given.
    """
    w, x, y, z = e
    return (
        cosine * w - sine * (x * a[0] + y * a[1] + z * a[2]),
        cosine * x + sine * (w * a[0] + y * a[2] - z * a[1]),
        cosine * y + sine * (w * a[1] + z * a[0] - x * a[2]),
        cosine * z + sine * (w * a[2] + x * a[1] - y * a[0]),
    )


@kernel
def rotation_change(e: LaneQuaternion, a: Vector) -> LaneVector:
    """Change of the vector ``a`` by the rotation ``e``."""
    axis = (e[1], e[2], e[3])
    t = cross(axis, a)
    t = (2.0 * t[0], 2.0 * t[1], 2.0 * t[2])
    return sum_of(multiple(e[0], t), cross(axis, t))


@kernel
def matrix_of(e: LaneQuaternion) -> LaneMatrix:
    """Matrix of the rotation by the quaternion ``e``."""
    w, x, y, z = e
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz = x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    return (
        (1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy)),
        (2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx)),
        (2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy)),
    )
