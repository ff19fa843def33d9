"""Results on disk: tables that grow row by row, and ``run.json``.

A table is written as NAME.part and gets its final name when the run has completed, so a file with a
final name is complete. Numbers are the shortest decimals that read back to the same double.
"""

import io
import os
from collections.abc import Mapping, Sequence
from errno import EISDIR
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import orjson

from msahl.contact.events import COLUMNS as EVENT_COLUMNS
from msahl.model import Model
from msahl.run.hidden_bodies import shown_tables, without_hidden
from msahl.run.tables import ERROR, EVENTS, TABLES, error_columns

PART = ".part"
INFO, DECK, CHECKPOINT = "run.json", "deck.xml", "checkpoint"
RESERVED = 4096
"""Bytes that ``run.json`` reserves at the start, so that the end can be reported on a full disk."""


def file_name(table: str) -> str:
    """Name of the file of a ``table``."""
    return f"{table}.csv"


GRADIENTS = "gradients.csv"
"""Derivatives of measures by numbers of the deck, if they were asked for."""
DRIVES = "drives"
"""Name of the table of the loads that produce a given motion."""
TABLE_FILES = (*map(file_name, (*TABLES, EVENTS, DRIVES)), GRADIENTS)
"""Names of the files of all tables."""


class Table:
    """One CSV file that is being written: a new one, or the first ``end`` bytes of an old one."""

    def __init__(self, path: Path, columns: list[str], end: int | None = None) -> None:
        self.path = path
        self.part = path.with_name(path.name + PART)
        if end is not None and not self.part.exists():
            path.replace(self.part)  # the run was killed just when tables got their final names
        # Unbuffered: what could not be written is not tried again on closing.
        self.file = create(self.part) if end is None else _reopen(self.part)
        self.end, self.head = end or 0, (",".join(columns) + "\n").encode()
        if end is None:
            self._append(self.head)
        else:
            self.cut(end)

    def write(self, rows: np.ndarray) -> None:
        """Append ``rows`` (m, columns) of finite numbers, or of objects: words and numbers; an
        ``OSError`` names the file.
        """
        if rows.dtype == object:
            self._append("".join(f"{','.join(map(_word, row))}\n" for row in rows).encode())
            return
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
        """Cut the file after its first ``end`` bytes."""
        self.file.seek(end)
        self.file.truncate()
        self.end = end

    def restart(self) -> None:
        """Drop all rows."""
        self.cut(len(self.head))

    def flush(self) -> None:
        """Make the operating system write everything to the disk."""
        os.fsync(self.file.fileno())

    def close(self) -> None:
        """Close the file."""
        self.file.close()


def _word(value: str | float) -> str:
    """Return a word, or the shortest decimal of a number; names have no commas."""
    return value if isinstance(value, str) else orjson.dumps(value).decode()


def write_table(path: Path, columns: list[str], rows: np.ndarray) -> None:
    """Write a complete table of finite numbers at once; it is never seen half-written."""
    table = Table(path, columns)
    try:
        if len(rows):
            table.write(rows)
    finally:
        table.close()
    table.part.replace(path)


