"""The deck as it ran: the user's own bytes, with step and end as the run had them."""

import hashlib
from io import BytesIO
from os import PathLike
from pathlib import Path

from msahl.deck.faults import Faults
from msahl.deck.parse import parse, parse_with_comments, read_bytes


def effective_deck(
    path: str | PathLike[str],
    dt: float | None = None,
    t_final: float | None = None,
    scheme: str | None = None,
    damping: float | None = None,
    reactions: str | None = None,
    degree: int | None = None,
) -> bytes:
    """The deck at ``path``, which ``read_deck`` has accepted, with what is given of how it is run:
    ``dt`` and ``t_final`` [s], ``scheme``, ``damping``, ``reactions`` and ``degree``.

    With nothing given the bytes are those of the file; otherwise the document is the same, comments
    included, but for ``<simulation>``. Raises ``DeckError`` if the file is no deck any more.
    """
    path = Path(path)
    faults = Faults(str(path))
    data = read_bytes(path, faults)
    parse(data, faults)
    times = {"deltaT": dt, "tFinal": t_final}
    changes = {tag: value for tag, value in times.items() if value is not None}
    share = None if damping is None else repr(float(damping))
    power = None if degree is None else str(degree)
    words = {"scheme": scheme, "degree": power, "damping": share, "reactions": reactions}
    attributes = {key: word for key, word in words.items() if word is not None}
    return _with_simulation(data, changes, attributes) if changes or attributes else data


def _with_simulation(data: bytes, changes: dict[str, float], attributes: dict[str, str]) -> bytes:
    """The document with some children of ``<simulation>`` [sec] and attributes replaced."""
    root = parse_with_comments(data)
    for simulation in root.iterfind("simulation"):
        for key, word in attributes.items():
            simulation.set(key, word)
    for tag, value in changes.items():
        for element in root.iterfind(f"simulation/{tag}"):
            tail = element.tail
            element.clear()
            element.tail = tail
            element.text = repr(float(value))
            element.set("units", "sec")
    tree = root.getroottree()
    encoding = tree.docinfo.encoding or "UTF-8"
    stream = BytesIO()
    tree.write(stream, xml_declaration=True, encoding=encoding)
    return stream.getvalue()


def deck_digest(data: bytes) -> str:
    """SHA-256 of a deck's bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()
