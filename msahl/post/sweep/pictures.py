"""Draw what a sweep found: measures over parameters, maps, scatter matrices, histograms, indices.

Points that failed have no value: they are crosses at the lower edge of a panel, or crossed cells of
a map, and their number is in the title. Points with the verdict FAIL have a red rim.
"""

from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from msahl.post.draw import COLOURS, LINES, folded, plain
from msahl.post.sweep.read import ERROR, Measured, Parameter, SweepRuns
from msahl.post.sweep.statistics import (
    LEVEL,
    Indices,
    Statistics,
    groups,
    independent,
    statistics_of,
)
from msahl.records import record

FAILED = "#D55E00"
"""Colour of failed points and of the verdict FAIL."""
MOST_LINES, MOST_VARIABLES, MOST_MEASURES = 8, 7, 12
"""Most curves of a panel, variables of a scatter matrix, and measures with pictures."""
MOST_LABELS = 12
"""Values of an option up to which each point has its value beside it."""
WIDE = 100.0
"""Ratio of the largest value of a measure to the least from which its scale is logarithmic."""
LEAST_MAP = 3
"""Values that both parameters of a map have at least."""
TITLE_WIDTH = 88


@record(slots=False)
class Picture:
    """A figure with the name of its file, its caption, and whether it has few enough marks to be
    drawn as vectors."""

    name: str
    caption: str
    figure: Figure
    vector: bool = True


def pictures(
    sweep: SweepRuns, measures: Sequence[Measured], found: Sequence[Indices] = ()
) -> Iterator[Picture]:
    """Yield the pictures that suit the plan of a sweep, for each of ``measures``, and of the Sobol
    indices that were ``found``."""
    shown = list(measures[:MOST_MEASURES])
    drawn = [p for p in sweep.varied if p.drawn]
    listed = [p for p in sweep.varied if not p.drawn]
    if found:
        yield _indices(found[:MOST_MEASURES])
    for number, measure in enumerate(shown, start=1):
        if drawn:
            yield _histogram(sweep, measure, number)
        if len(sweep.varied) == 1:
            yield _over_one(sweep, measure, sweep.varied[0], None, number)
        elif len(listed) == 2 and not drawn:
            yield _of_two(sweep, measure, listed, number)
    if len(sweep.varied) > 2 or (len(sweep.varied) > 1 and drawn):
        yield _scatter_matrix(sweep, shown)
    if any(p.name.startswith("--") for p in listed):
        yield from _error_over_time(sweep, listed)


def missing(sweep: SweepRuns, measure: Measured, among: np.ndarray | None = None) -> str:
    """Return in words how many points a picture lacks; empty if none."""
    among = np.ones(sweep.count, dtype=bool) if among is None else among
    failed = int((among & ~sweep.completed).sum())
    without = int((among & sweep.completed & ~np.isfinite(measure.values)).sum())
    rest = sweep.planned - sweep.count
    parts = [f"{failed} failed"] * bool(failed) + [f"{without} without value"] * bool(without)
    parts += [f"{rest} not computed yet"] * bool(rest)
    known = int((among & np.isfinite(measure.values)).sum())
    bad = int((among & sweep.bad & np.isfinite(measure.values)).sum())
    parts += [f"{bad} with the verdict FAIL included"] * bool(bad)
    return f"{known} points" + "".join(f", {part}" for part in parts)


def _figure(size: tuple[float, float], title: str) -> Figure:
    figure = Figure(figsize=size)
    FigureCanvasAgg(figure)
    figure.suptitle(
        plain(folded(title, int(TITLE_WIDTH * size[0] / 8.0))), x=0.01, ha="left", size=11
    )
    return figure


