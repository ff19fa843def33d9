"""Rotations by Wiener-Milenkovic parameters, and by the rotation increment of a step.

    p  = 4 tan(phi/4) u        rotation by phi about the unit vector u, |p| <= 4 when rescaled
    p0 = 2 - p.p/8             4 - p0 = 2 + p.p/8
    R  = 1 + (2 p0 [p] + 2 [p][p]) / (4 - p0)^2

R takes components in the rotated axes to components in the original ones: an orientation p of a
body relative to the inertial axes gives R = R_IB. (Hainge 2010, eq. 3.1, in which two signs and a
term were lost in print, is the transpose.) p and its shadow set -16 p/(p.p) are the same
orientation; the one inside the ball |p| <= 4 is published, so no orientation is singular.

    Q = 2 tan(phi/2) u         rotation increment: the rotation over one step
    R(Q) a = a + (Q x a + Q x (Q x a)/2) / N,   N = 1 + Q.Q/4
    q(c) = c / (1 - c.c/16)    in terms of the Wiener-Milenkovic parameters c of the same rotation

Source of the composition: Bauchau and Trainelli, The vectorial parameterization of rotation,
Nonlinear Dynamics 32 (2003), with nu = 1/(1 - p.p/16).
"""

import math

from msahl.algebra.many import hypot, remainder, tan
from msahl.algebra.vector import Matrix, Vector, add, axpy, cross, dot, scale
from msahl.jit.kernel import kernel

HALF_REVOLUTION = 4.0
"""|p| of a rotation by pi, where the parameters change to their shadow set."""


@kernel
def rescaled(p: Vector) -> Vector:
    """Return the parameters of the same orientation with ``|p| <= 4``."""
    square = dot(p, p)
    if square > HALF_REVOLUTION * HALF_REVOLUTION:
        return scale(-16.0 / square, p)
    return p


@kernel
def matrix(p: Vector) -> Matrix:
    """Return ``R`` of the parameters ``p``; orthogonal to round-off for any ``p``."""
    p0 = 2.0 - 0.125 * dot(p, p)
    a = 1.0 / ((4.0 - p0) * (4.0 - p0))
    c = 2.0 * p0 * a
    s = 2.0 * a
    x, y, z = p
    return (
        (1.0 - s * (y * y + z * z), s * x * y - c * z, s * x * z + c * y),
        (s * x * y + c * z, 1.0 - s * (x * x + z * z), s * y * z - c * x),
        (s * x * z - c * y, s * y * z + c * x, 1.0 - s * (x * x + y * y)),
    )


@kernel
def compose(p: Vector, q: Vector) -> Vector:
    """Return the rescaled parameters of ``R(p) R(q)``: by ``p``, then by ``q`` in the new axes."""
    p0 = 2.0 - 0.125 * dot(p, p)
    q0 = 2.0 - 0.125 * dot(q, q)
    # Euler parameters of the product, times (4 - p0)(4 - q0); their sign picks the shadow set.
    e0 = p0 * q0 - dot(p, q)
    e = add(axpy(q0, p, scale(p0, q)), cross(p, q))
    norm = (4.0 - p0) * (4.0 - q0)
    if e0 >= 0.0:
        return scale(4.0 / (norm + e0), e)
    return scale(-4.0 / (norm - e0), e)


@kernel
def inverse(p: Vector) -> Vector:
    """Return the parameters of the inverse rotation."""
    return (-p[0], -p[1], -p[2])


@kernel
def from_increment(Q: Vector) -> Vector:
    """Return the Wiener-Milenkovic parameters of the rotation increment ``Q``, as phi < pi."""
    return scale(2.0 / (1.0 + math.sqrt(1.0 + 0.25 * dot(Q, Q))), Q)


@kernel
def to_increment(c: Vector) -> Vector:
    """Return ``Q`` of the parameters ``c``, ``|c| < 4``."""
    return scale(1.0 / (1.0 - dot(c, c) / 16.0), c)


@kernel
def angle_share(Q: Vector) -> tuple[float, float]:
    """Return ``psi``, with ``psi Q = phi u`` the rotation vector, and ``g``: ``d psi = g Q.dQ``."""
    q = dot(Q, Q)
    if q < 1e-2:
        rest = 1.0 / 448.0 - q * (1.0 / 2304.0 - q * (1.0 / 11264.0))
        psi = 1.0 - q * (1.0 / 12.0 - q * (1.0 / 80.0 - q * rest))
        rest = 3.0 / 224.0 - q * (1.0 / 288.0 - q * (5.0 / 5632.0))
        return psi, -1.0 / 6.0 + q * (1.0 / 20.0 - q * rest)
    n = math.sqrt(q)
    psi = 2.0 * math.atan(0.5 * n) / n
    return psi, (1.0 / (1.0 + 0.25 * q) - psi) / q


@kernel
def of_angle(c: Vector) -> Vector:
    """Return the increment ``Q`` of the rotation vector ``c = phi u``; beyond phi = 3 in proportion
    to it, because no ``Q`` is a rotation by pi.
    """
    q = 0.25 * dot(c, c)
    if q < 1e-2:
        rest = 2.0 / 15.0 + q * (17.0 / 315.0 + q * (62.0 / 2835.0 + q * (1382.0 / 155925.0)))
        return scale(1.0 + q * (1.0 / 3.0 + q * rest), c)
    half = min(math.sqrt(q), 1.5)
    return scale(math.tan(half) / half, c)


@kernel
def rotation_change(Q: Vector, a: Vector) -> Vector:
    """Return ``(R(Q) - 1) a``, the change of a body-fixed vector, without cancellation."""
    Qa = cross(Q, a)
    return scale(1.0 / (1.0 + 0.25 * dot(Q, Q)), axpy(0.5, cross(Q, Qa), Qa))


@kernel
def rotation_tangent(Q: Vector) -> Matrix:
    """Return ``D`` with ``d(R(Q) a) = (D dQ) x R(Q) a``: ``D = (1 + [Q]/2) / N``."""
    n = 1.0 / (1.0 + 0.25 * dot(Q, Q))
    x, y, z = 0.5 * n * Q[0], 0.5 * n * Q[1], 0.5 * n * Q[2]
    return ((n, -z, y), (z, n, -x), (-y, x, n))


def from_axis_angle(axis: Vector, phi: float) -> Vector:
    """Return the rescaled parameters of the rotation by ``phi`` [rad] about ``axis``, not zero."""
    length = hypot(*axis)
    angle = remainder(phi, 2.0 * math.pi)
    return scale(4.0 * tan(0.25 * angle) / length, axis)


def to_axis_angle(p: Vector) -> tuple[Vector, float]:
    """Return unit axis and angle in [0, pi] of ``p``; the axis of the identity is z."""
    p = rescaled(p)
    length = math.hypot(*p)
    if length == 0.0:
        return (0.0, 0.0, 1.0), 0.0
    return scale(1.0 / length, p), 4.0 * math.atan(0.25 * length)
