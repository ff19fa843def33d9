"""Draw the stability page: maps of cells, and vibrations that are too fast for the step."""

from collections.abc import Sequence
from math import log10
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from msahl.deck import read_deck
from msahl.model import Model, Options
from msahl.post.draw import looks, style
from msahl.study.runs import run_in_memory, with_step
from tools.validation.extreme_families import FAMILIES, Family
from tools.validation.small_pictures import save_small
from tools.validation.stability_cells import (
    BOUNDED,
    COARSE,
    COMPARED,
    DOUBTFUL,
    FAILED,
    GOOD,
    LATE,
    REFUSED,
    STEPS,
    Cell,
    show_value,
)
from tools.validation.thesis_runs import FIGURES

LOOKS = {
    GOOD: ("#3B8FC4", "good: position within the tolerance"),
    COARSE: ("#BBDDF0", "coarse: stable, but the step is too large for the position"),
    BOUNDED: ("#DDDDDD", "bounded: stable, no reference position"),
    DOUBTFUL: ("#F0C84B", "doubtful: energy balance or constraints violated"),
    FAILED: ("#D55E00", "failed: a step did not converge"),
    LATE: ("#8B5A8C", "out of time: too many subdivided steps"),
    REFUSED: ("#333333", "refused: no consistent initial conditions"),
}
"""Outcomes in their order, with colour and description."""
COLOURS = ListedColormap([colour for colour, _ in LOOKS.values()])
PALE = (COARSE, BOUNDED, DOUBTFUL)
A_PAGE = 4
"""Number of families in one figure."""


def maps(cells: Sequence[Cell]) -> list[tuple[Path, list[str]]]:
    """Draw the maps of all families; return each file with the names of its families."""
    names = list(dict.fromkeys(cell.family for cell in cells))
    groups = [names[k : k + A_PAGE] for k in range(0, len(names), A_PAGE)]
    return [(_draw(cells, group, k + 1), group) for k, group in enumerate(groups)]


def _draw(cells: Sequence[Cell], names: Sequence[str], number: int) -> Path:
    schemes = list(dict.fromkeys(cell.scheme for cell in cells))
    values = {n: list(dict.fromkeys(c.value for c in cells if c.family == n)) for n in names}
    heights = [len(values[name]) + 1.6 for name in names]
    with style():
        figure = Figure(figsize=(1.6 + 3.4 * len(schemes), 0.9 + 0.3 * sum(heights)))
        FigureCanvasAgg(figure)
        panels = figure.subplots(
            len(names), len(schemes), squeeze=False, sharey="row", height_ratios=heights
        )
        for name, row in zip(names, panels, strict=True):
            for scheme, axes in zip(schemes, row, strict=True):
                own = [c for c in cells if (c.family, c.scheme) == (name, scheme)]
                _map(axes, own, values[name])
                axes.set_title(scheme, fontsize=9, loc="right")
            row[0].set_title(title_of(name), fontsize=9)
            row[0].set_ylabel(label_of(name), fontsize=8)
        for axes in panels[-1]:
            axes.set_xlabel("step [s]")
        handles = [Patch(color=colour, label=words) for colour, words in LOOKS.values()]
        figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=8)
        return save_small(figure, FIGURES / f"stability_{number}.png", colours=192)


def title_of(name: str) -> str:
    """Return the title of a family."""
    return FAMILIES[name].title if name in FAMILIES else "Restart"


def label_of(name: str) -> str:
    """Return the name of the varied parameter with its unit, in lines that fit beside a map."""
    if name not in FAMILIES:
        return "deck"
    family = FAMILIES[name]
    unit = "" if family.unit == "1" else f" [{family.unit}]"
    words, line, lines = f"{family.varied}{unit}".split(" "), "", []
    for word in words:
        if line and len(line) + len(word) > 22:
            lines.append(line)
            line = ""
        line = f"{line} {word}".strip()
    return "\n".join([*lines, line])


def _map(axes: Axes, cells: Sequence[Cell], values: Sequence[float | str]) -> None:
    """Draw the cells of a scheme: step sizes across, values up, the decade of the error in each."""
    order = list(LOOKS)
    field = np.full((len(values), len(STEPS)), np.nan)
    for cell in cells:
        row, column = values.index(cell.value), STEPS.index(cell.dt)
        field[row, column] = order.index(cell.outcome)
        if cell.error is not None:
            shown = "exact" if cell.error == 0.0 else f"{round(log10(cell.error))}"
            colour = "black" if cell.outcome in PALE else "white"
            axes.text(column, row, shown, ha="center", va="center", fontsize=7, color=colour)
    axes.imshow(
        field, cmap=COLOURS, vmin=-0.5, vmax=len(order) - 0.5, aspect="auto", origin="lower"
    )
    axes.set_xticks(range(len(STEPS)), [f"{dt:g}" for dt in STEPS], fontsize=7)
    axes.set_yticks(range(len(values)), [show_value(v) for v in values], fontsize=8)
    axes.grid(visible=False)
    axes.set_xticks(np.arange(len(STEPS)) + 0.5, minor=True)
    axes.set_yticks(np.arange(len(values)) + 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=1.0)
    axes.tick_params(which="both", length=0)


RINGING_STEP = 0.01
RINGING_END = 0.5


def ringing() -> Path:
    """Draw a stiff spring and the governor at a step of 0.01 s, one row of panels per scheme."""
    models: tuple[tuple[Family, float, str, str, str], ...] = (
        (FAMILIES["stiff_spring"], 1e-7, "states", "Block.vy", "velocity of the block [m/s]"),
        (FAMILIES["governor"], 0.0, "reactions", "Hinge 1.Fz", "force in hinge 1, along z [N]"),
        (FAMILIES["governor"], 4e4, "reactions", "Hinge 1.Fz", "force in hinge 1, along z [N]"),
    )
    titles = ("stiff spring", "governor without dampers", "governor with dampers")
    with style():
        figure = Figure(figsize=(10.5, 1.0 + 1.7 * len(COMPARED)))
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(COMPARED), len(models), sharex=True, sharey="col")
        for column, title, (family, x, table, name, label) in zip(
            panels.T, titles, models, strict=True
        ):
            model = with_value(family, x)
            column[0].set_title(f"{title}:\n{label}")
            column[-1].set_xlabel("time [s]")
            for axes, scheme, look in zip(column, COMPARED, looks(), strict=False):
                one = with_step(model, RINGING_STEP, RINGING_END, scheme)
                _, run = run_in_memory(one, Options())
                axes.plot(run.time, getattr(run, table)[name], **look)
        for axes, scheme in zip(panels[:, 0], COMPARED, strict=True):
            axes.set_ylabel(scheme)
        return save_small(figure, FIGURES / "stability_ringing.png", colours=96)


def with_value(family: Family, x: float) -> Model:
    """Return the model of a family's deck with a value."""
    with TemporaryDirectory() as folder:
        deck = Path(folder) / "deck.xml"
        deck.write_bytes(family.with_value(x))
        return read_deck(deck)
