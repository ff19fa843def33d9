"""Joints of MJCF: the axes of a link."""

import math

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.mjcf_settings import Settings, note_unread, rotation_of, several
from msahl.importers.reading import Log, direction, number, numbers
from msahl.importers.robot import Axis, Pose

KINDS = ("hinge", "slide", "ball", "free")
OF_LIMITS = (
    "range", "limited", "margin", "solreflimit", "solimplimit", "solreffriction",
    "solimpfriction",
)  # fmt: skip
"""Attributes of soft limits and friction."""
READ = (
    "name", "class", "type", "pos", "axis", "ref", "springref", "stiffness", "damping",
    "frictionloss", "armature", "springdamper", "group", "user",
)  # fmt: skip


def read_joint(element: Element, name: str, frame: Pose, settings: Settings, log: Log) -> Axis:
    """Return the axis of a ``<joint>`` with resolved attributes, in a ``frame`` of its link."""
    kind = attribute(element, "type", "hinge")
    if element.tag == "freejoint":
        kind = "free"
    if kind not in KINDS:
        log.fault(element, f"type '{kind}' is none of {', '.join(KINDS)}")
        kind = "hinge"
    axis = Axis(name, kind, element)
    axis.point = frame.p + frame.R @ np.array(numbers(element, "pos", log))
    axis.axis = frame.R @ direction(element, "axis", log, (0.0, 0.0, 1.0))
    if element.tag == "freejoint":
        return axis
    unit = settings.degree if kind == "hinge" else 1.0
    axis.zero = axis.value = unit * number(element, "ref", log)
    axis.rest = unit * number(element, "springref", log)
    _read_forces(axis, log)
    _read_range(axis, unit, settings, log)
    note_unread(element, (*READ, *OF_LIMITS), log)
    return axis


def _read_forces(axis: Axis, log: Log) -> None:
    """Read stiffness, damping, dry friction and armature."""
    element = axis.element
    for name in ("stiffness", "damping"):
        first, *powers = several(element, name, log, 8) or [0.0]
        setattr(axis, name, first)
        if any(powers):
            log.lost(element, f"higher powers of its {name}; the first number is taken")
    axis.friction = number(element, "frictionloss", log)
    axis.armature = number(element, "armature", log)
    found = {n: getattr(axis, n) for n in ("stiffness", "damping", "friction", "armature")}
    if min(found.values()) < 0.0:
        log.fault(element, "stiffness, damping, frictionloss and armature must not be negative")


def note_forces(axis: Axis, log: Log) -> None:
    """Note forces of a joint that msahl has nothing for."""
    names = {"ball": ("armature",), "free": ("stiffness", "friction", "armature")}
    lost = [name for name in names.get(axis.kind, ()) if getattr(axis, name)]
    if lost:
        log.lost(axis.element, f"{' and '.join(lost)} of a {axis.kind} joint")


def _read_range(axis: Axis, unit: float, settings: Settings, log: Log) -> None:
    """Read the range of a joint with limits, of which MuJoCo makes soft ones."""
    element = axis.element
    if not settings.is_limited(element, ""):
        return
    if axis.kind not in ("hinge", "slide"):
        log.lost(element, f"the range of a {axis.kind} joint")
        return
    lower, upper = numbers(element, "range", log, count=2)
    if lower < upper:
        axis.lower, axis.upper, axis.limit = unit * lower, unit * upper, element
    else:
        log.fault(element, f"its range is from {lower:g} to {upper:g}; give the lower end first")


def set_coordinates(axis: Axis, q: list[float], v: list[float]) -> None:
    """Give an axis its coordinates ``q`` and rates ``v`` of a keyframe, as many as it has."""
    if axis.kind in ("hinge", "slide"):
        axis.value, axis.rate = q[0], v[0]
        return
    axis.rotated = _rotation(q[-4:])
    if axis.kind == "free":
        axis.placed = Pose(axis.rotated, np.array(q[:3]))
        axis.velocity = np.array(v[:3]), np.array(v[3:])
    else:
        axis.velocity = np.zeros(3), np.array(v)


def _rotation(quaternion: list[float]) -> np.ndarray:
    length = math.hypot(*quaternion)
    return rotation_of(np.array(quaternion)) if length > 0.0 else np.eye(3)


COORDINATES = {"hinge": (1, 1), "slide": (1, 1), "ball": (4, 3), "free": (7, 6)}
"""Numbers of coordinates and of rates of each kind."""
