"""Joints of MJCF: the axes of a link."""

import math

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.mjcf_settings import Settings, rotation_of, several
from msahl.importers.reading import Log, direction, number, numbers
from msahl.importers.robot import Axis, Pose

KINDS = ("hinge", "slide", "ball", "free")
STOPS = "limits are not made contacts: the joint moves beyond its range"
OF_LIMITS = (
    "range", "limited", "margin", "solreflimit", "solimplimit", "solreffriction",
    "solimpfriction",
)  # fmt: skip
"""Attributes of soft limits and friction."""
READ = (
    "name", "class", "type", "pos", "axis", "ref", "springref", "stiffness", "damping",
    "frictionloss", "armature", "group", "user",
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
    _note_others(element, settings, log)
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
    if axis.kind == "free" and any(found.values()):
        log.lost(element, "forces along a free joint, and its armature")
    if axis.kind == "ball":
        lost = [name for name in found if found[name]]
        if lost:
            log.lost(element, f"{' and '.join(lost)} of a ball joint")


def _note_others(element: Element, settings: Settings, log: Log) -> None:
    """Note limits, and attributes that msahl has nothing for."""
    if settings.is_limited({str(k): str(v) for k, v in element.attrib.items()}, ""):
        log.lost(element, STOPS)
    for name in map(str, element.attrib):
        if name not in READ and name not in OF_LIMITS:
            log.lost(element, f"its {name}")


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
