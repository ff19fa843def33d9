"""One picture of small multiples: error against loop seconds, a hue for each program.

The line of a program joins the runs that no other run of its codes surpasses in both; faint dots
are all runs.
"""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

from benchmarks.multiples import finish_axes, save
from benchmarks.precision_asked import Found

HUES = {"msahl": "C0", "exudyn": "C1", "mujoco": "C2", "drake": "C4"}
COLUMNS = 3
LIMITS = (1e-11, 1.0)
"""Errors shown [m]."""
TARGET = 1e-6


def draw_problems(found: list[Found], path: Path, limits: tuple[float, float] = LIMITS) -> None:
    """Draw every program on every problem, errors between the ``limits`` [m]."""
    rows = -(-max(len(found), 1) // COLUMNS)
    size = (8.0, 2.3 * rows + 0.5)
    figure, grid = plt.subplots(rows, COLUMNS, figsize=size, layout="constrained", squeeze=False)
    for axes in grid.flat[len(found) :]:
        axes.set_axis_off()
    for axes, one in zip(grid.flat, found, strict=False):
        for program, hue in HUES.items():
            _draw(axes, runs(one, program), hue)
        finish_axes(axes, one.problem.name, limits, TARGET)
    save(figure, HUES, ("time loop [s]", "largest position error [m]"), path)


def runs(found: Found, program: str) -> list[tuple[float, float]]:
    """Return seconds and errors of all runs of a program, the fastest first."""
    curves = [curve for curve in found.curves if curve.code.name.startswith(program)]
    points = [p for curve in curves for p in curve.sorted() if p.samples and p.error > 0.0]
    return sorted((p.seconds, p.error) for p in points)


def best(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return those that are better than all faster ones."""
    kept: list[tuple[float, float]] = []
    for seconds, error in points:
        if not kept or error < kept[-1][1]:
            kept.append((seconds, error))
    return kept


def _draw(axes: Any, points: list[tuple[float, float]], hue: str) -> None:
    if points:
        axes.loglog(*zip(*points, strict=True), color=hue, marker=".", linestyle="", markersize=3,
                    alpha=0.35)  # fmt: skip
        axes.loglog(*zip(*best(points), strict=True), color=hue, linewidth=1.4)
