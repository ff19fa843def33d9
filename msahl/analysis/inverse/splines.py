"""Rates and accelerations of a table by splines, in several ways whose differences are their error.

    accelerations given     rates and accelerations as given
    rates given             acceleration: derivative of the spline of degree 5 through the rates
    values alone            rate and acceleration: derivatives of the spline of degree 5

At its knots the derivative of such a spline is wrong by O(h^5) to O(h^6), its second derivative by
O(h^4). The same is repeated without the highest given derivatives (without rates, say), which
shows how well values and derivatives of the table agree, and with every second row, which shows
what their distance costs. With smoothing, splines of degree 5 pass by the values at the
distance of the noise, in the mean, and the repetitions take the even and the odd rows.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from msahl.analysis.inverse.table import Track

DEGREE = 5


class Smooth(NamedTuple):
    """A track at all rows: its values, rates and accelerations, each (m, k)."""

    values: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray


def derived(time: np.ndarray, track: Track, noise: float) -> list[Smooth]:
    """Return the motion of a ``track`` as it is used, first, and its repetitions; ``noise`` is the
    standard deviation of the values, 0 for none.
    """
    if noise > 0.0:
        even, odd = slice(0, None, 2), slice(1, None, 2)
        return [_smoothed(time, track.values, rows, noise) for rows in (slice(None), even, odd)]
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


def _smoothed(time: np.ndarray, values: np.ndarray, rows: slice, noise: float) -> Smooth:
    """Return the motion by splines that pass the values at the distance ``noise`` in the mean."""
    from scipy.interpolate import UnivariateSpline

    t = time[rows]
    parts: list[list[np.ndarray]] = [[], [], []]
    for column in values[rows].T:
        spline = UnivariateSpline(t, column, k=DEGREE, s=t.size * noise**2)
        for order in range(3):
            parts[order].append(spline.derivative(order)(time) if order else spline(time))
    return Smooth(*(np.stack(part, axis=1) for part in parts))
