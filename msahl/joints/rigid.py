"""Rigid joint: no relative motion.

coincide, no rotation                       6 equations, degrees of freedom: 0
"""

from msahl.joints.joint import Coincide, Equations, Kind, no_rotation
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Three of position, three of orientation."""
    return [Coincide(), *no_rotation(joint)]


KIND = Kind("rigid", equations, pose=(), tree=())
