"""Set the style of figures, draw curves, and save figures: equal data give equal files.

matplotlib is used through its objects on the Agg and SVG canvases; no display is needed, and no
global state is changed.
"""

import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import cycle, pairwise, product
from pathlib import Path
from textwrap import wrap
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Okabe and Ito's colours, distinguishable by every kind of colour vision.
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
TITLE_WIDTH = 64
"""Characters in a line of a title; more would run into the legend."""
MOST_IN_LEGEND = 12
LONGEST_NAME = 44
MOST_DECADES = 8
"""Decades of a logarithmic scale; products of rounding errors would extend it much further down."""
NO_DATES: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
"""Metadata of each format without what differs from day to day."""
INTERVALS = 750
"""Intervals into which a long run is divided: as many as a picture can resolve."""


@contextmanager
def style() -> Iterator[None]:
    """Set the style of all figures made and saved in this context, whatever the user's settings."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        for name, value in STYLE.items():
            matplotlib.rcParams[name] = value
        yield


def plain(name: str) -> str:
    """Escape a name from a deck, so that matplotlib shows it literally: no formula, not hidden."""
    return f" {name}".replace("$", r"\$") if name.startswith("_") else name.replace("$", r"\$")


def folded(text: str, width: int = 24) -> str:
    """Break each line of ``text`` between words where it is longer than ``width`` characters."""
    return "\n".join("\n".join(wrap(line, width)) for line in text.splitlines())


def new_figure(rows: int, height: float = 2.4, title: str = "") -> tuple[Figure, list[Axes]]:
    """Return a figure of ``rows`` panels below each other that share their abscissa."""
    figure = Figure(figsize=(8.0, 0.9 + height * rows))
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    axes[0].set_title(plain(folded(title, TITLE_WIDTH)))
    return figure, list(axes)


def looks() -> Iterator[dict[str, Any]]:
    """Yield colour and line style of one curve after the other."""
    return cycle({"linestyle": line, "color": colour} for line, colour in product(LINES, COLOURS))


def curves(
    axes: Axes,
    time: np.ndarray,
    series: np.ndarray | Sequence[np.ndarray],
    names: Sequence[str],
    lines: Sequence[str] = (),
) -> None:
    """Draw each column of ``series`` (m, k), or each of several (m,), against ``time`` (m,), in the
    line styles ``lines``."""
    columns = series.T if isinstance(series, np.ndarray) else series
    for i, (values, name, look) in enumerate(zip(columns, names, looks(), strict=False)):
        chosen = {"linestyle": lines[i]} if lines else {}
        axes.plot(*thinned(time, values), label=plain(name), **(look | chosen))


def absolute_curves(axes: Axes, time: np.ndarray, series: np.ndarray, names: Sequence[str]) -> None:
    """Draw the absolute value of each column on a logarithmic scale; of a long run the peaks.

    Columns of nan are not drawn, but keep their style and their place in the legend.

    Zeros, and values ``MOST_DECADES`` below the largest, leave the panel at its lower edge. If all
    values are zero there is no scale, and a text in the panel says so.
    """
    time, series = peaks(time, np.abs(series))
    if not np.nan_to_num(series).any():
        curves(axes, time, series, names)
        axes.set_yticks([0.0])
        axes.text(0.5, 0.6, "zero at every output time", transform=axes.transAxes, ha="center")
        return
    top = float(np.nanmax(series))
    floor = max(float(series[series > 0.0].min()), top * 10.0**-MOST_DECADES)
    # At least two decades: fewer may leave a logarithmic axis without a tick label.
    low, high = min(0.5 * floor, 0.02 * top), 2.0 * top
    axes.set(yscale="log", ylim=(low, high))
    curves(axes, time, np.maximum(series, 0.1 * low), names)


def thinned(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reduce ``values`` (m,) of a long run to the least and largest of each interval of time."""
    if values.size <= 2 * INTERVALS:
        return time, values
    kept = {0, values.size - 1}
    for begin, end in _intervals(values.size):
        kept.add(begin + int(values[begin:end].argmin()))
        kept.add(begin + int(values[begin:end].argmax()))
    index = np.array(sorted(kept))
    return time[index], values[index]


def peaks(time: np.ndarray, series: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reduce ``series`` (m, k) of a long run to each column's largest value per interval."""
    if len(time) <= 2 * INTERVALS:
        return time, series
    intervals = list(_intervals(len(time)))
    ends = np.array([end - 1 for _, end in intervals])
    return time[ends], np.array([series[begin:end].max(axis=0) for begin, end in intervals])


def _intervals(length: int) -> Iterator[tuple[int, int]]:
    """Yield the first index of each of ``INTERVALS`` intervals, and the index after its last."""
    return pairwise(int(edge) for edge in np.linspace(0, length, INTERVALS + 1))


def legend(figure: Figure, axes: Axes) -> None:
    """Add the legend of the curves of ``axes`` beside the panels."""
    handles, labels = axes.get_legend_handles_labels()
    labels = ["\n".join(map(shortened, label.splitlines())) for label in labels]
    if len(labels) > MOST_IN_LEGEND:
        more = f"and {len(labels) - MOST_IN_LEGEND} more"
        handles, labels = handles[:MOST_IN_LEGEND], labels[:MOST_IN_LEGEND]
        figure.legend(handles, labels, loc="outside right upper", title_fontsize=9, title=more)
    elif labels:
        figure.legend(handles, labels, loc="outside right upper")


def shortened(name: str) -> str:
    """Return a name, cut to ``LONGEST_NAME`` characters to leave space for the curves."""
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 3]}..."


def encode(figure: Figure, form: str) -> bytes:
    """Return the bytes of ``figure`` as "png", "svg" or "pdf", without dates."""
    stream = BytesIO()
    with warnings.catch_warnings():
        # Letters that the font lacks are drawn as boxes.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        figure.savefig(stream, format=form, dpi=150, metadata=NO_DATES[form])
    return stream.getvalue()


def save(figures: Iterable[tuple[str, Figure]], forms: Sequence[str], folder: Path) -> list[Path]:
    """Write every named figure in every form to ``folder``; return the paths written."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, figure in figures:
        for form in forms:
            path = folder / f"{name}.{form}"
            path.write_bytes(encode(figure, form))
            written.append(path)
    return written
