"""Reader of prescribed motions: elements -> records."""

import math

from msahl.algebra.functions import Law
from msahl.algebra.vector import ZERO, Vector
from msahl.check.context import INERTIAL
from msahl.check.loads import UNIT_LENGTH, element_findings, repeated_motions, speed_jumps
from msahl.deck.faults import Element, line_of, text
from msahl.deck.laws import read_law
from msahl.deck.values import Reader
from msahl.model import Simulation
from msahl.model.motions import JointMotion, PointMotion

UNIT = {"angle": "angle", "slide": "length"}
"""Physical quantity of each joint coordinate."""

NOTHING = Law("constant", (0.0,))
"""Stands for a law with faults."""


def read_joint_motion(element: Element, reader: Reader) -> JointMotion:
    """Return the record of a ``<jointMotion>``."""
    name, joint, coordinate = (text(element.find(tag)) for tag in ("name", "joint", "coordinate"))
    law = read_law(element.find("law"), UNIT[coordinate], reader) or NOTHING
    motion = JointMotion(name, joint, coordinate, law)
    reader.add(element, element_findings(motion, reader.context))
    return motion


def read_point_motion(element: Element, reader: Reader) -> PointMotion:
    """Return the record of a ``<pointMotion>``."""
    body = text(element.find("body"))
    known = body in reader.context.axes
    position = element.find("position")
    motion = PointMotion(
        name=text(element.find("name")),
        body=body,
        point=reader.vector(position, own=body, wanted=body) if known else ZERO,
        direction=_direction(element, reader),
        law=read_law(element.find("law"), "length", reader) or NOTHING,
    )
    reader.add(element, element_findings(motion, reader.context))
    return motion


def _direction(element: Element, reader: Reader) -> Vector:
    """Return the direction of a ``<pointMotion>``, inertial axes; one of length 1 is kept to the
    last digit."""
    direction = element.find("direction")
    given = reader.vector(direction, INERTIAL, INERTIAL)
    if abs(math.hypot(*given) - 1.0) <= UNIT_LENGTH:
        return given
    return reader.direction(direction, INERTIAL) or (0.0, 0.0, 1.0)


def check_speeds(
    elements: list[Element],
    motions: list[JointMotion | PointMotion],
    simulation: Simulation,
    reader: Reader,
) -> None:
    """Add a fault for every motion whose speed jumps in a run by a tolerance."""
    for index, message in speed_jumps(motions, simulation):
        reader.faults.add(elements[index], message, elements[index].find("law"))


def check_prescribed_once(elements: list[Element], reader: Reader) -> None:
    """Add a fault for every joint coordinate that has two prescribed motions that act at t = 0."""
    released = reader.context.released
    motions = [
        e for e in elements if e.tag == "jointMotion" and text(e.find("name")) not in released
    ]
    pairs = [(text(e.find("joint")), text(e.find("coordinate"))) for e in motions]
    for index, message in repeated_motions(pairs, lambda k: f"line {line_of(motions[k])}"):
        reader.faults.add(motions[index], message)
