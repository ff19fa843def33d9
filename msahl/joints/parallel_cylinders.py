"""Parallel cylinders: line contact of two cylinders with parallel axes, free of friction.

    parallel axes, distance of the axes = r1 + r2     3 equations, degrees of freedom: 3

A negative radius is a hollow cylinder: the other lies in it, at the distance r1 - r2.
"""

import math

from msahl.joints.joint import Equation, Equations, Kind, axis_distance, parallel_axes
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Two of orientation, one of position."""
    distance = abs(joint.parameter("parentRadius") + joint.parameter("childRadius"))
    return [*parallel_axes(joint), Equation(axis_distance(joint), distance)]


RADII = (
    ("parentRadius", "length", None, -math.inf),
    ("childRadius", "length", None, -math.inf),
)
KIND = Kind("parallelCylinders", equations, axes=1, parameters=RADII, solid="cylinder")
