"""Writer of a deck whose model begins at another configuration, as the same model otherwise.

What a deck counts from t = 0, or takes from the places of bodies at t = 0, is made explicit:

    places and velocities of bodies     in place of the deck's and of coordinates of joints
    vectors in axes of other bodies     in the axes of their own
    axes of joints                      on both sides
    springs                             their unloaded lengths and values of joint coordinates
    bushings                            a frame on each side, unloaded where these coincide
    profiles of cams                    in the frame that the cam's joint then has
    auxiliary states                    their values
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lxml.etree import Comment, SubElement, indent

from msahl.algebra.rotation import matrix, to_axis_angle
from msahl.algebra.vector import Vector, dot, times, transpose
from msahl.deck.ends import SIDES
from msahl.deck.faults import Element, Faults, text
from msahl.deck.parse import parse, parse_with_comments
from msahl.deck.read import read_what_is_sound
from msahl.deck.springs import ALONG
from msahl.deck.units import DEFAULTS, to_si
from msahl.deck.values import VECTORS
from msahl.deck.write import document_bytes
from msahl.joints.kind_properties import axis_sides
from msahl.joints.registry import KINDS
from msahl.model import Bushing, Joint, JointSpring, Model
from msahl.model.bodies import RigidBody

UNITS = {"length": "m", "angle": "rad", "velocity": "m/sec", "angularVelocity": "rad/sec"}
"""Units of the numbers that are written, by physical quantity."""


@dataclass(frozen=True)
class Configuration:
    """Where a model begins: ``bodies`` with their places and velocities by name; of springs
    between two points without a free length that ``length`` [m]; of springs along a coordinate of a
    joint its ``travel`` from where the deck begins [m or rad]; values of auxiliary ``states``.
    """

    bodies: Mapping[str, RigidBody]
    length: Mapping[str, float] = field(default_factory=dict)
    travel: Mapping[str, float] = field(default_factory=dict)
    states: Mapping[str, float] = field(default_factory=dict)


def moved_text(data: bytes, path: Path, to: Configuration, note: str) -> bytes:
    """Return the deck ``data``, complete and in plain numbers (see ``effective_text``), with its
    model at another configuration; ``note`` is written at its head.
    """
    document, faults, carried = (
        parse_with_comments(data),
        Faults(str(path)),
        dict[Element, Vector](),
    )
    root = parse(data, faults)
    twins = dict(zip(root.iter("*"), document.iter("*"), strict=True))
    model = read_what_is_sound(root, path, (), faults, {}, carried)
    faults.raise_if_any()
    for element, components in carried.items():
        _set_components(twins[element], components)
    _set_bodies(document, to)
    joints = {joint.name: joint for joint in model.joints}
    for element in document.iterfind("system/joints/*"):
        if element.tag in KINDS:
            _set_joint(element, joints[text(element.find("name"))])
    _set_loads(document, model, to)
    for state in document.iterfind("system/signals/state"):
        state.set("initial", repr(float(to.states[str(state.get("name"))])))
    for simulation in document.iterfind("simulation"):
        simulation.attrib.pop("start", "")
    _set_profiles(document, joints, path)
    document.insert(0, Comment(f" {note} "))
    indent(document)
    return document_bytes(document)


def _set_components(element: Element, components: Vector) -> None:
    """Set a vector element to components [SI] in the axes of its own body, the default."""
    quantity, tags = VECTORS[str(element.tag)]
    for child in list(element):
        element.remove(child)
    element.attrib.pop("basis", "")
    given = list(zip(tags, components, strict=True))
    for tag, value in [(tag, value) for tag, value in given if value] or given[:1]:
        _set_number(SubElement(element, tag), value, quantity)


def _set_number(element: Element, value: float, quantity: str) -> None:
    for child in list(element):  # comments
        element.remove(child)
    element.text = repr(float(value))
    if quantity:
        element.set("units", UNITS[quantity])


def _child(parent: Element, tag: str) -> Element:
    """Return a child, which is added if it is missing."""
    found = parent.find(tag)
    return SubElement(parent, tag) if found is None else found


def _set_nodes(element: Element, to: Configuration) -> None:
    """Set the nodes of a beam, whose initial conditions remain: the unstressed beam is there."""
    name, numbers, k = text(element.find("name")), [], 1
    while (body := to.bodies.get(f"{name}.{k}")) is not None:
        parts = (body.position, body.orientation, body.velocity, body.angular_velocity)
        numbers += [repr(float(value)) for part in parts for value in part]
        k += 1
    _child(element, "nodes").text = " ".join(numbers)


def _set_bodies(document: Element, to: Configuration) -> None:
    """Set the initial conditions of all bodies."""
    grounds = [text(name) for name in document.iterfind("system/bodies/ground/name")]
    for element in document.iterfind("system/bodies/beam"):
        _set_nodes(element, to)
    for element in document.iterfind("system/bodies/rigidBody"):
        body = to.bodies[text(element.find("name"))]
        for old in element.findall("initialConditions"):
            element.remove(old)
        start = SubElement(element, "initialConditions")
        position = SubElement(start, "position")
        if grounds:
            _set_components(position, body.position)
            position.set("basis", grounds[0])
        else:
            own = transpose(matrix(body.orientation))
            _set_components(position, times(own, body.position))
        axis, angle = to_axis_angle(body.orientation)
        if angle:
            rotation = SubElement(SubElement(start, "orientation"), "eulerRotation")
            _set_number(SubElement(rotation, "phi"), angle, "angle")
            for tag, value in zip(("u1", "u2", "u3"), axis, strict=True):
                SubElement(rotation, tag).text = repr(float(value))
        for tag, rate in (("velocity", body.velocity), ("angularVelocity", body.angular_velocity)):
            if any(rate):
                _set_components(SubElement(start, tag), rate)


def _set_joint(element: Element, joint: Joint) -> None:
    """Give an axis to each side whose axis a joint uses, and remove its coordinates at t = 0."""
    for start in element.findall("initialConditions"):
        element.remove(start)
    if KINDS[joint.kind].axes == 0:
        return
    sides = axis_sides(KINDS[joint.kind])
    for side, axes in zip(SIDES, (joint.parent_axes, joint.child_axes), strict=True):
        end = _child(element, side)
        if side in sides:
            _set_components(_child(end, "axis"), axes[2])
        else:
            for tag in ("axis", "reference"):
                for direction in end.findall(tag):
                    end.remove(direction)


def _set_loads(document: Element, model: Model, to: Configuration) -> None:
    """Make explicit where springs are unloaded."""
    loads = {load.name: load for load in model.loads}
    for element in document.iterfind("system/loads/*"):
        load = loads[text(element.find("name"))]
        if load.name in to.length:
            _set_number(_child(element, "freeLength"), to.length[load.name], "length")
        elif isinstance(load, JointSpring) and to.travel[load.name]:
            _move_spring(element, load.free, to.travel[load.name])
        elif isinstance(load, Bushing) and not load.aligned:
            element.set("unloaded", "aligned")
            for side, axes in zip(SIDES, (load.parent_axes, load.child_axes), strict=True):
                end = _child(element, side)
                _set_components(_child(end, "axis"), axes[2])
                _set_components(_child(end, "reference"), axes[0])


def _move_spring(element: Element, free: float, travel: float) -> None:
    """Let a spring along a joint coordinate count from a place further along by ``travel``."""
    _, tag, quantity, _ = ALONG[str(element.tag)]
    table = element.find("table")
    if table is None:
        _set_number(_child(element, tag), free - travel, quantity)
    for entry in () if table is None else table.iterfind(f"entry/{quantity}"):
        _set_number(entry, _in_si(entry, quantity) - travel, quantity)


def _in_si(element: Element, quantity: str) -> float:
    system = "US" if text(element.getroottree().getroot().find("unitSystem")) == "US" else "SI"
    units = element.get("units") or DEFAULTS[system][quantity]
    return to_si(float(element.text or ""), str(units), quantity)


def _set_profiles(document: Element, joints: Mapping[str, Joint], path: Path) -> None:
    """Rotate the profiles of cams into the frames that their joints have now."""
    followers = list(document.iterfind("system/joints/camFollower"))
    if not followers:
        return
    faults = Faults(str(path))
    moved = read_what_is_sound(parse(document_bytes(document), faults), path, (), faults, {})
    now = {joint.name: joint for joint in moved.joints}
    for element in followers:
        name = text(element.find("first"))
        if name in now:
            old, new = joints[name].child_axes, now[name].child_axes
            angle = math.atan2(dot(old[0], new[1]), dot(old[0], new[0]))
            for point in element.iterfind("profile/point"):
                _rotate(point, angle)


def _rotate(point: Element, angle: float) -> None:
    """Rotate a point of a profile about the cam's axis."""
    x, y = (
        0.0 if (child := point.find(tag)) is None else _in_si(child, "length") for tag in ("x", "y")
    )
    c, s = math.cos(angle), math.sin(angle)
    for tag, value in (("x", c * x - s * y), ("y", s * x + c * y)):
        _set_number(_child(point, tag), value, "length")
