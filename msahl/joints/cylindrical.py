"""Cylindrical joint: a common axis, along which and about which the child is free.

point on axis, parallel axes            4 equations, degrees of freedom: 2 (slide, angle)
"""

from msahl.joints.joint import HINGE, SLIDE_AXIS, Equations, Kind, on_axis, parallel_axes
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Two of position, two of orientation."""
    return [*on_axis(joint), *parallel_axes(joint)]


SLIDE_ANGLE = ("slide", "angle")
KIND = Kind(
    "cylindrical",
    equations,
    axes=1,
    coordinates=SLIDE_ANGLE,
    pose=SLIDE_ANGLE,
    bearing=True,
    tree=(SLIDE_AXIS, HINGE),
)
