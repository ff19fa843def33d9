"""Loads on a body, and friction in a joint: elements -> records."""

import math

from msahl.algebra.vector import ZERO, Vector, axpy, scale, sub
from msahl.deck.faults import Element, text
from msahl.deck.laws import read_law
from msahl.deck.motions import moving_body
from msahl.deck.named import named_joint
from msahl.deck.values import Reader
from msahl.joints.registry import KINDS
from msahl.model.loads import ConcentratedLoad, Drag, Friction


def read_concentrated(element: Element, reader: Reader) -> ConcentratedLoad:
    """Record of a ``<concentrated>`` load; force and moment stay in the axes of their basis."""
    force, moment = element.find("force"), element.find("moment")
    if force is None and moment is None:
        reader.faults.add(element, "it has neither <force> nor <moment>; add one")
    body = moving_body(element, reader)
    return ConcentratedLoad(
        name=text(element.find("name")),
        body=body,
        point=_point(element, "position", body, reader),
        force=reader.components(force),
        force_basis=_basis(force, reader),
        moment=reader.components(moment),
        moment_basis=_basis(moment, reader),
        law=read_law(element.find("law"), "", reader),
    )


def read_body_force(element: Element, reader: Reader) -> ConcentratedLoad:
    """A ``<bodyForce>``, so much per mass, as its resultant at the mass centre."""
    body = moving_body(element, reader)
    acceleration = element.find("acceleration")
    a = reader.components(acceleration)
    basis = _basis(acceleration, reader)
    record = reader.bodies.get(body)
    force, point = (scale(record.mass, a), record.r_BG) if record else (ZERO, ZERO)
    return _force(element, body, point, force, basis, reader)


def read_distributed(element: Element, reader: Reader) -> ConcentratedLoad:
    """A ``<distributed>`` load as its resultant.

    Of p = p_0 + (p_1 - p_0) s/L along the segment, s from 0 to L: the force L (p_0 + p_1)/2 at
    s/L = (p_0 + 2 p_1)/(3 (p_0 + p_1)), exactly, for all p have one direction.
    """
    body = moving_body(element, reader)
    start, end = (_point(element, tag, body, reader) for tag in ("start", "end"))
    first = reader.number(element.find("startLoad"), "lineLoad")
    place = element.find("endLoad")
    last = first if place is None else reader.number(place, "lineLoad")
    direction = element.find("direction")
    basis = _basis(direction, reader)
    length, total = math.dist(start, end), first + last
    if length == 0.0 and reader.faults.sound(element):
        reader.faults.add(element, "<start> and <end> are one point; give two, or a <concentrated>")
    if total == 0.0 and reader.faults.sound(element):
        message = "<startLoad> and <endLoad> cancel; give the <moment> of a <concentrated> load"
        reader.faults.add(element, message)
    if not reader.faults.sound(element):
        return _force(element, body, ZERO, ZERO, basis, reader)
    at = (first + 2.0 * last) / (3.0 * total)
    unit = reader.components(direction)
    size = math.hypot(*unit)
    if size == 0.0 and direction is not None:
        reader.faults.add(direction, "the direction is zero; give a direction, 0 0 1 say")
        size = 1.0
    force = scale(0.5 * length * total / size, unit)
    return _force(element, body, axpy(at, sub(end, start), start), force, basis, reader)


def read_drag(element: Element, reader: Reader) -> Drag:
    """Record of a ``<drag>``."""
    body = moving_body(element, reader)
    point = _point(element, "position", body, reader)
    coefficient = not_negative(element, "coefficient", "dragCoefficient", reader)
    return Drag(text(element.find("name")), body, point, coefficient)


def read_friction(element: Element, reader: Reader) -> Friction:
    """Record of a ``<friction>``."""
    coordinate = text(element.find("coordinate"))
    joint = named_joint(element, "joint", coordinate, reader)
    kind = KINDS.get(reader.kinds.get(joint, ""))
    if kind is not None and not kind.bearing:
        known = ", ".join(name for name, other in KINDS.items() if other.bearing)
        message = f"friction in a {kind.name} is not known; name one of {known}"
        reader.faults.add(element, message, element.find("joint"))
    width = element.find("width")
    speed = reader.number(width, "angularVelocity" if coordinate == "angle" else "velocity")
    if width is not None and speed <= 0.0 and reader.faults.sound(width):
        message = f"it is {speed:g}; it must be greater than zero, a small part of usual speeds"
        reader.faults.add(width, message)
    return Friction(
        name=text(element.find("name")),
        joint=joint,
        coordinate=coordinate,
        coefficient=not_negative(element, "coefficient", "", reader),
        radius=_bearing_radius(element, coordinate, reader),
        width=speed,
    )


def _bearing_radius(element: Element, coordinate: str, reader: Reader) -> float:
    """Arm of the friction about an axis [m]; 1 along it."""
    place = element.find("radius")
    if coordinate == "slide":
        if place is not None:
            reader.faults.add(place, "friction along a slide has no radius; delete it")
        return 1.0
    if place is None:
        reader.faults.add(element, "<radius> is missing; add that of the bearing")
        return 1.0
    return not_negative(element, "radius", "length", reader)


def not_negative(element: Element, tag: str, quantity: str, reader: Reader) -> float:
    """Value of a child that may be zero but not less [SI]; zero without it."""
    place = element.find(tag)
    value = reader.number(place, quantity)
    if value < 0.0 and place is not None:
        reader.faults.add(place, f"it is {value:g}; it must not be less than zero")
    return value


def _force(
    element: Element, body: str, point: Vector, force: Vector, basis: str, reader: Reader
) -> ConcentratedLoad:
    """A resultant force; its moment is none."""
    law = read_law(element.find("law"), "", reader)
    return ConcentratedLoad(text(element.find("name")), body, point, force, basis, ZERO, basis, law)


def _point(element: Element, tag: str, body: str, reader: Reader) -> Vector:
    """Point of a body from its B, its axes [m]."""
    if body not in reader.axes:
        return ZERO
    return reader.vector(element.find(tag), own=body, wanted=body)


def _basis(element: Element | None, reader: Reader) -> str:
    """The basis an element names; else a ground, for the inertial axes are every ground's.

    An absent element is a zero vector, for which any basis will do.
    """
    if element is not None and element.get("basis"):
        return reader.basis(element)
    if reader.grounds:
        return next(iter(reader.grounds))
    if element is not None:
        message = "without basis it is in a ground's axes, but the deck has no ground; add either"
        reader.faults.add(element, message)
    return next((name for name in reader.axes if name), "")
