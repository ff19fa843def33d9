"""Prismatic joint (slider): a common axis without rotation.

point on axis, no rotation                  5 equations, degrees of freedom: 1 (slide)
"""

from msahl.joints.joint import SLIDE_AXIS, Equations, Kind, no_rotation, on_axis
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Two of position, three of orientation."""
    return [*on_axis(joint), *no_rotation(joint)]


KIND = Kind(
    "prismatic",
    equations,
    axes=1,
    coordinates=("slide",),
    pose=("slide",),
    bearing=True,
    tree=(SLIDE_AXIS,),
)
