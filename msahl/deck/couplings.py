"""Couplings between two joints: elements -> records."""

from msahl.deck.cam import read_lift
from msahl.deck.faults import Element, text
from msahl.deck.named import named_joint
from msahl.deck.values import Reader
from msahl.model.couplings import COORDINATES, Coupling

SCALES = {"gear": ("ratio", ""), "rackAndPinion": ("radius", "length")}
"""Tag and quantity of a coupling's one number."""


def read_coupling(element: Element, reader: Reader) -> Coupling:
    """Record of a ``<gear>``, ``<rackAndPinion>`` or ``<camFollower>``."""
    kind = str(element.tag)
    tags = ("first", "second")
    first, second = (
        named_joint(element, tag, coordinate, reader)
        for tag, coordinate in zip(tags, COORDINATES[kind], strict=True)
    )
    if first == second and reader.faults.sound(element):
        reader.faults.add(element, f"first and second are both '{first}'; couple two joints")
    ratio, lift = 0.0, None
    if kind in SCALES:
        ratio = _ratio(element, *SCALES[kind], reader)
    elif first in reader.joints and second in reader.joints and reader.faults.sound(element):
        lift = read_lift(element, reader.joints[first], reader.joints[second], reader)
    return Coupling(text(element.find("name")), kind, first, second, ratio, lift)


def _ratio(element: Element, tag: str, quantity: str, reader: Reader) -> float:
    place = element.find(tag)
    ratio = reader.number(place, quantity)
    if ratio == 0.0 and place is not None and reader.faults.sound(place):
        message = f"the {tag} is zero, which couples nothing; give another (negative: reversed)"
        reader.faults.add(place, message)
    return ratio
