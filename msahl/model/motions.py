"""Prescribed motions: a law of time for a joint's free motion, or for a point of a body."""

from dataclasses import dataclass

from msahl.algebra.functions import Law
from msahl.algebra.vector import Vector


@dataclass(frozen=True, slots=True)
class JointMotion:
    """The ``freedom`` ("angle" [rad] or "slide" [m]) of ``joint`` moves from where it is at t = 0
    by what ``law`` has changed since."""

    name: str
    joint: str
    coordinate: str
    law: Law


@dataclass(frozen=True, slots=True)
class PointMotion:
    """``point`` [m] of ``body`` (from B, its axes) moves along ``direction`` (inertial axes) by
    what ``law`` [m] has changed since t = 0; across it the point is free."""

    name: str
    body: str
    point: Vector
    direction: Vector
    law: Law
