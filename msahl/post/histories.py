"""Draw columns of runs: histories in small multiples, phase plots, and comparisons of runs.

Of one run, columns of the same quantity share a panel, each in its colour. Of several runs, every
column has a panel of its own, and every run a colour.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msahl.post.columns import grouped, matching, series
from msahl.post.draw import COLOURS, LINES, MOST_IN_LEGEND, folded, looks, plain
from msahl.post.graph_data import thinned
from msahl.printable import shown_path
from msahl.results.read import ResultError, Run
from msahl.run.column_units import ORIENTATION, POSITION, quantity

MOST_PANELS = 48
"""Most panels of a figure; more are too small to read."""
ONE_COLUMN = 4
"""Most panels that stand below each other at full width; more stand in two columns."""
MOST_IN_PANEL = 6
"""Columns of one quantity that share a panel; more are spread over panels by their names."""
TITLE_WIDTH = 80
JUMP = 4.0
"""Least jump of an orientation parameter at a rotation by 180 degrees that breaks its curve: of the
vector it is 8."""
NEGLIGIBLE = 1e-9
"""Columns below this fraction of the largest of their quantity have no curve; the title says so."""


def histories(runs: Sequence[Run], patterns: Sequence[str]) -> tuple[str, Figure]:
    """Draw the columns that match ``patterns`` against time, in small multiples.

    Several runs need not have the same output times, only the same columns. Raises ``ResultError``
    if there is no such column, or there are too many.
    """
    columns, zeros = _without_zeros(runs, matching(runs[0], patterns))
    panels = _panels(runs, columns)
    if len(panels) > MOST_PANELS:
        raise ResultError(
            f"{len(columns)} columns match and would need {len(panels)} panels; at most "
            f"{MOST_PANELS} fit in a figure: choose fewer columns"
        )
    labels = run_labels(runs)
    note = f"\n(zero or nearly so: {', '.join(zeros)})" if zeros else ""
    figure, all_axes = _grid(len(panels), title(runs, "histories") + note)
    for axes, (label, names) in zip(all_axes, panels, strict=True):
        several = len(runs) > 1
        named = [
            (labels[k] if several else name, run, name)
            for k, run in enumerate(runs)
            for name in names
        ]
        styles = _looks_of_runs(len(runs)) if several else looks()
        for (text, run, name), look in zip(named, styles, strict=False):
            for k, piece in enumerate(_pieces(run, name)):
                axes.plot(*thinned(*piece), label="" if k else plain(text), **look)
        axes.set_ylabel(label)
        if len(runs) == 1:
            _legend_beside(axes)
    if len(runs) > 1:
        _legend_of_runs(figure, all_axes[0])
    return "columns", figure


def _pieces(run: Run, column: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return times and values of a column, divided where an orientation parameter jumps."""
    times, values = series(run, column)
    jumps = np.zeros(0, dtype=int)
    if quantity(column) == ORIENTATION:
        jumps = np.flatnonzero(np.abs(np.diff(values)) > JUMP) + 1
    parts = zip(np.split(times, jumps), np.split(values, jumps), strict=True)
    return list(parts)


