"""Configurations with one joint rotated by half a revolution, from which equilibria are searched.

What hangs in an equilibrium stands in another: of two rods on hinges each does so alone.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import at
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.projection import close, move
from msahl.analysis.modes.solution import is_large
from msahl.joints.joint import Z
from msahl.joints.registry import KINDS
from msahl.joints.spherical import KIND as BALL
from msahl.system.arrays import node_count

STEPS = 8
"""Parts of half a revolution: counted angles follow less than half a revolution at once."""


class Hinge(NamedTuple):
    """A joint about whose axis, or about whose point, the bodies beyond it can rotate."""

    bodies: tuple[int, ...]  # numbers of these
    child: int  # number of the body with the axis
    point: np.ndarray  # (3,) of the axis, from the child's reference point in its axes
    axis: np.ndarray | None  # (3,) in its axes; None: any, of a spherical joint


def hinges_of(point: Point) -> list[Hinge]:
    """Return the hinges of a model that is not large: joints with an angle, and spherical ones,
    which close no loop.
    """
    model = point.model
    number = {body.name: b for b, body in enumerate(model.bodies)}
    if is_large(point) or model.beams:
        return []
    found = []
    for joint in model.joints:
        spherical = joint.kind == BALL.name
        if not (spherical or "angle" in KINDS[joint.kind].coordinates) or joint.child not in number:
            continue
        beyond = _beyond(point, joint.name, joint.child)
        if beyond is not None and joint.parent not in beyond:
            bodies = tuple(sorted(number[name] for name in beyond))
            axis = None if spherical else np.array(joint.child_axes[Z])
            found.append(Hinge(bodies, number[joint.child], np.array(joint.child_point), axis))
    return found


def _beyond(point: Point, without: str, body: str) -> set[str] | None:
    """Return the bodies that joints connect with a ``body`` but for one joint; None if that of the
    ground is among them.
    """
    joints = [joint for joint in point.model.joints if joint.name != without]
    names = {each.name for each in point.model.bodies}
    found, waiting = {body}, [body]
    while waiting:
        name = waiting.pop()
        for joint in joints:
            for one, other in ((joint.parent, joint.child), (joint.child, joint.parent)):
                if one == name and other not in found:
                    if other not in names:
                        return None
                    found.add(other)
                    waiting.append(other)
    return found


def flipped(point: Point, hinge: Hinge) -> Point:
    """Return a ``point`` with the bodies beyond a hinge rotated by half a revolution; raises
    ``StartError`` if the joints cannot be closed there.
    """
    system, state = point.system, point.state
    across = _horizontal(np.array(point.model.gravity))
    for _ in range(STEPS):
        R = np.array(matrix(at(state.p, hinge.child)))
        arm = hinge.point - np.array(point.model.bodies[hinge.child].r_BG)
        axis = across if hinge.axis is None else R @ hinge.axis
        centre, theta = state.x[hinge.child] + R @ arm, math.pi / STEPS * axis
        dq = np.zeros((node_count(system), 3))
        for b in hinge.bodies:
            dq[system.frames.rotation[b]] = theta
            dq[system.frames.displacement[b]] = _travel(state.x[b] - centre, theta)
        state = close(system, move(system, state, dq), point.unknowns)
    return replace(point, state=state)


def _horizontal(gravity: np.ndarray) -> np.ndarray:
    """A unit vector (3,) across ``gravity``, which may be zero."""
    across = np.cross(gravity, np.eye(3)[np.argmin(np.abs(gravity))])
    length = float(np.linalg.norm(across))
    return across / length if length else np.array([0.0, 1.0, 0.0])


def _travel(arm: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """(3,) displacement of the end of an ``arm`` that rotates by the vector ``theta``."""
    angle = float(np.linalg.norm(theta))
    axis = theta / angle
    across = np.cross(axis, arm)
    moved: np.ndarray = math.sin(angle) * across + (1.0 - math.cos(angle)) * np.cross(axis, across)
    return moved
