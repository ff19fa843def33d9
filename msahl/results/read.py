"""A run's folder -> arrays: the model it ran, its tables and its ``run.json``."""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from msahl.deck import read_deck
from msahl.model import Model, resolve
from msahl.printable import printable, shown_path
from msahl.results.folder import find
from msahl.results.info import AGAIN, ResultError, read_info
from msahl.results.write import DECK, ERROR_COLUMNS, ERRORS, PART, STATES
from msahl.system.names import reaction_columns, state_columns, work_columns, workers

__all__ = ["ResultError", "Run", "find_table", "read_info", "read_run", "read_table"]

LONGEST = 40
"""Characters of a cell or a column that are shown."""
SAME_TIME = 1e-9
"""Of the last time: what the last row may be off the end of a run, by the round-off of sums."""


@dataclass(frozen=True)
class Run:
    """One run as read back. Tables have the columns of ``system.names``; rows share ``time``."""

    folder: Path
    model: Model
    info: dict[str, Any]
    states: pd.DataFrame
    reactions: pd.DataFrame | None
    work: pd.DataFrame | None
    partial: bool
    errors: pd.DataFrame | None = None  # estimated errors [m]; fewer rows if its companion stopped

    @property
    def time(self) -> np.ndarray:
        """Times of the rows [s]."""
        return self.states["time"].to_numpy()

    @property
    def every(self) -> int:
        """Steps from one row to the next, at least 1: more if the output was thinned. Rows of a
        scheme of higher order are where they are, whatever its steps.

        A run cut off by force has no ``run.json`` to say so; its rows' spacing tells.
        """
        options, dt = self.info.get("options", {}), self.model.simulation.dt
        told = options.get("every")
        if told is not None or len(self.time) < 2:
            interval = None if resolve(self.model.simulation).degree else options.get("outputInterval")
            return int(told or 1) * max(1, round((interval or dt) / dt))
        spacing = float(self.time[1] - self.time[0])
        return max(1, round(spacing / dt))

    @property
    def instantaneous(self) -> bool:
        """Whether reactions are those at the rows' own times, not means over the steps before."""
        return resolve(self.model.simulation).instantaneous

    @property
    def has_means(self) -> bool:
        """Whether the mean reaction of every step is on file."""
        return self.every == 1 and not self.instantaneous


def read_run(folder: Path) -> Run:
    """Read the run in ``folder``; a run that stopped early is read as far as it came.

    Raises ``ResultError`` if there is no run, ``DeckError`` if its deck is not valid.
    """
    deck = find(folder, DECK)
    if deck is None:
        message = "not the folder of a run (no deck.xml); make one: msahl run"
        raise ResultError(f"{shown_path(folder)}: {message}")
    model, info = read_deck(deck), read_info(folder)
    columns = {"states.csv": state_columns(model)}
    if model.joints or model.couplings or model.motions:
        columns["reactions.csv"] = reaction_columns(model)
    if workers(model):
        columns["work.csv"] = work_columns(model)
    paths = {name: _path(folder, name) for name in columns}
    tables = {name: _table(paths[name], header) for name, header in columns.items()}
    rows = _count_rows(folder, paths, tables, info)
    tables = {name: table.iloc[:rows] for name, table in tables.items()}
    _check_times(paths, tables, info)
    return Run(
        folder=folder,
        model=model,
        info=info,
        states=tables["states.csv"],
        reactions=tables.get("reactions.csv"),
        work=tables.get("work.csv"),
        partial=find_table(folder, STATES) == folder / (STATES + PART),
        errors=_errors(folder, tables["states.csv"]["time"].to_numpy(), info),
    )


def _errors(folder: Path, times: np.ndarray, info: dict[str, Any]) -> pd.DataFrame | None:
    """The table of estimated errors, at the first of these ``times``; None if there is none."""
    told, path = info.get("error") or {}, find_table(folder, ERRORS)
    if path is None:
        if told:
            raise ResultError(f"{shown_path(folder / ERRORS)}: missing; {AGAIN}")
        return None
    table = _table(path, ERROR_COLUMNS).iloc[: len(times)]
    check_rows(path, table)
    if told.get("complete") and len(table) != len(times):
        raise ResultError(wrong_count(path, len(table), f"states.csv has {len(times)}"))
    other = np.flatnonzero(table["time"].to_numpy() != times[: len(table)])
    if other.size:
        here, there = table["time"].iloc[other[0]], times[other[0]]
        message = f"time {here:.12g} s, where states.csv has {there:.12g} s"
        raise ResultError(f"{_line(path, other[0])}: {message}; {AGAIN}")
    return table


