"""What a study says: ``study.csv``, ``study.md`` with its pictures, ``study.html``."""

from collections.abc import Sequence
from pathlib import Path

from msahl.post.document import Block, Heading, Items, Paragraph, Picture, as_html, as_markdown
from msahl.post.draw import encode, style
from msahl.post.table import Cell, Column, Table, as_csv
from msahl.results.write import write_whole
from msahl.study.errors import BY_KEY, MEASURES
from msahl.study.order import describe
from msahl.study.study import Point, Study

DEFINITIONS = (
    ("seconds", "median over the repeats of the time of the loop; start-up, compilation and output "
     "are left out."),
    ("position, orientation, velocity, angular velocity", "of the body that is farthest off, "
     "against the reference at the rows' times, in inertial axes; orientation as an angle."),
    ("reaction, mean at mid-step", "the published reaction, a mean over a step, against the "
     "reference's force at the middle of the step; of the joint that is farthest off."),
    ("reaction, at the row", "the force that follows from the accelerations of the run's own state "
     "at the row (index-1 problem) against the reference's force at that time."),
    ("energy over max KE, over |E(1)|", "balance error over the largest kinetic energy, and over "
     "the energy of the first row (Hainge 2010, eq. 3.11)."),
    ("virtual work", "Hainge's measure (2010, eq. 3.16-3.18), not zero for an exact motion; force "
     ". change of gap, zero for an ideal joint. Over each step; of the joint with the most."),
    ("target kept to", "time up to which the error stays within the target; in a chaotic scene it "
     "says more than the largest error."),
    ("order", "slope of log error over log step with its 95 % interval, fitted to the largest "
     "errors over the longest stretch of steps whose slopes agree within 0.15 and that reaches the "
     "finest step or round-off."),
)  # fmt: skip


def write_study(study: Study, folder: Path) -> list[Path]:
    """Write the study to ``folder``; the paths written, pictures not among them."""
    blocks = build(study)
    folder.mkdir(parents=True, exist_ok=True)
    for block in blocks:
        if isinstance(block, Picture):
            write_whole(folder / block.name, block.png)
    texts = {
        "study.csv": as_csv(table_of_all(study)),
        "study.md": as_markdown(blocks),
        "study.html": as_html(_title(study), blocks),
    }
    for name, text in texts.items():
        write_whole(folder / name, text.encode())
    return [folder / name for name in texts]


def build(study: Study) -> list[Block]:
    """What the report says, in order."""
    return [
        Heading(1, f"Error against run time: {_title(study)}"),
        Paragraph(recommendation(study)),
        *_stopped(study),
        Paragraph(study.reference.words),
        *_failures(study),
        *_pictures(study),
        Heading(2, "Cost and largest errors"),
        main_table(study),
        Heading(2, "Observed orders"),
        order_table(study),
        Heading(2, "All errors"),
        *(block for key in BY_KEY for block in _measure_table(study, key)),
        Heading(2, "What the numbers mean"),
        Items(DEFINITIONS),
    ]


def _title(study: Study) -> str:
    return study.plan.model.simulation.title.strip() or "study"


def recommendation(study: Study) -> str:
    """The cheapest run that meets the target, in a sentence."""
    plan = study.plan
    measure = BY_KEY[plan.measure]
    unit = "" if measure.unit == "1" else f" {measure.unit}"
    wanted = f"{measure.name} within {plan.target:g}{unit} at every row"
    best = study.cheapest
    if best is None:
        return f"No run of this study keeps {wanted}; {_reach(study, unit)}"
    trial = best.trial
    error = best.largest(plan.measure) or 0.0
    how = "a step the fit proposed, then run" if best.tried else "run"
    return (
        f"The cheapest run that keeps {wanted}: --scheme {trial.scheme} --dt {trial.dt:.15g} "
        f"({how}: largest error {error:.2e}{unit}, {trial.seconds:.3g} s)."
    )


def _reach(study: Study, unit: str) -> str:
    """How near the best run came."""
    key = study.plan.measure
    known = [p for p in study.points if p.trial.completed and p.largest(key) is not None]
    if not known:
        return "none has such an error: the scene lacks it, or no run came to its end."
    best = min(known, key=lambda p: p.largest(key) or 0.0)
    kept = best.errors.kept_to(key, study.plan.target)
    until = "" if kept is None else f" and keeps it to t = {kept:.4g} s"
    return (
        f"the best, --scheme {best.trial.scheme} --dt {best.trial.dt:.15g}, comes to "
        f"{best.largest(key):.2e}{unit}{until}."
    )


def _stopped(study: Study) -> list[Block]:
    words = "The study was stopped before all its runs were made: what follows is of those made."
    return [Paragraph(words)] if study.stopped else []


