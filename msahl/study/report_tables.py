"""Tabulate a study: time and errors of its runs, the recommended run, and the observed orders."""

from collections.abc import Sequence

from msahl.post.table import Cell, Column, Table
from msahl.study.errors import METRIC_OF, METRICS, ErrorMetric
from msahl.study.order import describe
from msahl.study.plan import StudyRun
from msahl.study.study import Study

RUN_COLUMNS = (
    Column("scheme", "scheme"),
    Column("dt", "dt [s]", form=".6g"),
    Column("tolerance", "tolerance [m]", form=".3g", missing=""),
    Column("steps", "steps", form="d"),
    Column("seconds", "time loop [s]", form=".3g"),
)


def describe_options(run: StudyRun) -> str:
    """Return the options of the command line that set scheme and step size or tolerance."""
    case = run.trial.case
    size = "--tolerance" if case.chooses_steps else "--dt"
    return f"--scheme {case.scheme} {size} {case.size:.15g}"


def _header(metric: ErrorMetric) -> str:
    return metric.name if metric.unit == "1" else f"{metric.name} [{metric.unit}]"


def _sorted(study: Study) -> Sequence[StudyRun]:
    return sorted(study.runs, key=lambda r: (study.schemes.index(r.trial.scheme), -r.trial.dt))


def _run_cells(run: StudyRun) -> tuple[Cell, ...]:
    trial = run.trial
    tolerance = trial.case.size if trial.case.chooses_steps else None
    return trial.scheme, trial.dt, tolerance, trial.report.steps, trial.seconds


def comparison_table(study: Study) -> list[Table]:
    """Return a table of the recommended run and of the one with the deck's settings, if any."""
    metric = METRIC_OF[study.plan.metric]
    unit = "" if metric.unit == "1" else f" [{metric.unit}]"
    columns: tuple[Column, ...] = (
        Column("run", "run"),
        Column("options", "options"),
        Column("error", f"largest {metric.name} error{unit}", form=".2e", missing="-"),
        Column("loop", "time loop [s]", form=".3g"),
        Column("command", "complete command [s]", form=".2g", missing="-"),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, run in (("recommended", study.fastest), ("deck's settings", study.deck_run)):
        if run is not None:
            command = study.commands.get(run.trial.case)
            seconds = command.seconds if command else None
            error = run.largest(study.plan.metric)
            rows.append((name, describe_options(run), error, run.trial.seconds, seconds))
    if not study.commands:  # there was no time left for them
        columns, rows = columns[:-1], [row[:-1] for row in rows]
    return [Table(columns, tuple(rows))] if rows else []


def cost_table(study: Study) -> Table:
    """Return a table of runs: their time, iterations and largest errors."""
    shown = [m for m in METRICS if m.needs_reference or m.key == "energy_over_kinetic"]
    columns = (
        *RUN_COLUMNS,
        Column("iterations", "iterations per step", form=".2f"),
        *(Column(m.key, _header(m), form=".2e") for m in shown),
        Column("estimate", "position, estimated [m]", form=".2e"),
        Column("within_until", "within target until [s]", form=".4g"),
    )
    rows = tuple(
        (
            *_run_cells(run),
            run.trial.report.iterations / max(run.trial.report.steps, 1),
            *(run.largest(m.key) for m in shown),
            run.estimate,
            run.errors.within_until(study.plan.metric, study.plan.target),
        )
        for run in _sorted(study)
    )
    return Table(columns, rows).filled()


def order_table(study: Study) -> Table:
    """Return a table of observed orders, one row for each scheme and metric."""
    columns = (
        Column("scheme", "scheme"),
        Column("metric", "error of"),
        Column("order", "order", form=".3f", missing="-"),
        Column("uncertainty", "+-", form=".3f", missing="-"),
        Column("constant", "error at a step of 1 s", form=".2e", missing="-"),
        Column("valid", "valid range of step sizes"),
    )
    rows: list[tuple[Cell, ...]] = []
    for scheme in study.schemes:
        for metric in METRICS:
            runs, errors = study.series(scheme, metric.key)
            if not runs:
                continue
            fit = study.fits.get((scheme, metric.key))
            valid = describe(fit, [run.trial.dt for run in runs], errors.tolist())
            values = (fit.order, fit.uncertainty, fit.constant) if fit else (None, None, None)
            rows.append((scheme, metric.name, *values, valid))
    return Table(columns, tuple(rows))


def metric_table(study: Study, key: str) -> Table:
    """Return a table of the root mean square and the largest value of one error of all runs."""
    unit = "" if METRIC_OF[key].unit == "1" else f" [{METRIC_OF[key].unit}]"
    columns = (
        *RUN_COLUMNS[:3],
        Column("rms", f"RMS{unit}", form=".3e"),
        Column("max", f"max{unit}", form=".3e"),
    )
    known = [(run, run.errors.statistics[key]) for run in _sorted(study)]
    rows = tuple((*_run_cells(run)[:3], e.rms, e.max) for run, e in known if e is not None)
    return Table(columns, rows).filled()


def table_of_all(study: Study) -> Table:
    """Return a table of all numbers of every run: ``study.csv``."""
    columns = (
        *RUN_COLUMNS,
        Column("status", "status"),
        Column("iterations", "iterations", form="d"),
        Column("factorisations", "factorisations", form="d"),
        Column("estimate", "position, estimated [m]", form=".6e"),
        *(
            Column(f"{m.key}_{kind}", f"{m.name} {kind} [{m.unit}]", form=".6e")
            for m in METRICS
            for kind in ("rms", "max")
        ),
    )
    rows = []
    for run in _sorted(study):
        report = run.trial.report
        values: list[Cell] = []
        for metric in METRICS:
            found = run.errors.statistics[metric.key]
            values += (None, None) if found is None else (found.rms, found.max)
        counts = (report.status, report.iterations, report.factorisations, run.estimate)
        rows.append((*_run_cells(run), *counts, *values))
    return Table(columns, tuple(rows))
