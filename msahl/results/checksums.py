"""Checksums of the files of a run, by which a reader sees what was altered after it."""

import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msahl.printable import shown_path
from msahl.results.folder import find, tables
from msahl.results.write import DECK

CHECKSUMS = "checksums"
"""Their field in ``run.json``: the CRC-32 of each file by name, in hexadecimal digits."""
PIECE = 1 << 20
"""Bytes that are read at a time."""


def checksums(work: Path) -> dict[str, str]:
    """Return the checksums of the tables and of the deck of the run in ``work``."""
    paths = ((name, find(work, name)) for name in (*tables(work), DECK))
    return {name: _checksum(path) for name, path in paths if path is not None}


def altered(folder: Path, info: Mapping[str, Any]) -> list[str]:
    """Return the paths of the files of the run in ``folder`` that are not those which its
    ``run.json``, with the content ``info``, was written with.
    """
    known = info.get(CHECKSUMS, {})
    paths = {name: find(folder, name) for name in known}
    return [
        shown_path(path)
        for name, path in paths.items()
        if path is not None and _checksum(path) != known[name]
    ]


def _checksum(path: Path) -> str:
    value = 0
    with path.open("rb", buffering=0) as file:
        while piece := file.read(PIECE):
            value = zlib.crc32(piece, value)
    return f"{value:08x}"
