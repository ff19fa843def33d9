"""Compliant contact along a coordinate q, which pushes where q is beyond a limit.

    d = max(0, s (q_0 - q))                     depth [m or rad]
    F = k d^n (1 + c d_dot), F >= 0             force that pushes back [N, or N m along an angle]
    T = -s k d^n                                tension, with the potential V = k d^(n+1)/(n+1)
    R = s |T| min(1, s c q_dot)                 resistance, so that T + R = -s F
    q_0     limit; s = 1 if it is a lower one, -1 if it is an upper one
    k, n    stiffness [N/m^n, or N m/rad^n], exponent: 1 of a linear contact, 1.5 of Hertz's
    c       damping [s/m or s/rad]

The force never pulls: a contact that opens faster than 1/c has none. ``laws.restitution`` has c by
the coefficient of restitution. Source: Hunt, Crossley, Coefficient of restitution interpreted as
damping in vibroimpact, J. Appl. Mech. 42 (1975).
"""

import numpy as np

from msahl.jit.kernel import kernel
from msahl.laws.law import CoordinateLaw, Field

STIFFNESS, EXPONENT, DAMPING, SIDE = range(4)


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
