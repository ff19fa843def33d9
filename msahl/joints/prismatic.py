"""Prismatic joint (slider): a common axis without turn.

point on axis, no turn                  5 equations, free motions: 1 (slide)
"""

from msahl.joints.joint import Equations, Kind, no_turn, on_axis
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Two of position, three of orientation."""
    return [*on_axis(joint), *no_turn(joint)]


KIND = Kind("prismatic", equations, axes=1, coordinates=("slide",), bearing=True)
