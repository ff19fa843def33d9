"""Graphs as data: curves over one abscissa, in groups, and the thinning of long series.

A page draws them by uPlot (``page.graphs``), a picture by matplotlib (``draw.draw_group``).
"""

import numpy as np

from msahl.records import record

INTERVALS = 600
"""Intervals of which a long series keeps the least and the largest value: about one for each pixel
of a graph."""
HIDDEN = 0.004
"""Part of the range of a series by which it may leave the values shown of it: half a pixel of a
graph of a page."""
MOST_DECADES = 8
"""Decades of a logarithmic scale; products of rounding errors would extend it much further down."""


@record
class Graph:
    """Curves over one abscissa: ``x`` (m,), and name and values (m,) of each curve.

    With ``log`` absolute values are drawn on a logarithmic scale. Values that are not finite leave
    the curve open. In a picture ``broken`` lines leave curves visible that coincide with others.
    ``marks`` are places on the abscissa, of events, with names or "".
    """

    title: str
    x: np.ndarray
    curves: tuple[tuple[str, np.ndarray], ...]
    x_title: str = "time [s]"
    log: bool = False
    broken: bool = False
    marks: tuple[tuple[float, str], ...] = ()


@record
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
    """Reduce long series ``values`` (m,) or (m, k) over ``x`` (m,) to two values of each interval.

    They are those at the times that are returned wherever these show the series, so that smooth
    curves stay smooth. Where it leaves the range of the values there and of those beside them by
    more than ``HIDDEN`` of its own range, they are the least or the largest of the interval, or
    both.
    """
    if len(x) <= 2 * intervals:
        return x, values
    # Each interval is divided into two cells with a row each, the first and the last of all
    # included, so that rows are at equal distances.
    edges = np.linspace(0, len(x), 2 * intervals + 1).astype(int)
    rows = np.linspace(0, len(x) - 1, 2 * intervals).round().astype(int)
    low, high = (extreme.reduceat(values, edges[:-1], axis=0) for extreme in (np.fmin, np.fmax))
    shown = np.where(np.isnan(values[rows]), low, values[rows])
    least = HIDDEN * (np.fmax.reduce(high, axis=0) - np.fmin.reduce(low, axis=0))
    under, over = _hidden(shown, low + least, high - least)
    kept = np.where(over, high, np.where(under, low, shown))
    extremes = _extremes(kept, low, high)
    # Until no value is hidden: what is put in place of a value showed what is beside it, perhaps.
    while (hides := np.logical_or(*_hidden(kept, low + least, high - least))).any():
        both = hides[::2] | hides[1::2]
        both = np.repeat(both, 2, axis=0) & (kept != extremes)
        if not both.any():
            break
        kept = np.where(both, extremes, kept)
    return x[rows], kept


def _extremes(kept: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the least and the largest value of each pair of cells in their order; those of one
    cell in that of the values ``kept``."""
    low, high, kept = (of.reshape(-1, 2, *of.shape[1:]) for of in (low, high, kept))
    first, second = np.argmin(low, axis=1), np.argmax(high, axis=1)
    rises = np.where(first == second, kept[:, 0] <= kept[:, 1], first < second)
    ends = np.fmin.reduce(low, axis=1), np.fmax.reduce(high, axis=1)
    pairs = np.stack([np.where(rises, *ends), np.where(rises, *ends[::-1])], axis=1)
    return pairs.reshape(-1, *pairs.shape[2:])


def _hidden(shown: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which cells have values below, and which above, the value shown of them and of the
    two beside them."""
    padded = np.concatenate([shown[:1], shown, shown[-1:]])
    near = np.stack([padded[:-2], shown, padded[2:]])
    return low < np.fmin.reduce(near), high > np.fmax.reduce(near)


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
