"""The pictures of a study: the error that the target is of against run time, and all errors."""

from collections.abc import Iterator
from math import ceil
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msahl.post.draw import looks, plain
from msahl.study.errors import BY_KEY, MEASURES, Measure
from msahl.study.order import Fit
from msahl.study.plan import Point
from msahl.study.study import Study

MARKERS = "osD^vP*X<>p"
COLUMNS = 3
DECADES = 3
"""Least decades an axis of errors shows: a flat line of round-off should look flat."""
TOP, BOTTOM = 1e2, 1e-13
"""Errors [SI] beyond which runs are not shown in the first picture, if there are others."""


def pictures(study: Study) -> Iterator[tuple[str, str, Figure]]:
    """Name, caption and figure of every picture; none if no run has an error to show."""
    if not any(_has_values(study, s, m.key) for s in study.schemes for m in MEASURES):
        return
    if any(_has_values(study, s, study.plan.measure) for s in study.schemes):
        yield "error-time", _caption(study), _first(study)
    yield (
        "all-errors-time",
        "Largest errors of each run against the seconds it took",
        _grid(study, True),
    )
    yield "error-step", "Largest errors of each run against its step", _grid(study, False)


def _caption(study: Study) -> str:
    return f"Largest {BY_KEY[study.plan.measure].name} error of each run against its loop's seconds"


def _looks(study: Study) -> dict[str, dict[str, Any]]:
    """Colour, line and marker of each scheme, the same in all pictures."""
    return {
        scheme: look | {"marker": MARKERS[i % len(MARKERS)]}
        for i, (scheme, look) in enumerate(zip(study.schemes, looks(), strict=False))
    }


def _first(study: Study) -> Figure:
    """Error against seconds: a curve of each scheme, the target, the recommended run, the deck's
    own.
    """
    key = study.plan.measure
    measure = BY_KEY[key]
    figure = Figure(figsize=(9.0, 5.6))
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", xlabel="seconds of the loop")
    axes.set_ylabel(f"largest {measure.name} error [{measure.unit}]")
    axes.set_title(plain(study.plan.model.simulation.title.strip() or "study"))
    _mark_runs(study, axes)
    for scheme, look in _looks(study).items():
        points, errors = study.series(scheme, key)
        shown = [(p, e) for p, e in zip(points, errors, strict=True) if 0.0 < e < TOP]
        if shown:
            seconds = [p.trial.seconds for p, _ in shown]
            axes.plot(seconds, [e for _, e in shown], markersize=4, label=scheme, **look)
            _estimates(axes, [p for p, _ in shown], look, key)
    low, high = axes.get_ylim()
    if high > 10.0 * BOTTOM > 10.0 * low:
        axes.set_ylim(bottom=BOTTOM)
    _widen(axes)
    _target(study, axes)
    figure.legend(loc="outside right upper")
    return figure


def _estimates(axes: Axes, points: list[Point], look: dict[str, Any], key: str) -> None:
    """The errors that runs report themselves, dashed."""
    known = [(p.trial.seconds, p.estimate) for p in points if p.estimate]
    if known and key == "position":
        name = f"{points[0].trial.scheme}, estimated"
        dashed = look | {"linestyle": (0, (4, 3)), "marker": None, "color": "black"}
        axes.plot(*zip(*known, strict=True), label=name, **(dashed | {"zorder": 3}))


def _target(study: Study, axes: Axes) -> None:
    """The line of the target, and the reference's own error where it can be seen."""
    _line(axes, study.plan.target, f"target {study.plan.target:g}")
    low, _ = axes.get_ylim()
    error = study.reference.error
    if study.plan.measure == "position" and error > low:
        _line(axes, error, f"error of the reference {error:.0e}")
        axes.axhspan(low, error, color="#888888", alpha=0.12, linewidth=0.0)
        axes.set_ylim(bottom=low)


def _line(axes: Axes, y: float, words: str) -> None:
    axes.axhline(y, color="#888888", linewidth=1.0, linestyle=":")
    axes.annotate(
        words,
        (1.0, y),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        xytext=(-3, 3),
        ha="right",
        color="#555555",
        fontsize=8,
    )


def _mark_runs(study: Study, axes: Axes) -> None:
    """The recommended run and the deck's own, with their options."""
    for point, name, marker, size, face in (
        (study.fastest, "recommended", "*", 17, "#FFD400"),
        (study.of_deck, "deck's own", "s", 11, "none"),
    ):
        error = point.largest(study.plan.measure) if point and point.trial.completed else None
        if point is None or not error or error >= TOP:
            continue
        case = point.trial.case
        axes.plot(
            [point.trial.seconds],
            [error],
            marker=marker,
            markersize=size,
            markerfacecolor=face,
            markeredgecolor="black",
            linestyle="none",
            zorder=4,
            label=f"{name}:\n{case.scheme}, {'tolerance' if case.chooses else 'dt'} {case.size:g}",
        )


def _grid(study: Study, by_time: bool) -> Figure:
    shown = [m for m in MEASURES if any(_has_values(study, s, m.key) for s in study.schemes)]
    rows = ceil(len(shown) / COLUMNS)
    height = 0.8 + 2.9 * rows
    # A layout that matplotlib finds by itself draws everything twice.
    with matplotlib.rc_context({"figure.constrained_layout.use": False}):
        figure = Figure(figsize=(10.5, height))
    FigureCanvasAgg(figure)
    figure.subplots_adjust(0.08, 1.15 / height, 0.98, 1.0 - 0.75 / height, 0.36, 0.42)
    panels = figure.subplots(rows, COLUMNS, squeeze=False).reshape(-1)
    for axes, measure in zip(panels, shown, strict=False):
        _panel(study, axes, measure, by_time)
        axes.minorticks_off()
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    title = study.plan.model.simulation.title.strip() or "study"
    figure.suptitle(f"{plain(title)}: largest error against {'run time' if by_time else 'step'}")
    named: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        named |= {label: handle for label, handle in zip(labels, handles, strict=True)
                  if label not in named}  # fmt: skip
    figure.legend(named.values(), named.keys(), loc="lower center",
                  ncols=min(len(named), 6))  # fmt: skip
    return figure


def _has_values(study: Study, scheme: str, key: str) -> bool:
    _, errors = study.series(scheme, key)
    return bool(np.any(errors > 0.0))


def _panel(study: Study, axes: Axes, measure: Measure, by_time: bool) -> None:
    axes.set(xscale="log", yscale="log", title=measure.name)
    axes.set_ylabel("relative error" if measure.unit == "1" else f"error [{measure.unit}]")
    axes.set_xlabel("run time [s]" if by_time else "step [s]")
    for scheme, look in _looks(study).items():
        points, errors = study.series(scheme, measure.key)
        if not np.any(errors > 0.0):
            continue
        x = np.array([p.trial.seconds if by_time else p.trial.dt for p in points])
        order = np.argsort(x)
        axes.plot(x[order], errors[order], markersize=4, label=scheme, **look)
        fit = study.fits.get((scheme, measure.key))
        if fit is not None and not by_time and scheme == study.schemes[0]:
            _triangle(axes, fit)
    _widen(axes)
    low, high = axes.get_ylim()
    if measure.key == study.plan.measure and low < study.plan.target < high:
        _line(axes, study.plan.target, "target")


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
