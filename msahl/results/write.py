"""Results on disk: tables that grow row by row and appear whole, and ``run.json``.

A table is written as NAME.part and takes its name when the run has ended well; what is there under
a final name is therefore complete. Numbers are the shortest decimals that read back to the same
double.
"""

import io
import os
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import orjson

from msahl.model import Model
from msahl.system.names import reaction_columns, state_columns, work_columns, workers

PART = ".part"
INFO, DECK, CHECKPOINT = "run.json", "deck.xml", "checkpoint"
STATES, REACTIONS, WORK, ERRORS = TABLES = ("states.csv", "reactions.csv", "work.csv", "error.csv")
ERROR_COLUMNS = ["time", "position", "orientation"]
"""Head of the table of estimated errors [s, m, m]."""
ROOM = 4096
"""Bytes that ``run.json`` is given at the start: it can tell of the end on a disk then full."""


class Table:
    """One CSV file under way: anew, or going on after the first ``end`` bytes of what is there."""

    def __init__(self, path: Path, columns: list[str], end: int | None = None) -> None:
        self.path = path
        self.part = path.with_name(path.name + PART)
        if end is not None and not self.part.exists():
            path.replace(self.part)  # stopped by force just when tables took their names
        # Unbuffered: what could not be written is not tried again on closing.
        self.file = create(self.part) if end is None else _reopen(self.part)
        self.end, self.head = end or 0, (",".join(columns) + "\n").encode()
        if end is None:
            self._append(self.head)
        else:
            self.cut(end)

    def write(self, rows: np.ndarray) -> None:
        """Append ``rows`` (m, columns) of finite numbers; ``OSError`` bears the file's name."""
        text = orjson.dumps(np.ascontiguousarray(rows), option=orjson.OPT_SERIALIZE_NUMPY)
        # A JSON array of arrays is CSV but for its brackets.
        self._append(text[2:-2].replace(b"],[", b"\n") + b"\n")

    def _append(self, text: bytes) -> None:
        try:
            write_all(self.file, text)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.part)) from error
        self.end += len(text)

    def cut(self, end: int) -> None:
        """Go back to the first ``end`` bytes."""
        self.file.seek(end)
        self.file.truncate()
        self.end = end

    def restart(self) -> None:
        """Drop all rows."""
        self.cut(len(self.head))

    def to_disk(self) -> None:
        """Have the system bring to the disk what was written."""
        os.fsync(self.file.fileno())

    def close(self) -> None:
        """End the file."""
        self.file.close()


class RunFolder:
    """The folder of one run; a context that leaves its tables ``.part`` unless told ``whole``.

    It begins anew, or goes on with tables of which ``ends`` tells how far they are good, in bytes
    by the files' names. Raises ``OSError`` if it cannot be written.
    """

    def __init__(
        self, folder: Path, model: Model, deck: bytes, ends: dict[str, int] | None = None
    ) -> None:
        self.folder = folder
        self.whole = False
        folder.mkdir(parents=True, exist_ok=True)
        if ends is None:
            clear(folder)
            write_whole(folder / DECK, deck)
        columns = {STATES: state_columns(model)}
        if model.joints or model.couplings or model.motions:
            columns[REACTIONS] = reaction_columns(model)
        if workers(model):
            columns[WORK] = work_columns(model)
        if ends is not None and ERRORS in ends:
            columns[ERRORS] = ERROR_COLUMNS
        self.tables = {
            name: Table(folder / name, heads, None if ends is None else ends[name])
            for name, heads in columns.items()
        }

    def write(
        self, states: np.ndarray, reactions: np.ndarray, work: np.ndarray, errors: np.ndarray
    ) -> None:
        """Append rows to every table the scene has, or, if one cannot be written, to none."""
        rows = {STATES: states, REACTIONS: reactions, WORK: work, ERRORS: errors}
        if len(errors) and ERRORS not in self.tables:
            self.tables[ERRORS] = Table(self.folder / ERRORS, ERROR_COLUMNS)
        ends = self.ends()
        try:
            for name, table in self.tables.items():
                if len(rows[name]):
                    table.write(rows[name])
        except BaseException:
            for name, table in self.tables.items():
                table.cut(ends[name])
            raise

    def restart(self) -> None:
        """Drop the rows of all tables."""
        for table in self.tables.values():
            table.restart()

    def ends(self) -> dict[str, int]:
        """Bytes of the tables so far, by file name."""
        return {name: table.end for name, table in self.tables.items()}

    def to_disk(self) -> None:
        """Have the system bring all rows to the disk."""
        for table in self.tables.values():
            table.to_disk()

    def __enter__(self) -> "RunFolder":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for table in self.tables.values():
            table.close()
        if self.whole and kind is None:
            for table in self.tables.values():
                table.part.replace(table.path)


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write ``content`` whole, indented, to ``path``."""
    write_whole(path, orjson.dumps(content, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE))


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that is never seen half-written; a part that is there gives its room."""
    part = path.with_name(path.name + PART)
    reuse = part.is_file() and not part.is_symlink() and part.stat().st_nlink == 1
    with _reopen(part) if reuse else create(part) as file:
        write_all(file, content)
        file.truncate()
    part.replace(path)


def write_beginning(folder: Path, content: dict[str, Any]) -> None:
    """Tell of a run under way in ``run.json.part``, with room for what its end will add."""
    text = orjson.dumps(content, option=orjson.OPT_INDENT_2)
    # The first file of a run, and never half-written: it says whose folder this is.
    hidden = folder / f".{INFO}"
    with create(hidden) as file:
        write_all(file, text.ljust(ROOM) + b"\n")
    hidden.replace(folder / (INFO + PART))
    (folder / INFO).unlink(missing_ok=True)


def clear(folder: Path) -> None:
    """Remove what an earlier run left, so that no file is taken for the new run's."""
    (folder / INFO).unlink(missing_ok=True)
    for name in (*TABLES, CHECKPOINT):
        (folder / name).unlink(missing_ok=True)
        (folder / (name + PART)).unlink(missing_ok=True)


def create(path: Path) -> io.FileIO:
    """A new file. What was there is removed, not written over: it may be a link to another file."""
    path.unlink(missing_ok=True)
    return path.open("xb", buffering=0)


def write_all(file: io.FileIO, content: bytes) -> None:
    """Write all of ``content``, of which an unbuffered file may take a part at a time."""
    rest = memoryview(content)
    while rest:
        rest = rest[file.write(rest) :]


def _reopen(path: Path) -> io.FileIO:
    """A file of ours, to go on with; a symbolic link in its place is an ``OSError``."""
    flags = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
    return open(path, "r+b", buffering=0, opener=lambda name, _: os.open(name, flags))
