"""The deck as it ran: the user's own bytes, with step and end as the run had them."""

import hashlib
from io import BytesIO
from os import PathLike
from pathlib import Path

from lxml.etree import SubElement

from msahl.deck.faults import Faults
from msahl.deck.parse import parse, parse_with_comments, read_bytes

OTHER = {"tolerance": "localTolerance", "localTolerance": "tolerance"}
"""Elements that replace one another."""


def effective_deck(
    path: str | PathLike[str],
    dt: float | None = None,
    t_final: float | None = None,
    scheme: str | None = None,
    damping: float | None = None,
    rotation_update: str | None = None,
    reactions: str | None = None,
    degree: int | None = None,
    interval: float | None = None,
    tolerance: float | None = None,
    local_tolerance: float | None = None,
) -> bytes:
    """The deck at ``path``, which ``read_deck`` has accepted, with what is given of how it is run:
    ``dt``, ``t_final`` and ``interval`` [s], ``tolerance`` or ``local_tolerance`` [m], ``scheme``,
    ``damping``, ``rotation_update``, ``reactions`` and ``degree``.

    With nothing given the bytes are those of the file; otherwise the document is the same, comments
    included, but for ``<simulation>``. Raises ``DeckError`` if the file is no deck any more.
    """
    path = Path(path)
    faults = Faults(str(path))
    data = read_bytes(path, faults)
    parse(data, faults)
    numbers = {
        "deltaT": (dt, "sec"),
        "tFinal": (t_final, "sec"),
        "outputInterval": (interval, "sec"),
        "tolerance": (tolerance, "m"),
        "localTolerance": (local_tolerance, "m"),
    }
    changes = {
        tag: (repr(float(value)), unit)
        for tag, (value, unit) in numbers.items()
        if value is not None
    }
    share = None if damping is None else repr(float(damping))
    power = None if degree is None else str(degree)
    words = {
        "scheme": scheme,
        "degree": power,
        "damping": share,
        "rotationUpdate": rotation_update,
        "reactions": reactions,
    }
    attributes = {key: word for key, word in words.items() if word is not None}
    return _with_simulation(data, changes, attributes) if changes or attributes else data


def _with_simulation(
    data: bytes, changes: dict[str, tuple[str, str]], attributes: dict[str, str]
) -> bytes:
    """The document with some children of ``<simulation>``, number and unit, and attributes replaced
    or added.
    """
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
    """SHA-256 of a deck's bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()
