"""When a column of a run's tables passes a value, or turns, between the rows.

Rows are joined by piecewise polynomials of degree 5 with four smooth derivatives; those of degree 3
say how well the rows hold what lies between them: the difference of the two times is told as the
uncertainty. Rows must be dense enough for the motion, whatever the steps were.
"""

from collections.abc import Callable
from dataclasses import dataclass
from sys import float_info

import numpy as np
from scipy.interpolate import PPoly, make_interp_spline

from msahl.post.table import Cell, Column, Table
from msahl.results.read import ResultError, Run

DEGREES = (5, 3)
"""Of the polynomials that are told, and of those they are compared with."""
RESOLVED = 1e-4
"""Of the rows' spacing: nearer to each other, or to the first or the last row, no two are told
apart. A slope that touches zero does so twice within 1e-6 of it, by round-off."""
ROUND_OFF = 64.0 * float_info.epsilon
"""Of the column's largest value."""


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
    return _events(run, column, lambda curve: _shifted(curve, level), abs(level))


def turns(run: Run, column: str) -> list[Event]:
    """Where the ``column`` is largest or smallest. Raises ``ResultError`` likewise."""
    return _events(run, column, lambda curve: curve.derivative())


def _events(run: Run, column: str, of: Callable[[PPoly], PPoly], size: float = 0.0) -> list[Event]:
    """Where the function ``of`` the column's curve changes its sign between the first row and the
    last; values below the round-off of the column, or of a ``size``, have no sign."""
    values = _values(run, column)
    if len(run.time) <= DEGREES[0]:
        raise ResultError(f"{run.folder}: {len(run.time)} rows say nothing of what lies between")
    fine, coarse = (
        PPoly.from_spline(make_interp_spline(run.time, values, k=degree)) for degree in DEGREES
    )
    spacing = float(np.diff(run.time).max())
    # Beyond the ends as well: the coarse curve of what begins at rest may turn before it begins.
    others = _roots(of(coarse), RESOLVED * spacing, extrapolate=True)
    roots = _roots(of(fine), RESOLVED * spacing, extrapolate=False)
    apart = np.abs(roots[:, None] - others).min(axis=1, initial=np.inf)
    found = _inside(roots, apart, run.time)
    found &= _crossed(of(fine), roots, run.time, ROUND_OFF * max(np.abs(values).max(), size))
    return [
        Event(
            time=float(time),
            apart=float(known) if known <= spacing else None,
            value=float(fine(time)),
            slope=float(fine.derivative()(time)),
        )
        for time, known in zip(roots[found], apart[found], strict=True)
    ]


def _shifted(curve: PPoly, level: float) -> PPoly:
    """The curve less a level."""
    coefficients = curve.c.copy()
    coefficients[-1] -= level
    return PPoly(coefficients, curve.x)


def _roots(curve: PPoly, resolved: float, extrapolate: bool) -> np.ndarray:
    """Zeros of a curve; those nearer to each other than what is ``resolved`` are one.

    A piece that is zero all along has no one time and is left out.
    """
    roots = np.unique(curve.roots(discontinuity=False, extrapolate=extrapolate))
    roots = roots[np.isfinite(roots)]
    groups = np.split(roots, np.flatnonzero(np.diff(roots) > resolved) + 1)
    return np.array([group.mean() for group in groups if group.size])


def _inside(roots: np.ndarray, apart: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Which roots can be told from the first and the last row: they are farther from them than
    they are known, twice over as the finer curve's own error is not in it."""
    spacing = float(np.diff(time).max())
    known = 2.0 * np.where(apart <= spacing, apart, 0.0) + RESOLVED * spacing
    return np.asarray((roots - time[0] > known) & (time[-1] - roots > known))


def _crossed(curve: PPoly, roots: np.ndarray, time: np.ndarray, smallest: float) -> np.ndarray:
    """At which roots a curve has one sign halfway to the root before, or the first row, and the
    other halfway to the next; the ``smallest`` value is that of the column."""
    ends = np.concatenate((time[:1], roots, time[-1:]))
    between = curve(0.5 * (ends[:-1] + ends[1:]))
    # A slope is a difference of values over the time between two rows.
    degree = DEGREES[0] + 1 - curve.c.shape[0]
    least = smallest / float(np.diff(time).min()) ** degree
    signs = np.where(np.abs(between) > least, np.sign(between), 0.0)
    return np.asarray(signs[:-1] * signs[1:] < 0.0)


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
