"""Damping of a contact (``laws.contact``) by its coefficient of restitution.

In a collision by which two bodies approach with the speed v, and in which nothing else acts, their
reduced mass m has m d_ddot = -k d^n (1 + c d_dot), so

    d_dot/(1 + c d_dot) d(d_dot) = -(k/m) d^n d(d)

The right side is zero from the touch to the release, and so is the left from v to -e v: with
chi = c v

    chi - ln(1 + chi) = -chi e - ln(1 - chi e)

which depends neither on m, nor on k and n. So a coefficient of restitution e at an approach speed v
determines c. That of slower impacts is nearer to 1, that of faster ones less: e is about
1 - 2/3 c v, which Hunt and Crossley (1975) give for small losses.
"""

import math

LEAST_RESTITUTION = 0.05
"""For less, chi e is 1 in floating point, and the force hardly opens the contact again."""
BELOW, SMALL, TERMS = 1.0 - 1e-15, 0.1, 18
"""Largest chi e that is tried; up to which x a series of so many terms is exact to round-off."""


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
