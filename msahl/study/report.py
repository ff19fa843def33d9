"""What a study says: ``study.csv``, ``study.md`` with its pictures, ``study.html``."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from msahl.model import resolve
from msahl.post.document import (
    Block,
    Folded,
    Heading,
    Items,
    Paragraph,
    Picture,
    as_html,
    as_markdown,
)
from msahl.post.draw import encode, style
from msahl.post.table import Cell, Column, Table, as_csv
from msahl.results.write import replace_file
from msahl.study.command import shown, words_of
from msahl.study.errors import BY_KEY, MEASURES
from msahl.study.order import FLAT, describe
from msahl.study.plan import Point
from msahl.study.study import Study

DEFINITIONS = (
    ("seconds", "of the loop, the least of the repeats; start-up, compilation and output are not "
     "included. The whole command includes them, but not compilation."),
    ("position, estimated", "the error that the run itself reports, from a companion run of higher "
     "accuracy; the dashed line of the picture."),
    ("n/a", "not measured: the time of the study was used up (--budget), or the model lacks it."),
    ("position, orientation, velocity, angular velocity", "of the body that is farthest off, "
     "against the reference at the output times, in inertial axes; orientation as an angle."),
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
    for block in _unfolded(blocks):
        if isinstance(block, Picture):
            replace_file(folder / block.name, block.png)
    texts = {
        "study.csv": as_csv(table_of_all(study)),
        "study.md": as_markdown(blocks),
        "study.html": as_html(_title(study), blocks),
    }
    for name, text in texts.items():
        replace_file(folder / name, text.encode())
    return [folder / name for name in texts]


def _unfolded(blocks: Sequence[Block]) -> Iterator[Block]:
    for block in blocks:
        yield from _unfolded(block.blocks) if isinstance(block, Folded) else (block,)


def build(study: Study) -> list[Block]:
    """What the report says, in order: the picture first."""
    drawn = _pictures(study)
    first, others = drawn[:1], drawn[1:]
    return [
        Heading(1, f"Error against run time: {_title(study)}"),
        Paragraph(recommendation(study)),
        *_rows_hint(study),
        *_stopped(study),
        *first,
        *gain_table(study),
        Paragraph(study.reference.words),
        *_failures(study),
        Folded("Cost and largest errors of all runs", (main_table(study),)),
        Folded("Other errors", tuple(others)),
        Folded("Observed orders", (order_table(study),)),
        Folded(
            "Root mean square and largest value of each error",
            tuple(block for key in BY_KEY for block in _measure_table(study, key)),
        ),
        Heading(2, "What the numbers mean"),
        Items(DEFINITIONS),
    ]


def _title(study: Study) -> str:
    return study.plan.model.simulation.title.strip() or "study"


def recommendation(study: Study) -> str:
    """The fastest run that meets the target, and what it gains, in words."""
    plan, best = study.plan, study.fastest
    wanted = f"{BY_KEY[plan.measure].name} error of at most {plan.target:g}{_unit(study)}"
    if best is None:
        return f"No run of this study has a {wanted}; {_reach(study)}"
    wanted += " at every output time"
    if study.reference.horizon < plan.model.simulation.t_final:
        wanted += (
            f" up to t = {study.reference.horizon:.4g} s, after which there are no true values"
        )
    sentences = [
        f"The fastest run with a {wanted}: {_command(study, best)}.",
        f"Its {_figures(study, best)}.",
        *_gain(study, best),
    ]
    if all((p.largest(plan.measure) or 0.0) <= FLAT for p in study.points if p.trial.completed):
        sentences.append(
            "This error is round-off in every run, so it does not tell which is accurate: choose "
            "another --measure, such as orientation."
        )
    if resolve(plan.model.simulation).adaptive and not best.trial.case.chooses:
        sentences.append("The deck gives a tolerance, which must be removed from it for this run.")
    return " ".join(sentences)


def _unit(study: Study) -> str:
    unit = BY_KEY[study.plan.measure].unit
    return "" if unit == "1" else f" {unit}"


def _command(study: Study, point: Point) -> str:
    """The command line of a run, or its options where no command was given."""
    words = words_of(point.trial.case, study.plan, study.deck or "DECK", study.given_end)
    return shown(words)


def _figures(study: Study, point: Point) -> str:
    """Error and seconds of a run."""
    error = point.largest(study.plan.measure)
    known = "unknown" if error is None else f"{error:.2e}{_unit(study)}"
    command = study.commands.get(point.trial.case)
    whole = f", {command.whole:.2g} s for the whole command" if command else ""
    return f"largest error is {known}; it takes {point.trial.seconds:.3g} s in the loop{whole}"


def _gain(study: Study, best: Point) -> list[str]:
    """What a run gains over the deck's own setting."""
    own = study.of_deck
    if own is None or own is best or not own.trial.completed:
        return []
    error, old = best.largest(study.plan.measure), own.largest(study.plan.measure)
    faster = own.trial.seconds / max(best.trial.seconds, 1e-9)
    words = _times(faster, "faster", "slower")
    if error and old:
        words += " and " + _times(old / error, "more accurate", "less accurate")
    return [
        f"It is {words} than the deck's own setting ({_options(own)}), whose "
        f"{_figures(study, own)}."
    ]


def _times(ratio: float, better: str, worse: str) -> str:
    factor, word = (ratio, better) if ratio >= 1.0 else (1.0 / ratio, worse)
    return f"{float(f'{factor:.2g}'):g} times {word}"


