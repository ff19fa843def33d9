"""Rules about the two ends of a joint, spring or bushing, and how near their points must be."""

import sys
from collections.abc import Iterator
from typing import Protocol

import numpy as np

from msahl.algebra.many import dist, hypot, largest
from msahl.algebra.vector import IDENTITY, Matrix, Vector, dot, sub
from msahl.check.context import Context
from msahl.check.directions import PARALLEL
from msahl.check.faults import Finding, shown

FIT = 1e-6
"""Largest distance of the two points at t = 0, as a share of the longest arm: decks are typed with
6 to 7 digits."""

ROUNDING = 64 * sys.float_info.epsilon
"""Distance that is always accepted, as a share of the points' distance from the inertial origin."""


class Ends(Protocol):
    """Parent and child of a joint, spring or bushing by name, and each one's point in its axes."""

    @property
    def parent(self) -> str:
        """Name of the parent."""

    @property
    def child(self) -> str:
        """Name of the child."""

    @property
    def parent_point(self) -> Vector:
        """Point of the parent [m]."""

    @property
    def child_point(self) -> Vector:
        """Point of the child [m]."""


def ends_findings(ends: Ends, context: Context) -> Iterator[Finding]:
    """Find ends that are one body or two grounds."""
    parent, child = ends.parent, ends.child
    if parent == child:
        yield Finding("ends", f"parent and child are both '{parent}'; name two different bodies")
    elif {parent, child} <= context.grounds.keys():
        message = f"'{parent}' and '{child}' are both grounds; name a body that moves"
        yield Finding("ends", message)


def is_placed(ends: Ends, context: Context) -> bool:
    """Return whether the places of both bodies are known."""
    return {ends.parent, ends.child} <= context.origins.keys()


def points(ends: Ends, context: Context) -> tuple[Vector, Vector]:
    """Return the parent's and the child's point at t = 0, inertial axes [m]."""
    here = context.point(ends.parent, ends.parent_point)
    return here, context.point(ends.child, ends.child_point)


def arm(ends: Ends) -> float:
    """Return the longer distance of a point from its body's B [m]."""
    longer: float = largest(hypot(*ends.parent_point), hypot(*ends.child_point))
    return longer


def tolerance(here: Vector, there: Vector, longest: float, context: Context) -> float:
    """Return the accepted distance of two points at t = 0 [m], by the ``longest`` arm [m]."""
    far = largest(hypot(*here), hypot(*there), context.extent)
    accepted: float = largest(FIT * longest, ROUNDING * far)
    return accepted


def plainly_together(here: np.ndarray, there: np.ndarray, longest: np.ndarray) -> np.ndarray:
    """Return which of many pairs of points (n, 3) ``apart`` accepts beyond doubt, (n,) bool, by
    their ``longest`` arms (n,) [m]."""
    far = np.maximum(np.linalg.norm(here, axis=1), np.linalg.norm(there, axis=1))
    accepted = np.maximum(FIT * longest, ROUNDING * far)
    return np.linalg.norm(there - here, axis=1) <= 0.5 * accepted


def apart(ends: Ends, context: Context) -> Iterator[Finding]:
    """Find two points that should coincide at t = 0 and do not."""
    here, there = points(ends, context)
    distance = dist(here, there)
    if distance > tolerance(here, there, arm(ends), context):
        message = (
            f"its points are {distance:.4g} m apart at t = 0: {shown(here)} m on parent "
            f"'{ends.parent}' but {shown(there)} m on child '{ends.child}' (inertial axes); "
            f"move the child by {shown(sub(here, there))} m"
        )
        yield Finding("", message)


def frame_findings(axes: Matrix, part: str) -> Iterator[Finding]:
    """Find rows of a joint's frame that are not three right-handed unit vectors."""
    if axes == IDENTITY:  # of joints without axes
        return
    x, y, z = axes
    products = (dot(x, y), dot(y, z), dot(z, x), *(hypot(*row) - 1.0 for row in axes))
    volume = dot(
        x, (y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0])
    )
    if not largest(*map(abs, products)) <= PARALLEL or volume < 0.0:
        message = "its rows must be three right-handed unit vectors at right angles; correct them"
        yield Finding(part, message)
