"""Rigid joint: no relative motion.

coincide, no turn                       6 equations, free motions: 0
"""

from msahl.joints.joint import Coincide, Equations, Joint, Kind, no_turn


def equations(joint: Joint) -> Equations:
    """Three of position, three of orientation."""
    return [Coincide(), *no_turn(joint)]


KIND = Kind("rigid", equations)
