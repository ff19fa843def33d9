"""Decks with more elements of their beams, and the error in space of an equilibrium.

    u_n - u = c n^-q        q = 2 p of elements of degree p, so twice the elements suffice

Positions are compared where both have nodes: at the ends of the beams and at the places that the
deck names; and at all other bodies.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from lxml import etree

from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.search import find
from msahl.analysis.equilibria.tables import state_row
from msahl.analysis.linearised.point import Point
from msahl.deck.source import Source
from msahl.model import Model
from msahl.start.velocities import StartError
from msahl.system.names import STATE_COLUMNS

SAME = 1e-9
"""Distance of two places, relative to the length of a beam, that counts as zero."""


class RefinementError(Exception):
    """A deck cannot be compared with one of more elements."""


def equilibrium_error(source: Source, text: bytes, found: Point, rotation: np.ndarray) -> float:
    """Return the error in space [m] of an equilibrium ``found`` of the deck ``text`` in plain
    numbers, in a steady ``rotation`` (3,) [rad/s]: the largest of a position at the ends of beams,
    at places that the deck names, and of other bodies.

    Raises ``RefinementError`` if there is none with twice the elements, or the deck names nodes by
    numbers.
    """
    model = Source(source.path, refined(text, source, 2, begin=False)).model(())
    try:
        finer = find(search_start(model), rotation)
    except StartError as error:
        raise RefinementError(str(error)) from error
    if finer is None:
        raise RefinementError("no equilibrium was found with twice the elements")
    places = [by_name(point.model, state_row(point)[None]) for point in (found, finer.place.point)]
    common = [key for key in places[0] if key in places[1]]
    change = max(float(np.abs(places[0][key] - places[1][key]).max()) for key in common)
    ratio = 2.0 ** (2 * min(beam.degree for beam in found.model.beams))
    return change * ratio / (ratio - 1.0)


def refined(text: bytes, source: Source, factor: int, begin: bool = True) -> bytes:
    """Return a deck in plain numbers with ``factor`` times the elements of each beam, which keeps
    where its nodes ``begin``, or not.

    Raises ``RefinementError`` where the deck names a node by its number, which would be another
    place.
    """
    if factor == 1:
        return text
    beams = Source(source.path, text).model(()).beams
    root = etree.fromstring(text)
    _check_nodes(root, [beam.name for beam in beams])
    numbers = {beam.name: len(beam.lengths) for beam in beams}
    for element in root.iterfind("system/bodies/beam"):
        name = " ".join((element.findtext("name") or "").split())
        place = element.find("elements")
        if place is None:
            place = etree.SubElement(element, "elements")
        place.text = str(factor * numbers[name])
        for nodes in [] if begin else element.findall("nodes"):
            element.remove(nodes)
    return etree.tostring(root)


def _check_nodes(root: Any, beams: Sequence[str]) -> None:
    """Raise ``RefinementError`` where a deck names a node of ``beams`` by a number but 1."""
    for element in root.iter(etree.Element):
        beam, _, node = (element.text or "").strip().rpartition(".")
        node = element.get("node", node if beam in beams else "")
        if node.isdigit() and node != "1":
            raise RefinementError(
                f"line {element.sourceline} names node {node} of a beam, which is another place "
                'with more elements; name it by its station, such as station="0.25"'
            )


def by_name(model: Model, rows: np.ndarray) -> dict[tuple[str, float], np.ndarray]:
    """Positions (times, 3) in ``rows`` of states (times, ...), by name and share."""
    states = rows.reshape(-1, len(model.bodies), len(STATE_COLUMNS))
    number = {body.name: index for index, body in enumerate(model.bodies)}
    found = {}
    for beam in model.beams:
        for k in range(0, len(beam.nodes), beam.degree):
            share = round(beam.stations[k] / beam.stations[-1] / SAME) * SAME
            found[beam.name, share] = states[:, number[beam.nodes[k]], :3]
        for name in beam.nodes:
            del number[name]
    return found | {(name, -1.0): states[:, index, :3] for name, index in number.items()}
