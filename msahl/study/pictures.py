"""The pictures of a study: each error against the step, and against run time."""

from collections.abc import Iterator
from math import ceil

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msahl.post.draw import looks, plain
from msahl.study.errors import MEASURES, Measure
from msahl.study.order import Fit
from msahl.study.study import Study

MARKERS = "osD^vP*X"
COLUMNS = 3
DECADES = 3
"""Least decades an axis of errors shows: a flat line of round-off should look flat."""


def pictures(study: Study) -> Iterator[tuple[str, str, Figure]]:
    """Name, caption and figure of every picture; none if no run has an error to show."""
    if not any(_has_values(study, s, m.key) for s in study.schemes for m in MEASURES):
        return
    yield "error-time", "Largest error of each run against the seconds it took", _grid(study, True)
    yield "error-step", "Largest error of each run against its step", _grid(study, False)


def _grid(study: Study, by_time: bool) -> Figure:
    shown = [m for m in MEASURES if any(_has_values(study, s, m.key) for s in study.schemes)]
    rows = ceil(len(shown) / COLUMNS)
    figure = Figure(figsize=(10.5, 0.8 + 2.9 * rows))
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, COLUMNS, squeeze=False).reshape(-1)
    for axes, measure in zip(panels, shown, strict=False):
        _panel(study, axes, measure, by_time)
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    title = study.plan.model.simulation.title.strip() or "study"
    figure.suptitle(f"{plain(title)}: largest error against {'run time' if by_time else 'step'}")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 5))
    return figure


def _has_values(study: Study, scheme: str, key: str) -> bool:
    _, errors = study.series(scheme, key)
    return bool(np.any(errors > 0.0))


def _panel(study: Study, axes: Axes, measure: Measure, by_time: bool) -> None:
    axes.set(xscale="log", yscale="log", title=measure.name)
    axes.set_ylabel("relative error" if measure.unit == "1" else f"error [{measure.unit}]")
    axes.set_xlabel("run time [s]" if by_time else "step [s]")
    for scheme, look, marker in zip(study.schemes, looks(), MARKERS, strict=False):
        points, errors = study.series(scheme, measure.key)
        if not np.any(errors > 0.0):
            continue
        x = np.array([p.trial.seconds if by_time else p.trial.dt for p in points])
        order = np.argsort(x)
        axes.plot(x[order], errors[order], marker=marker, markersize=4, label=scheme, **look)
        fit = study.fits.get((scheme, measure.key))
        if fit is not None and not by_time and scheme == study.schemes[0]:
            _triangle(axes, fit)
    _widen(axes)
    low, high = axes.get_ylim()
    if measure.key == study.plan.measure and low < study.plan.target < high:
        axes.axhline(study.plan.target, color="#888888", linewidth=1.0, linestyle=":")
        axes.annotate(
            "target",
            (1.0, study.plan.target),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            xytext=(-3, 3),
            ha="right",
            color="#555555",
            fontsize=8,
        )


def _triangle(axes: Axes, fit: Fit) -> None:
    """The fitted order as a slope, below the line."""
    middle = np.sqrt(fit.coarsest * fit.finest)
    wide = min(np.sqrt(fit.coarsest / fit.finest), 4.0) ** 0.5
    left, right = middle / wide, middle * wide
    low, high = 0.25 * fit.error(left), 0.25 * fit.error(right)
    axes.plot([left, right, right, left], [low, low, high, low], color="#666666", linewidth=0.9)
    axes.annotate(
        f"{fit.order:.2f}",
        (right, np.sqrt(low * high)),
        textcoords="offset points",
        xytext=(4, 0),
        va="center",
        color="#444444",
        fontsize=9,
    )


def _widen(axes: Axes) -> None:
    low, high = axes.get_ylim()
    short = 10.0**DECADES / (high / low)
    if short > 1.0:
        axes.set_ylim(low / short**0.5, high * short**0.5)
