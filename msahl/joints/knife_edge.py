"""Knife edge: a point of the child does not move across its blade (a skate, a wheel's plane).

    n . (velocity of the child's point) = 0        1 equation between rates, degrees of freedom: 5

n, the child's axis, is at a right angle to the blade. Non-holonomic: the parent is a ground.
"""

from msahl.joints.joint import CHILD, Equations, Kind, Z, slip
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """One of velocity."""
    return [slip(joint.child_axes[Z], CHILD)]


KIND = Kind("knifeEdge", equations, axes=1, moment=False, on_ground=True, glyph="knife")
