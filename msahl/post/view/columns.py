"""Reduce the columns of a run's tables to what a graph shows, and pack them for the viewer."""

from collections.abc import Iterator
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from msahl.model import Model
from msahl.post.graph_data import thinned
from msahl.post.view.packing import pack_integers, pack_numbers
from msahl.printable import printable, shown_path
from msahl.records import record
from msahl.results.info import ResultError
from msahl.results.sample import Sample
from msahl.results.write import DRIVES
from msahl.run.column_units import quantity
from msahl.run.hidden_bodies import shown_tables, without_hidden
from msahl.run.tables import AMPLITUDES, JOINTS, REACTIONS, SIGNALS, STATES

LEVELS = 65535
"""Steps from the least to the greatest value of a column: values are rounded to one of them."""
FEWEST = 100
"""Least number of intervals that the time is divided into."""


@record(slots=False)
class Columns:
    """Columns of the tables of a run at the same times: ``values`` (rows, columns)."""

    names: list[str]
    tables: list[str]
    units: list[str]
    time: np.ndarray
    values: np.ndarray


def columns_of_run(sample: Sample, patterns: tuple[str, ...] = ()) -> Columns:
    """Return the columns that match a pattern (all if there is none), coordinates of joints first.

    Raises ``ResultError`` for a pattern that no column matches.
    """
    found: dict[str, tuple[str, np.ndarray, str]] = {}
    for table, (head, rows) in _in_order(sample):
        for name, column in zip(head[1:], rows.T[1:], strict=True):
            found.setdefault(name, (table, column, name))  # two tables may have the load of a drive
    every = list(found.values())
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for _, _, name in every):
            where = shown_path(sample.folder)
            raise ResultError(f"{where}: no column matches '{printable(pattern)}'")
    chosen = [
        entry
        for entry in every
        if not patterns or any(fnmatchcase(entry[2], pattern) for pattern in patterns)
    ]
    values = [column for _, column, _ in chosen]
    return Columns(
        [name for _, _, name in chosen],
        [table for table, _, _ in chosen],
        [_unit(name, sample.model) for _, _, name in chosen],
        sample.time,
        np.stack(values, axis=1) if values else np.empty((len(sample.time), 0)),
    )


def _unit(name: str, model: Model) -> str:
    """Return the SI unit of a column, empty if it has none or it is not known."""
    unit = quantity(name, model).unit
    return "" if unit in ("-", "SI") else unit


def _in_order(sample: Sample) -> Iterator[tuple[str, tuple[list[str], np.ndarray]]]:
    """Yield the tables in the order of the graph's list, without bodies that are not shown."""
    first, shown = (DRIVES, JOINTS, AMPLITUDES, REACTIONS, SIGNALS), sample.tables
    if sample.model.hidden:
        states = without_hidden(sample.model, {STATES: shown[STATES][1]})[STATES]
        shown = shown | {STATES: (shown_tables(sample.model)[STATES], states)}
    yield from ((name, shown[name]) for name in first if name in shown)
    yield from ((name, table) for name, table in shown.items() if name not in first)


def pack_columns(columns: Columns, most: int) -> dict[str, Any]:
    """Return the columns as the viewer reads them: at most about ``most`` numbers.

    Of longer series (``every`` is false) there are two values of each interval of the time, as
    ``thinned`` chooses them. A value is ``least`` + ``step`` times its integer.
    """
    width = max(len(columns.names), 1)
    time, values = _extremes(columns.time, columns.values, max(most // width // 2, FEWEST))
    least = values.min(axis=0)
    step = (values.max(axis=0) - least) / LEVELS
    scaled = (values - least) / np.where(step > 0.0, step, 1.0)
    return {
        "names": columns.names,
        "tables": columns.tables,
        "units": columns.units,
        "least": least.tolist(),
        "step": step.tolist(),
        "every": len(time) == len(columns.time),
        "time": pack_numbers(time),
        "values": pack_integers(np.rint(scaled).astype(np.int64)),
    }


def _extremes(
    time: np.ndarray, values: np.ndarray, intervals: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the series thinned; the graph begins and ends with the run."""
    times, pairs = thinned(time, values, intervals)
    if times is not time:
        pairs[0], pairs[-1] = values[0], values[-1]
    return times, pairs
