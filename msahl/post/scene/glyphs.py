"""Describe joints, motions, springs, loads and markers for a scene, by bodies and points."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from msahl.joints.kind_properties import glyph
from msahl.joints.registry import KINDS
from msahl.model import (
    Bushing,
    ConcentratedLoad,
    Coupling,
    Joint,
    JointActuator,
    JointLoad,
    JointMotion,
    JointSpring,
    MarkerActuator,
    MarkerAngle,
    Model,
    PointLoad,
    SpringDamper,
)
from msahl.post.scene.geometry import floats, quaternion

Entry = dict[str, Any]
GROUND = -1

ROTARY = {"coil": "torsion", "strut": "torsion", "damper": "drum"}
"""Glyphs of springs and dampers between directions, by those between points."""
SIDES = ("parent", "child")
COUPLING_GLYPHS = {"gear": "gear", "rackAndPinion": "rack", "camFollower": "cam"}


def numbers(model: Model) -> dict[str, int]:
    """Return the numbers of bodies and grounds by name."""
    found = {ground.name: GROUND for ground in model.grounds}
    return found | {body.name: index for index, body in enumerate(model.bodies)}


def joint_entries(model: Model, body: Mapping[str, int]) -> list[Entry]:
    """Return the joints, then the couplings."""
    place = {joint.name: index for index, joint in enumerate(model.joints)}
    joints = [_joint(joint, body) for joint in model.joints]
    return joints + [_coupling(coupling, joints, place) for coupling in model.couplings]


def _joint(joint: Joint, body: Mapping[str, int]) -> Entry:
    kind = KINDS[joint.kind]
    return {
        "name": joint.name,
        "kind": joint.kind,
        "glyph": glyph(kind),
        "parent": body[joint.parent],
        "parentPoint": floats(joint.parent_point),
        "child": body[joint.child],
        "childPoint": floats(joint.child_point),
        "axis": floats(joint.parent_axes[2]) if kind.axes else None,
        "childAxis": floats(joint.child_axes[2]) if kind.axes else None,
        # A distance of its own at t = 0 is not a number yet, which JSON does not have.
        "parameters": {key: value for key, value in joint.parameters if value == value},
        "joints": None,
    }


def _coupling(coupling: Coupling, joints: list[Entry], place: Mapping[str, int]) -> Entry:
    """Return a coupling as an element between the children of its joints."""
    first, second = place[coupling.first], place[coupling.second]
    driver, driven = joints[first], joints[second]
    return {
        "name": coupling.name,
        "kind": coupling.kind,
        "glyph": COUPLING_GLYPHS[coupling.kind],
        "parent": driver["child"],
        "parentPoint": driver["childPoint"],
        "child": driven["child"],
        "childPoint": driven["childPoint"],
        "axis": driver["childAxis"],
        "childAxis": driven["childAxis"],
        "parameters": {} if coupling.lift else {"ratio": coupling.ratio},
        "joints": [first, second],
    }


def motion_entries(model: Model, body: Mapping[str, int], place: Mapping[str, int]) -> list[Entry]:
    """Return the prescribed motions."""
    found: list[Entry] = []
    for motion in model.motions:
        entry = {"name": motion.name} | dict.fromkeys(
            ("joint", "coordinate", "body", "point", "direction")
        )
        if isinstance(motion, JointMotion):
            entry |= {"joint": place[motion.joint], "coordinate": motion.coordinate}
        else:
            entry |= {"body": body[motion.body], "point": floats(motion.point)}
            entry |= {"direction": floats(motion.direction)}
        found.append(entry)
    return found


def spring_entries(model: Model, body: Mapping[str, int], joints: list[Entry]) -> list[Entry]:
    """Return the spring-dampers between points, along coordinates of joints, and the bushings."""
    place = {joint["name"]: index for index, joint in enumerate(joints)}
    found: list[Entry] = []
    for load in model.loads:
        if isinstance(load, SpringDamper | Bushing):
            a, b = (load.parent, load.parent_point), (load.child, load.child_point)
            ends = [(body[name], floats(point)) for name, point in (a, b)]
            joint, axis = None, None
        elif isinstance(load, JointSpring):
            joint = place[load.joint]
            ends = [(joints[joint][end], joints[joint][f"{end}Point"]) for end in SIDES]
            axis = joints[joint]["axis"]
        else:
            continue
        entry: Entry = {"name": load.name, "glyph": _spring_glyph(load)}
        for end, (number, point) in zip("ab", ends, strict=True):
            entry |= {end: number, f"{end}Point": point}
        found.append(entry | {"joint": joint, "axis": axis})
    return found


def _spring_glyph(load: SpringDamper | JointSpring | Bushing) -> str:
    """Return what a spring-damper is drawn as, by what it does."""
    if isinstance(load, Bushing):
        return "bushing"
    is_spring = load.stiffness != 0.0 or load.table is not None
    found = "coil" if load.damping == 0.0 else "strut" if is_spring else "damper"
    is_rotary = isinstance(load, JointSpring) and load.coordinate == "angle"
    return ROTARY[found] if is_rotary else found


def load_entries(model: Model, body: Mapping[str, int], place: Mapping[str, int]) -> list[Entry]:
    """Return all loads but springs; a key that a load does not have is None."""
    markers = {marker.name: marker for marker in model.markers}
    found: list[Entry] = []
    for load in model.loads:
        entry = dict.fromkeys(("body", "point", "force", "moment", "joint", "coordinate"))
        entry |= dict.fromkeys(("a", "aPoint", "b", "bPoint"))
        entry |= {"name": load.name, "varies": False}
        entry |= {"forceBasis": GROUND, "momentBasis": GROUND}
        if isinstance(load, ConcentratedLoad | PointLoad):
            entry |= {"kind": "drag", "body": body[load.body], "point": floats(load.point)}
            if isinstance(load, ConcentratedLoad):
                entry |= _constant_load(load, body)
        elif isinstance(load, JointLoad | JointActuator):
            kind = "friction" if isinstance(load, JointLoad) else "actuator"
            entry |= {"kind": kind, "joint": place[load.joint], "coordinate": load.coordinate}
        elif isinstance(load, MarkerActuator):
            a, b = markers[load.start], markers[load.end]
            entry |= {"kind": "actuator", "a": body[a.body], "aPoint": floats(a.point)}
            entry |= {"b": body[b.body], "bPoint": floats(b.point)}
        else:
            continue
        found.append(entry)
    return found


def _constant_load(load: ConcentratedLoad, body: Mapping[str, int]) -> Entry:
    return {
        "kind": "force",
        "force": floats(load.force) if any(load.force) else None,
        "forceBasis": body.get(load.force_basis, GROUND),
        "moment": floats(load.moment) if any(load.moment) else None,
        "momentBasis": body.get(load.moment_basis, GROUND),
        "varies": load.law is not None or load.expression is not None,
    }


def marker_entries(model: Model, body: Mapping[str, int]) -> list[Entry]:
    """Return the markers; their orientation is of their axes in those of the body."""
    return [
        {
            "name": marker.name,
            "body": body[marker.body],
            "point": floats(marker.point),
            "orientation": quaternion(np.array(marker.axes).T),
        }
        for marker in model.markers
    ]


def sensor_entries(model: Model) -> list[Entry]:
    """Return distances and angles between markers."""
    place = {marker.name: index for index, marker in enumerate(model.markers)}
    found: list[Entry] = []
    for sensor in model.sensors:
        ends, kind = [sensor.start, sensor.end], "distance"
        if isinstance(sensor, MarkerAngle):
            ends, kind = [sensor.start, sensor.vertex, sensor.end], "angle"
        found.append({"name": sensor.name, "kind": kind, "markers": [place[e] for e in ends]})
    return found