def _over_one(
    sweep: SweepRuns, measure: Measured, over: Parameter, by: Parameter | None, number: int
) -> Picture:
    """Draw a measure over one parameter, a curve for each value of another."""
    figure = _figure((8.0, 4.6), f"{measure.name} over {over.name}\n({missing(sweep, measure)})")
    axes = figure.add_subplot()
    x, ticks = _abscissa(over)
    groups = by.levels if by else [""]
    for k, level in enumerate(groups[:MOST_LINES]):
        chosen = np.array([not by or cell == level for cell in (by.cells if by else over.cells)])
        order = np.flatnonzero(chosen)[np.argsort(x[chosen], kind="stable")]
        joined = over.values is not None and len(set(x[order])) == len(order) and not over.drawn
        axes.plot(
            x[order], measure.values[order],
            ls=LINES[k // len(COLOURS) % len(LINES)] if joined else "",
            marker="o", ms=4 if len(order) < 300 else 2,
            color=COLOURS[k % len(COLOURS)], label=plain(by.short[level] if by else level),
        )  # fmt: skip
    _mark(axes, sweep, measure, x)
    if ticks:
        axes.set_xticks(range(len(ticks)), [plain(folded(tick, 14)) for tick in ticks])
    elif _is_geometric(np.unique(x)):
        axes.set_xscale("log")
    known = measure.values[np.isfinite(measure.values)]
    if len(known) and known.min() > 0.0 and known.max() > WIDE * known.min():
        axes.set_yscale("log")
    axes.set(xlabel=plain(over.name), ylabel=plain(folded(measure.label, 40)))
    if by:
        more = f" (first {MOST_LINES} of {len(groups)})" if len(groups) > MOST_LINES else ""
        axes.legend(title=plain(by.name + more), loc="center left", bbox_to_anchor=(1.0, 0.5))
    caption = f"{measure.name} over {over.name}" + (f", by {by.name}" if by else "")
    return Picture(f"over-{number}", caption, figure, sweep.count < 2000)


def _abscissa(over: Parameter) -> tuple[np.ndarray, list[str]]:
    """Return the places of points along the axis, and labels of the places 0, 1, ... for words."""
    if over.values is not None:
        return over.values, []
    levels = over.levels
    places = np.array([float(levels.index(cell)) for cell in over.cells])
    return places, [over.short[level] for level in levels]


def _is_geometric(values: np.ndarray) -> bool:
    """Return whether values are positive and spread over more than a decade, evenly in logarithms
    rather than in themselves."""
    if len(values) < 3 or values[0] <= 0.0 or values[-1] < 10.0 * values[0]:
        return False
    steps, ratios = np.diff(values), np.diff(np.log(values))
    return bool(np.ptp(ratios) / ratios.mean() < np.ptp(steps) / steps.mean())


def _mark(axes: Axes, sweep: SweepRuns, measure: Measured, x: np.ndarray) -> None:
    """Mark failed points at the lower edge, and give those with the verdict FAIL a red rim."""
    missing = ~np.isfinite(measure.values)
    if missing.any():
        axes.plot(
            x[missing], np.zeros(int(missing.sum())), "x", color=FAILED, ms=6, clip_on=False,
            transform=axes.get_xaxis_transform(), label="_failed", zorder=10,
        )  # fmt: skip
    bad = sweep.bad & ~missing
    if bad.any():
        axes.plot(
            x[bad], measure.values[bad], "o", mfc="none", mec=FAILED, ms=8, label="_bad", zorder=9
        )


def _of_two(sweep: SweepRuns, measure: Measured, both: Sequence[Parameter], number: int) -> Picture:
    """Draw a measure over two parameters: a map if they form a grid of numbers, else curves."""
    first, second = both
    table = _grid(first, second, measure)
    numbers = all(parameter.values is not None for parameter in both)
    if table is not None and numbers and min(table.shape) >= LEAST_MAP:
        return _map(sweep, measure, both, table, number)
    over, by = (first, second) if len(first.levels) >= len(second.levels) else (second, first)
    if over.values is None and by.values is not None:
        over, by = by, over
    return _over_one(sweep, measure, over, by, number)


def _grid(first: Parameter, second: Parameter, measure: Measured) -> np.ndarray | None:
    """Return the measure at all pairs of values (second, first); None if pairs lack or repeat."""
    columns, rows = first.levels, second.levels
    if len(columns) * len(rows) != len(first.cells):
        return None
    places = [
        (rows.index(b), columns.index(a)) for a, b in zip(first.cells, second.cells, strict=True)
    ]
    if len(set(places)) != len(places):
        return None
    table = np.full((len(rows), len(columns)), np.nan)
    for place, value in zip(places, measure.values, strict=True):
        table[place] = value
    return table


def _map(
    sweep: SweepRuns, measure: Measured, both: Sequence[Parameter], table: np.ndarray, number: int
) -> Picture:
    """Draw a map of a measure over two parameters; cells of failed points are crossed."""
    first, second = both
    title = f"{measure.name} over {first.name} and {second.name}\n({missing(sweep, measure)})"
    figure = _figure((8.0, 5.6), title)
    axes = figure.add_subplot()
    axes.grid(visible=False)
    x, y = (_sorted_values(p) for p in both)
    mesh = axes.pcolormesh(_edges(x), _edges(y), table, cmap="viridis", rasterized=True)
    without_value = np.argwhere(~np.isfinite(table))
    axes.plot(x[without_value[:, 1]], y[without_value[:, 0]], "x", color=FAILED, ms=6)
    for scale, values in ((axes.set_xscale, x), (axes.set_yscale, y)):
        if _is_geometric(values):
            scale("log")
    axes.set(xlabel=plain(first.name), ylabel=plain(second.name))
    figure.colorbar(mesh, ax=axes, label=plain(folded(measure.label, 40)))
    caption = f"{measure.name} over {first.name} and {second.name}"
    return Picture(f"map-{number}", caption, figure, vector=False)


def _sorted_values(parameter: Parameter) -> np.ndarray:
    assert parameter.values is not None
    numbers = dict(zip(parameter.cells, parameter.values, strict=True))
    return np.array([numbers[level] for level in parameter.levels])


def _edges(values: np.ndarray) -> np.ndarray:
    """Return the edges (n + 1,) of cells around sorted values (n,), halfway between them."""
    if _is_geometric(values):
        return np.asarray(np.exp(_edges_of(np.log(values))))
    return _edges_of(values)


def _edges_of(values: np.ndarray) -> np.ndarray:
    middles = 0.5 * (values[1:] + values[:-1])
    ends = (2.0 * values[0] - middles[0], 2.0 * values[-1] - middles[-1])
    return np.concatenate([ends[:1], middles, ends[1:]])


def _histogram(sweep: SweepRuns, measure: Measured, number: int) -> Picture:
    """Draw the distribution of a measure, with mean, standard deviation and confidence interval; of
    several groups of points the outlines."""
    found = groups(sweep)
    title = f"Distribution of {measure.name}\n({missing(sweep, measure, independent(sweep))})"
    figure = _figure((8.0, 4.4), title)
    axes = figure.add_subplot()
    known = np.isfinite(measure.values)
    values = measure.values[known & independent(sweep)]
    edges = np.histogram_bin_edges(values, _bins(values)) if len(values) else np.array([0.0, 1.0])
    if len(found) == 1:
        axes.set_axisbelow(True)
        axes.hist(values, bins=list(edges), color=COLOURS[5], edgecolor="white", lw=0.4)
        _draw_statistics(axes, statistics_of(sweep, measure, found[0][1]))
    for k, (words, among) in enumerate(found[:MOST_LINES] if len(found) > 1 else []):
        label = plain(folded(words, 28))
        own = measure.values[known & among]
        axes.hist(
            own, bins=list(edges), histtype="step", color=COLOURS[k % len(COLOURS)], label=label
        )
    if len(found) > 1:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9)
    axes.set(xlabel=plain(folded(measure.label, 70)), ylabel="points")
    return Picture(f"histogram-{number}", f"Distribution of {measure.name}", figure)


