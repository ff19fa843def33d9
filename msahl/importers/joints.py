"""Joints of a deck from those of a robot, and where they stand at t = 0.

A joint of the deck has the value of the file's coordinate. If a link has several joints, a small
body stands between each and the next; slides and a hinge that make up a planar or a cylindrical
joint are one joint.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import parameters, plain_vector
from msahl.algebra.vector import IDENTITY, ZERO, Matrix, Vector
from msahl.check.directions import PARALLEL, frame, shared_references, unit
from msahl.importers.robot import HERE, Axis, Pose
from msahl.model.joints import Joint


@dataclass
class Start:
    """Coordinates of a joint at t = 0, and their rates, by the names of the deck's elements. ``P``
    is an orientation and ``w`` its angular velocity [rad/s], child's axes. ``approximate`` values
    begin the closing of a loop."""

    values: dict[str, float] = field(default_factory=dict)
    rates: dict[str, float] = field(default_factory=dict)
    P: Vector | None = None
    w: Vector = ZERO
    approximate: bool = False


class Placed(NamedTuple):
    """A joint with its start; and which coordinate of it each axis of the file is, by name."""

    joint: Joint
    start: Start
    coordinates: dict[str, str]


class Ends(NamedTuple):
    """What a joint connects: the body ``child``, whose axes are those of the link, to ``parent``,
    where it has this ``pose`` if all coordinates are those of the file's own pose."""

    name: str  # of the joint
    parent: str
    child: str
    pose: Pose


def groups(axes: Sequence[Axis]) -> list[list[Axis]]:
    """Return the axes of a link in groups, each of which is one joint of the deck."""
    found: list[list[Axis]] = []
    rest = list(axes)
    while rest:
        sizes = ((3, _planar), (2, _cylindrical), (2, _universal))
        size = next((n for n, fits in sizes if fits(rest[:n])), 1)
        found.append(rest[:size])
        rest = rest[size:]
    return found


def _planar(axes: Sequence[Axis]) -> bool:
    """Return whether two slides and a hinge make up a planar joint without loads and stops."""
    if [axis.kind for axis in axes] != ["slide", "slide", "hinge"]:
        return False
    a, b, c = (axis.axis for axis in axes)
    return max(abs(a @ b), abs(b @ c), abs(a @ c)) < PARALLEL and not _loaded(axes)


def _universal(axes: Sequence[Axis]) -> bool:
    """Return whether two hinges are those of a universal joint without loads and stops."""
    if len(axes) != 2 or not axes[0].crosses:
        return False
    return abs(axes[0].axis @ axes[1].axis) < PARALLEL and not _loaded(axes)


def _loaded(axes: Sequence[Axis]) -> bool:
    """Return whether a force, a stop or a relation acts along one of the axes."""
    return any(
        a.damping or a.stiffness or a.friction or a.armature or a.limit is not None or a.driven
        for a in axes
    )


def _cylindrical(axes: Sequence[Axis]) -> bool:
    """Return whether a slide and a hinge have one direction."""
    kinds = {axis.kind for axis in axes}
    if len(axes) != 2 or kinds != {"slide", "hinge"}:
        return False
    return abs(axes[0].axis @ axes[1].axis - 1.0) < PARALLEL**2


def placed(group: Sequence[Axis], ends: Ends) -> Placed:
    """Return the joint of the deck that a group of axes is."""
    if len(group) > 1:
        return _several(group, ends)
    (axis,) = group
    if axis.kind == "ball":
        return _ball(axis, ends)
    if axis.kind == "planar":
        joint = _joint("planar", ends, axis, axis.point)
        return Placed(joint, Start({"slide1": 0.0, "slide2": 0.0, "angle": 0.0}), {})
    if axis.kind == "screw":
        return _screw(axis, ends)
    kind = {"hinge": "revolute", "slide": "prismatic"}[axis.kind]
    joint = _joint(kind, ends, axis, axis.point)
    return Placed(joint, _start([axis], [axis.coordinate]), {axis.name: axis.coordinate})


def _screw(axis: Axis, ends: Ends) -> Placed:
    """Return a screw joint, whose slide follows its angle."""
    lead = axis.pitch / (2.0 * np.pi)
    joint = replace(_joint("screw", ends, axis, axis.point), parameters=(("pitch", axis.pitch),))
    values = {"angle": axis.value, "slide": lead * axis.value}
    rates = {"angleRate": axis.rate, "slideRate": lead * axis.rate} if axis.rate else {}
    return Placed(joint, Start(values, rates), {axis.name: "angle"})


