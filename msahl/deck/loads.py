"""Reader of loads on a body, and of friction in a joint: elements -> records."""

import math

from msahl.algebra.functions import Law
from msahl.algebra.vector import ZERO, Vector, axpy, scale, sub
from msahl.check.loads import direction_findings, element_findings
from msahl.deck.faults import Element, text
from msahl.deck.laws import read_law
from msahl.deck.signals import read_factor
from msahl.deck.values import Reader
from msahl.expressions.syntax import Tree
from msahl.laws.law import CoordinateLaw, PointLaw
from msahl.laws.registry import JOINT_LAWS, POINT_LAWS
from msahl.model.loads import ConcentratedLoad, JointLoad, PointLoad


def read_concentrated(element: Element, reader: Reader) -> ConcentratedLoad:
    """Return the record of a ``<concentrated>`` load, in the axes of the vectors' bases."""
    force, moment = element.find("force"), element.find("moment")
    if force is None and moment is None:
        reader.faults.add(element, "it has neither <force> nor <moment>; add one")
    body = text(element.find("body"))
    load = ConcentratedLoad(
        name=text(element.find("name")),
        body=body,
        point=_point(element, "position", body, reader),
        force=reader.components(force),
        force_basis=basis_of(force, reader),
        moment=reader.components(moment),
        moment_basis=basis_of(moment, reader),
        law=law_of(element, reader),
        expression=expression_of(element, reader),
    )
    reader.add(element, element_findings(load, reader.context))
    return load


def law_of(element: Element, reader: Reader) -> Law | None:
    """Return the law of time that multiplies a load, None without one."""
    return (
        None
        if element.find("law/expression") is not None
        else read_law(element.find("law"), "", reader)
    )


def expression_of(element: Element, reader: Reader) -> Tree | None:
    """Return the expression of the motion that multiplies a load, None without one."""
    expression = element.find("law/expression")
    return None if expression is None else read_factor(expression, reader)


def read_body_force(element: Element, reader: Reader) -> ConcentratedLoad:
    """Return a ``<bodyForce>``, a force per mass, as its resultant at the mass centre."""
    acceleration = element.find("acceleration")
    a = reader.components(acceleration)
    record = reader.bodies.get(text(element.find("body")))
    force, point = (scale(record.mass, a), record.r_BG) if record else (ZERO, ZERO)
    return _resultant(element, point, force, acceleration, reader)


def read_distributed(element: Element, reader: Reader) -> ConcentratedLoad:
    """Return a ``<distributed>`` load as its resultant.

    Of p = p_0 + (p_1 - p_0) s/L along the segment, s from 0 to L: the force L (p_0 + p_1)/2 at
    s/L = (p_0 + 2 p_1)/(3 (p_0 + p_1)), exactly, for all p have one direction.
    """
    body = text(element.find("body"))
    for tag in ("start", "end"):
        stations = element.find(f"{tag}Station")
        if element.find(tag) is None:
            message = f"<{tag}> is missing; add the {tag} of the segment from B of '{body}'"
            reader.faults.add(element, message)
        elif stations is not None:
            message = f"'{body}' is no beam and has no stations; delete <{tag}Station>"
            reader.faults.add(stations, message)
    start, end = (_point(element, tag, body, reader) for tag in ("start", "end"))
    first = reader.number(element.find("startLoad"), "lineLoad")
    place = element.find("endLoad")
    last = first if place is None else reader.number(place, "lineLoad")
    direction = element.find("direction")
    length, total = math.dist(start, end), first + last
    if length == 0.0 and reader.faults.sound(element):
        reader.faults.add(element, "<start> and <end> are one point; give two, or a <concentrated>")
    if total == 0.0 and reader.faults.sound(element):
        message = "<startLoad> and <endLoad> cancel; give the <moment> of a <concentrated> load"
        reader.faults.add(element, message)
    unit = reader.components(direction)
    size = math.hypot(*unit)
    if direction is not None and reader.faults.sound(element):
        reader.add(direction, direction_findings("direction", unit))
    if not reader.faults.sound(element):
        return _resultant(element, ZERO, ZERO, direction, reader)
    at = (first + 2.0 * last) / (3.0 * total)
    force = scale(0.5 * length * total / size, unit)
    return _resultant(element, axpy(at, sub(end, start), start), force, direction, reader)


def read_point_load(element: Element, reader: Reader) -> PointLoad:
    """Return the record of a force at a point by a law of ``msahl.laws``."""
    law, body = POINT_LAWS[str(element.tag)], text(element.find("body"))
    load = PointLoad(
        name=text(element.find("name")),
        law=law.name,
        body=body,
        point=_point(element, "position", body, reader),
        parameters=_parameters(element, law, reader),
    )
    reader.add(element, element_findings(load, reader.context))
    return load


def _parameters(
    element: Element, law: PointLaw | CoordinateLaw, reader: Reader, coordinate: str = ""
) -> tuple[tuple[str, float], ...]:
    """Return the numbers of a law by name [SI]; it may act along a ``coordinate`` of a joint."""
    found = []
    for field in law.fields:
        place, quantity, value = element.find(field.name), field.quantity_along(coordinate), 1.0
        if quantity is None and place is not None:
            message = f"{law.name} along a {coordinate} has no {field.name}; delete it"
            reader.faults.add(place, message)
        elif quantity is not None and place is not None:
            value = reader.number(place, quantity)
        elif quantity is not None and field.default is not None:
            value = field.default
        elif quantity is not None:
            reader.faults.add(element, f"<{field.name}> is missing; add it")
        found.append((field.name, value))
    return tuple(found)


def read_joint_load(element: Element, reader: Reader) -> JointLoad:
    """Return the record of a force along a joint's coordinate by a law of ``msahl.laws``."""
    law, coordinate = JOINT_LAWS[str(element.tag)], text(element.find("coordinate"))
    load = JointLoad(
        name=text(element.find("name")),
        law=law.name,
        joint=text(element.find("joint")),
        coordinate=coordinate,
        parameters=_parameters(element, law, reader, coordinate),
    )
    reader.add(element, element_findings(load, reader.context))
    return load


def _resultant(
    element: Element, point: Vector, force: Vector, vector: Element | None, reader: Reader
) -> ConcentratedLoad:
    """Return a force without moment at a point, in the basis that the element ``vector`` names."""
    name, body = text(element.find("name")), text(element.find("body"))
    basis = basis_of(vector, reader)
    law, expression = law_of(element, reader), expression_of(element, reader)
    load = ConcentratedLoad(name, body, point, force, basis, ZERO, basis, law, expression)
    reader.add(element, element_findings(load, reader.context))
    return load


def _point(element: Element, tag: str, body: str, reader: Reader) -> Vector:
    """Return a point of a body from its B, body axes [m]."""
    if body not in reader.context.axes:
        return ZERO
    return reader.vector(element.find(tag), own=body, wanted=body)


def basis_of(element: Element | None, reader: Reader) -> str:
    """Return the basis that an element names, or else a ground, since every ground has the inertial
    axes. For a missing element, a zero vector, any basis serves."""
    if element is not None and element.get("basis"):
        return reader.basis(element)
    if reader.context.grounds:
        return next(iter(reader.context.grounds))
    if element is not None:
        message = "without basis it is in a ground's axes, but the deck has no ground; add either"
        reader.faults.add(element, message)
    return next(iter(reader.context.bodies()), "")