def _bins(values: np.ndarray) -> int:
    """Return the number of bins: the square root of the number of values, 5 to 60."""
    return int(np.clip(np.sqrt(len(values)), 5, 60))


def _draw_statistics(axes: Axes, found: Statistics) -> None:
    """Draw mean, standard deviation and confidence interval of the mean."""
    if found.deviation is None or found.interval is None:
        return
    low, high = found.interval
    axes.axvspan(
        found.mean - found.deviation, found.mean + found.deviation, color="#dddddd", alpha=0.5,
        zorder=0, label=f"standard deviation {found.deviation:.4g}",
    )  # fmt: skip
    axes.axvspan(
        low, high, color=FAILED, alpha=0.35, lw=0, label=f"{LEVEL:.0%} interval of the mean"
    )
    axes.axvline(found.mean, color=COLOURS[0], lw=1.5, label=f"mean {found.mean:.6g}")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9)


def _scatter_matrix(sweep: SweepRuns, measures: Sequence[Measured]) -> Picture:
    """Draw every pair of parameters and measures, with histograms on the diagonal."""
    columns = [(p.name, *_abscissa(p)) for p in sweep.varied][: MOST_VARIABLES - 1]
    left = MOST_VARIABLES - len(columns)
    columns += [(m.label, m.values, []) for m in measures[:left]]
    n, k = len(columns), len(sweep.varied)
    without_value = (
        ~np.isfinite(np.array([m.values for m in measures])).all(axis=0) if measures else None
    )
    failed = int((~sweep.completed).sum())
    note = f"{sweep.count} points" + (f", {failed} of them failed (crosses)" if failed else "")
    size = max(6.0, 1.7 * n)
    figure = _figure((size, size), f"Parameters and measures in pairs\n({note})")
    grid = figure.subplots(n, n, squeeze=False, sharex="col")
    for i, j in np.ndindex(n, n):
        axes = cast(Axes, grid[i, j])
        x, y = columns[j][1], columns[i][1]
        axes.tick_params(labelsize=7)
        if i == j:
            axes.hist(x[np.isfinite(x)], bins=_bins(x), color=COLOURS[5])
            axes.set_yticks([])
        else:
            axes.plot(x, y, ".", ms=3 if sweep.count < 1000 else 1.5, color=COLOURS[0], mew=0)
            if without_value is not None and i < k and j < k:
                axes.plot(x[without_value], y[without_value], "x", ms=4, color=FAILED, mew=0.8)
        if j:
            axes.set_yticklabels([])
        if i == n - 1:
            axes.set_xlabel(plain(folded(columns[j][0], 16)), fontsize=8)
        if j == 0:
            axes.set_ylabel(plain(folded(columns[i][0], 16)), fontsize=8)
    return Picture("scatter", "Parameters and measures in pairs", figure, vector=False)


