"""The journal of a sweep: a line for each outcome, with a checksum.

A line is JSON, and its last field is the checksum of all before it. So an outcome that a killed
process or a full disk left torn, or that was changed afterwards, is none: its point is run again.
"""

import hashlib
import os
import re
import time
from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path

import orjson

from msahl.locks import lock
from msahl.printable import shown_path
from msahl.sweep.faults import StoreError
from msahl.sweep.points import Row

SYNC_SECONDS = 2.0
"""Time after which lines are flushed to the disk: what a power failure may lose [s]."""
BINARY = getattr(os, "O_BINARY", 0)
"""Windows would write other ends of lines, which the checksums do not know."""
END = re.compile(rb',"sum":"([0-9a-f]{16})"\}\n\Z')


class Journal:
    """A journal that rows are appended to, opened when that is wanted: a sweep that is complete may
    belong to another user. Raises ``OSError`` if it cannot be written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.synced = time.monotonic()

    @cached_property
    def file(self) -> int:
        """The descriptor of the file."""
        opened = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND | BINARY, 0o666)
        size = os.fstat(opened).st_size
        os.lseek(opened, max(0, size - 1), os.SEEK_SET)
        if size and os.read(opened, 1) != b"\n":
            os.write(opened, b"\n")  # ends a torn line
        return opened

    def lock(self) -> None:
        """Lock the file until it is closed, where that is possible; raises ``StoreError`` if
        another process has locked it."""
        if not lock(self.file):
            raise StoreError(
                f"{shown_path(self.path)}: another process is running the same points; wait for "
                "its end, or stop it"
            )

    def append(self, lines: Iterable[bytes]) -> None:
        """Append lines, as ``line_of`` makes them."""
        self._write(b"".join(lines))
        if time.monotonic() - self.synced > SYNC_SECONDS:
            self.sync()

    def _write(self, content: bytes) -> None:
        while content:
            content = content[os.write(self.file, content) :]

    def sync(self) -> None:
        """Flush all lines to the disk."""
        os.fsync(self.file)
        self.synced = time.monotonic()

    def close(self) -> None:
        """Flush and close the file, if it was opened."""
        if "file" not in vars(self):
            return
        try:
            self.sync()
        finally:
            os.close(self.file)
            del self.file


def journal_of_shard(k: int, n: int) -> str:
    """The name of the journal of shard ``k`` of ``n``."""
    return f"journal-{k}-of-{n}.jsonl"


def line_of(row: Row) -> bytes:
    """Return the line of a row, which ends with the checksum of all before it."""
    content = orjson.dumps(row)[:-1]
    return b'%s,"sum":"%s"}\n' % (content, _checksum(content))


def row_of(line: bytes) -> Row | None:
    """Return the row of a line; None if it is torn, or not as it was written."""
    match = END.search(line)
    if match is None or _checksum(line[: match.start()]) != match[1]:
        return None
    row: Row = orjson.loads(line)
    return row


def _checksum(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=8).hexdigest().encode()


def journal_lines(path: Path) -> Iterator[tuple[int, Row]]:
    """Yield the place of each sound line of a journal, and its row."""
    place = 0
    with path.open("rb") as file:
        for line in file:
            row = row_of(line)
            if row is not None:
                yield place, row
            place += len(line)
