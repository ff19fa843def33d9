"""Small multiples of error against seconds: what their pictures have in common."""

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt


def finish_axes(axes: Any, title: str, limits: tuple[float, float], target: float) -> None:
    """Set title and limits of one picture, and a line at the ``target`` of the error."""
    axes.axhline(target, color="0.5", linewidth=0.8)
    axes.set_title(title, fontsize=9)
    axes.set_ylim(*limits)
    axes.tick_params(labelsize=7)
    axes.grid(True, which="major", alpha=0.3)


def save(figure: Any, hues: dict[str, str], labels: tuple[str, str], path: Path) -> None:
    """Write a figure with a legend of the programs' ``hues`` and the ``labels`` of x and y."""
    handles = [mpl.lines.Line2D([], [], color=hue, label=name) for name, hue in hues.items()]
    figure.legend(handles=handles, fontsize=8, loc="outside upper center", ncols=len(hues))
    figure.supxlabel(labels[0], fontsize=9)
    figure.supylabel(labels[1], fontsize=9)
    figure.savefig(path, dpi=90)
    plt.close(figure)
