"""Revolute joint (hinge): a common point and a common axis.

coincide, parallel axes                 5 equations, degrees of freedom: 1 (angle)
"""

from msahl.joints.joint import HINGE, Coincide, Equations, Kind, parallel_axes
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Three of position, two of orientation."""
    return [Coincide(), *parallel_axes(joint)]


KIND = Kind(
    "revolute",
    equations,
    axes=1,
    coordinates=("angle",),
    pose=("angle",),
    bearing=True,
    tree=(HINGE,),
)
