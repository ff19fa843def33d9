"""How pictures look, and how they reach the disk: the same bytes for the same data.

Object-oriented matplotlib on the Agg and SVG canvases; no display, no global state.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import cycle, pairwise, product
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Okabe and Ito's colours, told apart by every kind of colour vision; then again, dashed.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
LINES = ("-", "--", ":", "-.")
STYLE: dict[Any, Any] = {
    "axes.edgecolor": "#666666",
    "axes.formatter.limits": (-4, 5),
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": "#444444",
    "axes.titlelocation": "left",
    "axes.titlesize": 11,
    "figure.constrained_layout.use": True,
    "font.size": 10,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "svg.hashsalt": "msahl",
}
MOST_IN_LEGEND = 12
MOST_DECADES = 8
"""Shown on a logarithmic scale; products of round-off errors reach much further down."""
STRETCHES = 750
"""Stretches a long run is cut into, as many as a picture can tell apart."""


@contextmanager
def style() -> Iterator[None]:
    """Make and save figures inside this context: they look alike whatever the user's settings."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        for name, value in STYLE.items():
            matplotlib.rcParams[name] = value
        yield


def plain(name: str) -> str:
    """A name from a deck as matplotlib shows it letter by letter: no formula, no hidden label."""
    return f" {name}".replace("$", r"\$") if name.startswith("_") else name.replace("$", r"\$")


def new_figure(rows: int, height: float = 2.4, title: str = "") -> tuple[Figure, list[Axes]]:
    """A figure of ``rows`` panels below each other that share their abscissa."""
    figure = Figure(figsize=(8.0, 0.9 + height * rows))
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    axes[0].set_title(plain(title))
    return figure, list(axes)


def looks() -> Iterator[dict[str, Any]]:
    """Colour and line style of one curve after the other."""
    return cycle({"linestyle": line, "color": colour} for line, colour in product(LINES, COLOURS))


def curves(
    axes: Axes,
    time: np.ndarray,
    series: np.ndarray,
    names: Sequence[str],
    lines: Sequence[str] = (),
) -> None:
    """Draw each column of ``series`` (m, k) against ``time`` (m,), in the line styles ``lines``."""
    for i, (values, name, look) in enumerate(zip(series.T, names, looks(), strict=False)):
        chosen = {"linestyle": lines[i]} if lines else {}
        axes.plot(*thinned(time, values), label=plain(name), **(look | chosen))


def sizes(axes: Axes, time: np.ndarray, series: np.ndarray, names: Sequence[str]) -> None:
    """Draw the absolute value of each column on a logarithmic scale, of many rows the largest.

    Columns of nan are not drawn, but keep their look and their place in the legend.

    Zeros, and what is ``MOST_DECADES`` below the largest value, run off the lower edge. Where all
    is zero there is no scale: the axis says so.
    """
    time, series = peaks(time, np.abs(series))
    if not np.nan_to_num(series).any():
        curves(axes, time, series, names)
        axes.set_yticks([0.0])
        axes.text(0.5, 0.6, "zero at every row", transform=axes.transAxes, ha="center")
        return
    top = float(np.nanmax(series))
    floor = max(float(series[series > 0.0].min()), top * 10.0**-MOST_DECADES)
    # Two decades at least: fewer may leave a logarithmic axis without a number on it.
    low, high = min(0.5 * floor, 0.02 * top), 2.0 * top
    axes.set(yscale="log", ylim=(low, high))
    curves(axes, time, np.maximum(series, 0.1 * low), names)


def thinned(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``values`` (m,), of many rows the least and the largest of each stretch: no peak is lost."""
    if values.size <= 2 * STRETCHES:
        return time, values
    kept = {0, values.size - 1}
    for begin, end in _stretches(values.size):
        kept.add(begin + int(values[begin:end].argmin()))
        kept.add(begin + int(values[begin:end].argmax()))
    index = np.array(sorted(kept))
    return time[index], values[index]


def peaks(time: np.ndarray, series: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``series`` (m, k), of many rows each column's largest value in each stretch of time."""
    if len(time) <= 2 * STRETCHES:
        return time, series
    stretches = list(_stretches(len(time)))
    ends = np.array([end - 1 for _, end in stretches])
    return time[ends], np.array([series[begin:end].max(axis=0) for begin, end in stretches])


def _stretches(rows: int) -> Iterator[tuple[int, int]]:
    """First row of each of ``STRETCHES`` stretches, and the row after its last."""
    return pairwise(int(edge) for edge in np.linspace(0, rows, STRETCHES + 1))


def legend(figure: Figure, axes: Axes) -> None:
    """Name the curves of ``axes`` beside the panels, where they hide nothing."""
    handles, labels = axes.get_legend_handles_labels()
    if len(labels) > MOST_IN_LEGEND:
        more = f"and {len(labels) - MOST_IN_LEGEND} more"
        handles, labels = handles[:MOST_IN_LEGEND], labels[:MOST_IN_LEGEND]
        figure.legend(handles, labels, loc="outside right upper", title_fontsize=9, title=more)
    elif labels:
        figure.legend(handles, labels, loc="outside right upper")


def encode(figure: Figure, form: str) -> bytes:
    """The bytes of ``figure`` as "png" or "svg", without dates."""
    stream = BytesIO()
    metadata: dict[str, Any] = {"Date": None} if form == "svg" else {"Software": None}
    figure.savefig(stream, format=form, dpi=150, metadata=metadata)
    return stream.getvalue()


def save(figures: Iterable[tuple[str, Figure]], forms: Sequence[str], folder: Path) -> list[Path]:
    """Write every named figure in every form to ``folder``; the paths written."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, figure in figures:
        for form in forms:
            path = folder / f"{name}.{form}"
            path.write_bytes(encode(figure, form))
            written.append(path)
    return written
