"""Spherical joint: a point of the child coincides with a point of the parent.

    g = (r_child + s_child) - (r_parent + s_parent) = 0            (3,)  [m], inertial axes

One ``coincide``; its multiplier is the force of the parent on the child. 3 equations,
degrees of freedom: 3 (all rotations).
"""

from msahl.joints.joint import Coincide, Equations, Kind, TreeAxis, X, Y, Z
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Three of position."""
    return [Coincide()]


KIND = Kind(
    "spherical",
    equations,
    pose=("orientation",),
    moment=False,
    tree=tuple(TreeAxis(False, axis) for axis in (X, Y, Z)),
)
