"""Reader of what a joint's ``<initialConditions>`` and parameters give."""

import math
from collections.abc import Iterator

from msahl.deck.faults import Element, attribute
from msahl.deck.values import Reader
from msahl.joints import coordinates
from msahl.joints.coordinates import ORIENTATION
from msahl.joints.joint import Kind
from msahl.joints.tree import JointStart
from msahl.model.joints import Joint

QUANTITIES = {"angle": ("angle", "angularVelocity"), "slide": ("length", "velocity")}
"""Physical quantity of a coordinate and of its rate, by the first letters of its name."""
ORIENTATION_RATE = "angularVelocity"
"""Element with the rate of an orientation."""


def has_references(kind: Kind) -> bool:
    """Return whether coordinates of this kind count from directions on both sides."""
    return kind.axes > 0 and kind.pose is not None and ORIENTATION not in kind.pose


def read_parameters(element: Element, kind: Kind, reader: Reader) -> tuple[tuple[str, float], ...]:
    """Return every parameter of the kind by name [SI], or its default."""
    values = []
    for name, quantity, default, _ in kind.parameters:
        place = element.find(name)
        absent = place is None and default is not None
        value = default if absent else reader.number(place, quantity)
        values.append((name, value if value is not None else math.nan))
    return tuple(values)


def gives_starts(root: Element) -> bool:
    """Return whether a deck gives a coordinate or a rate of any joint."""
    # XPath is evaluated by libxml2, and ``iterfind`` by Python.
    return bool(root.xpath("boolean(system/joints/*/initialConditions/*[not(self::reaction)])"))


def start_elements(element: Element) -> Iterator[Element]:
    """Yield the coordinates and rates that a joint's ``<initialConditions>`` give."""
    for start in element.iterfind("initialConditions"):
        yield from (child for child in start if child.tag != "reaction")


def read_joint_start(element: Element, joint: Joint, reader: Reader) -> JointStart:
    """Return what a joint's ``<initialConditions>`` give; faults for coordinates it has not."""
    start, names = JointStart(joint), coordinates.coordinates(joint)
    for child in start_elements(element):
        tag = str(child.tag)
        name = ORIENTATION if tag == ORIENTATION_RATE else tag.removesuffix("Rate")
        if name not in names:
            has = ", ".join(names) or "none"
            message = f"a {joint.kind} has no coordinate {name} (it has: {has}); delete <{tag}>"
            reader.faults.add(child, message)
        elif tag == ORIENTATION_RATE:
            pass  # in axes that may still be unknown
        elif tag != name:
            start.rates[tag] = reader.number(child, _quantities(name)[1])
        else:
            given = start.guesses if _is_approximate(child) else start.values
            if name == ORIENTATION:
                given[name], start.P = 0.0, reader.parameters_of(child)
            else:
                given[name] = reader.number(child, _quantities(name)[0])
    return start


def _is_approximate(element: Element) -> bool:
    return attribute(element, "approximate") == "true"


def _quantities(name: str) -> tuple[str, str]:
    return QUANTITIES[name.rstrip("12")]
