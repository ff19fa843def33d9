"""Edge slider: a straight edge of the child lies in a plane of the parent.

child's point in plane, normal . edge = 0       2 equations, degrees of freedom: 4
"""

from msahl.joints.joint import Equations, Kind, Z, in_plane, perpendicular
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """One of position, one of orientation; the child's axis is the edge."""
    normal = joint.parent_axes[Z]
    return [in_plane(normal), perpendicular(normal, joint.child_axes[Z])]


KIND = Kind("edgeSlider", equations, axes=2)
