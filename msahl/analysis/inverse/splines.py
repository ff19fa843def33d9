"""Rates and accelerations of a table by splines, in several ways whose differences are their error.

    accelerations given     rates and accelerations as given
    rates given             acceleration: derivative of the spline of degree 5 through the rates
    values alone            rate and acceleration: derivatives of the spline of degree 5

At its knots the derivative of such a spline is wrong by O(h^5) to O(h^6), its second derivative by
O(h^4). The same is repeated without the highest given derivatives (without rates, say), which
shows how well values and derivatives of the table agree, and with every second row, which shows
what their distance costs. With smoothing, splines of least squares of degree 5 have so few
intervals that noise and what they cannot follow are in balance; the repetitions have the errors
added that both cause.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msahl.analysis.inverse.table import Track

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE = 5
DEVIATIONS = 3.0
"""Standard deviations of a smoothed motion that count as its error."""
CHUNK = 256
"""Times whose variance is computed at once."""


class Smooth(NamedTuple):
    """A track at all rows: its values, rates and accelerations, each (m, k)."""

    values: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray


def derived(time: np.ndarray, track: Track, noise: float, number: int = 0) -> list[Smooth]:
    """Return the motion of a ``track`` as it is used, first, and its repetitions; ``noise`` is the
    standard deviation of the values, 0 for none. By the ``number`` of the track its errors have the
    signs of those of other tracks, or the opposite ones.
    """
    if noise > 0.0:
        return _smoothed(time, track.values, noise, number)
    levels: list[np.ndarray] = [track.values]
    if track.rates is not None:
        levels.append(track.rates)
        if track.accelerations is not None:
            levels.append(track.accelerations)
    found = [_interpolated(time, levels, every_row(time))]
    if len(levels) > 1:
        found.append(_interpolated(time, levels[:-1], every_row(time)))
    if len(levels) < 3:
        found.append(_interpolated(time, levels, every_second_row(time)))
    return found


def every_row(time: np.ndarray) -> np.ndarray:
    """Return the numbers of all rows."""
    return np.arange(time.size)


def every_second_row(time: np.ndarray) -> np.ndarray:
    """Return the numbers of every second row, and of the last one."""
    rows = np.arange(0, time.size, 2)
    return rows if rows[-1] == time.size - 1 else np.append(rows, time.size - 1)


def _interpolated(time: np.ndarray, levels: Sequence[np.ndarray], rows: np.ndarray) -> Smooth:
    """Return the motion by the splines through some ``rows`` of the given values, rates, ..."""
    from scipy.interpolate import make_interp_spline

    degree = min(DEGREE, 2 * ((rows.size - 1) // 2) - 1)
    found = [*levels[:3]]
    highest = found[-1]
    spline = make_interp_spline(time[rows], highest[rows], k=degree)
    for order in range(1, 4 - len(found)):
        found.append(spline.derivative(order)(time))
    return Smooth(*found)


def _smoothed(time: np.ndarray, values: np.ndarray, noise: float, number: int = 0) -> list[Smooth]:
    """Return the motion by the spline of least squares whose number of intervals is best, and by
    the same with errors added and taken away: what noise of the standard deviation ``noise`` does
    to it, and the difference to a spline with other intervals, which shows what it cannot follow.
    """
    from scipy.ndimage import maximum_filter1d

    count = _best_count(time, values, noise)
    spline = _fitted(time, values, count)
    other = _fitted(time, values, _another(count, time.size))
    used = [spline.derivative(order)(time) for order in range(3)]
    # The difference passes through zero a few times in each interval.
    width = 2 * math.ceil(0.5 * time.size / count) + 1
    bars = [
        maximum_filter1d(np.abs(other.derivative(order)(time) - used[order]), width, axis=0)
        + DEVIATIONS * noise * _deviation(time, spline, order)[:, None]
        for order in (1, 2)
    ]
    # Half of them, since error bars are twice the largest difference.
    opposite = (-1.0) ** (number + np.arange(values.shape[1]))
    found = [Smooth(*used)]
    for sign in (np.ones(values.shape[1]), opposite):
        rate, acceleration = (0.5 * sign * bar for bar in bars)
        found.append(Smooth(used[0], used[1] + rate, used[2] + acceleration))
    return found


def _another(count: int, rows: int) -> int:
    """Return half as many intervals more or, if there are too few rows for that, a third less."""
    more = math.ceil(1.5 * count)
    return more if more + DEGREE < rows else max(count - count // 3, 1)


def _best_count(time: np.ndarray, values: np.ndarray, noise: float) -> int:
    """Return the number of intervals with the least expected error of the values, by the sum of
    squares that remains and the noise that so many coefficients let through (Mallows' C_p).
    """
    best, least, count = 1, np.inf, 1
    while count == 1 or count + DEGREE < time.size:
        remains = float(np.sum((_fitted(time, values, count)(time) - values) ** 2)) / noise**2
        expected = remains + 2.0 * values.shape[1] * (count + DEGREE)
        if expected < least:
            best, least = count, expected
        elif count > 4 * best and remains < 2.0 * values.size:
            break
        count = math.ceil(1.2 * count + 0.5)
    return best


def _fitted(time: np.ndarray, values: np.ndarray, count: int) -> "BSpline":
    """Return the spline of least squares with ``count`` intervals of equal numbers of rows."""
    from scipy.interpolate import make_lsq_spline

    rows = np.linspace(0, time.size - 1, count + 1)[1:-1]
    inner = np.interp(rows, np.arange(time.size), time)
    knots = np.concatenate([[time[0]] * (DEGREE + 1), inner, [time[-1]] * (DEGREE + 1)])
    return make_lsq_spline(time, values, knots, k=DEGREE)


def _deviation(time: np.ndarray, spline: "BSpline", order: int) -> np.ndarray:
    """(m,) standard deviation of a derivative of a spline of least squares for values with that of
    1: sigma^2 = b (B^T B)^-1 b^T, with a row b of the derivatives of its basis.
    """
    from scipy.interpolate import BSpline
    from scipy.linalg import cho_solve_banded, cholesky_banded

    knots, n = spline.t, len(spline.c)
    B = BSpline.design_matrix(time, knots, DEGREE).tocsc()
    product = (B.T @ B).todia()
    bands = np.zeros((DEGREE + 1, n))
    for k in range(DEGREE + 1):
        bands[k, : n - k] = product.diagonal(-k)
    factor = cholesky_banded(bands, lower=True)
    # The variance is smooth: a few times in each interval are enough.
    rows = np.unique(np.linspace(0, time.size - 1, min(time.size, 4 * n)).astype(int))
    variance = np.empty(rows.size)
    for first in range(0, rows.size, CHUNK):
        part = slice(first, first + CHUNK)
        b = np.asarray(BSpline(knots, np.eye(n), DEGREE).derivative(order)(time[rows[part]]))
        variance[part] = np.sum(b.T * cho_solve_banded((factor, True), b.T), axis=0)
    return np.asarray(np.interp(time, time[rows], np.sqrt(np.maximum(variance, 0.0))))
