"""Log-log pictures of the loops and of the curves of work and precision."""

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt

from benchmarks.curves import TARGETS, Curve
from benchmarks.loops import CODES, Measured

# One hue for each family, and a marker for each member: to be told apart in grey as well.
STYLES: dict[str, dict[str, Any]] = {
    "msahl newton": {"color": "C0", "marker": "o", "linewidth": 2.2},
    "msahl auto": {"color": "C0", "marker": "s", "linestyle": "--"},
    "msahl root": {"color": "C0", "marker": "v", "linestyle": ":"},
    "msahl newton --full": {"color": "C9", "marker": "D", "linestyle": "-."},
    "msahl newton --rotation-update exponential": {"color": "C9", "marker": "*", "linestyle": "--"},
    "exudyn index 3": {"color": "C1", "marker": "o"},
    "exudyn index 2": {"color": "C1", "marker": "s", "linestyle": "--"},
    "exudyn index 2 EP": {"color": "C1", "marker": "v", "linestyle": ":"},
    "mujoco RK4": {"color": "C2", "marker": "^"},
    "drake RK3": {"color": "C4", "marker": "o"},
    "drake RK5": {"color": "C4", "marker": "s"},
    "drake RK3 fixed": {"color": "C4", "marker": "o", "linestyle": ":"},
    "drake RK5 fixed": {"color": "C4", "marker": "s", "linestyle": ":"},
    "msahl preserving": {"color": "C0", "marker": ".", "linestyle": ":"},
    "msahl decaying": {"color": "C9", "marker": ".", "linestyle": ":"},
}
MARKERS = "ov^sDP*X"
"""Of the degrees of a scheme of ours."""


def draw_all(rows: list[Measured], folder: Path) -> None:
    """``bodies.png`` and ``precision.png``."""
    _draw_bodies(rows, folder / "bodies.png")
    _draw_precision(rows, folder / "precision.png")


def _draw_bodies(rows: list[Measured], path: Path) -> None:
    figure, axes = plt.subplots(figsize=(7.5, 5.0), layout="constrained")
    for code in CODES:
        mine = [r for r in rows if r.code == code and r.h == 0.01 and r.samples]
        chains = [r for r in mine if not r.problem.name.startswith("top")]
        points = sorted((r.problem.bodies, 1e6 * r.per_step_and_body) for r in chains)
        if points:
            axes.loglog(*zip(*points, strict=True), label=code, markersize=5, **STYLES[code])
    axes.set_xlabel("bodies (pendulums, then chains)")
    axes.set_ylabel("time per step and body [µs]")
    axes.set_title("Cost of a step, h = 0.01 s")
    axes.grid(True, which="major", alpha=0.4)
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _draw_precision(rows: list[Measured], path: Path) -> None:
    names = list(
        dict.fromkeys(r.problem.name for r in rows if not r.problem.name.startswith("chain"))
    )
    figure, grid = plt.subplots(2, 2, figsize=(9.5, 7.0), layout="constrained", squeeze=False)
    for axes, name in zip(grid.flat, names, strict=False):
        for code in CODES:
            mine = [r for r in rows if r.code == code and r.problem.name == name and r.errors]
            points = [
                (r.per_step * r.problem.span / r.h, r.errors.position) for r in mine if r.errors
            ]
            if points:
                axes.loglog(*zip(*points, strict=True), label=code, markersize=5, **STYLES[code])
        axes.set_title(name)
        axes.grid(True, which="major", alpha=0.4)
    for axes in grid[-1]:
        axes.set_xlabel("loop for 10 s of motion [s]")
    for axes in grid[:, 0]:
        axes.set_ylabel("largest position error [m]")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=8, loc="outside lower center", ncols=4)
    figure.suptitle("Error against time, h = 0.01, 0.004, 0.002 s (left to right)")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def draw_curves(name: str, curves: list[Curve], path: Path) -> None:
    """Error against loop seconds of every code on one problem."""
    figure, axes = plt.subplots(figsize=(9.0, 5.5), layout="constrained")
    for curve in curves:
        points = [(p.seconds, p.error) for p in curve.sorted() if p.samples]
        if points:
            code = curve.code.name
            axes.loglog(*zip(*points, strict=True), label=code, markersize=5, **_style(code))
    for target in TARGETS:
        axes.axhline(target, color="0.5", linewidth=0.8)
    axes.set_xlabel("loop for 10 s of motion [s]")
    axes.set_ylabel("largest position error [m]")
    axes.set_title(name)
    axes.grid(True, which="major", alpha=0.4)
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _style(code: str) -> dict[str, Any]:
    """That of the list; of our schemes of a degree, a hue by family and a marker by degree."""
    if code in STYLES:
        return STYLES[code]
    word = code.removeprefix("msahl ")
    family = word.rstrip("0123456789")
    degree = word.removeprefix(family)
    hue = {"gauss": "C0", "radau": "C9"}.get(family, "C3")
    return {"color": hue, "marker": MARKERS[int(degree or 1) - 1], "linewidth": 1.8}
