"""Planar joint: two planes lie on each other.

child's point in plane, parallel normals        3 equations, degrees of freedom: 3
"""

from msahl.joints.joint import HINGE, Equations, Kind, TreeAxis, X, Y, Z, in_plane, parallel_axes
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """One of position, two of orientation."""
    return [in_plane(joint.parent_axes[Z]), *parallel_axes(joint)]


KIND = Kind(
    "planar",
    equations,
    axes=1,
    pose=("slide1", "slide2", "angle"),
    tree=(TreeAxis(True, X), TreeAxis(True, Y), HINGE),
)
