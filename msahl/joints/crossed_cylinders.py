"""Crossed cylinders: point contact of two cylinders with skew axes, free of friction.

    distance of the axes = r1 + r2                 1 equation, degrees of freedom: 5

D from a point of one axis a to a point of the other b. In the products D.D, D.a, D.b and a.b alone
(the coordinate kind SKEW) the equation is a polynomial, so the forces and moments of both
bodies balance exactly.
"""

from msahl.joints.joint import Equation, Equations, Kind, skew_distance
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """One of position."""
    distance = joint.parameter("parentRadius") + joint.parameter("childRadius")
    return [Equation(skew_distance(joint, distance))]


RADII = (("parentRadius", "length", None, 0.0), ("childRadius", "length", None, 0.0))
KIND = Kind("crossedCylinders", equations, axes=2, parameters=RADII, faces=True, solid="cylinder")
