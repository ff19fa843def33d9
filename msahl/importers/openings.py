"""How far loops are open at t = 0, in the pose that the file, a keyframe or the user gives."""

import math
from typing import NamedTuple

import numpy as np

from msahl.deck.faults import DeckError
from msahl.deck.placement import UNCLOSED
from msahl.importers.build import world_pose
from msahl.importers.reading import Log
from msahl.importers.robot import HERE, Closure, Pose, Robot

ROUNDED = 1e-9
"""Distance [m] and angle [rad] that the digits of a file leave."""
ELSEWHERE = "start elsewhere, by --at or --key"
CONSTRAINED = {
    "spherical": ("xyz", ""),
    "rigid": ("xyz", "xyz"),
    "revolute": ("xyz", "xy"),
    "prismatic": ("xy", "xyz"),
    "universal": ("xyz", ""),
    "screw": ("xy", "xy"),
}
"""Directions of the joint's frame along which, and about which, a kind of closure keeps its links
together. What couples two of them, such as a thread, is not counted."""


class Opening(NamedTuple):
    """A ``distance`` [m] and an ``angle`` [rad] by which a closure is open."""

    closure: Closure
    distance: float
    angle: float

    def __str__(self) -> str:
        parts = [
            f"{value:.3g} {unit}"
            for value, unit in ((self.distance, "m"), (self.angle, "rad"))
            if value > ROUNDED
        ]
        return f"its loop is open by {' and '.join(parts)} at t = 0"


def openings(robot: Robot) -> list[Opening]:
    """Return the closures that are open where the coordinates at t = 0 place the links."""
    found = []
    for closure in robot.closures:
        here, there = (
            (world_pose(robot.links[name], robot) if name else HERE).after(pose)
            for name, pose in zip(closure.links, closure.poses, strict=True)
        )
        along, about = CONSTRAINED[closure.kind]
        apart = here.inverse().after(there)
        distance = math.hypot(*(apart.p["xyz".index(axis)] for axis in along))
        opening = Opening(closure, distance, _angle(apart, about))
        if max(opening.distance, opening.angle) > ROUNDED:
            found.append(opening)
    return found


def _angle(apart: Pose, about: str) -> float:
    """Return the angle of a rotation, or that between z axes if it may rotate about these."""
    R = apart.R
    if about == "xyz":
        sine = 0.5 * math.hypot(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
        return math.atan2(sine, 0.5 * (float(np.trace(R)) - 1.0))
    return math.atan2(math.hypot(R[0, 2], R[1, 2]), R[2, 2]) if about else 0.0


def note_openings(found: list[Opening], log: Log) -> None:
    """Note the loops that the start has to close."""
    for opening in found:
        words = f"{opening}; the start closes it, which changes the coordinates within it"
        log.changed(opening.closure.element, words)


def fault_openings(found: list[Opening], error: DeckError, log: Log) -> None:
    """Raise ``DeckError`` for the loops that are open if the ``error`` of the deck is about them:
    they cannot be closed, or joint bodies that both have places of their own."""
    for opening in found:
        name = f"'{opening.closure.name}'"
        if any(UNCLOSED in fault.message or name in fault.where for fault in error.faults):
            words = (
                f"{opening}, and cannot be closed from there; {ELSEWHERE}, or correct its points"
            )
            log.fault(opening.closure.element, words)
    log.raise_if_any()
