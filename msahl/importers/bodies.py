"""Bodies of a robot: links that are fixed to one another are one body.

A link without joints is part of the body that its parent is part of, or of the ground; its name
stays as a marker. With ``keep_fixed`` it is a body on a rigid joint, whose axes are parallel to
those of the parent's body.
"""

from dataclasses import dataclass, field

import numpy as np

from msahl.check.bodies import impossible
from msahl.importers.inertia import REPAIR, matrix
from msahl.importers.names import Names
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log
from msahl.importers.robot import HERE, Inertia, Link, Look, Pose, Robot, together

GROUND = "Ground"
SHARE = 1e-9
"""Inertia of a body that stands for none, as a share of that of the link it carries, from which it
is taken: what it changes in the motion is of this size. Smaller shares cost more in round-off."""
RADIUS = 0.1
"""Radius of gyration [m] of such a body where no link determines it."""


@dataclass
class Part:
    """A body of the deck: the ``link`` that gives it its frame (None: the ground), the inertia and
    shapes of all links that it consists of, and frames fixed in it, by name."""

    name: str
    link: Link | None
    inertias: list[Inertia] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)
    frames: list[tuple[str, Pose]] = field(default_factory=list)
    rigid: tuple[str, np.ndarray] | None = None
    """The body that it is fixed to by a rigid joint, and the point there."""

    @property
    def inertia(self) -> Inertia:
        """Mass, mass centre and inertia of all links."""
        return together(self.inertias)


@dataclass
class Parts:
    """All bodies by name, the first is the ground; where each link is: the name of its body, and
    its frame there."""

    bodies: dict[str, Part]
    places: dict[str, tuple[str, Pose]]


def parts_of(robot: Robot, options: ImportOptions, names: Names, log: Log) -> Parts:
    """Return the bodies of a robot; those that cannot move for want of mass are faults."""
    ground = Part(names.unique(GROUND), None)
    parts = Parts({ground.name: ground}, {"": (ground.name, HERE)})
    for link in robot.links.values():
        _add(link, parts, options, names, log)
    for part in parts.bodies.values():
        if part.link is not None:
            _check(part, part.link, robot, options, log)
    log.raise_if_any()
    return parts


def _add(link: Link, parts: Parts, options: ImportOptions, names: Names, log: Log) -> None:
    """Make a body of a link, or a part of the body of its parent."""
    holder, outer = parts.places[link.parent]
    pose = outer.after(link.pose)
    kept = options.keep_fixed and link.inertia.mass > 0.0 and parts.bodies[holder].link is not None
    if link.axes or kept:
        part = Part(names.unique(link.name), link)
        inner = HERE if link.axes else Pose(pose.R, np.zeros(3))
        if not link.axes:
            part.rigid = (holder, pose.p)
        parts.bodies[part.name] = part
    else:
        part, inner = parts.bodies[holder], pose
        part.frames.append((link.name, pose))
        if part.link is None and link.inertia.mass:
            log.changed(link.element, "it is fixed to the ground, which has no mass")
    parts.places[link.name] = (part.name, inner)
    if link.inertia.mass or link.inertia.J.any():
        part.inertias.append(link.inertia.seen_from(inner))
    for look in link.looks:
        look.pose = inner.after(look.pose)
        part.looks.append(look)
    part.frames += [(name, inner.after(frame)) for name, frame in link.frames]


def _check(part: Part, link: Link, robot: Robot, options: ImportOptions, log: Log) -> None:
    """Add a fault for a body that has no mass or an impossible inertia, or repair the former."""
    inertia = part.inertia
    if not inertia.mass > 0.0:
        tiny = tiny_inertia(robot)
        words = f"{tiny.mass:.3g} kg, {SHARE:g} of all masses"
        if not options.repair:
            log.fault(link.element, f"it moves and has no mass; --repair gives it {words}")
        else:
            log.changed(link.element, f"it moves and has no mass; it gets {words}")
            part.inertias = [tiny]
        return
    complaint = impossible(matrix(inertia.J))
    if complaint:
        log.fault(link.element, f"{complaint.partition(':')[0]} are impossible; {REPAIR}")


def carrier(link: Inertia, point: np.ndarray) -> Inertia:
    """Return the inertia of a body that stands for none between two joints of a link: with its mass
    centre at a ``point``, and compact."""
    largest = float(np.linalg.eigvalsh(link.J).max())
    return Inertia(SHARE * link.mass, point, SHARE * largest * np.eye(3))


def without(link: Inertia, carriers: int) -> Inertia:
    """Return the inertia of a link from which that of its ``carriers`` is taken."""
    return link._replace(mass=link.mass * (1.0 - carriers * SHARE))


def tiny_inertia(robot: Robot) -> Inertia:
    """Return the inertia of a link that has none, by the masses of all."""
    mass = SHARE * (sum(link.inertia.mass for link in robot.links.values()) or 1.0)
    return Inertia(mass, HERE.p, mass * RADIUS**2 * np.eye(3))
