"""Joints of SDF: their frames, axes and dynamics; and the tree that they make of the links.

A joint's axes are given in its frame or in another one. All is converted to inertial axes at the
pose of the file, where every coordinate is zero; the tree is laid through the joints from the
ground on, links that are fixed to each other first. A joint whose links are both placed already
closes a loop. One that is passed from its child to its parent has its axes reversed, which keeps
the sign of its coordinate.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from msahl.algebra.rotation_arrays import plain_vector
from msahl.check.directions import PARALLEL, frame, unit
from msahl.deck.faults import Element, attribute
from msahl.importers.reading import Log
from msahl.importers.robot import HERE, Axis, Closure, Link, Pose, Relation, Robot
from msahl.importers.sdf_frames import Scope, body_of, pose_in, rotation_in
from msahl.importers.sdf_values import bound, flag, raw_pose, text_of, value, values

KINDS = {
    "revolute": ("hinge",),
    "continuous": ("hinge",),
    "prismatic": ("slide",),
    "ball": ("ball",),
    "fixed": (),
    "universal": ("hinge", "hinge"),
    "revolute2": ("hinge", "hinge"),
    "screw": ("screw",),
}
"""Types of joints, and what their axes are here, from the parent to the child."""
GEARBOX = "gearbox"
CLOSES = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic",
          "ball": "spherical", "fixed": "rigid", "universal": "universal",
          "revolute2": "universal", "screw": "screw"}  # fmt: skip
"""Joints of the deck that close loops."""
JOINT = ("parent", "child", "pose", "axis", "axis2", "thread_pitch", "screw_thread_pitch",
         "gearbox_ratio", "gearbox_reference_body")  # fmt: skip
UNUSED = ("initial_position", "use_parent_model_frame")
AXIS = ("xyz", "limit", "dynamics", "mimic", *UNUSED)
IN_MODEL = (1, 4)
"""Last version in which axes are given in the axes of the model."""


@dataclass
class Connection:
    """A joint between two links ("": the ground) by their names in the deck, with its ``place`` in
    inertial axes; its ``axes`` have directions in these, and no points yet."""

    name: str
    type: str
    ends: tuple[str, str]
    place: Pose
    element: Element
    axes: list[Axis] = field(default_factory=list)


def read_joints(scope: Scope, outer: Pose, log: Log) -> list[Connection]:
    """Return the joints of a scope that has the pose ``outer``, without those of nested models and
    gearboxes; faults are added."""
    found = []
    for element in scope.element.iterfind("joint"):
        known = (*KINDS, GEARBOX)
        kind = attribute(element, "type")
        if kind not in known:
            log.fault(element, f"type '{kind}' is none of {', '.join(known)}")
        elif kind != GEARBOX:
            found += _connection(scope, element, kind, outer, log)
    return found


def _connection(
    scope: Scope, element: Element, kind: str, outer: Pose, log: Log
) -> list[Connection]:
    """Return a joint; none with a fault."""
    for child in element:
        if child.tag not in JOINT:
            log.lost(child, "msahl has no such element")
    ends = [_end(scope, element, side, log) for side in ("parent", "child")]
    name = attribute(element, "name")
    if None in ends or name not in scope.frames:
        return []
    if ends[0] == ends[1]:
        log.fault(element, "its parent and its child are one link")
        return []
    place = outer.after(pose_in(scope, name, element, log))
    joint = Connection(f"{scope.prefix}{name}", kind, (str(ends[0]), str(ends[1])), place, element)
    kinds = KINDS[kind]
    for number, (axis_kind, tag) in enumerate(zip(kinds, ("axis", "axis2"), strict=False)):
        label = joint.name if not number else f"{joint.name} 2"
        axis = Axis(label, axis_kind, element)
        _read_axis(axis, element.find(tag), scope, joint, outer, log)
        joint.axes.append(axis)
    if kind == "screw":
        joint.axes[0].pitch = _pitch(element, log)
    return [joint]


def _end(scope: Scope, element: Element, side: str, log: Log) -> str | None:
    """Return the link at one end of a joint; None with a fault."""
    end = element.find(side)
    name = text_of(element, side)
    if end is None or not name:
        log.fault(element, f"it has no <{side}>; name a link, or world")
        return None
    return body_of(scope, name, end, log)


def _pitch(element: Element, log: Log) -> float:
    """Return the advance of a screw by one revolution [m]: until SDF 1.10 it is -2 pi by the
    ``thread_pitch`` [rad/m], as Gazebo reads it."""
    if element.find("screw_thread_pitch") is not None:
        pitch = value(element, "screw_thread_pitch", log, 1.0)
    elif element.find("thread_pitch") is not None:
        old = value(element, "thread_pitch", log, 1.0)
        pitch = -2.0 * math.pi / old if old else 0.0
    else:
        pitch = 1.0
    if pitch == 0.0:
        log.fault(element, "its pitch is zero or infinite; give screw_thread_pitch")
    return pitch


def _read_axis(
    axis: Axis, given: Element | None, scope: Scope, joint: Connection, outer: Pose, log: Log
) -> None:
    """Read direction, limits and dynamics of an axis."""
    axis.axis = np.array([0.0, 0.0, 1.0])
    if axis.kind == "ball":
        if given is not None:
            log.lost(given, "a ball joint has no axis, damping and friction here")
        return
    if given is None:
        axis.axis = joint.place.R @ axis.axis
        return
    for child in given:
        if child.tag not in AXIS:
            log.lost(child, "msahl has no such element")
    axis.axis = _direction(given, scope, joint, outer, log)
    dynamics, limit = given.find("dynamics"), given.find("limit")
    if limit is not None:
        _read_limit(axis, limit, joint.type != "continuous", log)
    if value(given, "initial_position", log):
        log.lost(given, "its initial_position: joints start at zero; use --at")
    if dynamics is None:
        return
    axis.damping, axis.friction = (value(dynamics, t, log) for t in ("damping", "friction"))
    axis.stiffness = value(dynamics, "spring_stiffness", log)
    axis.rest = value(dynamics, "spring_reference", log)
    if min(axis.damping, axis.friction, axis.stiffness) < 0.0:
        log.fault(dynamics, "damping, friction and spring_stiffness must not be negative")


def _direction(
    given: Element, scope: Scope, joint: Connection, outer: Pose, log: Log
) -> np.ndarray:
    """Return the direction (3,) of an axis in inertial axes."""
    a = np.array(values(given, "xyz", log, (0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(a))
    if not length > 0.0:
        log.fault(given, "its xyz is zero; give a direction")
        return np.array([0.0, 0.0, 1.0])
    xyz = given.find("xyz")
    named = "" if xyz is None else attribute(xyz, "expressed_in")
    if named and xyz is not None:
        R = outer.R @ rotation_in(scope, named, xyz, log)
    elif scope.version <= IN_MODEL or flag(given, "use_parent_model_frame"):
        R = outer.R
    else:
        R = joint.place.R
    return np.asarray(R @ (a / length))


def _read_limit(axis: Axis, limit: Element, is_bounded: bool, log: Log) -> None:
    """Read the range of an axis; what bounds its rate and its load is listed."""
    lower = bound(limit, "lower", log, -math.inf)
    upper = bound(limit, "upper", log, math.inf)
    if is_bounded and max(-lower, upper) < math.inf and axis.kind != "screw":
        if lower < upper:
            axis.lower, axis.upper, axis.limit = lower, upper, limit
        elif lower == upper:
            log.lost(limit, "its range is one value; make the joint a fixed one")
        else:
            log.lost(limit, "its range is empty: lower is not less than upper; the joint is free")
    elif is_bounded and min(-lower, upper) < math.inf:
        log.lost(limit, "a limit on one side, or of a screw: the joint moves beyond it")
    bounds = {name: bound(limit, name, log, math.inf) for name in ("effort", "velocity")}
    others = [name for name, most in bounds.items() if 0.0 <= most < math.inf]
    if others:
        log.lost(limit, f"its {' and '.join(others)}: nothing bounds the load and the rate")
    if any(limit.find(name) is not None for name in ("stiffness", "dissipation")):
        log.lost(limit, "its stiffness and dissipation: stops are rigid")


def arrange(robot: Robot, poses: Mapping[str, Pose], roots: Iterable[str], static: set[str],
            joints: list[Connection], log: Log) -> None:  # fmt: skip
    """Lay a tree through the links of a robot, which have these ``poses`` in inertial axes, and add
    joints that close loops. Links that no joint connects to the ground float; of each group of them
    the first one in ``roots`` does so."""
    tree = _Tree(robot, poses, joints, log)
    tree.place("", *(robot.links[name] for name in static))
    for root in roots:
        if root not in tree.order:
            link = robot.links[root]
            link.pose, link.axes = poses[root], [Axis(f"{root} floats", "free", link.element)]
            tree.place(root)
    robot.links = {name: robot.links[name] for name in tree.order if name}


class _Tree:
    """The links placed so far, in their ``order``."""

    def __init__(
        self, robot: Robot, poses: Mapping[str, Pose], joints: list[Connection], log: Log
    ) -> None:
        self.robot, self.poses, self.log = robot, {"": HERE, **poses}, log
        self.order: dict[str, None] = {}
        self.used: set[int] = set()
        self.at: dict[str, list[Connection]] = {}
        for joint in joints:
            for end in joint.ends:
                self.at.setdefault(end, []).append(joint)

    def place(self, root: str, *fixed: Link) -> None:
        """Place a link, those ``fixed`` to the ground, and all that joints connect to them."""
        waiting = self._rigidly(root)
        for link in fixed:
            if link.name not in self.order:
                link.parent, link.pose = "", self.poses[link.name]
                waiting += self._rigidly(link.name)
        for name in waiting:  # it grows
            for joint in self.at.get(name, ()):
                if id(joint) in self.used:
                    continue
                self.used.add(id(joint))
                other = joint.ends[joint.ends[0] == name]
                if other in self.order:
                    self._close(joint)
                else:
                    self._attach(joint, name, other)
                    waiting += self._rigidly(other)

    def _rigidly(self, name: str) -> list[str]:
        """Place a link and all that are fixed to it; return these."""
        self.order[name] = None
        found = [name]
        for holder in found:  # it grows
            for joint in self.at.get(holder, ()):
                if joint.type != "fixed" or id(joint) in self.used:
                    continue
                self.used.add(id(joint))
                other = joint.ends[joint.ends[0] == holder]
                if other in self.order:
                    self._close(joint)
                    continue
                self._attach(joint, holder, other)
                self.order[other] = None
                found.append(other)
        return found

    def _attach(self, joint: Connection, holder: str, name: str) -> None:
        """Put a joint into the link that it carries."""
        link, own = self.robot.links[name], self.poses[name]
        link.parent, link.pose = holder, self.poses[holder].inverse().after(own)
        is_reversed = joint.ends[0] == name
        point = own.inverse().after(joint.place).p
        for axis in joint.axes:
            direction = own.R.T @ axis.axis
            axis.axis, axis.point = -direction if is_reversed else direction, point
        link.axes = joint.axes[::-1] if is_reversed else joint.axes
        link.axes[:1] = [replace(one, crosses=len(joint.axes) == 2) for one in link.axes[:1]]

    def _close(self, joint: Connection) -> None:
        """Add a joint that closes a loop."""
        kind = CLOSES[joint.type]
        if len({self._group(end) for end in joint.ends}) == 1:
            self.log.lost(joint.element, "its links are fixed to each other already")
            return
        directions = [axis.axis for axis in joint.axes] or [joint.place.R[:, 2]]
        if abs(directions[0] @ directions[-1]) > PARALLEL and kind == "universal":
            self.log.fault(joint.element, "it closes a loop, and its axes are not at a right angle")
            return
        frames = [Pose(_axes(d), joint.place.p) for d in (directions[0], directions[-1])]
        poses = tuple(
            self.poses[end].inverse().after(one)
            for end, one in zip(joint.ends, frames, strict=True)
        )
        pitch = joint.axes[0].pitch if kind == "screw" else 0.0
        only = joint.axes[0] if len(joint.axes) == 1 and kind != "spherical" else None
        loads = [a.damping or a.friction or a.stiffness or a.limit is not None for a in joint.axes]
        if only is None and any(loads):
            words = (
                "damping, friction, springs and limits of its two axes, because it closes a loop"
            )
            self.log.lost(joint.element, words)
        self.robot.closures.append(
            Closure(joint.name, kind, joint.ends, (poses[0], poses[1]), joint.element, only, pitch)
        )

    def _group(self, name: str) -> str:
        """Return the link that a link is fixed to, directly or through others."""
        while name and not self.robot.links[name].axes:
            name = self.robot.links[name].parent
        return name


def _axes(direction: np.ndarray) -> np.ndarray:
    """Return axes (3, 3), the third along a direction."""
    return np.array(frame(unit(plain_vector(direction)))).T


def read_relations(
    scope: Scope, joints: list[Connection], outer: Pose, robot: Robot, log: Log
) -> None:
    """Read mimic and gearbox joints of a scope that has the pose ``outer``; the axes of its
    ``joints`` have their directions in inertial axes still."""
    axes = {axis.name: axis for joint in joints for axis in joint.axes}
    for joint in joints:
        for axis, tag in zip(joint.axes, ("axis", "axis2"), strict=False):
            mimic = joint.element.find(f"{tag}/mimic")
            if mimic is not None:
                _mimic(mimic, axis, scope, axes, robot, log)
    for element in scope.element.iterfind("joint"):
        if attribute(element, "type") == GEARBOX and attribute(element, "name") in scope.frames:
            _gearbox(element, scope, joints, outer, robot, log)


def _mimic(
    element: Element, axis: Axis, scope: Scope, axes: Mapping[str, Axis], robot: Robot, log: Log
) -> None:
    """Read that an axis follows another: q = multiplier (q_leader - reference) + offset."""
    second = " 2" if attribute(element, "axis") == "axis2" else ""
    leader = axes.get(f"{scope.prefix}{attribute(element, 'joint')}{second}")
    if leader is None or leader is axis or {leader.kind, axis.kind} - {"hinge", "slide"}:
        name = attribute(element, "joint")
        log.fault(element, f"joint '{name}' is no other joint that rotates or slides")
        return
    ratio = value(element, "multiplier", log, 1.0)
    offset = value(element, "offset", log) - ratio * value(element, "reference", log)
    robot.relations.append(Relation(leader.name, axis.name, ratio, offset, element))


def _gearbox(
    element: Element, scope: Scope, joints: list[Connection], outer: Pose, robot: Robot, log: Log
) -> None:
    """Read a gearbox: theta_2 = -ratio theta_1, the angles of child and parent from a reference
    body about ``axis2`` and ``axis``; both have a hinge on that body."""
    ends = [_end(scope, element, side, log) for side in ("parent", "child")]
    base = body_of(scope, text_of(element, "gearbox_reference_body"), element, log)
    ratio = value(element, "gearbox_ratio", log, 1.0)
    if None in ends or base is None:
        return
    name = attribute(element, "name")
    place = outer.after(pose_in(scope, name, element, log))
    box = Connection(name, GEARBOX, (str(ends[0]), str(ends[1])), place, element)
    found = []
    for end, tag in zip(box.ends, ("axis", "axis2"), strict=True):
        hinge = next((j for j in joints if set(j.ends) == {base, end} and len(j.axes) == 1
                      and j.axes[0].kind == "hinge"), None)  # fmt: skip
        if hinge is None:
            log.lost(element, f"there is no hinge between '{end}' and its reference body")
            return
        given = element.find(tag)
        a = place.R[:, 2] if given is None else _direction(given, scope, box, outer, log)
        # The hinge's angle is that of its child about its own axis.
        reverses = (a @ hinge.axes[0].axis < 0.0) != (hinge.ends[1] != end)
        found.append((hinge.axes[0].name, -1.0 if reverses else 1.0))
    (first, s_1), (second, s_2) = found
    if first == second:
        log.fault(element, "its two links have one hinge; name a third link as reference body")
    elif ratio:
        robot.relations.append(Relation(first, second, -ratio * s_1 * s_2, 0.0, element))
    else:
        log.lost(element, "its ratio is zero: the joint moves freely instead")


def named_frames(scope: Scope, outer: Pose, log: Log) -> list[tuple[str, str, Pose]]:
    """Return the ``<frame>`` elements of a scope: name in the deck, link, and pose in inertial
    axes."""
    found = []
    for name, one in scope.frames.items():
        if one.element.tag == "frame":
            link = body_of(scope, name, one.element, log)
            if link:
                pose = outer.after(pose_in(scope, name, one.element, log))
                found.append((f"{scope.prefix}{name}", link, pose))
    return found


def inner_pose(element: Element | None, log: Log) -> Pose:
    """Return the pose of a part of a link in it; a frame that it is relative to is a fault."""
    given = None if element is None else element.find("pose")
    if given is not None and attribute(given, "relative_to"):
        log.fault(given, "poses within a link are relative to it here; delete relative_to")
    return raw_pose(given, log)
