"""Reads a run's folder: the model that was run, its tables and its ``run.json``."""

import csv
import io
from dataclasses import field
from itertools import chain
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pandas as pd

from msahl.contact.events import COLUMNS as EVENT_COLUMNS
from msahl.contact.events import WORDS as EVENT_WORDS
from msahl.deck import read_deck
from msahl.model import Model, resolve
from msahl.printable import printable, shown_path
from msahl.records import record
from msahl.results.checksums import altered
from msahl.results.folder import find
from msahl.results.info import AGAIN, ResultError, read_info
from msahl.results.write import DECK, DRIVES, PART, file_name
from msahl.run.hidden_bodies import shown_tables, with_hidden
from msahl.run.tables import (
    AMPLITUDES,
    ERROR,
    EVENTS,
    REACTIONS,
    STATES,
    WORK,
    error_columns,
    tables_of_model,
)
from msahl.run.verdict import FAIL

__all__ = ["ResultError", "Run", "read_info", "read_run", "read_table"]

STATES_FILE, ERROR_FILE = file_name(STATES), file_name(ERROR)
LONGEST = 40
"""Most characters of a cell or a column name in a message."""
SAME_TIME = 1e-9
"""Largest difference of the last time from the end of the run, relative to it."""


@record(slots=False)
class Run:
    """One run as it was read. Tables have the columns of ``system.names``; rows share ``time``."""

    folder: Path
    model: Model
    info: dict[str, Any]
    states: pd.DataFrame
    reactions: pd.DataFrame | None
    work: pd.DataFrame | None
    partial: bool
    errors: pd.DataFrame | None = None  # estimated errors [m]; fewer rows if its companion stopped
    others: dict[str, pd.DataFrame] = field(default_factory=dict)  # all other tables, by name
    drives: pd.DataFrame | None = None  # loads that produce a given motion
    events: pd.DataFrame | None = None  # of contacts and events; None if the model has none

    @property
    def time(self) -> np.ndarray:
        """Output times [s]."""
        return self.states["time"].to_numpy()

    @property
    def every(self) -> int:
        """Steps from one output time to the next, at least 1; with the output times of gauss and
        radau, which need not be at the ends of steps, it counts output times.

        A killed run has no ``run.json`` to say so; then it follows from the output times.
        """
        options, dt = self.info.get("options", {}), self.model.simulation.dt
        every = options.get("every")
        if every is not None or len(self.time) < 2:
            degree = resolve(self.model.simulation).degree
            interval = None if degree else options.get("outputInterval")
            return int(every or 1) * max(1, round((interval or dt) / dt))
        spacing = float(self.time[1] - self.time[0])
        return max(1, round(spacing / dt))

    @property
    def instantaneous(self) -> bool:
        """Whether reactions are those at the output times, not means over the steps before."""
        return resolve(self.model.simulation).instantaneous

    @property
    def has_means(self) -> bool:
        """Whether the tables hold the mean reactions of every step."""
        return self.every == 1 and not self.instantaneous


def read_run(folder: Path) -> Run:
    """Read the run in ``folder``; a run that stopped early is read up to its last row.

    The verdict on a run whose files were altered after it is FAIL. Raises ``ResultError`` if there
    is no run, ``DeckError`` if its deck is not valid.
    """
    model, info = read_model(folder), _judged(folder, read_info(folder))
    columns = {file_name(name): head for name, head in shown_tables(model).items()}
    paths = {name: require_table(folder, name) for name in columns}
    tables = {name: _table(paths[name], header) for name, header in columns.items()}
    rows = _count_rows(folder, paths, tables, info)
    tables = {name: table.iloc[:rows] for name, table in tables.items()}
    _check_times(paths, tables, info)
    return Run(
        folder=folder,
        model=model,
        info=info,
        states=all_states(model, tables[STATES_FILE], tables.get(file_name(AMPLITUDES))),
        reactions=tables.get(file_name(REACTIONS)),
        work=tables.get(file_name(WORK)),
        others={
            name: tables[file_name(name)]
            for name in tables_of_model(model)
            if name not in (STATES, REACTIONS, WORK)
        },
        partial=find(folder, STATES_FILE) == folder / (STATES_FILE + PART),
        errors=_errors(folder, model, tables[STATES_FILE]["time"].to_numpy(), info),
        drives=_drives(folder, tables[STATES_FILE]["time"].to_numpy(), info),
        events=read_events(folder, model),
    )


