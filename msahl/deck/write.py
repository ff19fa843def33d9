"""The deck as it ran: the user's own bytes, with step and end as the run had them."""

import hashlib
from io import BytesIO
from os import PathLike
from pathlib import Path

from msahl.deck.faults import Faults
from msahl.deck.parse import parse, parse_with_comments, read_bytes


def effective_deck(
    path: str | PathLike[str], dt: float | None = None, t_final: float | None = None
) -> bytes:
    """The deck at ``path``, which ``read_deck`` has accepted, with ``dt`` and ``t_final`` [s].

    Without either the bytes are those of the file; otherwise the document is the same, comments
    included, but for these two elements. Raises ``DeckError`` if the file is no deck any more.
    """
    path = Path(path)
    faults = Faults(str(path))
    data = read_bytes(path, faults)
    parse(data, faults)
    given = {"deltaT": dt, "tFinal": t_final}
    changes = {tag: value for tag, value in given.items() if value is not None}
    return _with_times(data, changes) if changes else data


def _with_times(data: bytes, changes: dict[str, float]) -> bytes:
    """The document with the text of some children of ``<simulation>`` replaced [sec]."""
    root = parse_with_comments(data)
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
