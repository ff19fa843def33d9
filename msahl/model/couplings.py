"""Records of couplings: constraint equations between the coordinates of two joints.

    gear            angle_2 = ratio angle_1                    ratio < 0 for external teeth
    rackAndPinion   slide_2 = radius angle_1
    camFollower     slide_2 = lift(angle_1)                    a planar cam on a revolute joint

Coordinates count from t = 0. The joints' parents may be any bodies. The one multiplier of a
coupling is the load along the second joint's coordinate.
"""

from msahl.algebra.functions import Law
from msahl.records import record


@record
class Coupling:
    """``first`` and ``second`` name joints; ``ratio`` is a gear's ratio or a pinion's radius [m],
    ``lift`` a cam's lift [m] over its angle [rad], periodic."""

    name: str
    kind: str
    first: str
    second: str
    ratio: float = 0.0
    lift: Law | None = None


COORDINATES = {
    "gear": ("angle", "angle"),
    "rackAndPinion": ("angle", "slide"),
    "camFollower": ("angle", "slide"),
}
"""Coordinates of the two joints that each kind relates."""