def write_tables(folder: Path, tables: Mapping[str, tuple[Sequence[str], np.ndarray]]) -> None:
    """Write columns and rows of complete ``tables`` by name into the ``folder``, which is made."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (columns, rows) in tables.items():
        write_table(folder / file_name(name), list(columns), rows)


class RunFolder:
    """The sink of a run on disk. As a context it gives the tables their final names at the end, if
    ``complete`` was set.

    The tables are new, or those of an interrupted run, of which ``ends`` gives the valid bytes by
    file name. Raises ``OSError`` if the folder cannot be written.
    """

    def __init__(
        self, folder: Path, model: Model, deck: bytes, ends: dict[str, int] | None = None
    ) -> None:
        self.folder, self.model = folder, model
        self.complete = False
        self.takes_observed = True
        folder.mkdir(parents=True, exist_ok=True)
        if ends is None:
            clear(folder)
            replace_file(folder / DECK, deck)
        columns, self.of_errors = shown_tables(model), error_columns(model)
        if model.rigid_contacts or model.events:
            columns[EVENTS] = EVENT_COLUMNS
        if ends is not None and file_name(ERROR) in ends:
            columns[ERROR] = self.of_errors
        self.tables: dict[str, Table] = {}
        for name, head in columns.items():
            file = file_name(name)
            self.tables[name] = Table(folder / file, head, None if ends is None else ends[file])

    def write(self, tables: Mapping[str, np.ndarray]) -> None:
        """Append rows to every table of the model, or, if one cannot be written, to none."""
        if ERROR not in self.tables and len(tables.get(ERROR, ())):
            self.tables[ERROR] = Table(self.folder / file_name(ERROR), self.of_errors)
        tables = without_hidden(self.model, tables)
        before = {name: table.end for name, table in self.tables.items()}
        try:
            for name, table in self.tables.items():
                if len(tables.get(name, ())):
                    table.write(tables[name])
        except BaseException:
            for name, table in self.tables.items():
                table.cut(before[name])
            raise

    def restart(self) -> None:
        """Drop the rows of all tables."""
        for table in self.tables.values():
            table.restart()

    def ends(self) -> dict[str, int]:
        """Bytes of the tables so far, by file name."""
        return {file_name(name): table.end for name, table in self.tables.items()}

    def flush(self) -> None:
        """Make the operating system write all rows to the disk."""
        for table in self.tables.values():
            table.flush()

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
        if self.complete and kind is None:
            for table in self.tables.values():
                table.part.replace(table.path)


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write ``content`` to ``path``, indented; the file is never seen half-written."""
    options = orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE
    replace_file(path, orjson.dumps(content, option=options))


def replace_file(path: Path, content: bytes) -> None:
    """Write a file that is never seen half-written, in the disk space of its ``.part`` if there is
    one. A device or a pipe, such as /dev/stdout, is written into, not replaced.
    """
    if path.is_dir():  # before a part of it is written
        raise IsADirectoryError(EISDIR, os.strerror(EISDIR), str(path))
    if path.is_char_device() or path.is_fifo():
        with path.open("wb", buffering=0) as stream:
            write_all(stream, content)
        return
    part = path.with_name(path.name + PART)
    reuse = part.is_file() and not part.is_symlink() and part.stat().st_nlink == 1
    with _reopen(part) if reuse else create(part) as file:
        write_all(file, content)
        file.truncate()
    part.replace(path)


def write_beginning(folder: Path, content: dict[str, Any]) -> None:
    """Write ``run.json.part`` of a run that begins, with space reserved for the report."""
    text = orjson.dumps(content, option=orjson.OPT_INDENT_2)
    # The first file of a run, and never half-written: it says which run the folder belongs to.
    hidden = folder / f".{INFO}"
    with create(hidden) as file:
        write_all(file, text.ljust(RESERVED) + b"\n")
    hidden.replace(folder / (INFO + PART))
    (folder / INFO).unlink(missing_ok=True)


def clear(folder: Path) -> None:
    """Remove the files of an earlier run, so that none is taken for one of the new run."""
    (folder / INFO).unlink(missing_ok=True)
    for name in (*TABLE_FILES, CHECKPOINT):
        (folder / name).unlink(missing_ok=True)
        (folder / (name + PART)).unlink(missing_ok=True)


def create(path: Path) -> io.FileIO:
    """A new file. An old one is removed and not overwritten: it may be a link to another file."""
    path.unlink(missing_ok=True)
    return path.open("xb", buffering=0)


def write_all(file: io.FileIO, content: bytes) -> None:
    """Write all of ``content``; an unbuffered file may take only a part at a time."""
    rest = memoryview(content)
    while rest:
        rest = rest[file.write(rest) :]


def _reopen(path: Path) -> io.FileIO:
    """One of our files, to be continued; a symbolic link in its place is an ``OSError``."""
    flags = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
    return open(path, "r+b", buffering=0, opener=lambda name, _: os.open(name, flags))
