"""Rigid joint: no relative motion.

coincide, no turn                       6 equations, free motions: 0
"""

from msahl.joints.joint import Coincide, Equations, Kind, no_turn
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Three of position, three of orientation."""
    return [Coincide(), *no_turn(joint)]


KIND = Kind("rigid", equations)
