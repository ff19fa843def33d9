"""Draw modes over a parameter, from the folder of ``msahl modes --over``: diagrams and a page."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msahl.analysis.modes.campbell import COLUMNS, CRITICAL_COLUMNS
from msahl.post.document import Block, Folded, Paragraph
from msahl.post.draw import COLOURS, LINES, encode, folded, plain, style
from msahl.post.page.blocks import as_html
from msahl.post.page.drawing import as_picture
from msahl.post.table import Column, Table
from msahl.printable import shown_path
from msahl.records import record
from msahl.results.read import ResultError, read_table
from msahl.results.write import replace_file

INFO, PAGE = "campbell.json", "campbell.html"
MOST_CURVES = 40
"""Modes that are drawn."""
MOST_IN_LEGEND = 14
MOST_ROWS = 400
"""Rows of the table that the page lists."""
AGAIN = "write it by msahl modes DECK --over NAME=VALUES -o DIR"
UNSTABLE = "#D55E00"
GREY = "#888888"
WHIRL = {1: "forward", -1: "backward", 0: ""}


@record(slots=False)
class Diagram:
    """Modes over a parameter: ``rows`` (r, 8) and ``critical`` (c, 8) as in the tables."""

    title: str
    name: str
    unit: str
    orders: tuple[float, ...]
    speed: float  # of a value in rad/s; 0 if it is no speed
    rows: np.ndarray
    critical: np.ndarray

    @property
    def parameter(self) -> str:
        """Name and unit of the parameter."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def mode(self, number: int) -> np.ndarray:
        """(k, 8) rows of a mode."""
        found: np.ndarray = self.rows[self.rows[:, 1] == number]
        return found

    @property
    def numbers(self) -> list[int]:
        """Numbers of the modes that are drawn."""
        return [int(n) for n in np.unique(self.rows[:, 1])[:MOST_CURVES]]


