"""Compliant contact along a coordinate q, which pushes where q is beyond a limit.

    d = max(0, s (q_0 - q))                     depth [m or rad]
    F = k d^n (1 + c d_dot), F >= 0             force that pushes back [N, or N m along an angle]
    T = -s k d^n                                tension, with the potential V = k d^(n+1)/(n+1)
    R = s |T| min(1, s c q_dot)                 resistance, so that T + R = -s F
    q_0     limit; s = 1 if it is a lower one, -1 if it is an upper one
    k, n    stiffness [N/m^n, or N m/rad^n], exponent: 1 of a linear contact, 1.5 of Hertz's
    c       damping [s/m or s/rad]

The force never pulls: a contact that opens faster than 1/c has none. In a collision by which two
bodies approach with the speed v and in which nothing else acts, m d_ddot = -F with any mass m gives

    (1 + c d_dot)^-1 d_dot d(d_dot) = -(k/m) d^n d(d)

whose left side, integrated from v to -e v, is zero, so with chi = c v

    ln((1 + chi)/(1 - chi e)) = chi (1 + e)

or chi - ln(1 + chi) = -chi e - ln(1 - chi e), which depends neither on mass, nor on stiffness and
exponent. So a coefficient of restitution e at an approach speed v determines c (``damping_of``).
That of slower impacts is nearer to 1, that of faster ones less: e is about 1 - 2/3 c v.

Source: Hunt, Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Appl.
Mech. 42 (1975), for the law; they give c for small losses only.
"""

import math

import numpy as np

from msahl.jit.kernel import kernel
from msahl.laws.law import CoordinateLaw, Field

STIFFNESS, EXPONENT, DAMPING, SIDE = range(4)
LEAST_RESTITUTION = 0.05
"""For less, chi e is 1 in floating point, and the force hardly opens the contact again."""
BELOW, SMALL, TERMS = 1.0 - 1e-15, 0.1, 18
"""Largest chi e that is tried; up to which x a series of so many terms is exact to round-off."""


@kernel
def depth(c: np.ndarray, q: float, free: float) -> float:
    """Return d."""
    return max(0.0, c[SIDE] * (free - q))


@kernel
def tension(c: np.ndarray, q: float, free: float) -> tuple[float, float]:
    """Return T and dT/dq."""
    d = depth(c, q, free)
    if d == 0.0:
        return 0.0, 0.0
    slope = c[STIFFNESS] * d ** (c[EXPONENT] - 1.0)
    return -c[SIDE] * slope * d, c[EXPONENT] * slope


@kernel
def potential(c: np.ndarray, q: float, free: float) -> float:
    """Return V."""
    d, power = depth(c, q, free), c[EXPONENT] + 1.0
    return c[STIFFNESS] * d**power / power


@kernel
def resistance(c: np.ndarray, rate: float, N: float) -> tuple[float, float]:
    """Return R and dR/dq_dot, with N = |T|."""
    share = c[SIDE] * c[DAMPING] * rate
    if share >= 1.0:
        return c[SIDE] * N, 0.0
    return N * c[DAMPING] * rate, N * c[DAMPING]


def damping_of(restitution: float, speed: float) -> float:
    """Return c by which two bodies that approach with a ``speed`` [m/s or rad/s] leave each other
    with the ``restitution``, from ``LEAST_RESTITUTION`` to 1, times it.
    """
    from scipy.optimize import brentq  # which few models need

    e = restitution
    if e == 1.0:
        return 0.0
    found = brentq(lambda chi: _work(chi) - e * e * _work(-chi * e), 0.0, BELOW / e, xtol=1e-300)
    return float(found) / speed


def _work(x: float) -> float:
    """Return (x - ln(1 + x))/x^2, by its series where the difference would cancel."""
    if abs(x) > SMALL:
        return (x - math.log1p(x)) / x**2
    return math.fsum((-x) ** k / (k + 2) for k in range(TERMS))


CONTACT = CoordinateLaw(
    "contact",
    (
        Field("stiffness", above=0.0),
        Field("exponent", default=1.0, least=1.0),
        Field("damping", default=0.0, least=0.0),
        Field("side", default=1.0),
    ),
    tension=tension,
    potential=potential,
    resistance=resistance,
    by_tension=True,
)