def all_states(model: Model, states: pd.DataFrame, amplitudes: pd.DataFrame | None) -> pd.DataFrame:
    """Return the states of all bodies, by those that tables show and the amplitudes."""
    if not model.hidden or amplitudes is None:
        return states
    rows = with_hidden(model, states.to_numpy(), amplitudes.to_numpy())
    return pd.DataFrame(rows, columns=tables_of_model(model)[STATES])


def _judged(folder: Path, info: dict[str, Any]) -> dict[str, Any]:
    """Return the content ``info`` of ``run.json`` with the verdict FAIL if files were altered."""
    changed = altered(folder, info) if "verdict" in info else []
    if not changed:
        return info
    verb = "was" if len(changed) == 1 else "were"
    reason = f"{', '.join(changed)} {verb} altered after the run; {AGAIN}"
    verdict = info["verdict"]
    reasons = [reason, *verdict["reasons"]]
    return {**info, "verdict": {**verdict, "word": FAIL, "reasons": reasons}}


def read_events(folder: Path, model: Model) -> pd.DataFrame | None:
    """The table of events; None if the model has neither contacts nor events."""
    path = find(folder, file_name(EVENTS))
    if not (model.rigid_contacts or model.events):
        return None
    if path is None:
        raise ResultError(f"{shown_path(folder / file_name(EVENTS))}: missing; {AGAIN}")
    try:
        with _complete_lines(path) as file:
            head, *rows = csv.reader(file)
        numbers = {name: [float(row[k]) for row in rows] for k, name in _numbers_of_events()}
        words = {name: [row[EVENT_COLUMNS.index(name)] for row in rows] for name in EVENT_WORDS}
    except (OSError, ValueError, IndexError) as error:
        raise ResultError(f"{shown_path(path)}: cannot be read: {error}; {AGAIN}") from error
    if head != EVENT_COLUMNS:
        raise ResultError(f"{shown_path(path)}:1: its columns are not those of events; {AGAIN}")
    return pd.DataFrame({**numbers, **words})[EVENT_COLUMNS]


def _numbers_of_events() -> list[tuple[int, str]]:
    return [(k, name) for k, name in enumerate(EVENT_COLUMNS) if name not in EVENT_WORDS]


def drives_file(folder: Path, info: dict[str, Any]) -> Path | None:
    """Path of the table of the loads of a given motion; None if the folder is that of a run."""
    return find(folder, file_name(DRIVES)) if "inverse" in info else None


def _drives(folder: Path, times: np.ndarray, info: dict[str, Any]) -> pd.DataFrame | None:
    """The table of the loads of a given motion, at these ``times``; None if there is none."""
    path = drives_file(folder, info)
    if path is None:
        return None
    table = read_table(path)
    if "time" not in table.columns or len(table) != len(times):
        raise ResultError(wrong_count(path, len(table), f"states.csv has {len(times)}"))
    check_rows(path, table)
    _require_times(path, table, times)
    return table


def _errors(
    folder: Path, model: Model, times: np.ndarray, info: dict[str, Any]
) -> pd.DataFrame | None:
    """The table of estimated errors, at the first of these ``times``; None if there is none."""
    estimate, path = info.get("error") or {}, find(folder, ERROR_FILE)
    if path is None:
        if estimate:
            raise ResultError(f"{shown_path(folder / ERROR_FILE)}: missing; {AGAIN}")
        return None
    table = _table(path, error_columns(model)).iloc[: len(times)]
    check_rows(path, table)
    if estimate.get("complete") and len(table) != len(times):
        raise ResultError(wrong_count(path, len(table), f"states.csv has {len(times)}"))
    _require_times(path, table, times)
    return table


