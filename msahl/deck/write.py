"""Writer of the deck as it ran: the user's own bytes, with the changes that the run was given."""

import hashlib
from collections.abc import Mapping
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

from lxml.etree import SubElement

from msahl.deck.faults import Faults
from msahl.deck.parse import parse, parse_with_comments, read_bytes, was_parsed

OTHER = {"tolerance": "localTolerance", "localTolerance": "tolerance"}
"""Elements that replace one another."""
UNITS = {
    "deltaT": "sec",
    "tFinal": "sec",
    "outputInterval": "sec",
    "tolerance": "m",
    "localTolerance": "m",
}
"""Settings that are elements of ``<simulation>``, with their units; the others are attributes."""


def effective_deck(path: str | PathLike[str], changes: Mapping[str, Any] | None = None) -> bytes:
    """Return the deck at ``path``, which ``read_deck`` has accepted, with ``changes`` of
    ``<simulation>``: values [s, m] by the names of its elements and attributes.

    Without changes the bytes are those of the file; otherwise the document is the same, comments
    included, but for ``<simulation>``. Raises ``DeckError`` if the file is no deck any more.
    """
    path = Path(path)
    faults = Faults(str(path))
    data = read_bytes(path, faults)
    if not was_parsed(data):
        parse(data, faults)
    changes = changes or {}
    numbers = {
        tag: (repr(float(changes[tag])), unit) for tag, unit in UNITS.items() if tag in changes
    }
    attributes = {
        key: repr(value) if isinstance(value, float) else str(value)
        for key, value in changes.items()
        if key not in UNITS
    }
    return _with_simulation(data, numbers, attributes) if changes else data


def _with_simulation(
    data: bytes, changes: dict[str, tuple[str, str]], attributes: dict[str, str]
) -> bytes:
    """Return the document with children of ``<simulation>`` (number and unit) and attributes
    replaced or added."""
    root = parse_with_comments(data)
    for simulation in root.iterfind("simulation"):
        for key, word in attributes.items():
            simulation.set(key, word)
        for tag, (number, unit) in changes.items():
            for other in simulation.findall(OTHER[tag]) if tag in OTHER else ():
                simulation.remove(other)
            element = simulation.find(tag)
            if element is None:
                element = SubElement(simulation, tag)
            tail = element.tail
            element.clear()
            element.tail = tail
            element.text = number
            element.set("units", unit)
    tree = root.getroottree()
    encoding = tree.docinfo.encoding or "UTF-8"
    stream = BytesIO()
    tree.write(stream, xml_declaration=True, encoding=encoding)
    return stream.getvalue()


def deck_digest(data: bytes) -> str:
    """Return the SHA-256 of a deck's bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()
