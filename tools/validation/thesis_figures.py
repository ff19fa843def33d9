"""Draw the counterparts of the thesis's figures."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msahl.post.draw import looks, plain, style
from msahl.post.graph_data import peaks, thinned
from tools.validation.small_pictures import bounded, save_small
from tools.validation.thesis_printed import RUNS, STEPS
from tools.validation.thesis_runs import FIGURES, Measured, run_deck

TINY = 1e-18
"""Smaller values are drawn at the lower edge of the axes."""


def case_figure(deck: str, title: str, runs: Sequence[tuple[str, Measured]]) -> Path:
    """Draw path, energy balance error and virtual work of a deck's runs."""
    with style():
        figure = Figure(figsize=(10.5, 1.0 + 2.2 * len(runs)))
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(len(runs), 3, width_ratios=(1.0, 1.0, 1.0))
        top = deck.startswith("top")
        _path(figure.add_subplot(grid[:, 0]), runs[0][1], "xy" if top else "xz", runs[0][0])
        for row, (name, measured) in enumerate(runs):
            _energy(figure.add_subplot(grid[row, 1]), measured, name)
            work = figure.add_subplot(grid[row, 2])
            _work(work, measured, name)
        handles, labels = work.get_legend_handles_labels()
        if len(labels) > 1:
            figure.legend(handles, labels, loc="outside lower right", ncols=len(labels), fontsize=9)
        figure.suptitle(title)
        return save_small(figure, FIGURES / f"{deck}.png")


def _path(axes: Axes, measured: Measured, plane: str, name: str) -> None:
    states, model = measured.run.states, measured.run.model
    i, j = plane[0], plane[1]
    for body, look in zip(model.bodies, looks(), strict=False):
        x, y = (states[f"{body.name}.{c}"].to_numpy() for c in (i, j))
        step = max(1, len(x) // 6000)
        axes.plot(x[::step], y[::step], label=plain(body.name), **(look | {"linewidth": 0.8}))
    axes.set(xlabel=f"{i} [m]", ylabel=f"{j} [m]", title=f"path, {name}")
    axes.set_aspect("equal", adjustable="datalim")
    if plane == "xz":
        axes.invert_yaxis()


def _energy(axes: Axes, measured: Measured, name: str) -> None:
    energy = measured.metrics.energy
    error = np.abs(energy.error[:, None]) / energy.largest_kinetic
    time, error = peaks(energy.time, error)
    axes.plot(time, np.maximum(error, TINY), linewidth=0.7)
    axes.set(yscale="log", title=name, ylabel="|energy error| / max KE [-]", xlabel="time [s]")
    bounded(axes, error, 1e-18)


def _work(axes: Axes, measured: Measured, name: str) -> None:
    time = measured.run.time[1:]
    joints = measured.run.model.joints
    for joint, work, look in zip(joints, measured.work.T, looks(), strict=False):
        axes.plot(*thinned(time, work), label=joint.name, **(look | {"linewidth": 0.7}))
    axes.set(title=name, ylabel="virtual work per step [J]", xlabel="time [s]")


def trend_figure(name: str, decks: Sequence[str], title: str, seconds: np.ndarray) -> Path:
    """Draw time, energy error and work against the step size; ``seconds`` (decks, steps)."""
    with style():
        figure = Figure(figsize=(10.5, 3.9))
        FigureCanvasAgg(figure)
        cost, energy, work = figure.subplots(1, 3)
        for deck, taken, look in zip(decks, seconds, looks(), strict=False):
            runs = [run_deck(deck, dt, 10.0) for dt in STEPS]
            label = deck.replace("_", " ")
            marks = {"marker": "o", "markersize": 3, **look}
            cost.loglog(STEPS, taken, label=label, **marks)
            spreads = [m.metrics.energy.error_over_kinetic for m in runs]
            energy.loglog(STEPS, [s.rms if s else np.nan for s in spreads], **marks)
            mean = [float(np.abs(m.work.mean(axis=0)).max()) for m in runs]
            work.loglog(STEPS, mean, **marks)
            rms = [float(np.sqrt((m.work**2).mean(axis=0)).max()) for m in runs]
            work.loglog(STEPS, rms, **(marks | {"linestyle": ":"}))
            _printed(energy, work, deck, str(look["color"]))
        cost.set(title="time loop for 10 s", ylabel="time loop [s]")
        energy.set(title="energy error, RMS", ylabel="energy error / max KE [-]")
        work.set(title="|mean| (dotted: RMS)", ylabel="virtual work per step [J]")
        for axes in (cost, energy, work):
            axes.set_xlabel("step size [s]")
        low, high = energy.get_ylim()
        energy.set_ylim(min(low, 1e-16), max(high, 1e-11))
        energy.plot([], [], "k*", label="printed (energy: over E(1))")
        handles, labels = cost.get_legend_handles_labels()
        stars, star_labels = energy.get_legend_handles_labels()
        figure.legend(
            handles + stars, labels + star_labels, loc="outside lower center", ncols=4, fontsize=9
        )
        figure.suptitle(title)
        return save_small(figure, FIGURES / f"trend_{name}.png")


def _printed(energy: Axes, work: Axes, deck: str, colour: str) -> None:
    for run in RUNS:
        if run.deck != deck or run.t_final != 10.0:
            continue
        if run.energy is not None:
            energy.loglog(run.dt, run.energy, "*", color=colour, markersize=9)
        work.loglog(run.dt, max(map(abs, run.work)), "*", color=colour, markersize=9)


def chaos_figure(pairs: Sequence[tuple[str, np.ndarray, np.ndarray, np.ndarray]]) -> Path:
    """Draw the distance of the second bobs of each pair: name, time, distance, fitted growth."""
    with style():
        figure = Figure(figsize=(8.0, 3.8))
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        for (name, time, apart, fitted), look in zip(pairs, looks(), strict=False):
            axes.semilogy(*thinned(time, np.maximum(apart, 1e-6)), label=name, **look)
            axes.semilogy(time, fitted, color="#444444", linestyle="--", linewidth=1.0)
        axes.set(xlabel="time [s]", ylabel="distance of the second bobs [m]", ylim=(1e-5, 40.0))
        axes.set_title("two motions that start 0.01 degrees apart (dashed: fitted growth)")
        figure.legend(loc="outside right upper")
        return save_small(figure, FIGURES / "chaos.png")
