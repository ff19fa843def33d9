"""Prescribed motions: elements -> records."""

from msahl.algebra.functions import Law
from msahl.algebra.vector import ZERO
from msahl.deck.faults import Element, line_of, text
from msahl.deck.laws import read_law
from msahl.deck.named import UNIT, named_joint
from msahl.deck.values import INERTIAL, Reader
from msahl.model.motions import JointMotion, PointMotion

NOTHING = Law("constant", (0.0,))
"""Stands for a law with faults."""


def read_drive(element: Element, reader: Reader) -> JointMotion:
    """Record of a ``<drive>``."""
    coordinate = text(element.find("freedom"))
    joint = named_joint(element, "joint", coordinate, reader)
    law = read_law(element.find("law"), UNIT[coordinate], reader) or NOTHING
    return JointMotion(text(element.find("name")), joint, coordinate, law)


def read_point_motion(element: Element, reader: Reader) -> PointMotion:
    """Record of a ``<pointMotion>``."""
    body = moving_body(element, reader)
    known = body in reader.axes
    position, way = element.find("position"), element.find("direction")
    return PointMotion(
        name=text(element.find("name")),
        body=body,
        point=reader.vector(position, own=body, wanted=body) if known else ZERO,
        direction=reader.direction(way, INERTIAL) or (0.0, 0.0, 1.0),
        law=read_law(element.find("law"), "length", reader) or NOTHING,
    )


def moving_body(element: Element, reader: Reader) -> str:
    """Name of the rigid body an element acts on."""
    label = element.find("body")
    body = text(label)
    if body in reader.grounds:
        message = f"'{body}' is a ground and never moves; name a rigid body"
        reader.faults.add(element, message, label)
    return body


def check_driven_once(elements: list[Element], reader: Reader) -> None:
    """No free motion of a joint has two drives."""
    taken: dict[tuple[str, str], Element] = {}
    for element in elements:
        if element.tag != "drive":
            continue
        joint, coordinate = text(element.find("joint")), text(element.find("freedom"))
        first = taken.setdefault((joint, coordinate), element)
        if first is not element:
            line = line_of(first)
            message = f"the {coordinate} of '{joint}' is driven already (line {line}); keep one"
            reader.faults.add(element, message)