def _options(point: Point) -> str:
    case = point.trial.case
    return f"--scheme {case.scheme} {'--tolerance' if case.chooses else '--dt'} {case.size:.15g}"


def _rows_hint(study: Study) -> list[Block]:
    """How to have more rows from a run of large steps."""
    best, own = study.fastest, study.of_deck
    if best is None or own is None or len(best.trial.run.time) >= len(own.trial.run.time):
        return []
    interval = float(own.trial.run.time[1])
    return [
        Paragraph(
            f"The run has {len(best.trial.run.time)} rows. For rows as often as in the deck's own "
            f"run add --output-interval {interval:.6g}; the rows between the steps' ends follow "
            "from the polynomials of the steps."
        )
    ]


def gain_table(study: Study) -> list[Block]:
    """The recommended run beside the deck's own."""
    columns = (
        Column("run", "run"),
        Column("options", "options"),
        Column("error", f"largest {BY_KEY[study.plan.measure].name} error"
               f" [{BY_KEY[study.plan.measure].unit}]", form=".2e", missing="-"),
        Column("loop", "loop [s]", form=".3g"),
        Column("whole", "whole command [s]", form=".2g", missing="-"),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for name, point in (("recommended", study.fastest), ("the deck's own", study.of_deck)):
        if point is not None:
            command = study.commands.get(point.trial.case)
            error = point.largest(study.plan.measure)
            whole = command.whole if command else None
            rows.append((name, _options(point), error, point.trial.seconds, whole))
    return [Table(columns, tuple(rows))] if rows else []


def _reach(study: Study) -> str:
    """How near the best run came."""
    key = study.plan.measure
    known = [p for p in study.points if p.trial.completed and p.largest(key) is not None]
    if not known:
        return "none has such an error: the model lacks it, or no run came to its end."
    best = min(known, key=lambda p: p.largest(key) or 0.0)
    kept = best.errors.kept_to(key, study.plan.target)
    until = "" if kept is None else f" and stays within the target until t = {kept:.4g} s"
    return f"the most accurate, {_options(best)}, has {best.largest(key):.2e}{_unit(study)}{until}."


def _stopped(study: Study) -> list[Block]:
    words = "The study was stopped before all its runs were made: what follows is of those made."
    return [Paragraph(words)] if study.stopped else []


def _failures(study: Study) -> list[Block]:
    failed = [p.trial for p in study.points if not p.trial.completed]
    items = tuple(
        (
            f"{t.scheme}, {'tolerance' if t.case.chooses else 'dt'} = {t.case.size:g}",
            t.report.message,
        )
        for t in failed
    )
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
    Column("tolerance", "tolerance [m]", form=".3g", missing=""),
    Column("steps", "steps", form="d"),
    Column("seconds", "seconds", form=".3g"),
)


def _sorted(study: Study) -> Sequence[Point]:
    return sorted(study.points, key=lambda p: (study.schemes.index(p.trial.scheme), -p.trial.dt))


def _run_cells(point: Point) -> tuple[Cell, ...]:
    trial = point.trial
    tolerance = trial.case.size if trial.case.chooses else None
    return trial.scheme, trial.dt, tolerance, trial.report.steps, trial.seconds


def main_table(study: Study) -> Table:
    """Cost and the largest errors, a row a run."""
    columns = (
        *RUN_COLUMNS,
        Column("iterations", "iterations a step", form=".2f"),
        *(Column(m.key, f"{m.name} [{m.unit}]", form=".2e") for m in MEASURES if m.true),
        Column("energy_over_kinetic", "energy over max KE", form=".2e"),
        Column("estimate", "position, estimated [m]", form=".2e"),
        Column("kept_to", "target kept to [s]", form=".4g"),
    )
    first = len(RUN_COLUMNS) + 1
    keys = [column.key for column in columns[first:-2]]
    rows = tuple(
        (
            *_run_cells(point),
            point.trial.report.iterations / max(point.trial.report.steps, 1),
            *(point.largest(key) for key in keys),
            point.estimate,
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
        *RUN_COLUMNS[:3],
        Column("rms", f"RMS [{measure.unit}]", form=".3e"),
        Column("max", f"max [{measure.unit}]", form=".3e"),
    )
    known = [(p, p.errors.figures[key]) for p in _sorted(study)]
    rows = tuple((*_run_cells(p)[:3], e.rms, e.max) for p, e in known if e is not None)
    return (
        [Heading(3, measure.name.capitalize()), _without_empty(Table(columns, rows))]
        if rows
        else []
    )


def table_of_all(study: Study) -> Table:
    """Every figure of every run: ``study.csv``."""
    columns = (
        *RUN_COLUMNS,
        Column("status", "status"),
        Column("iterations", "iterations", form="d"),
        Column("factorisations", "factorisations", form="d"),
        Column("estimate", "position, estimated [m]", form=".6e"),
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
        counts = (report.status, report.iterations, report.factorisations, point.estimate)
        rows.append((*_run_cells(point), *counts, *figures))
    return Table(columns, tuple(rows))


def _without_empty(table: Table) -> Table:
    """The table without columns that no row fills."""
    for i, column in enumerate(table.columns):
        if table.rows and all(row[i] is None for row in table.rows):
            return _without_empty(table.without(column.key))
    return table