def _without_zeros(runs: Sequence[Run], columns: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the columns to draw, and those that are not because they are zero in all runs, or
    nearly so beside others of the same quantity; all are drawn if no others are left."""
    largest = {c: max(float(np.abs(series(run, c)[1]).max()) for run in runs) for c in columns}
    zeros = [
        name
        for names in grouped(columns, runs[0].model).values()
        for name in names
        if largest[name] <= NEGLIGIBLE * max(largest[other] for other in names)
    ]
    left = [name for name in columns if name not in zeros]
    return (left, zeros) if left else (list(columns), [])


def phase(runs: Sequence[Run], abscissa: str, ordinate: str) -> tuple[str, Figure]:
    """Draw one column over another; a dot is the start of each run.

    Raises ``ResultError`` if a run has no such column, or the two have different output times.
    """
    labels = run_labels(runs)
    quantities = [quantity(name, runs[0].model) for name in (abscissa, ordinate)]
    figure, (axes,) = _grid(1, title(runs, "phase plot"), height=5.4)
    for k, (run, look) in enumerate(zip(runs, _looks_of_runs(len(runs)), strict=True)):
        (_, across), (_, up) = series(run, abscissa), series(run, ordinate)
        if len(across) != len(up):
            raise ResultError(
                f"{shown_path(run.folder)}: '{abscissa}' has {len(across)} output times and "
                f"'{ordinate}' has {len(up)}; choose columns of the same table"
            )
        axes.plot(across, up, label=plain(labels[k]), **look)
        axes.plot(across[:1], up[:1], "o", color=look["color"], markersize=5)
    names = [
        plain(f"{n} [{q.unit}]") for n, q in zip((abscissa, ordinate), quantities, strict=True)
    ]
    axes.set(xlabel=names[0], ylabel=names[1])
    if quantities == [POSITION, POSITION]:
        axes.set_aspect("equal", adjustable="datalim")
    if len(runs) > 1:
        _legend_of_runs(figure, axes)
    return "phase", figure


def run_labels(runs: Sequence[Run]) -> list[str]:
    """Return the names of runs for a legend: their folders without the path they have in common."""
    paths = [Path(run.folder).absolute() for run in runs]
    parts = [path.parts for path in paths]
    shared = 0
    while len({each[: shared + 1] for each in parts}) == 1 and shared + 1 < min(map(len, parts)):
        shared += 1
    return ["/".join(each[shared:]) for each in parts]


def _looks_of_runs(count: int) -> list[dict[str, Any]]:
    """Return a look for each run: equal curves remain visible through broken lines."""
    return [
        {"color": COLOURS[k % len(COLOURS)], "linestyle": LINES[k % len(LINES)]}
        for k in range(count)
    ]


def _panels(runs: Sequence[Run], columns: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Return label and columns of each panel."""
    model = runs[0].model
    if len(runs) > 1:
        return [(plain(f"{c} [{quantity(c, model).unit}]"), [c]) for c in columns]
    panels = []
    for quantity_shown, names in grouped(columns, model).items():
        parts = _parts(names)
        panels += [(folded(str(quantity_shown)), part) for part in parts]
    return panels


def _parts(names: Sequence[str]) -> list[list[str]]:
    """Spread the columns of one quantity over panels: all in one, or one panel for each component
    (``.x``, ``.y``, ...), as many as there are; each has at most ``MOST_IN_LEGEND`` columns."""
    if len(names) <= MOST_IN_PANEL:
        return [list(names)]
    by_component: dict[str, list[str]] = {}
    for name in names:
        _, point, component = name.rpartition(".")
        # Signals have no components; those whose names differ by a number belong together.
        key = component if point else component.rstrip("0123456789")
        by_component.setdefault(key, []).append(name)
    return [
        part[i : i + MOST_IN_LEGEND]
        for part in by_component.values()
        for i in range(0, len(part), MOST_IN_LEGEND)
    ]


def _grid(count: int, heading: str, height: float = 0.0) -> tuple[Figure, list[Axes]]:
    """Return a figure of ``count`` panels that share their abscissa, in one or two columns."""
    across = 1 if count <= ONE_COLUMN else 2
    down = -(-count // across)
    high = height or (2.4 if down <= 3 else 1.8)
    figure = Figure(figsize=(8.0 if across == 1 else 11.0, 0.9 + high * down))
    FigureCanvasAgg(figure)
    grid = figure.subplots(down, across, sharex=True, squeeze=False)
    # Down the first column, then down the second: neighbours in a table stay neighbours.
    flat = list(grid.T.ravel())
    for axes in flat[count:]:
        axes.remove()
    figure.suptitle(plain(folded(heading, TITLE_WIDTH)), x=0.01, ha="left", fontsize=11)
    for axes in _lowest(flat[:count], down):
        axes.set_xlabel("time [s]")
        axes.tick_params(labelbottom=True)
    return figure, flat[:count]


def _lowest(axes: Sequence[Axes], down: int) -> list[Axes]:
    """Return the lowest panel of each column."""
    return [column[-1] for i in range(0, len(axes), down) if (column := axes[i : i + down])]


def _legend_beside(axes: Axes) -> None:
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, borderaxespad=0.4)


def _legend_of_runs(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    wide = max(map(len, labels))
    figure.legend(handles, labels, loc="outside lower left", ncols=max(1, 90 // (wide + 8)))


def title(runs: Sequence[Run], what: str) -> str:
    """Return the title of a picture of ``runs``."""
    titles = dict.fromkeys(run.model.simulation.title or run.folder.name for run in runs)
    many = f", {len(runs)} runs" if len(runs) > 1 else ""
    return f"{' / '.join(titles)}: {what}{many}"
