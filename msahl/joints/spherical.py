"""Spherical joint: a point of the child coincides with a point of the parent.

    g = (r_child + s_child) - (r_parent + s_parent) = 0            (3,)  [m], inertial axes

One ``coincide`` of the primitives; its multiplier is the force of the parent on the child. Free
motions: 3 (all turns). Source: Hainge 2010, figure 1.2.
"""

from dataclasses import dataclass

from msahl.vector import Vector


@dataclass(frozen=True, slots=True)
class Spherical:
    """``parent_point`` and ``child_point`` [m] from each body's B, in that body's axes."""

    name: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
