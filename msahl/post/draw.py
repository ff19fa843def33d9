"""Set the style of figures, draw curves, and save figures: equal data give equal files.

matplotlib is used through its objects on the Agg and SVG canvases; no display is needed, and no
global state is changed.
"""

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import cycle, product
from pathlib import Path
from textwrap import wrap
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msahl.post.graph_data import MOST_DECADES, Graph, Group, peaks, thinned

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
MANY = 5
"""From this number of panels on, each is drawn less high."""
NO_DATES: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
"""Metadata of each format without what differs from day to day."""


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


def draw_group(group: Group, heading: str) -> Figure:
    """Return a figure of the graphs of a group below each other, with one legend of all curves."""
    count = len(group.graphs)
    height = 3.4 if count == 1 else 2.4 if count < MANY else 1.7
    note = f"\n({group.note})" if group.note else ""
    figure, all_axes = new_figure(count, height, f"{heading}: {group.title}{note}")
    names = dict.fromkeys(name for graph in group.graphs for name, _ in graph.curves)
    look = dict(zip(names, looks(), strict=False))
    for axes, graph in zip(all_axes, group.graphs, strict=True):
        draw_graph(axes, graph, look)
    all_axes[-1].set_xlabel(group.graphs[-1].x_title)
    legend(figure, *all_axes)
    return figure


def draw_graph(axes: Axes, graph: Graph, look: Mapping[str, dict[str, Any]]) -> None:
    """Draw a graph in a panel; ``look`` has colour and line style by the name of a curve."""
    x, values = graph.x, np.array([series for _, series in graph.curves]).T
    if graph.log:
        x, values = _on_logarithmic_scale(axes, x, values)
    for k, (name, _) in enumerate(graph.curves):
        line = {"linestyle": LINES[k % len(LINES)]} if graph.broken else {}
        axes.plot(*thinned(x, values[:, k]), label=plain(name), **(look[name] | line))
    for place, name in graph.marks:
        colour = COLOURS[1] if name else "#888888"
        axes.axvline(place, color=colour, linewidth=0.6, alpha=0.7, zorder=0)
    axes.set_ylabel(folded(graph.title))


def _on_logarithmic_scale(
    axes: Axes, x: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give a panel the scale of absolute values (m, k), and return them; of a long run the peaks.

    Zeros, and values ``MOST_DECADES`` below the largest, leave the panel at its lower edge. If all
    values are zero there is no scale, and a text in the panel says so.
    """
    x, values = peaks(x, np.abs(values))
    top = float(np.nanmax(values, initial=0.0))
    if top == 0.0:
        text = "zero at every output time" if len(x) else "no output times"
        axes.set_yticks([0.0])
        axes.text(0.5, 0.6, text, transform=axes.transAxes, ha="center")
        return x, values
    floor = max(float(values[values > 0.0].min()), top * 10.0**-MOST_DECADES)
    # At least two decades: fewer may leave a logarithmic axis without a tick label.
    low = min(0.5 * floor, 0.02 * top)
    axes.set(yscale="log", ylim=(low, 2.0 * top))
    return x, np.maximum(values, 0.1 * low)


def legend(figure: Figure, *all_axes: Axes) -> None:
    """Add the legend of the curves of all panels beside them, each name once."""
    found = {
        shortened(label): handle
        for axes in all_axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    shown = list(found)[:MOST_IN_LEGEND]
    more = f"and {len(found) - len(shown)} more" if len(found) > len(shown) else None
    if shown:
        handles = [found[label] for label in shown]
        figure.legend(handles, shown, loc="outside right upper", title_fontsize=9, title=more)


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
