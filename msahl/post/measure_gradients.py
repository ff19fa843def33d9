"""Derivatives of measures of a run, from the derivatives of its tables.

    final, initial    those at the end, at t = 0
    max, min, absmax  those at the output time that has it; range: the difference of two
    mean, rms         by the trapezoidal rule, the end of the run included
    at T              interpolated as the values are
    time of c = v     -dc/dp over dc/dt at the crossing, of the spline through its neighbours

Largest and least values are those of the output times, as the measures themselves.
"""

from typing import NamedTuple

import numpy as np

from msahl.post.measures import SAME_TIME, Measure

NEIGHBOURS = 12
"""Rows around a time that the value there is interpolated from, and two to spare."""
DEGREE = 5
SAME_VALUE = 1e-9
"""Difference of two rows, relative to the range of all, below which both are the largest."""
EXTREMES = ("max", "min", "absmax", "range")


class Series(NamedTuple):
    """A column at m output times, and its derivatives by n parameters."""

    times: np.ndarray  # (m,) [s]
    values: np.ndarray  # (m,)
    slopes: np.ndarray  # (n, m)
    end: np.ndarray  # (n,) derivatives of the last of the times [s]


def rows_needed(measure: Measure, times: np.ndarray, value: float) -> range:
    """Return the numbers of the output ``times`` on which the derivative of a measure with this
    ``value`` depends.
    """
    last = len(times) - 1
    if measure.kind in ("final", "initial"):
        row = last if measure.kind == "final" else 0
        return range(row, row + 1)
    if measure.kind not in ("at", "time of"):
        return range(last + 1)
    t = measure.number if measure.kind == "at" else value
    nearest = int(np.argmin(np.abs(times - t)))
    if measure.kind == "at" and abs(times[nearest] - t) <= SAME_TIME * abs(times[-1]):
        return range(nearest, nearest + 1)
    first = max(0, min(nearest - NEIGHBOURS // 2, last + 1 - NEIGHBOURS))
    return range(first, min(last + 1, first + NEIGHBOURS))


def derivative(measure: Measure, series: Series, value: float) -> np.ndarray:
    """Return the derivatives (n,) of a measure that has this ``value``, from what it needs;
    nan where it has none.
    """
    kind, v, slopes = measure.kind, series.values, series.slopes
    if kind in ("final", "initial"):
        return slopes[:, -1 if kind == "final" else 0]
    if kind in ("max", "min"):
        return slopes[:, int(np.argmax(v) if kind == "max" else np.argmin(v))]
    if kind == "absmax":
        row = int(np.argmax(np.abs(v)))
        return np.sign(v[row]) * slopes[:, row]
    if kind == "range":
        return slopes[:, int(np.argmax(v))] - slopes[:, int(np.argmin(v))]
    if kind == "mean":
        return _of_mean(series, v, slopes)
    if kind == "rms":
        of_square = _of_mean(series, v**2, 2.0 * v * slopes)
        return of_square / (2.0 * value) if value > 0.0 else np.full(len(slopes), np.nan)
    return _at(measure, series, value)


def is_tied(measure: Measure, series: Series) -> bool:
    """Whether rows that are no neighbours share the largest value, so that there is no derivative
    but one for each direction.
    """
    if measure.kind not in EXTREMES or len(series.values) < 2:
        return False
    v = np.abs(series.values) if measure.kind == "absmax" else series.values
    near = SAME_VALUE * max(float(np.ptp(v)), 1e-300)
    ends = [v.max() - v] if measure.kind in ("max", "absmax") else [v - v.min()]
    if measure.kind == "range":
        ends.append(v.max() - v)
    tied = [np.flatnonzero(distance <= near) for distance in ends]
    return any(len(rows) > 1 and rows[-1] - rows[0] >= len(rows) for rows in tied)


def _of_mean(series: Series, v: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return the derivatives of the mean of ``v`` over the time, with the end of the run."""
    duration = series.times[-1] - series.times[0]
    if duration <= 0.0:
        return slopes[:, -1]
    dt = np.diff(series.times)
    of_values = 0.5 * (slopes[:, 1:] + slopes[:, :-1]) @ dt
    mean = 0.5 * float(dt @ (v[1:] + v[:-1])) / duration
    changed: np.ndarray = of_values + (0.5 * (v[-1] + v[-2]) - mean) * series.end
    return changed / duration


def _at(measure: Measure, series: Series, value: float) -> np.ndarray:
    """Return the derivatives of the value at a time, or of the time of a value."""
    t = measure.number if measure.kind == "at" else value
    if len(series.times) == 1:
        return series.slopes[:, 0]
    from scipy.interpolate import make_interp_spline

    degree = min(DEGREE, len(series.times) - 1)
    slopes = make_interp_spline(series.times, series.slopes.T, k=degree)(t)
    if measure.kind == "at":
        return np.asarray(slopes)
    rate = make_interp_spline(series.times, series.values, k=degree).derivative()(t)
    return np.asarray(-slopes / rate)
