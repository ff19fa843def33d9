"""Reader of couplings between two joints: elements -> records."""

from dataclasses import replace

from msahl.check.joints import SCALES, coupling_findings
from msahl.deck.cam import read_given_lift, read_lift
from msahl.deck.faults import Element, text
from msahl.deck.values import Reader
from msahl.model.couplings import Coupling

QUANTITIES = {"ratio": "", "radius": "length"}
"""Physical quantity of a coupling's one number, by its tag."""


def read_coupling(element: Element, reader: Reader) -> Coupling:
    """Return the record of a ``<gear>``, ``<rackAndPinion>`` or ``<camFollower>``."""
    name, first, second = (text(element.find(tag)) for tag in ("name", "first", "second"))
    kind, ratio = str(element.tag), 0.0
    if kind in SCALES:
        tag = SCALES[kind]
        ratio = reader.number(element.find(tag), QUANTITIES[tag])
    coupling = Coupling(name, kind, first, second, ratio)
    reader.add(element, coupling_findings(coupling, reader.context))
    known = first in reader.joints and second in reader.joints
    if kind not in SCALES and known and reader.faults.sound(element):
        lift = read_given_lift(element, reader)
        if lift is None:
            lift = read_lift(element, reader.joints[first], reader.joints[second], reader)
        return replace(coupling, lift=lift)
    return coupling
