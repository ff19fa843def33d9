"""Reads evenly spaced rows of the tables of a run, however long they are, in little memory."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from msahl.model import Model
from msahl.printable import shown_path
from msahl.records import record
from msahl.results.info import AGAIN, ResultError, read_info
from msahl.results.read import (
    Run,
    drives_file,
    read_model,
    require_columns,
    require_table,
    unreadable,
)
from msahl.results.write import DRIVES, PART, file_name
from msahl.run.hidden_bodies import shown_tables, with_hidden
from msahl.run.tables import AMPLITUDES, REACTIONS, STATES, WORK, tables_of_model

BLOCK = 1 << 22
"""Bytes of a file that are searched for line ends at a time."""
NEWLINE = 10


@record(slots=False)
class Sample:
    """Rows of a run's tables at the same times.

    ``total`` is the number of output times of the run, ``stride`` that from one row to the next;
    the last row of the run is always among them. ``tables`` has for each name the columns and an
    array (rows, columns), of which the first column is the time [s].
    """

    folder: Path
    model: Model
    info: dict[str, Any]
    total: int
    stride: int
    tables: dict[str, tuple[list[str], np.ndarray]]
    partial: bool

    @property
    def time(self) -> np.ndarray:
        """Output times that were read [s]."""
        return np.ascontiguousarray(self.tables[STATES][1][:, 0])


def read_sample(folder: Path, numbers: int, most: int) -> Sample:
    """Read rows of all tables of the run in ``folder``: all of them, or evenly spaced ones, so that
    they are at most ``most`` and hold about ``numbers`` numbers (but 1000 rows if there are).

    Raises ``ResultError`` if there is no run or a table is damaged at one of these rows,
    ``DeckError`` if its deck is not valid.
    """
    model, info = read_model(folder), read_info(folder)
    columns = shown_tables(model)
    files = {name: _Lines(require_table(folder, file_name(name))) for name in columns}
    try:
        for name, lines in files.items():
            require_columns(lines.path, lines.header, columns[name])
        if drives := drives_file(folder, info):
            files[DRIVES] = _Lines(drives)
            columns[DRIVES] = files[DRIVES].header
        total = min(len(lines) for lines in files.values())
        if total == 0:
            raise ResultError(f"{shown_path(folder)}: the run has no rows yet; {AGAIN}")
        width = sum(map(len, columns.values()))
        rows = _spaced(total, min(most, max(numbers // width, 1000)))
        tables = {name: (columns[name], lines.read(rows)) for name, lines in files.items()}
        if model.hidden:
            states = with_hidden(model, tables[STATES][1], tables[AMPLITUDES][1])
            tables[STATES] = (tables_of_model(model)[STATES], states)
    finally:
        for lines in files.values():
            lines.close()
    stride = int(rows[1] - rows[0]) if len(rows) > 1 else 1
    partial = files[STATES].path.suffix == PART
    return Sample(folder, model, info, total, stride, tables, partial)


def sample_run(run: Run, numbers: int, most: int) -> Sample:
    """Return rows of a run that was read, chosen as by ``read_sample``."""
    frames = {STATES: run.states, REACTIONS: run.reactions, WORK: run.work, **run.others}
    frames[DRIVES] = run.drives
    known = {name: frame for name, frame in frames.items() if frame is not None}
    total, width = len(run.time), sum(frame.shape[1] for frame in known.values())
    rows = _spaced(total, min(most, max(numbers // width, 1000)))
    tables = {name: (list(f.columns), f.to_numpy()[rows]) for name, f in known.items()}
    stride = int(rows[1] - rows[0]) if len(rows) > 1 else 1
    return Sample(run.folder, run.model, run.info, total, stride, tables, run.partial)


def _spaced(total: int, most: int) -> np.ndarray:
    """Return the numbers of at most ``most`` + 1 evenly spaced rows, and of the last."""
    rows = np.arange(0, total, -(-total // most))
    return rows if rows[-1] == total - 1 else np.append(rows, total - 1)


class _Lines:
    """The lines of a CSV table, of which any can be read without those before it.

    The file is read and not mapped, so that only the lines that are wanted take memory.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = path.open("rb")
        self.ends = _line_ends(self.file, path.suffix == PART)
        self.header = self._bytes(0, 0).decode(errors="replace").rstrip("\r").split(",")

    def __len__(self) -> int:
        """Return the number of rows, without the header."""
        return max(len(self.ends) - 1, 0)

    def close(self) -> None:
        """Release the file."""
        self.file.close()

    def _bytes(self, first: int, last: int) -> bytes:
        """Return the lines from ``first`` to ``last``, of which 0 is the header."""
        if last >= len(self.ends):
            return b""
        begin = self.ends[first - 1] + 1 if first else 0
        self.file.seek(begin)
        return self.file.read(self.ends[last] - begin)

    def read(self, rows: Sequence[int] | np.ndarray) -> np.ndarray:
        """Return the numbers of these rows, increasing from 0: (rows, columns)."""
        if len(rows) == rows[-1] + 1:
            text = self._bytes(1, len(rows))
        else:
            text = b"\n".join(self._bytes(row + 1, row + 1) for row in rows)
        lines = text.decode(errors="replace")
        try:
            numbers = np.loadtxt(io.StringIO(lines), delimiter=",", ndmin=2, comments=None)
            if numbers.shape != (len(rows), len(self.header)):
                raise ValueError
        except ValueError as error:
            line, _, why = unreadable(lines, len(self.header)).partition(": ")
            row = rows[int(line) - 2] if why else rows[0]
            raise self._fault(row, why or "not a table of numbers") from error
        bad = np.argwhere(~np.isfinite(numbers))
        if bad.size:
            row, column = bad[0]
            found = f"{self.header[column]} is {numbers[row, column]}, not a finite number"
            raise self._fault(rows[row], found)
        late = np.flatnonzero(np.diff(numbers[:, 0]) <= 0.0)
        if late.size:
            raise self._fault(rows[late[0] + 1], "times must increase")
        return numbers

    def _fault(self, row: int, why: str) -> ResultError:
        return ResultError(f"{shown_path(self.path)}:{row + 2}: {why}; {AGAIN}")


def _line_ends(file: BinaryIO, cut: bool) -> np.ndarray:
    """Return the places of the line ends; the last line of a table that is not ``cut`` may lack
    its own."""
    found, length, last = [np.empty(0, dtype=np.int64)], 0, b"\n"
    while block := file.read(BLOCK):
        found.append(length + np.flatnonzero(np.frombuffer(block, dtype=np.uint8) == NEWLINE))
        length, last = length + len(block), block[-1:]
    ends = np.concatenate(found)
    return ends if cut or last == b"\n" else np.append(ends, length)
