"""Graphs as data: curves over one abscissa, in groups, and the thinning of long series.

A page draws them by uPlot (``page.graphs``), a picture by matplotlib (``draw.draw_group``).
"""

from dataclasses import dataclass

import numpy as np

INTERVALS = 600
"""Intervals of which a long series keeps the least and the largest value: about one for each pixel
of a graph."""
MOST_DECADES = 8
"""Decades of a logarithmic scale; products of rounding errors would extend it much further down."""


@dataclass(frozen=True, slots=True)
class Graph:
    """Curves over one abscissa: ``x`` (m,), and name and values (m,) of each curve.

    With ``log`` absolute values are drawn on a logarithmic scale. Values that are not finite leave
    the curve open. In a picture ``broken`` lines leave curves visible that coincide with others.
    """

    title: str
    x: np.ndarray
    curves: tuple[tuple[str, np.ndarray], ...]
    x_title: str = "time [s]"
    log: bool = False
    broken: bool = False


@dataclass(frozen=True, slots=True)
class Group:
    """Graphs under one heading; graphs with the same curves share a legend. ``name`` is that of the
    picture's file."""

    title: str
    graphs: tuple[Graph, ...]
    note: str = ""
    name: str = ""


def thinned(
    x: np.ndarray, values: np.ndarray, intervals: int = INTERVALS
) -> tuple[np.ndarray, np.ndarray]:
    """Reduce long series ``values`` (m,) or (m, k) over ``x`` (m,) to two values of each interval:
    the least and the largest, in the order in which the series rises or falls.
    """
    if len(x) <= 2 * intervals:
        return x, values
    first, last = _ends(len(x), intervals)
    low, high = (extreme.reduceat(values, first, axis=0) for extreme in (np.fmin, np.fmax))
    rising = values[first] <= values[last]
    pairs = np.stack([np.where(rising, low, high), np.where(rising, high, low)], axis=1)
    return np.stack([x[first], x[last]], axis=1).ravel(), pairs.reshape(-1, *values.shape[1:])


def peaks(x: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reduce long series ``values`` (m, k) over ``x`` (m,) to the largest of each interval."""
    if len(x) <= 2 * INTERVALS:
        return x, values
    first, last = _ends(len(x), INTERVALS)
    return x[last], np.fmax.reduceat(values, first, axis=0)


def _ends(count: int, intervals: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and the last index of each interval."""
    edges = np.linspace(0, count, intervals + 1).astype(int)
    return edges[:-1], edges[1:] - 1
