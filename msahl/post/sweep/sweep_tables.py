"""Make tables of a sweep: outcomes, statistics, extremes, Sobol indices, failures, best point."""

from collections.abc import Sequence

import numpy as np

from msahl.post.sweep.read import Measured, SweepRuns
from msahl.post.sweep.statistics import (
    LEVEL,
    QUANTILES,
    Indices,
    groups,
    has_indices,
    indices_of,
    statistics_of,
)
from msahl.post.table import Cell, Column, Table
from msahl.printable import shown_path
from msahl.results.read import ResultError

MOST_FAILURES = 20
"""Failed points that a table lists."""
MINIMUM, MAXIMUM = "min", "max"
NUMBER = ".6g"


def outcome(sweep: SweepRuns) -> str:
    """Say in a sentence how many points completed, failed, and have the verdict FAIL."""
    done, bad = int(sweep.completed.sum()), int(sweep.bad.sum())
    parts = [f"{count} {status}" for status, count in sweep.failures.items()]
    failed = f", {sum(sweep.failures.values())} failed ({', '.join(parts)})" if parts else ""
    rest = sweep.planned - sweep.count
    open_ = f", {rest} not computed yet" if rest else ""
    verdicts = f"; {bad} of those completed have the verdict FAIL" if bad else ""
    return f"{sweep.planned} points: {done} completed{failed}{open_}{verdicts}."


def is_sample(sweep: SweepRuns) -> bool:
    """Return whether points were drawn from distributions."""
    return any(parameter.drawn for parameter in sweep.varied)


def statistics_table(sweep: SweepRuns) -> Table:
    """Return the table of statistics of a sample; of other plans that of extremes."""
    return _statistics(sweep) if is_sample(sweep) else _extremes(sweep)


def _statistics(sweep: SweepRuns) -> Table:
    interval = f"{LEVEL:.0%} interval"
    columns = (
        Column("measure", "measure"),
        Column("group", "points with"),
        Column("points", "points", form="d"),
        Column("missing", "without value", form="d"),
        Column("fail", "verdict FAIL", form="d"),
        Column("mean", "mean", form=NUMBER),
        Column("mean_low", "from", f"{interval} of the mean", NUMBER),
        Column("mean_high", "to", f"{interval} of the mean", NUMBER),
        Column("deviation", "standard deviation", form=NUMBER),
        Column("deviation_low", "from", "its interval", NUMBER),
        Column("deviation_high", "to", "its interval", NUMBER),
        Column("min", "least", form=NUMBER),
        *(Column(f"q{100 * q:g}", f"{q:.0%}", "quantiles", NUMBER) for q in QUANTILES),
        Column("max", "largest", form=NUMBER),
    )
    rows: list[tuple[Cell, ...]] = []
    for measure in sweep.measures:
        for words, among in groups(sweep):
            s = statistics_of(sweep, measure, among, words)
            numbers = [s.mean, *(s.interval or (None, None)), s.deviation]
            numbers += [*(s.deviation_interval or (None, None)), s.least]
            numbers += [*(s.quantiles or (None,) * len(QUANTILES)), s.largest]
            counts = (s.points, s.points - s.used, s.bad)
            rows.append((measure.label, words, *counts, *map(_finite, numbers)))
    table = Table(columns, tuple(rows))
    return table if any(row[1] for row in rows) else table.without("group")


def _extremes(sweep: SweepRuns) -> Table:
    """Return the least and the largest value of each measure, and where they are."""
    columns = (
        Column("measure", "measure"),
        Column("points", "points", form="d"),
        Column("missing", "without value", form="d"),
        Column("fail", "verdict FAIL", form="d"),
        Column("min", "least", form=NUMBER),
        Column("min_at", "at"),
        Column("max", "largest", form=NUMBER),
        Column("max_at", "at"),
    )
    rows: list[tuple[Cell, ...]] = []
    for measure in sweep.measures:
        known = np.flatnonzero(np.isfinite(measure.values))
        bad = int(sweep.bad[known].sum())
        ends = [known[pick(measure.values[known])] for pick in (np.argmin, np.argmax)]
        found: list[Cell] = []
        for k in ends:
            found += [float(measure.values[k]), place(sweep, int(k))]
        rows.append((measure.label, sweep.planned, sweep.planned - len(known), bad, *found))
    return Table(columns, tuple(rows))


