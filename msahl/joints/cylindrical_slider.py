"""Cylindrical slider: a cylinder of the child lies on a plane of the parent, free of friction.

child's point at radius above the plane, normal . axis = 0      2 equations, degrees of freedom: 4
"""

from msahl.joints.joint import Equations, Kind, Z, in_plane, perpendicular
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """One of position, one of orientation; the child's axis is the cylinder's."""
    normal = joint.parent_axes[Z]
    lying = perpendicular(normal, joint.child_axes[Z])
    return [in_plane(normal, joint.parameter("radius")), lying]


RADIUS = (("radius", "length", None, 0.0),)
KIND = Kind("cylindricalSlider", equations, axes=2, parameters=RADIUS, solid="cylinder")
