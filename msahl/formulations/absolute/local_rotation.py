"""Expresses the rotation within a step by Wiener-Milenkovic parameters, with its momentum.

    R = R(c) R0 ,   c = 0 at the start of the step           inertial axes [rad]
    W = H c_dot ,   H = B / (1 + q)^2 ,   B = (1 - q) 1 + 2 [s] + 2 s s^T ,   s = c/4 ,  q = s.s
    H^-1 = B^T ,    T = y.J0 y / 2 ,   y = H^T c_dot ,   J0 = R0 J R0^T

    R0, J     orientation at the start of the step, inertia in body axes [kg m^2]
    W         angular velocity, inertial axes [rad/s]
    T, y      kinetic energy of the rotation [J], W in inertial axes rotated back by R(c)
    [a]       matrix of a x (.)

A moment M does the work H^T M . dc. The momentum of c is pi = H J0 y; an angular momentum L in
inertial axes has pi = H^T L, so L = B pi. The derivatives below are those of these quotients, term
by term.

Source: O. A. Bauchau, L. Trainelli, The vectorial parameterization of rotation, Nonlinear Dynamics
32 (2003), for the parameters.
"""

from msahl.algebra.vector import (
    IDENTITY,
    Matrix,
    Vector,
    axpy,
    combine,
    cross,
    dot,
    multiple,
    outer,
    scale,
    skew,
)
from msahl.jit.kernel import kernel


@kernel
def tangent(c: Vector) -> Matrix:
    """Return the matrix H."""
    s = scale(0.25, c)
    k = 1.0 / (1.0 + dot(s, s)) ** 2
    skew_part = outer(2.0, s, s, skew(scale(2.0, s)))
    B = combine(1.0 - dot(s, s), IDENTITY, skew_part)
    return multiple(k, B)


@kernel
def momentum(c: Vector, z: Vector) -> Vector:
    """Return H z."""
    s = scale(0.25, c)
    k = 1.0 / (1.0 + dot(s, s)) ** 2
    straight = axpy(1.0 - dot(s, s), z, scale(2.0 * dot(s, z), s))
    return scale(k, axpy(2.0, cross(s, z), straight))


@kernel
def rate(c: Vector, a: Vector) -> Vector:
    """Return H^T a."""
    return momentum(scale(-1.0, c), a)


@kernel
def moment(c: Vector, pi: Vector) -> Vector:
    """Return the angular momentum B pi that belongs to the momentum ``pi``."""
    s = scale(0.25, c)
    return scale((1.0 + dot(s, s)) ** 2, momentum(c, pi))


@kernel
def parameter_rate(c: Vector, W: Vector) -> Vector:
    """Return c_dot = B^T W."""
    return moment(scale(-1.0, c), W)


@kernel
def momentum_slope(c: Vector, z: Vector) -> Matrix:
    """Return the derivative of H z by c at constant z."""
    s = scale(0.25, c)
    q = 1.0 + dot(s, s)
    k = 0.25 / (q * q)
    M = outer(2.0, s, z, skew(scale(-2.0, z)))
    M = outer(-2.0, z, s, combine(2.0 * dot(s, z), IDENTITY, M))
    return outer(-1.0 / q, momentum(c, z), s, multiple(k, M))


@kernel
def rate_slope(c: Vector, a: Vector) -> Matrix:
    """Return the derivative of H^T a by c at constant a."""
    return multiple(-1.0, momentum_slope(scale(-1.0, c), a))


@kernel
def curvature(c: Vector, z: Vector, a: Vector) -> Matrix:
    """Return the second derivative of (H z).a by c: of n k^2 with k = 1/(1 + q)."""
    s = scale(0.25, c)
    k = 1.0 / (1.0 + dot(s, s))
    n = dot(momentum(c, z), a) / (k * k)
    slope = axpy(2.0 * dot(s, a), z, axpy(2.0 * dot(s, z), a, scale(2.0, cross(z, a))))
    slope = axpy(-2.0 * dot(z, a), s, slope)
    straight = -2.0 * k * k * dot(z, a) - 4.0 * n * k**3
    M = combine(straight, IDENTITY, outer(24.0 * n * k**4, s, s, skew((0.0, 0.0, 0.0))))
    M = outer(2.0 * k * k, z, a, outer(2.0 * k * k, a, z, M))
    M = outer(-4.0 * k**3, slope, s, outer(-4.0 * k**3, s, slope, M))
    return multiple(0.0625, M)


@kernel
def square(M: Matrix) -> Matrix:
    """Return (2 M - tr M 1)/16: the part of B quadratic in c if M = c c^T; M is symmetric."""
    return multiple(0.125, combine(-0.5 * (M[0][0] + M[1][1] + M[2][2]), IDENTITY, M))


@kernel
def square_slope(d: Vector, a: Vector) -> Matrix:
    """Return the derivative by c of ``square(M) a`` with M = (c d^T + d c^T)/2."""
    M = outer(-0.0625, a, d, outer(0.0625, d, a, skew((0.0, 0.0, 0.0))))
    return combine(0.0625 * dot(d, a), IDENTITY, M)
