"""Draw a study: the studied error against run time, and all errors against run time and step."""

from collections.abc import Iterator
from math import ceil
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msahl.post.draw import looks, plain
from msahl.study.errors import METRIC_OF, METRICS, ErrorMetric
from msahl.study.order import Fit
from msahl.study.plan import StudyRun
from msahl.study.study import Study

MARKERS = "osD^vP*X<>p"
COLUMNS = 3
DECADES = 3
"""Least number of decades of an axis of errors, so that constant rounding errors look constant."""
TOP, BOTTOM = 1e2, 1e-13
"""Errors [SI] outside of which runs are not shown in the first figure, if there are others."""


def pictures(study: Study) -> Iterator[tuple[str, str, Figure]]:
    """Yield name, caption and figure of every picture; nothing if no run has an error to show."""
    if not any(_has_values(study, s, m.key) for s in study.schemes for m in METRICS):
        return
    if any(_has_values(study, s, study.plan.metric) for s in study.schemes):
        yield "error-time", _caption(study), _first(study)
    yield (
        "all-errors-time",
        "Largest errors of each run against the time of its time loop",
        _grid(study, True),
    )
    yield "error-step", "Largest errors of each run against its step size", _grid(study, False)


def _caption(study: Study) -> str:
    name = METRIC_OF[study.plan.metric].name
    return f"Largest {name} error of each run against the time of its time loop"


def _looks(study: Study) -> dict[str, dict[str, Any]]:
    """Return colour, line and marker of each scheme, the same in all figures."""
    return {
        scheme: look | {"marker": MARKERS[i % len(MARKERS)]}
        for i, (scheme, look) in enumerate(zip(study.schemes, looks(), strict=False))
    }


def _first(study: Study) -> Figure:
    """Draw error against run time: a curve for each scheme, the target, the recommended run and the
    run with the deck's own settings.
    """
    key = study.plan.metric
    metric = METRIC_OF[key]
    figure = Figure(figsize=(9.0, 5.6))
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log", xlabel="time of the time loop [s]")
    axes.set_ylabel(f"largest {metric.name} error [{_unit(metric)}]")
    axes.set_title(plain(study.plan.model.simulation.title.strip() or "study"))
    _mark_runs(study, axes)
    for scheme, look in _looks(study).items():
        runs, errors = study.series(scheme, key)
        shown = [(r, e) for r, e in zip(runs, errors, strict=True) if 0.0 < e < TOP]
        if shown:
            seconds = [r.trial.seconds for r, _ in shown]
            axes.plot(seconds, [e for _, e in shown], markersize=4, label=scheme, **look)
            _estimates(axes, [r for r, _ in shown], look, key)
    low, high = axes.get_ylim()
    if high > 10.0 * BOTTOM > 10.0 * low:
        axes.set_ylim(bottom=BOTTOM)
    _widen(axes)
    _target(study, axes)
    figure.legend(loc="outside right upper")
    return figure


def _estimates(axes: Axes, runs: list[StudyRun], look: dict[str, Any], key: str) -> None:
    """Draw the errors that the runs estimate themselves, dashed."""
    known = [(r.trial.seconds, r.estimate) for r in runs if r.estimate]
    if known and key == "position":
        name = f"{runs[0].trial.scheme}, estimated"
        dashed = look | {"linestyle": (0, (4, 3)), "marker": None, "color": "black"}
        axes.plot(*zip(*known, strict=True), label=name, **(dashed | {"zorder": 3}))


def _target(study: Study, axes: Axes) -> None:
    """Draw the target, and the error of the reference if it is within the axes."""
    metric = METRIC_OF[study.plan.metric]
    unit = "" if metric.unit == "1" else f" {metric.unit}"
    _line(axes, study.plan.target, f"target {study.plan.target:g}{unit}")
    low, _ = axes.get_ylim()
    error = study.reference.error
    if study.plan.metric == "position" and error > low:
        _line(axes, error, f"error of the reference {error:.0e} m")
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
        annotation_clip=True,  # words far outside would leave the axes no space
    )


def _mark_runs(study: Study, axes: Axes) -> None:
    """Mark the recommended run and the one with the deck's own settings."""
    for run, name, marker, size, face in (
        (study.fastest, "recommended", "*", 17, "#FFD400"),
        (study.deck_run, "deck's settings", "s", 11, "none"),
    ):
        error = run.largest(study.plan.metric) if run and run.trial.completed else None
        if run is None or not error or error >= TOP:
            continue
        case = run.trial.case
        options = f"tolerance {case.size:g} m" if case.chooses_steps else f"dt {case.size:g} s"
        axes.plot(
            [run.trial.seconds],
            [error],
            marker=marker,
            markersize=size,
            markerfacecolor=face,
            markeredgecolor="black",
            linestyle="none",
            zorder=4,
            label=f"{name}:\n{case.scheme}, {options}",
        )


def _grid(study: Study, by_time: bool) -> Figure:
    shown = [m for m in METRICS if any(_has_values(study, s, m.key) for s in study.schemes)]
    rows = ceil(len(shown) / COLUMNS)
    height = 0.8 + 2.9 * rows
    # A layout that matplotlib finds by itself draws everything twice.
    with matplotlib.rc_context({"figure.constrained_layout.use": False}):
        figure = Figure(figsize=(10.5, height))
    FigureCanvasAgg(figure)
    figure.subplots_adjust(0.08, 1.15 / height, 0.98, 1.0 - 0.75 / height, 0.36, 0.42)
    panels = figure.subplots(rows, COLUMNS, squeeze=False).reshape(-1)
    for axes, metric in zip(panels, shown, strict=False):
        _panel(study, axes, metric, by_time)
        axes.minorticks_off()
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    title = study.plan.model.simulation.title.strip() or "study"
    abscissa = "time of the time loop" if by_time else "step size"
    figure.suptitle(f"{plain(title)}: largest errors against {abscissa}")
    named: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        named = dict(zip(labels, handles, strict=True)) | named
    order = [scheme for scheme in study.schemes if scheme in named]
    handles = [named[scheme] for scheme in order]
    figure.legend(handles, order, loc="lower center", ncols=min(len(order), 6))
    return figure


def _has_values(study: Study, scheme: str, key: str) -> bool:
    _, errors = study.series(scheme, key)
    return bool(np.any(errors > 0.0))


def _unit(metric: ErrorMetric) -> str:
    return "-" if metric.unit == "1" else metric.unit


def _panel(study: Study, axes: Axes, metric: ErrorMetric, by_time: bool) -> None:
    axes.set(xscale="log", yscale="log", title=metric.name)
    axes.set_ylabel(f"largest error [{_unit(metric)}]")
    axes.set_xlabel("time loop [s]" if by_time else "step size [s]")
    for scheme, look in _looks(study).items():
        runs, errors = study.series(scheme, metric.key)
        if not np.any(errors > 0.0):
            continue
        x = np.array([r.trial.seconds if by_time else r.trial.dt for r in runs])
        order = np.argsort(x)
        axes.plot(x[order], errors[order], markersize=4, label=scheme, **look)
        fit = study.fits.get((scheme, metric.key))
        if fit is not None and not by_time and scheme == study.schemes[0]:
            _triangle(axes, fit)
    _widen(axes)
    low, high = axes.get_ylim()
    if metric.key == study.plan.metric and low < study.plan.target < high:
        _line(axes, study.plan.target, "target")


def _triangle(axes: Axes, fit: Fit) -> None:
    """Draw the fitted order as the slope of a triangle below the curve."""
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
