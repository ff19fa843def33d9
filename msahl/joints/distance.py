"""Distance joint: a massless rod between a point of the parent and a point of the child.

    |P_child - P_parent| = length            1 equation, degrees of freedom: 5

Without a ``length`` it is the distance at t = 0.
"""

import math

from msahl.joints.joint import Equation, Equations, Kind
from msahl.joints.joint import distance as between
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """One of position."""
    length = joint.parameter("length")
    return [Equation(between(), None if math.isnan(length) else length)]


LENGTH = (("length", "length", math.nan, 0.0),)
KIND = Kind("distance", equations, parameters=LENGTH, moment=False, glyph="rod")