def read_diagram(folder: Path) -> Diagram:
    """Read a folder; raises ``ResultError``."""
    path = folder / INFO
    try:
        info = json.loads(path.read_text(encoding="utf-8"))
        speed = float(info["speed"] or 0.0)
        texts = [str(info[key]) for key in ("title", "name", "unit")]
        orders = tuple(float(n) for n in info["orders"])
    except OSError as error:
        message = f"no {INFO} ({error.strerror}): this is no folder of msahl modes --over; {AGAIN}"
        raise ResultError(f"{shown_path(folder)}: {message}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise ResultError(f"{shown_path(path)}: cannot be read: {error}; {AGAIN}") from error
    tables = []
    for name, columns in (("campbell.csv", COLUMNS), ("critical.csv", CRITICAL_COLUMNS)):
        table = read_table(folder / name)
        if list(table.columns) != list(columns):
            raise ResultError(f"{shown_path(folder / name)}:1: other columns; {AGAIN}")
        tables.append(table.to_numpy())
    if not len(tables[0]):
        raise ResultError(f"{shown_path(folder / 'campbell.csv')}: no rows; {AGAIN}")
    return Diagram(texts[0], texts[1], texts[2], orders, speed, *tables)


def figures(diagram: Diagram) -> list[tuple[str, str, Figure]]:
    """Return name, caption and figure of the Campbell diagram and of the root locus."""
    over = f"over {diagram.name}"
    return [
        ("campbell", f"Frequencies and real parts {over}", _campbell(diagram)),
        ("root-locus", f"Eigenvalues {over}", _root_locus(diagram)),
    ]


def _campbell(diagram: Diagram) -> Figure:
    """Draw frequencies of vibrations and real parts of all modes over the parameter."""
    figure = Figure(figsize=(8.0, 7.0))
    FigureCanvasAgg(figure)
    top, bottom = figure.subplots(2, 1, sharex=True)
    top.set_title(plain(folded(diagram.title or "Modes", 64)))
    for k, number in enumerate(diagram.numbers):
        rows = diagram.mode(number)
        look = {
            "color": COLOURS[k % len(COLOURS)],
            "linestyle": LINES[k // len(COLOURS) % len(LINES)],
            "marker": "." if len(rows) < 100 else "",
        }
        hertz = np.where(rows[:, 3] > 0.0, rows[:, 3] / (2.0 * np.pi), np.nan)
        top.plot(rows[:, 0], hertz, **look)
        label = f"mode {number}" if k < MOST_IN_LEGEND else "_more"
        bottom.plot(rows[:, 0], rows[:, 2], label=label, **look)
    _orders(top, diagram)
    bottom.axhline(0.0, color="#000000", linewidth=0.9)
    low, high = bottom.get_ylim()
    if high > 0.0:
        bottom.axhspan(0.0, high, color=UNSTABLE, alpha=0.08, linewidth=0.0)
        bottom.set_ylim(low, high)
    _criticals(top, bottom, diagram)
    top.set_ylabel("frequency [Hz]")
    top.set_ylim(bottom=0.0)
    bottom.set(xlabel=plain(diagram.parameter), ylabel="real part [1/s]")
    figure.legend(*bottom.get_legend_handles_labels(), loc="outside right upper")
    return figure


def _orders(axes: Axes, diagram: Diagram) -> None:
    """Draw the lines of frequencies that are multiples of the speed, within what is there."""
    if not diagram.speed:
        return
    ends = np.array([diagram.rows[:, 0].min(), diagram.rows[:, 0].max()])
    top = axes.get_ylim()[1]
    for order in diagram.orders:
        hertz = order * diagram.speed * np.abs(ends) / (2.0 * np.pi)
        axes.plot(ends, hertz, color=GREY, linestyle="--", linewidth=1.0)
        where = min(1.0, 0.97 * top / hertz[1]) if hertz[1] > 0.0 else 1.0
        axes.annotate(
            f"{order:g}x",
            (ends[0] + where * (ends[1] - ends[0]), where * hertz[1]),
            color="#555555",
            ha="right",
            va="bottom",
        )
    axes.set_ylim(top=top)


def _criticals(top: Axes, bottom: Axes, diagram: Diagram) -> None:
    """Mark the critical values: crossings of orders above, changes of stability below."""
    for value, _, order, _, _, imaginary, *_ in diagram.critical:
        if order:
            top.plot(value, imaginary / (2.0 * np.pi), "o", mfc="none", mec="#000000", ms=8)
            continue
        bottom.plot(value, 0.0, "o", mfc="none", mec="#000000", ms=8)
        for axes in (top, bottom):
            axes.axvline(value, color=GREY, linestyle=":", linewidth=1.0)
        bottom.annotate(
            f"{value:.6g}",
            (value, 0.0),
            xytext=(4, 5),
            textcoords="offset points",
            color="#444444",
        )


def _root_locus(diagram: Diagram) -> Figure:
    """Draw eigenvalues with imaginary part >= 0 in the complex plane, by the parameter."""
    figure = Figure(figsize=(8.0, 5.6))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_title(plain(folded(diagram.title or "Modes", 64)))
    shades = None
    values = diagram.rows[:, 0]
    low, high = float(values.min()), float(values.max())
    for number in diagram.numbers:
        rows = diagram.mode(number)
        axes.plot(rows[:, 2], rows[:, 3], color="#cccccc", linewidth=1.0, zorder=1)
        shades = axes.scatter(
            rows[:, 2],
            rows[:, 3],
            c=rows[:, 0],
            s=16,
            cmap="viridis",
            zorder=2,
            vmin=low,
            vmax=high,
        )
        axes.annotate(
            str(number),
            (rows[0, 2], rows[0, 3]),
            xytext=(4, 4),
            textcoords="offset points",
            color="#444444",
        )
    axes.axvline(0.0, color="#000000", linewidth=0.9)
    for row in diagram.critical[diagram.critical[:, 2] == 0.0]:
        axes.plot(row[4], row[5], "o", mfc="none", mec="#000000", ms=9, zorder=3)
    axes.set(xlabel="real part [1/s]", ylabel="imaginary part [1/s]")
    if shades is not None and high > low:
        figure.colorbar(shades, ax=axes, label=plain(diagram.parameter))
    return figure


def write_diagram(diagram: Diagram, folder: Path, forms: Sequence[str]) -> list[Path]:
    """Write ``campbell.html`` and the pictures in each of ``forms`` ("png", "svg", "pdf") to
    ``folder``; return the paths.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files: dict[str, bytes] = {}
    blocks: list[Block] = []
    with style():
        for name, caption, figure in figures(diagram):
            picture = as_picture(name, caption, figure)
            blocks.append(picture)
            for form in forms:
                files[f"{name}.{form}"] = picture.png if form == "png" else encode(figure, form)
    title = f"{diagram.title or 'Modes'} over {diagram.name}"
    page = as_html(title, [*blocks, *_critical_blocks(diagram), _listed(diagram)])
    replace_file(folder / PAGE, page.encode())
    for name, data in files.items():
        replace_file(folder / name, data)
    return [folder / name for name in (PAGE, *files)]


def _critical_blocks(diagram: Diagram) -> list[Block]:
    """Return the table of critical values."""
    if not len(diagram.critical):
        return [Paragraph("There are no critical values in this range.")]
    columns = (
        Column("value", diagram.parameter, form=".15g"),
        Column("error", "error", form=".0e"),
        Column("mode", "mode", form="d"),
        Column("what", "what"),
        Column("frequency", "frequency [Hz]", form=".9g"),
    )
    rows = []
    for value, error, order, mode, _, imaginary, _, whirl in diagram.critical:
        side = WHIRL[int(whirl)]
        what = f"{order:g}x the speed{f', {side} whirl' if side else ''}"
        if not order:
            what = "stability changes, " + ("flutter" if imaginary else "divergence")
        rows.append((float(value), float(error), int(mode), what, float(imaginary / (2 * np.pi))))
    return [Table(columns, tuple(rows))]


def _listed(diagram: Diagram) -> Folded:
    """Return the folded table of all modes."""
    shown = diagram.rows[:MOST_ROWS]
    labels = (diagram.parameter, "mode", "real [1/s]", "imaginary [1/s]", "frequency [Hz]")
    forms = (".9g", ".0f", ".9g", ".9g", ".9g", ".5f", ".3g", ".1e")
    columns = tuple(
        Column(key, label, form=form)
        for key, label, form in zip(COLUMNS, (*labels, *COLUMNS[5:]), forms, strict=True)
    )
    more = len(diagram.rows) - len(shown)
    title = f"Modes (first {len(shown)} rows; all are in campbell.csv)" if more else "Modes"
    return Folded(title, (Table(columns, tuple(tuple(map(float, row)) for row in shown)),))
