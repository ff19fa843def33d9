"""Rolling disk: a thin disk of the child rolls on a plane of a ground without slipping.

    height of the rim = 0                              1 equation of position
    velocity of the rim's lowest point = 0 along x, y  2 equations between rates

Degrees of freedom: 3 (non-holonomic). The child's point is the disk's centre, its axis the disk's;
the ground's axis is the plane's normal, on whose side the disk stands.
"""

from msahl.joints.joint import Equation, Equations, Kind, X, Y, Z, rim_height, roll
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """One of position, two of velocity."""
    radius = joint.parameter("radius")
    normal, axis = joint.parent_axes[Z], joint.child_axes[Z]
    height = Equation(rim_height(normal, axis, radius))
    return [height, *(roll(normal, axis, joint.parent_axes[i], radius) for i in (X, Y))]


KIND = Kind(
    "rollingDisk",
    equations,
    axes=2,
    parameters=(("radius", "length", None, 0.0),),
    moment=False,
    on_ground=True,
    glyph="roll",
    solid="disc",
)
