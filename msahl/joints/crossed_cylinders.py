"""Crossed cylinders: point contact of two cylinders with skew axes, free of friction.

    D . (a x b) = (r1 + r2) |a x b|          1 equation, free motions: 5

a, b the axes (the reader turns b so that the triple product starts positive), D from a point of
one to a point of the other.
"""

from msahl.joints.joint import Equation, Equations, Joint, Kind, skew_distance


def equations(joint: Joint) -> Equations:
    """One of position."""
    gap = joint.parameter("parentRadius") + joint.parameter("childRadius")
    return [Equation(skew_distance(joint, gap))]


RADII = (("parentRadius", "length", None, 0.0), ("childRadius", "length", None, 0.0))
KIND = Kind("crossedCylinders", equations, axes=2, parameters=RADII)
