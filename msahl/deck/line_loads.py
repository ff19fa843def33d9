"""Reader of loads on all nodes of beams: elements -> a concentrated load on each node.

A load per length has the shares of Lobatto's formula, as the masses of the nodes have: these loads
do the same work in a displacement of the element's degree, to the order of its error.
"""

import math
from collections.abc import Iterator

from msahl.algebra.vector import ZERO, Vector, scale
from msahl.check.loads import direction_findings, element_findings
from msahl.deck.faults import Element, attribute, text
from msahl.deck.loads import basis_of, expression_of, law_of
from msahl.deck.values import Reader
from msahl.model.bodies import RigidBody
from msahl.model.loads import ConcentratedLoad


def read_beam_force(element: Element, reader: Reader) -> Iterator[ConcentratedLoad]:
    """Yield the loads of a ``<bodyForce>``, a force per mass, at the mass centres of the nodes."""
    given = element.find("acceleration")
    a = reader.components(given)
    nodes = reader.beams[text(element.find("body"))]
    forces = [(node, node.r_BG, scale(node.mass, a)) for node in nodes]
    yield from _loads(element, given, forces, reader)


def read_line_load(element: Element, reader: Reader) -> Iterator[ConcentratedLoad]:
    """Yield the loads of a ``<distributed>`` load per length."""
    beam = text(element.find("body"))
    for tag in ("start", "end"):
        place = element.find(tag)
        if place is not None:
            message = f"'{beam}' is a beam; give <{tag}Station> in place of <{tag}>, or neither"
            reader.faults.add(place, message)
    start, end = (
        default if (place := element.find(tag)) is None else reader.number(place)
        for tag, default in (("startStation", 0.0), ("endStation", 1.0))
    )
    if not start < end:
        reader.faults.add(element, "<startStation> is not before <endStation>; correct one of them")
    first = reader.number(element.find("startLoad"), "lineLoad")
    place = element.find("endLoad")
    last = first if place is None else reader.number(place, "lineLoad")
    direction = element.find("direction")
    unit = reader.components(direction)
    size = math.hypot(*unit)
    if direction is not None and reader.faults.sound(element):
        reader.add(direction, direction_findings("direction", unit))
    nodes = reader.beams[beam]
    if not nodes or not reader.faults.sound(element):
        return
    length = reader.lengths[beam]
    shares = reader.meshes[beam].shares(start, end, first, last)
    forces = [
        (nodes[k - 1], ZERO, scale(length * share / size, unit)) for k, share in shares.items()
    ]
    yield from _loads(element, direction, forces, reader)


def _loads(
    element: Element,
    vector: Element | None,
    forces: list[tuple[RigidBody, Vector, Vector]],
    reader: Reader,
) -> Iterator[ConcentratedLoad]:
    """Yield a load for each node, point and force, in the basis that the element ``vector`` names;
    that of the beam is each node's own axes."""
    name, beam = text(element.find("name")), text(element.find("body"))
    follows = vector is not None and attribute(vector, "basis") == beam
    basis = "" if follows else basis_of(vector, reader)
    law, expression = law_of(element, reader), expression_of(element, reader)
    for node, point, force in forces:
        basis_of_load = node.name if follows else basis
        load = ConcentratedLoad(
            f"{name}.{node.name.rpartition('.')[2]}",
            *(node.name, point, force, basis_of_load, ZERO, basis_of_load, law, expression),
        )
        reader.add(element, element_findings(load, reader.context))
        yield load