def _count_rows(
    folder: Path, paths: dict[str, Path], tables: dict[str, pd.DataFrame], info: dict[str, Any]
) -> int:
    """Number of rows that all tables have.

    A killed run, which leaves no ``run.json``, may have written more rows of one table than of
    another. Otherwise tables of different lengths, or of another length than ``run.json`` says,
    were changed after the run.
    """
    counts = {name: len(table) for name, table in tables.items()}
    least, expected = min(counts.values()), info.get("outputTimes", counts[STATES_FILE])
    killed = "outputTimes" not in info and any(path.suffix == PART for path in paths.values())
    for name, count in counts.items():
        if count != expected and not killed:
            whence = "run.json says" if "outputTimes" in info else "states.csv has"
            raise ResultError(wrong_count(paths[name], count, f"{whence} {expected}"))
    if least == 0:
        raise ResultError(f"{shown_path(folder)}: the run has no rows yet; {AGAIN}")
    return least


def wrong_count(path: Path, count: int, expected: str) -> str:
    """Message on a table with another number of rows than ``expected``."""
    return f"{shown_path(path)}: {count} rows, but {expected}: rows were lost or added; {AGAIN}"


def _check_times(
    paths: dict[str, Path], tables: dict[str, pd.DataFrame], info: dict[str, Any]
) -> None:
    """Raise ``ResultError`` unless all tables hold finite numbers at the same increasing times,
    from 0 to the end of a run that was completed."""
    times = tables[STATES_FILE]["time"].to_numpy()
    for name, table in tables.items():
        check_rows(paths[name], table)
        _require_times(paths[name], table, times)
    if times[0] != 0.0:
        message = f"the first row is at {times[0]:.12g} s, not at 0"
        raise ResultError(f"{_line(paths[STATES_FILE], 0)}: {message}; {AGAIN}")
    end = info.get("time") if info.get("status") == "completed" else None
    if end is not None and abs(times[-1] - end) > SAME_TIME * abs(end):
        message = f"the last row is at {times[-1]:.12g} s; run.json says {end:.12g} s"
        raise ResultError(f"{_line(paths[STATES_FILE], len(times) - 1)}: {message}; {AGAIN}")


def _require_times(path: Path, table: pd.DataFrame, times: np.ndarray) -> None:
    """Raise ``ResultError`` unless the rows of a table are at the first of these ``times``."""
    other = np.flatnonzero(table["time"].to_numpy() != times[: len(table)])
    if other.size:
        here, there = table["time"].iloc[other[0]], times[other[0]]
        message = f"time {here:.12g} s, where states.csv has {there:.12g} s"
        raise ResultError(f"{_line(path, other[0])}: {message}; {AGAIN}")


def check_rows(path: Path, table: pd.DataFrame, only_times: bool = False) -> None:
    """Raise ``ResultError`` at the first number of a table that is not finite (``only_times``: at
    the first such time), or the first time that is not later than that before it."""
    numbers = (table[["time"]] if only_times else table).to_numpy()
    bad = np.argwhere(~np.isfinite(numbers))
    if bad.size:
        row, column = bad[0]
        message = f"{table.columns[column]} is {numbers[row, column]}, not a finite number"
        raise ResultError(f"{_line(path, row)}: {message}; {AGAIN}")
    times = table["time"].to_numpy()
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if late.size:
        row = int(late[0]) + 1
        message = f"time {times[row]:.12g} s follows {times[row - 1]:.12g} s; times must increase"
        raise ResultError(f"{_line(path, row)}: {message}; {AGAIN}")


def _line(path: Path, row: int) -> str:
    """A row of a table for a message, by the line of the file: the header is line 1."""
    return f"{shown_path(path)}:{row + 2}"


