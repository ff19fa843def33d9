"""Point slider: a point of the child moves in a plane of the parent.

child's point in plane                          1 equation, degrees of freedom: 5
"""

from msahl.joints.joint import Equations, Kind, Z, in_plane
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """One of position."""
    return [in_plane(joint.parent_axes[Z])]


KIND = Kind("pointSlider", equations, axes=1)
