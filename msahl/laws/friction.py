"""Coulomb friction against the motion along a coordinate of a joint.

    R = mu r N tanh(q_dot/w)              resistance [N, or N m along an angle]
    dR/dq_dot = mu r N (1 - tanh^2(q_dot/w))/w
    mu, r   coefficient of friction; lever arm: 1 along a slide, the bearing's radius for an angle
    N       magnitude of the joint's reaction force [N]
    w       rate at which friction has risen to three quarters of its limit [m/s or rad/s]; dry
            friction is regularised by it

Source: Coulomb's law with the usual regularisation by tanh.
"""

import math

import numpy as np

from msahl.jit.kernel import kernel
from msahl.laws.law import CoordinateLaw, Field


@kernel
def resistance(c: np.ndarray, rate: float, N: float) -> tuple[float, float]:
    """Return R and dR/dq_dot."""
    limit, t = c[0] * c[1] * N, math.tanh(rate / c[2])
    return limit * t, limit * (1.0 - t * t) / c[2]


FRICTION = CoordinateLaw(
    "friction",
    (
        Field("coefficient", least=0.0),
        Field("radius", (None, "length"), least=0.0),
        Field("width", ("velocity", "angularVelocity"), above=0.0),
    ),
    resistance=resistance,
    by_reaction=True,
    width="width",
)
