"""Find the times at which a column of a run's tables passes a value or has an extremum.

The values at the output times are interpolated by splines of degree 5. Splines of degree 3 show how
well the output times resolve the motion between them: the difference of the two times found is
given as the uncertainty. The output times must be dense enough for the motion, whatever the steps
were.
"""

from collections.abc import Callable
from sys import float_info

import numpy as np
from scipy.interpolate import PPoly, make_interp_spline

from msahl.post.table import Cell, Column, Table
from msahl.records import record
from msahl.results.read import ResultError, Run

DEGREES = (5, 3)
"""Degrees of the splines: of the reported one, and of the one that it is compared with."""
RESOLVED = 1e-4
"""Fraction of the output interval: roots nearer to each other are one, and those nearer to the
first or last output time are ignored. Because of rounding errors a slope that touches zero has two
roots within 1e-6 of the interval."""
ROUND_OFF = 64.0 * float_info.epsilon
"""Rounding error of a column, as a fraction of its largest value."""


@record(slots=False)
class Event:
    """At ``time`` [s] +- ``uncertainty`` [s] the column has this ``value`` and ``slope`` (time
    derivative); ``uncertainty`` is None if the coarser spline has no such event nearby.
    """

    time: float
    uncertainty: float | None
    value: float
    slope: float


def crossings(run: Run, column: str, level: float) -> list[Event]:
    """Find where the ``column`` passes the ``level``.

    Raises ``ResultError`` if there is no such column or it cannot be interpolated.
    """
    return _events(run, column, lambda curve: _shifted(curve, level), abs(level))


def extrema(run: Run, column: str) -> list[Event]:
    """Find the local maxima and minima of the ``column``. Raises ``ResultError`` likewise."""
    return _events(run, column, lambda curve: curve.derivative())


def first_crossing(time: np.ndarray, values: np.ndarray, level: float) -> Event | None:
    """Return where ``values`` (m,) at the output times ``time`` (m,) first pass the ``level``; None
    if they do not, or if they are too few to interpolate between them.
    """
    if len(time) <= DEGREES[0]:
        return None
    found = _events_of(time, values, lambda curve: _shifted(curve, level), abs(level))
    return found[0] if found else None


def _events(
    run: Run, column: str, function: Callable[[PPoly], PPoly], size: float = 0.0
) -> list[Event]:
    """Find where a ``function`` of the column's spline changes its sign; see ``_events_of``."""
    values = _values(run, column)
    if len(run.time) <= DEGREES[0]:
        raise ResultError(
            f"{run.folder}: {len(run.time)} output times are too few to interpolate between them; "
            f"at least {DEGREES[0] + 1} are needed"
        )
    return _events_of(run.time, values, function, size)


def _events_of(
    time: np.ndarray, values: np.ndarray, function: Callable[[PPoly], PPoly], size: float
) -> list[Event]:
    """Find where a ``function`` of the spline of ``values`` (m,) changes its sign between the
    first and the last output time; values below the rounding error of the column, or of ``size``,
    have no sign.
    """
    fine, coarse = (
        PPoly.from_spline(make_interp_spline(time, values, k=degree)) for degree in DEGREES
    )
    spacing = float(np.diff(time).max())
    # Extrapolated, because a coarse spline of a motion that starts at rest may have its extremum
    # before t = 0.
    others = _roots(function(coarse), RESOLVED * spacing, extrapolate=True)
    roots = _roots(function(fine), RESOLVED * spacing, extrapolate=False)
    distance = np.abs(roots[:, None] - others).min(axis=1, initial=np.inf)
    smallest = ROUND_OFF * max(np.abs(values).max(), size)
    found = _inside(roots, distance, time) | _enclosed(function(fine), roots, time, smallest)
    found &= _crossed(function(fine), roots, time, smallest)
    return [
        Event(
            time=float(at),
            uncertainty=float(known) if known <= spacing else None,
            value=float(fine(at)),
            slope=float(fine.derivative()(at)),
        )
        for at, known in zip(roots[found], distance[found], strict=True)
    ]


