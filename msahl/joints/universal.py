"""Universal joint (Cardan, Hooke): a common point, and two axes at a right angle.

coincide, axis of the parent . axis of the child = 0        4 equations, degrees of freedom: 2
"""

from msahl.joints.joint import CHILD, HINGE, Coincide, Equations, Kind, TreeAxis, Z, perpendicular
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Three of position, one of orientation."""
    return [Coincide(), perpendicular(joint.parent_axes[Z], joint.child_axes[Z])]


KIND = Kind(
    "universal",
    equations,
    axes=2,
    pose=("angle1", "angle2"),
    tree=(HINGE, TreeAxis(False, Z, CHILD)),
)