def _count_rows(
    folder: Path, paths: dict[str, Path], tables: dict[str, pd.DataFrame], info: dict[str, Any]
) -> int:
    """How many rows all tables have.

    A run cut off by force, which leaves no ``run.json``, may have written more of one table than of
    another; otherwise tables of different lengths, or of another than was told, were changed.
    """
    counts = {name: len(table) for name, table in tables.items()}
    least, told = min(counts.values()), info.get("outputTimes", counts["states.csv"])
    cut_off = "outputTimes" not in info and any(path.suffix == PART for path in paths.values())
    for name, count in counts.items():
        if count != told and not cut_off:
            whence = "run.json says" if "outputTimes" in info else "states.csv has"
            raise ResultError(wrong_count(paths[name], count, f"{whence} {told}"))
    if least == 0:
        raise ResultError(f"{shown_path(folder)}: the run has no rows yet; {AGAIN}")
    return least


def wrong_count(path: Path, count: int, expected: str) -> str:
    """What to say of a table with another number of rows than ``expected``."""
    return f"{shown_path(path)}: {count} rows, but {expected}: rows were lost or added; {AGAIN}"


def _check_times(
    paths: dict[str, Path], tables: dict[str, pd.DataFrame], info: dict[str, Any]
) -> None:
    """Raise ``ResultError`` unless all tables hold finite numbers at the same increasing times,
    from 0 to the end of a run that was completed."""
    times = tables["states.csv"]["time"].to_numpy()
    for name, table in tables.items():
        check_rows(paths[name], table)
        other = np.flatnonzero(table["time"].to_numpy() != times)
        if other.size:
            here, there = table["time"].iloc[other[0]], times[other[0]]
            message = f"time {here:.12g} s, where states.csv has {there:.12g} s"
            raise ResultError(f"{_line(paths[name], other[0])}: {message}; {AGAIN}")
    if times[0] != 0.0:
        message = f"the first row is at {times[0]:.12g} s, not at 0"
        raise ResultError(f"{_line(paths['states.csv'], 0)}: {message}; {AGAIN}")
    end = info.get("time") if info.get("status") == "completed" else None
    if end is not None and abs(times[-1] - end) > SAME_TIME * abs(end):
        message = f"the last row is at {times[-1]:.12g} s; run.json says {end:.12g} s"
        raise ResultError(f"{_line(paths['states.csv'], len(times) - 1)}: {message}; {AGAIN}")


def check_rows(path: Path, table: pd.DataFrame, only_times: bool = False) -> None:
    """Raise ``ResultError`` at the first number of a table that is not finite (``only_times``: at
    the first such time), or the first time that is not later than that of the row before."""
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


def find_table(folder: Path, name: str) -> Path | None:
    """Path of the table ``name``, whole or ``.part``; ``None`` if there is neither."""
    return find(folder, name)


def read_table(path: Path) -> pd.DataFrame:
    """A CSV table of numbers, every double as it was written.

    Of a table under way (``.part``) a last row cut short is left out: a number may be cut, too.
    """
    try:
        text = path.read_bytes().decode()
    except (ValueError, OSError) as error:
        raise ResultError(f"{shown_path(path)}: cannot be read: {error}; {AGAIN}") from error
    if path.suffix == PART:
        text = text[: text.rfind("\n") + 1]
    header, _, rows = text.partition("\n")
    columns = header.rstrip("\r").split(",")
    if len(set(columns)) < len(columns):
        raise ResultError(f"{shown_path(path)}:1: a column stands there twice; {AGAIN}")
    try:
        # numpy reads a decimal as the nearest double; pandas does so in some versions only.
        numbers = np.empty((0, len(columns)))
        if rows.strip():
            numbers = np.loadtxt(io.StringIO(rows), delimiter=",", ndmin=2, comments=None)
        return pd.DataFrame(numbers, columns=columns)
    except ValueError as error:
        message = _unreadable(rows, len(columns))
        raise ResultError(f"{shown_path(path)}:{message}; {AGAIN}") from error


def _unreadable(rows: str, columns: int) -> str:
    """The line of the first row that is not so many numbers, and what it is."""
    for line, row in enumerate(rows.splitlines(), start=2):
        cells = row.split(",")
        if len(cells) != columns and row.strip():
            return f"{line}: {len(cells)} numbers under {columns} columns"
        for cell in cells:
            try:
                float(cell)
            except ValueError:
                if row.strip():
                    return f"{line}: '{printable(cell[:LONGEST])}' is not a number"
    return " not a table of numbers"


def _path(folder: Path, name: str) -> Path:
    """The table ``name``, whole or partial."""
    path = find_table(folder, name)
    if path is None:
        raise ResultError(f"{shown_path(folder / name)}: missing; {AGAIN}")
    return path


def _table(path: Path, columns: list[str]) -> pd.DataFrame:
    """The table at ``path``; its columns must be those of the deck."""
    table = read_table(path)
    found = list(table.columns)
    if found != columns:
        lacks = [name for name in columns if name not in found]
        other = [name for name in found if name not in columns]
        why = (
            f"{lacks[0]} is missing" if lacks
            else f"{printable(other[0][:LONGEST])} is none" if other
            else "they stand in another order"
        )  # fmt: skip
        deck = shown_path(path.with_name("deck.xml"))
        message = f"its columns are not those of {deck}: {why}"
        raise ResultError(f"{shown_path(path)}: {message}; {AGAIN}")
    return table
