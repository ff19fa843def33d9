"""Linear spring along a coordinate.

    T = T_0 + k (q - q_free)              tension [N, or N m along an angle]
    V = (T_0 + k (q - q_free)/2) (q - q_free)
    T_0, k  preload, stiffness [N, N/m; or N m, N m/rad]

The mean of T over a change of q is that at its middle. Source: Hooke's law.
"""

import numpy as np

from msahl.jit.kernel import kernel
from msahl.laws.law import CoordinateLaw, Field


@kernel
def tension(c: np.ndarray, q: float, free: float) -> tuple[float, float]:
    """Return T and dT/dq."""
    return c[0] + c[1] * (q - free), c[1]


@kernel
def potential(c: np.ndarray, q: float, free: float) -> float:
    """Return V."""
    return (c[0] + c[1] * (0.5 * (free + q) - free)) * (q - free)


@kernel
def mean_tension(c: np.ndarray, q: float, dq: float, free: float) -> tuple[float, float]:
    """Return the mean of T from q to q + dq, and its derivative by dq."""
    return c[0] + c[1] * (q + 0.5 * dq - free), 0.5 * c[1]


SPRING = CoordinateLaw(
    "spring",
    (Field("preload", ("force", "moment")), Field("stiffness", ("stiffness", "angularStiffness"))),
    tension=tension,
    potential=potential,
    mean_tension=mean_tension,
)
