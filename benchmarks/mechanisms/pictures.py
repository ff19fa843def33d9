"""One picture of small multiples: error against loop seconds, a hue for each program."""

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt

from benchmarks.curves import Curve
from benchmarks.precision_asked import Found

HUES = {"msahl": "C0", "exudyn": "C1", "mujoco": "C2", "drake": "C4"}
COLUMNS = 3
LIMITS = (1e-11, 1.0)
"""Errors shown [m]."""
TARGET = 1e-6


def draw_mechanisms(found: list[Found], path: Path) -> None:
    """Draw every code on every mechanism."""
    rows = -(-max(len(found), 1) // COLUMNS)
    size = (9.0, 2.6 * rows + 0.4)
    figure, grid = plt.subplots(rows, COLUMNS, figsize=size, layout="constrained", squeeze=False)
    for axes in grid.flat[len(found) :]:
        axes.set_axis_off()
    for axes, one in zip(grid.flat, found, strict=False):
        for curve in one.curves:
            _draw(axes, curve)
        axes.axhline(TARGET, color="0.5", linewidth=0.8)
        axes.set_title(one.problem.name, fontsize=9)
        axes.set_ylim(*LIMITS)
        axes.tick_params(labelsize=7)
        axes.grid(True, which="major", alpha=0.3)
    handles = [mpl.lines.Line2D([], [], color=hue, label=name) for name, hue in HUES.items()]
    figure.legend(handles=handles, fontsize=8, loc="outside lower center", ncols=len(HUES))
    figure.supxlabel("time loop [s]", fontsize=9)
    figure.supylabel("largest position error [m]", fontsize=9)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _draw(axes: Any, curve: Curve) -> None:
    points = [(p.seconds, p.error) for p in curve.sorted() if p.samples and p.error > 0.0]
    if points:
        program = curve.code.name.split()[0]
        axes.loglog(
            *zip(*points, strict=True), color=HUES[program], marker=".", markersize=3, linewidth=1.0
        )
