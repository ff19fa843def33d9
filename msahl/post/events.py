"""When a column of a run's tables passes a value, or turns, between the rows.

Rows are joined by piecewise polynomials of degree 5 with four smooth derivatives; those of degree 3
say how well the rows hold what lies between them: the difference of the two times is told as the
uncertainty. Rows must be dense enough for the motion, whatever the steps were.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import PPoly, make_interp_spline

from msahl.post.table import Cell, Column, Table
from msahl.results.read import ResultError, Run

DEGREES = (5, 3)
"""Of the polynomials that are told, and of those they are compared with."""


@dataclass(frozen=True)
class Event:
    """At ``time`` [s], known to ``apart`` [s], the column has this ``value`` and ``slope`` by
    time; ``apart`` is None where the coarser polynomials have no such event nearby.
    """

    time: float
    apart: float | None
    value: float
    slope: float


def passages(run: Run, column: str, level: float) -> list[Event]:
    """Where the ``column`` passes the ``level``. Raises ``ResultError`` if it cannot be said."""
    return _events(run, column, lambda curve: curve.solve(level, extrapolate=False))


def turns(run: Run, column: str) -> list[Event]:
    """Where the ``column`` is largest or smallest. Raises ``ResultError`` likewise."""
    return _events(run, column, lambda curve: curve.derivative().roots(extrapolate=False))


def _events(run: Run, column: str, find: Callable[[Any], np.ndarray]) -> list[Event]:
    values = _values(run, column)
    if len(run.time) <= DEGREES[0]:
        raise ResultError(f"{run.folder}: {len(run.time)} rows say nothing of what lies between")
    fine, coarse = (
        PPoly.from_spline(make_interp_spline(run.time, values, k=degree)) for degree in DEGREES
    )
    slope, spacing = fine.derivative(), float(np.diff(run.time).max())
    others = np.unique(find(coarse))
    events = []
    for time in np.unique(find(fine)):
        # A piece that lies in the level all along has no one time.
        if np.isnan(time):
            continue
        apart = np.abs(others - time).min(initial=np.inf)
        events.append(
            Event(
                time=float(time),
                apart=float(apart) if apart <= spacing else None,
                value=float(fine(time)),
                slope=float(slope(time)),
            )
        )
    return events


def _values(run: Run, column: str) -> np.ndarray:
    for table in (run.states, run.reactions, run.work):
        if table is not None and column in table.columns and column != "time":
            values = table[column].to_numpy()
            break
    else:
        raise ResultError(f"{run.folder}: no column '{column}'; the tables' first lines name them")
    if column.rpartition(".")[2] in ("P1", "P2", "P3"):
        raise ResultError(
            f"{run.folder}: orientations jump at half a turn; ask for a position or a velocity"
        )
    return np.asarray(values)


def events_table(events: list[Event]) -> Table:
    """Events as rows."""
    columns = (
        Column("time", "time [s]", form=".9f"),
        Column("apart", "known to [s]", form=".1e"),
        Column("value", "value", form=".6g"),
        Column("slope", "slope [1/s]", form=".4g"),
    )
    rows: list[tuple[Cell, ...]] = [(e.time, e.apart, e.value, e.slope) for e in events]
    return Table(columns, tuple(rows))