def read_table(path: Path) -> pd.DataFrame:
    """A CSV table of numbers, every double as it was written.

    The last row of a table that is not complete (``.part``) is omitted if it is cut: a number may
    be cut, too.
    """
    try:
        with _complete_lines(path) as file:
            columns = file.readline().rstrip("\r\n").split(",")
            if len(set(columns)) < len(columns):
                raise ResultError(f"{shown_path(path)}:1: a column appears twice; {AGAIN}")
            numbers = _numbers(file, len(columns))
    except OSError as error:
        raise ResultError(f"{shown_path(path)}: cannot be read: {error}; {AGAIN}") from error
    except ValueError as error:
        try:
            rows = path.read_bytes().decode().partition("\n")[2]
        except ValueError as unknown:
            message = f"cannot be read: {unknown}"
            raise ResultError(f"{shown_path(path)}: {message}; {AGAIN}") from unknown
        message = unreadable(rows, len(columns))
        raise ResultError(f"{shown_path(path)}:{message}; {AGAIN}") from error
    return pd.DataFrame(numbers, columns=columns)


def _complete_lines(path: Path) -> TextIO:
    """Open a table; of one that is not complete without its last line if that is cut."""
    if path.suffix != PART:
        return path.open(encoding="utf-8", newline="")
    data = path.read_bytes()
    return io.TextIOWrapper(io.BytesIO(data[: data.rfind(b"\n") + 1]), "utf-8", newline="")


def _numbers(file: TextIO, columns: int) -> np.ndarray:
    """Return the numbers (m, columns) of the lines that follow, without holding their text; raises
    ``ValueError``.
    """
    for line in file:
        if line.strip():
            # numpy reads a decimal as the nearest double; pandas does so in some versions only.
            lines = chain((line,), file)
            found = np.loadtxt(lines, delimiter=",", ndmin=2, comments=None)
            if found.shape[1] != columns:
                raise ValueError("not as many numbers as columns")
            return found
    return np.empty((0, columns))


def unreadable(rows: str, columns: int) -> str:
    """The line of the first row that is not as many numbers as there are columns, and why."""
    for line, row in enumerate(rows.splitlines(), start=2):
        cells = row.split(",")
        if len(cells) != columns and row.strip():
            return f"{line}: {len(cells)} numbers under {columns} columns"
        for cell in cells:
            try:
                float(cell.replace("_", "x"))  # which Python takes, and tables have not
            except ValueError:
                if row.strip():
                    return f"{line}: '{printable(cell[:LONGEST])}' is not a number"
    return " not a table of numbers"


def read_model(folder: Path) -> Model:
    """The model of the run in ``folder``; raises ``ResultError`` if there is no run."""
    deck = find(folder, DECK)
    if deck is None:
        message = "not the folder of a run (no deck.xml); make one: msahl run"
        raise ResultError(f"{shown_path(folder)}: {message}")
    return read_deck(deck)


def require_table(folder: Path, name: str) -> Path:
    """Path of the table in the file ``name``, complete or not; raises ``ResultError``."""
    path = find(folder, name)
    if path is None:
        raise ResultError(f"{shown_path(folder / name)}: missing; {AGAIN}")
    return path


def _table(path: Path, columns: list[str]) -> pd.DataFrame:
    """The table at ``path``; its columns must be those of the deck."""
    table = read_table(path)
    require_columns(path, list(table.columns), columns)
    return table


def require_columns(path: Path, found: list[str], columns: list[str]) -> None:
    """Raise ``ResultError`` unless the columns found in a table are those of the deck."""
    if found != columns:
        lacks = [name for name in columns if name not in found]
        other = [name for name in found if name not in columns]
        why = (
            f"{lacks[0]} is missing" if lacks
            else f"{printable(other[0][:LONGEST])} is not one of them" if other
            else "their order is different"
        )  # fmt: skip
        deck = shown_path(path.with_name("deck.xml"))
        message = f"its columns are not those of {deck}: {why}"
        raise ResultError(f"{shown_path(path)}: {message}; {AGAIN}")