def _several(group: Sequence[Axis], ends: Ends) -> Placed:
    """Return a planar, a cylindrical or a universal joint."""
    if group[0].crosses:
        return _cross(group, ends)
    hinge = next(axis for axis in group if axis.kind == "hinge")
    slides = [axis for axis in group if axis.kind == "slide"]
    shift = -sum(slide.zero * slide.axis for slide in slides)
    if len(slides) == 1:
        joint = _joint("cylindrical", ends, hinge, hinge.point + shift)
        names = [axis.coordinate for axis in group]
        start = _start(group, names)
        return Placed(joint, start, {a.name: n for a, n in zip(group, names, strict=True)})
    x, z = slides[0].axis, hinge.axis
    joint = _joint("planar", ends, hinge, hinge.point + shift, x)
    sign = float(np.sign(np.cross(z, x) @ slides[1].axis))
    start = _start([*slides, hinge], ["slide1", "slide2", "angle"])
    for values in (start.values, start.rates):
        for name in values.keys() & {"slide2", "slide2Rate"}:
            values[name] *= sign
    found = {slides[0].name: "slide1", hinge.name: "angle"}
    return Placed(joint, start, found | ({slides[1].name: "slide2"} if sign > 0.0 else {}))


def _cross(group: Sequence[Axis], ends: Ends) -> Placed:
    """Return a universal joint: its angles are zero where the parent's reference is along the
    child's axis and the child's along the parent's."""
    a, b = (unit(_vector(axis.axis)) for axis in group)
    pose, point = ends.pose, group[0].point
    rows = np.array(frame(a, b)) @ pose.R.T
    here: Matrix = tuple(unit(_vector(row)) for row in rows)  # type: ignore[assignment]
    points = _vector(pose.p + pose.R @ point), _vector(point)
    joint = Joint(ends.name, "universal", ends.parent, ends.child, *points, here, frame(b, a))
    return Placed(joint, _start(group, ["angle1", "angle2"]), {})


def _start(group: Sequence[Axis], names: Sequence[str]) -> Start:
    """Return values and rates of axes by the names of coordinates."""
    pairs = list(zip(group, names, strict=True))
    return Start(
        {name: axis.value for axis, name in pairs},
        {f"{name}Rate": axis.rate for axis, name in pairs if axis.rate},
    )


def _joint(
    kind: str,
    ends: Ends,
    axis: Axis,
    point: np.ndarray,
    reference: np.ndarray | None = None,
) -> Joint:
    """Return a joint along or about an axis: at the link's pose the axis has the value ``zero``,
    and the parent's point is ``point`` of the link's frame."""
    pose = ends.pose
    z = unit(_vector(axis.axis))
    there = frame(z, None if reference is None else unit(_vector(reference)))
    c, s = (np.cos(axis.zero), np.sin(axis.zero)) if axis.kind in ("hinge", "screw") else (1.0, 0.0)
    back = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.array(there)
    rows = back @ pose.R.T
    here: Matrix = tuple(unit(_vector(row)) for row in rows)  # type: ignore[assignment]
    if axis.kind == "slide":
        point = point - axis.zero * axis.axis
    at = _vector(pose.p + pose.R @ point)
    references: tuple[Vector | None, Vector | None] = (None, None)
    if here == there == frame(z):
        references = shared_references(z, z, None, None)
    points = at, _vector(axis.point)
    return Joint(ends.name, kind, ends.parent, ends.child, *points, here, there, (), *references)


def _ball(axis: Axis, ends: Ends) -> Placed:
    """Return a spherical joint; its orientation is that of the child's axes in the parent's."""
    points = _vector(ends.pose.p + ends.pose.R @ axis.point), _vector(axis.point)
    joint = Joint(ends.name, "spherical", ends.parent, ends.child, *points, IDENTITY, IDENTITY)
    P = _vector(parameters(ends.pose.R @ axis.rotated))
    return Placed(joint, Start(P=P, w=_vector(axis.velocity[1])), {})


def rigid(ends: Ends) -> Placed:
    """Return a rigid joint between bodies with parallel axes; the child's point is its B."""
    points = _vector(ends.pose.p), _vector(HERE.p)
    joint = Joint(ends.name, "rigid", ends.parent, ends.child, *points)
    return Placed(joint, Start(), {})


def motion(axis: Axis) -> Pose:
    """Return where an axis takes its link at t = 0, from the link's pose."""
    if axis.kind == "slide":
        return Pose(np.eye(3), (axis.value - axis.zero) * axis.axis)
    rotates = axis.kind in ("hinge", "screw")
    R = about(axis.axis, axis.value - axis.zero) if rotates else axis.rotated
    advance = axis.pitch * (axis.value - axis.zero) / (2.0 * np.pi)
    return Pose(R, axis.point - R @ axis.point + advance * axis.axis)


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation (3, 3) by an angle [rad] about a unit vector."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K)


def _vector(a: np.ndarray) -> Vector:
    return plain_vector(a)
