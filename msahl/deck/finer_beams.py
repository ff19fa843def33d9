"""Decks with more elements of their beams, or with elements of a higher degree.

Places that a deck names, and the ends of all elements, have nodes in the finer deck as well.
"""

from collections.abc import Sequence
from typing import Any

from lxml import etree

from msahl.deck.source import Source
from msahl.model.beams import HIGHEST_DEGREE, Beam


class RefinementError(Exception):
    """A deck cannot be compared with one of a finer mesh."""


def more_elements(text: bytes, source: Source, factor: int, begin: bool = True) -> bytes:
    """Return a deck in plain numbers with ``factor`` times the elements of each beam, which keeps
    where its nodes ``begin``, or not.

    Raises ``RefinementError`` where the deck names a node by its number, which would be another
    place.
    """
    return text if factor == 1 else _refined(text, source, begin, factor, 0)


def higher_degree(text: bytes, source: Source) -> bytes:
    """Return a deck in plain numbers with elements of a degree that is higher by one, or where that
    is the highest, with twice the elements.

    Raises ``RefinementError`` as ``more_elements``, and where the deck says where nodes begin.
    """
    return _refined(text, source, True, 1, 1)


def _refined(text: bytes, source: Source, begin: bool, factor: int, degrees: int) -> bytes:
    beams = {beam.name: beam for beam in Source(source.path, text).model(()).beams}
    root = etree.fromstring(text)
    for name in beams.keys() - {_name(element) for element in _beams(root)}:
        raise RefinementError(f"beam '{name}' is given by its nodes, and not by a line")
    _check_nodes(root, list(beams))
    for element in _beams(root):
        beam = beams[_name(element)]
        nodes = element.findall("nodes")
        if nodes and begin:
            raise RefinementError(
                f"line {element.sourceline}: beam '{beam.name}' begins where <nodes> says, which a "
                'finer mesh cannot; let the deck begin by <simulation start="equilibrium">'
            )
        for given in nodes:
            element.remove(given)
        _set_mesh(element, beam, factor, degrees)
    return etree.tostring(root)


def _beams(root: Any) -> list[Any]:
    return root.findall("system/bodies/beam")


def _name(element: Any) -> str:
    return " ".join((element.findtext("name") or "").split())


def _set_mesh(element: Any, beam: Beam, factor: int, degrees: int) -> None:
    """Write the mesh of a beam into its ``element``."""
    degree = beam.degree + degrees
    if degree > HIGHEST_DEGREE:
        degree, factor = beam.degree, 2 * factor
    for tag, number in (("elements", factor * len(beam.lengths)), ("degree", degree)):
        place = element.find(tag)
        if place is None:
            place = etree.SubElement(element, tag)
        place.text = str(number)


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
