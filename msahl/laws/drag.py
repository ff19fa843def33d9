"""Quadratic drag against the velocity V of a point relative to the inertial axes.

F = -c |V| V                          force at the point [N]
dF/dV = -c (|V| 1 + V V^T/|V|)
c     drag coefficient [N s^2/m^2]; the law is Newton's, in any textbook
"""

import math

import numpy as np

from msahl.algebra.vector import IDENTITY, Matrix, Vector, axpy, dot, multiple, scale
from msahl.jit.kernel import kernel
from msahl.laws.law import Field, PointLaw


@kernel
def load(c: np.ndarray, V: Vector) -> Vector:
    """Return F at the velocity V."""
    return scale(-c[0] * math.sqrt(dot(V, V)), V)


@kernel
def slope(c: np.ndarray, V: Vector) -> Matrix:
    """Return dF/dV at the velocity V."""
    speed = math.sqrt(dot(V, V))
    if speed == 0.0:
        return ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    return multiple(
        -c[0],
        (
            axpy(speed, IDENTITY[0], scale(V[0] / speed, V)),
            axpy(speed, IDENTITY[1], scale(V[1] / speed, V)),
            axpy(speed, IDENTITY[2], scale(V[2] / speed, V)),
        ),
    )


DRAG = PointLaw("drag", load, slope, (Field("coefficient", "dragCoefficient", least=0.0),))