def _failures(study: Study) -> list[Block]:
    failed = [p.trial for p in study.points if not p.trial.completed]
    items = tuple((f"{t.scheme}, dt = {t.dt:g} s", t.report.message) for t in failed)
    return [Heading(2, "Runs that did not come to their end"), Items(items)] if items else []


def _pictures(study: Study) -> list[Block]:
    from msahl.study.pictures import pictures

    with style():
        return [
            Picture(f"{name}.png", caption, encode(figure, "png"))
            for name, caption, figure in pictures(study)
        ]


RUN_COLUMNS = (
    Column("scheme", "scheme"),
    Column("dt", "dt [s]", form=".6g"),
    Column("steps", "steps", form="d"),
    Column("seconds", "seconds", form=".3g"),
)


def _sorted(study: Study) -> Sequence[Point]:
    return sorted(study.points, key=lambda p: (study.schemes.index(p.trial.scheme), -p.trial.dt))


def _run_cells(point: Point) -> tuple[Cell, ...]:
    trial = point.trial
    return trial.scheme, trial.dt, trial.report.steps, trial.seconds


def main_table(study: Study) -> Table:
    """Cost and the largest errors, a row a run."""
    columns = (
        *RUN_COLUMNS,
        Column("iterations", "iterations a step", form=".2f"),
        *(Column(m.key, f"{m.name} [{m.unit}]", form=".2e") for m in MEASURES if m.true),
        Column("energy_over_kinetic", "energy over max KE", form=".2e"),
        Column("kept_to", "target kept to [s]", form=".4g"),
    )
    keys = [column.key for column in columns[5:-1]]
    rows = tuple(
        (
            *_run_cells(point),
            point.trial.report.iterations / max(point.trial.report.steps, 1),
            *(point.largest(key) for key in keys),
            point.errors.kept_to(study.plan.measure, study.plan.target),
        )
        for point in _sorted(study)
    )
    return _without_empty(Table(columns, rows))


def order_table(study: Study) -> Table:
    """The fits, a row a scheme and measure."""
    columns = (
        Column("scheme", "scheme"),
        Column("measure", "error of"),
        Column("order", "order", form=".3f", missing="-"),
        Column("uncertainty", "+-", form=".3f", missing="-"),
        Column("constant", "error at 1 s", form=".2e", missing="-"),
        Column("where", "where it holds"),
    )
    rows: list[tuple[Cell, ...]] = []
    for scheme in study.schemes:
        for measure in MEASURES:
            points, errors = study.series(scheme, measure.key)
            if not points:
                continue
            fit = study.fits.get((scheme, measure.key))
            steps = [point.trial.dt for point in points]
            where = describe(fit, steps, errors.tolist())
            figures = (fit.order, fit.uncertainty, fit.constant) if fit else (None, None, None)
            rows.append((scheme, measure.name, *figures, where))
    return Table(columns, tuple(rows))


def _measure_table(study: Study, key: str) -> list[Block]:
    measure = BY_KEY[key]
    columns = (
        *RUN_COLUMNS[:2],
        Column("rms", f"RMS [{measure.unit}]", form=".3e"),
        Column("max", f"max [{measure.unit}]", form=".3e"),
    )
    known = [(p, p.errors.figures[key]) for p in _sorted(study)]
    rows = tuple((p.trial.scheme, p.trial.dt, e.rms, e.max) for p, e in known if e is not None)
    return [Heading(3, measure.name.capitalize()), Table(columns, rows)] if rows else []


def table_of_all(study: Study) -> Table:
    """Every figure of every run: ``study.csv``."""
    columns = (
        *RUN_COLUMNS,
        Column("status", "status"),
        Column("iterations", "iterations", form="d"),
        Column("factorisations", "factorisations", form="d"),
        *(
            Column(f"{m.key}_{figure}", f"{m.name} {figure} [{m.unit}]", form=".6e")
            for m in MEASURES
            for figure in ("rms", "max")
        ),
    )
    rows = []
    for point in _sorted(study):
        report = point.trial.report
        figures: list[Cell] = []
        for measure in MEASURES:
            spread = point.errors.figures[measure.key]
            figures += (None, None) if spread is None else (spread.rms, spread.max)
        counts = (report.status, report.iterations, report.factorisations)
        rows.append((*_run_cells(point), *counts, *figures))
    return Table(columns, tuple(rows))


def _without_empty(table: Table) -> Table:
    """The table without columns that no row fills."""
    for i, column in enumerate(table.columns):
        if table.rows and all(row[i] is None for row in table.rows):
            return _without_empty(table.without(column.key))
    return table