def _shifted(curve: PPoly, level: float) -> PPoly:
    """Return the curve minus a level."""
    coefficients = curve.c.copy()
    coefficients[-1] -= level
    return PPoly(coefficients, curve.x)


def _roots(curve: PPoly, resolved: float, extrapolate: bool) -> np.ndarray:
    """Return the zeros of a curve, those nearer to each other than ``resolved`` as one.

    A piece that is zero everywhere has no single time and is ignored.
    """
    roots = np.unique(curve.roots(discontinuity=False, extrapolate=extrapolate))
    roots = roots[np.isfinite(roots)]
    groups = np.split(roots, np.flatnonzero(np.diff(roots) > resolved) + 1)
    return np.array([group.mean() for group in groups if group.size])


def _inside(roots: np.ndarray, distance: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Say which roots can be distinguished from the first and the last output time: their distance
    from it is more than twice their uncertainty, which does not contain the finer curve's error."""
    spacing = float(np.diff(time).max())
    known = 2.0 * np.where(distance <= spacing, distance, 0.0) + RESOLVED * spacing
    return np.asarray((roots - time[0] > known) & (time[-1] - roots > known))


def _enclosed(curve: PPoly, roots: np.ndarray, time: np.ndarray, smallest: float) -> np.ndarray:
    """Say which roots are in the first or last interval, at whose ends the column itself has
    different signs: there is a crossing then, however uncertain its time is."""
    found = np.zeros(len(roots), dtype=bool)
    if curve.c.shape[0] != DEGREES[0] + 1:
        return found  # a slope is not known at output times
    near = RESOLVED * float(np.diff(time).max())
    for begin, end in (time[:2], time[-2:]):
        low, high = curve(begin), curve(end)
        if low * high < 0.0 and min(abs(low), abs(high)) > smallest:
            found |= (roots > begin) & (roots < end)
    return np.asarray(found & (roots - time[0] > near) & (time[-1] - roots > near))


def _crossed(curve: PPoly, roots: np.ndarray, time: np.ndarray, smallest: float) -> np.ndarray:
    """Say at which roots a curve changes its sign, from halfway to the root before (or the first
    output time) to halfway to the next; ``smallest`` is the least value of the column that counts.
    """
    ends = np.concatenate((time[:1], roots, time[-1:]))
    between = curve(0.5 * (ends[:-1] + ends[1:]))
    # A slope is a difference of values over the time between two outputs.
    degree = DEGREES[0] + 1 - curve.c.shape[0]
    least = smallest / float(np.diff(time).min()) ** degree
    signs = np.where(np.abs(between) > least, np.sign(between), 0.0)
    return np.asarray(signs[:-1] * signs[1:] < 0.0)


def _values(run: Run, column: str) -> np.ndarray:
    for table in (run.states, run.reactions, run.work, *run.others.values(), run.drives):
        if table is not None and column in table.columns and column != "time":
            values = table[column].to_numpy()
            break
    else:
        raise ResultError(
            f"{run.folder}: no column '{column}'; the first line of each table lists its columns"
        )
    if column.rpartition(".")[2] in ("P1", "P2", "P3"):
        raise ResultError(
            f"{run.folder}: orientation parameters are discontinuous at rotations by 180 degrees; "
            "choose a position or a velocity"
        )
    return np.asarray(values)


def events_table(events: list[Event]) -> Table:
    """Return a table of events."""
    columns = (
        Column("time", "time [s]", form=".9f"),
        Column("uncertainty", "uncertainty [s]", form=".1e"),
        Column("value", "value", form=".6g"),
        Column("slope", "slope [1/s]", form=".4g"),
    )
    rows: list[tuple[Cell, ...]] = [(e.time, e.uncertainty, e.value, e.slope) for e in events]
    return Table(columns, tuple(rows))
