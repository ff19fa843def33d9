"""Names of the values of joints and markers that expressions of the motion may use.

joints    angle, angle1, angle2, slide, slide1, slide2, each with its rate (angleRate), and the
          components Fx Fy Fz Mx My Mz of the reaction in the accepted step before
markers   x y z, vx vy vz (inertial axes), q0 q1 q2 q3 (Euler parameters, q0 >= 0),
          wx wy wz (the marker's own axes)
"""

from collections.abc import Mapping

from msahl.elements.signals.group import POSITION, QUATERNION, SPIN, VELOCITY
from msahl.joints.registry import KINDS

RATE = "Rate"
COORDINATES = ("angle", "angle1", "angle2", "slide", "slide1", "slide2")
MARKER_VALUES: Mapping[str, tuple[int, int]] = {
    **{name: (POSITION, i) for i, name in enumerate(("x", "y", "z"))},
    **{name: (VELOCITY, i) for i, name in enumerate(("vx", "vy", "vz"))},
    **{name: (QUATERNION, i) for i, name in enumerate(("q0", "q1", "q2", "q3"))},
    **{name: (SPIN, i) for i, name in enumerate(("wx", "wy", "wz"))},
}
"""Kind of input (``elements.signals``) and component of each value of a marker."""
REACTION_VALUES = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def joint_values(kind: str) -> list[str]:
    """Return the values of a joint of a ``kind`` that expressions may name."""
    if kind not in KINDS:
        return []
    known = [name for name in KINDS[kind].pose or () if name in COORDINATES]
    moments = REACTION_VALUES if KINDS[kind].moment else REACTION_VALUES[:3]
    return [*known, *(name + RATE for name in known), *moments]
