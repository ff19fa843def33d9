"""Point on line (a sphere in a cylinder): a point of the child moves along an axis of the parent.

point on axis                         2 equations, degrees of freedom: 4 (slide, rotations)
"""

from msahl.joints.joint import Equations, Kind, on_axis
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Two of position."""
    return [*on_axis(joint)]


KIND = Kind("pointOnLine", equations, axes=1, coordinates=("slide",), pose=("slide", "orientation"))