def _indices(found: Sequence[Indices]) -> Picture:
    """Draw first and total Sobol indices with their confidence intervals."""
    omitted = [
        f"{i.measure.name}: {i.planned - i.rows} of {i.planned} rows"
        for i in found
        if i.rows < i.planned
    ]
    note = f"\n(omitted because a point has no value: {'; '.join(omitted)})" if omitted else ""
    title = f"Sobol indices, with {LEVEL:.0%} confidence intervals{note}"
    figure = _figure((8.0, 1.0 + 2.6 * len(found)), title)
    for axes, indices in zip(
        figure.subplots(len(found), 1, squeeze=False)[:, 0], found, strict=True
    ):
        places = np.arange(len(indices.parameters))
        axes.set_axisbelow(True)
        for shift, name, values, ends, colour in (
            (-0.2, "first order", indices.first, indices.first_interval, COLOURS[0]),
            (0.2, "total", indices.total, indices.total_interval, COLOURS[4]),
        ):
            bars = np.abs(ends.T - values)
            axes.bar(places + shift, values, 0.38, color=colour, label=name)
            axes.errorbar(places + shift, values, bars, fmt="none", ecolor="#444444", capsize=3)
        axes.set_xticks(places, [plain(folded(name, 20)) for name in indices.parameters])
        axes.set_ylabel("part of the variance [-]")
        axes.set_title(plain(indices.measure.name))
        axes.axhline(0.0, color="#666666", lw=0.8)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return Picture("sobol", "First and total Sobol indices", figure)


def _error_over_time(sweep: SweepRuns, listed: Sequence[Parameter]) -> Iterator[Picture]:
    """Draw the estimated error over the seconds of the time loop, a curve for each combination of
    options but the one that has most values; nothing if no error was estimated."""
    errors = next((m for m in sweep.measures if m.name == ERROR), None)
    options = [p for p in listed if p.name.startswith("--")]
    along = max(options, key=lambda p: (p.values is not None, len(p.levels)))
    if errors is None:
        return
    known = np.isfinite(errors.values) & (errors.values > 0.0) & np.isfinite(sweep.seconds)
    if not known.any():
        return
    others = [p for p in listed if p is not along]
    keys = list(zip(*(p.cells for p in others), strict=True)) if others else [()] * sweep.count
    figure = _figure((8.0, 5.0), f"Estimated error over time\n({missing(sweep, errors)})")
    axes = figure.add_subplot()
    groups = list(dict.fromkeys(keys))
    for k, key in enumerate(groups[: len(COLOURS) * len(LINES)]):
        chosen = known & np.array([each == key for each in keys])
        among = sweep.seconds if along.values is None else along.values
        order = np.flatnonzero(chosen)[np.argsort(among[chosen], kind="stable")]
        axes.plot(
            sweep.seconds[order], errors.values[order], marker="o", ms=4,
            color=COLOURS[k % len(COLOURS)], ls=LINES[k // len(COLOURS) % len(LINES)],
            label=plain(", ".join(f"{p.name} {c}" for p, c in zip(others, key, strict=True))),
        )  # fmt: skip
        for i in order if len(order) <= MOST_LABELS else []:
            place = (float(sweep.seconds[i]), float(errors.values[i]))
            axes.annotate(
                plain(along.cells[i]), place, xytext=(4, 4), textcoords="offset points", fontsize=7
            )
    axes.set(xscale="log", yscale="log", ylabel="estimated error of position [m]")
    axes.set_xlabel("time of the loop [s]")
    if others:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=9)
    caption = f"Estimated error over time; labels: {along.name}"
    yield Picture("error-over-time", caption, figure)
