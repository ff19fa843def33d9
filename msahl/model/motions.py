"""Records of prescribed motions: a law of time for a joint coordinate, or for a point of a body."""

from msahl.algebra.functions import Law
from msahl.algebra.vector import Vector
from msahl.records import record


@record
class JointMotion:
    """The ``coordinate`` ("angle" [rad] or "slide" [m]) of ``joint`` has its value at t = 0 plus
    the change of ``law`` since then."""

    name: str
    joint: str
    coordinate: str
    law: Law


@record
class PointMotion:
    """``point`` [m] of ``body`` (from B, its axes) moves along the unit vector ``direction``
    (inertial axes) by the change of ``law`` [m] since t = 0, and is free at right angles to it."""

    name: str
    body: str
    point: Vector
    direction: Vector
    law: Law
