"""Writer of the deck as it ran: the user's own bytes, with the changes that the run was given."""

import hashlib
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import TypedDict, Unpack, cast

from lxml.etree import SubElement

from msahl.deck.faults import Faults
from msahl.deck.parse import parse, parse_with_comments, read_bytes

OTHER = {"tolerance": "localTolerance", "localTolerance": "tolerance"}
"""Elements that replace one another."""

ELEMENTS = {
    "dt": ("deltaT", "sec"),
    "t_final": ("tFinal", "sec"),
    "interval": ("outputInterval", "sec"),
    "tolerance": ("tolerance", "m"),
    "local_tolerance": ("localTolerance", "m"),
}
"""Tag and unit of the changes that are children of ``<simulation>``."""

ATTRIBUTES = {
    "scheme": "scheme",
    "degree": "degree",
    "damping": "damping",
    "rotation_update": "rotationUpdate",
    "reactions": "reactions",
}
"""Names of the changes that are attributes of ``<simulation>``."""


class Changes(TypedDict, total=False):
    """Changes of how a deck is run: times [s], tolerances [m], scheme and its settings. None leaves
    the deck's own value."""

    dt: float | None
    t_final: float | None
    scheme: str | None
    damping: float | None
    rotation_update: str | None
    reactions: str | None
    degree: int | None
    interval: float | None
    tolerance: float | None
    local_tolerance: float | None


def effective_deck(path: str | PathLike[str], **given: Unpack[Changes]) -> bytes:
    """Return the deck at ``path``, which ``read_deck`` has accepted, with the changes ``given``.

    Without changes the bytes are those of the file; otherwise the document is the same, comments
    included, apart from ``<simulation>``. Raises ``DeckError`` if the file is no deck any more.
    """
    path = Path(path)
    faults = Faults(str(path))
    data = read_bytes(path, faults)
    parse(data, faults)
    elements: dict[str, tuple[str, str]] = {}
    attributes: dict[str, str] = {}
    for key, value in given.items():
        if value is None:
            continue
        if key in ELEMENTS:
            tag, unit = ELEMENTS[key]
            elements[tag] = (repr(float(cast(float, value))), unit)
        else:
            attributes[ATTRIBUTES[key]] = (
                repr(float(cast(float, value))) if key == "damping" else str(value)
            )
    return _with_simulation(data, elements, attributes) if elements or attributes else data


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