def place(sweep: SweepRuns, index: int) -> str:
    """Say which values the varied parameters have at a point."""
    return ", ".join(p.said(p.cells[index]) for p in sweep.varied)


def all_indices(sweep: SweepRuns) -> list[Indices]:
    """Return the Sobol indices of all measures asked for that vary; none without such a design."""
    if not has_indices(sweep):
        return []
    found = (indices_of(sweep, measure) for measure in sweep.asked)
    return [each for each in found if each is not None]


def indices_table(found: Sequence[Indices]) -> Table:
    """Return the table of Sobol indices with their confidence intervals."""
    interval = f"{LEVEL:.0%} interval"
    columns = (
        Column("measure", "measure"),
        Column("parameter", "parameter"),
        Column("first", "first order", form=".4f"),
        Column("first_low", "from", interval, ".4f"),
        Column("first_high", "to", interval, ".4f"),
        Column("total", "total", form=".4f"),
        Column("total_low", "from", f"{interval} ", ".4f"),
        Column("total_high", "to", f"{interval} ", ".4f"),
        Column("rows", "rows used", form="d"),
        Column("rows_omitted", "rows omitted", form="d"),
    )
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            each.measure.label, name,
            float(each.first[j]), *map(float, each.first_interval[j]),
            float(each.total[j]), *map(float, each.total_interval[j]),
            each.rows, each.planned - each.rows,
        )
        for each in found
        for j, name in enumerate(each.parameters)
    )  # fmt: skip
    return Table(columns, rows)


def failures_table(sweep: SweepRuns) -> Table:
    """Return the table of the first failed points, with their values and messages."""
    failed = np.flatnonzero(~sweep.completed)[:MOST_FAILURES]
    columns = (
        Column("point", "point", form="d"),
        *(Column(p.name, p.name) for p in sweep.varied),
        Column("status", "status"),
        Column("message", "message"),
    )
    rows = tuple(
        (
            int(sweep.numbers[k]),
            *(p.short[p.cells[k]] for p in sweep.varied),
            sweep.status[k],
            sweep.messages[k],
        )
        for k in failed
    )
    return Table(columns, rows)


def best(sweep: SweepRuns, measure: Measured, goal: str) -> tuple[Table, str]:
    """Return the point at which a measure is least ("min") or largest ("max"), and a note on what
    was not considered: points that failed, have no value, or have the verdict FAIL.

    Raises ``ResultError`` if no point is left.
    """
    considered = np.isfinite(measure.values) & sweep.completed & ~sweep.bad
    among = np.flatnonzero(considered)
    counts = {
        "failed": int((~sweep.completed).sum()),
        "without value": int((sweep.completed & ~np.isfinite(measure.values)).sum()),
        "with the verdict FAIL": int((sweep.bad & np.isfinite(measure.values)).sum()),
        "not computed yet": sweep.planned - sweep.count,
    }
    omitted = ", ".join(f"{count} {words}" for words, count in counts.items() if count)
    if not len(among):
        where = shown_path(sweep.folder)
        raise ResultError(f"{where}: no point to choose from by '{measure.name}': {omitted}")
    k = int(among[(np.argmin if goal == MINIMUM else np.argmax)(measure.values[among])])
    columns = [Column("point", "point", form="d"), *(Column(p.name, p.name) for p in sweep.varied)]
    row: list[Cell] = [int(sweep.numbers[k]), *(p.cells[k] for p in sweep.varied)]
    others = [each for each in sweep.measures if each is not measure]
    for each in (measure, *others):
        columns.append(Column(each.name, each.label, form=NUMBER))
        row.append(_finite(float(each.values[k])))
    columns.append(Column("verdict", "verdict"))
    row.append(sweep.verdict[k])
    note = f"chosen from {len(among)} points; not considered: {omitted}" if omitted else ""
    return Table(tuple(columns), (tuple(row),)), note


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None
