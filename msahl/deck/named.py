"""What an element names beside bodies: a joint, and one of its free motions."""

from msahl.deck.faults import Element, text
from msahl.deck.values import Reader
from msahl.joints.registry import KINDS

UNIT = {"angle": "angle", "slide": "length"}
"""Quantity of each free motion."""


def named_joint(element: Element, tag: str, coordinate: str, reader: Reader) -> str:
    """Name of the joint that the child ``tag`` names; a fault if it lacks the ``coordinate``."""
    label = element.find(tag)
    name = text(label)
    if name in reader.kinds and coordinate not in KINDS[reader.kinds[name]].coordinates:
        reader.faults.add(element, _without(name, coordinate, reader.kinds[name]), label)
    return name


def _without(name: str, coordinate: str, kind: str) -> str:
    """The joint has no such free motion."""
    others = [kind for kind, record in KINDS.items() if coordinate in record.coordinates]
    has = " and ".join(KINDS[kind].coordinates) or "none"
    return (
        f"joint '{name}', a {kind}, has no free {coordinate} to act along (it has: {has}); "
        f"name one of {', '.join(others)}"
    )
