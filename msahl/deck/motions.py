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


def read_joint_motion(element: Element, reader: Reader) -> JointMotion:
    """Record of a ``<jointMotion>``."""
    coordinate = text(element.find("coordinate"))
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
    """Add a fault for every joint coordinate that has two prescribed motions."""
    taken: dict[tuple[str, str], Element] = {}
    for element in elements:
        if element.tag != "jointMotion":
            continue
        joint, coordinate = text(element.find("joint")), text(element.find("coordinate"))
        first = taken.setdefault((joint, coordinate), element)
        if first is not element:
            line = line_of(first)
            message = (
                f"the {coordinate} of '{joint}' already has a prescribed motion (line {line}); "
                "keep one"
            )
            reader.faults.add(element, message)
