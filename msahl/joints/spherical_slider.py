"""Spherical slider: a sphere of the child lies on a plane of the parent, free of friction.

child's point at radius above the plane         1 equation, degrees of freedom: 5
"""

from msahl.joints.joint import Equations, Kind, Z, in_plane
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """One of position; the child's point is the sphere's centre."""
    return [in_plane(joint.parent_axes[Z], joint.parameter("radius"))]


RADIUS = (("radius", "length", None, 0.0),)
KIND = Kind("sphericalSlider", equations, axes=1, parameters=RADIUS, solid="sphere")
