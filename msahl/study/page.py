"""Write the report of a study: ``study.csv``, ``study.md`` with its pictures, ``study.html``.

Tables are made by ``report_tables``.
"""

from collections.abc import Sequence
from pathlib import Path

from msahl.model import resolve
from msahl.post.document import Banner, Block, Code, Folded, Heading, Items, Paragraph, Picture
from msahl.post.draw import style
from msahl.post.page.drawing import as_picture
from msahl.post.page.files import write_document
from msahl.post.table import as_csv
from msahl.results.write import replace_file
from msahl.study.command import command_line
from msahl.study.errors import METRIC_OF
from msahl.study.order import FLAT
from msahl.study.plan import StudyRun
from msahl.study.report_tables import (
    comparison_table,
    cost_table,
    describe_options,
    metric_table,
    order_table,
    table_of_all,
)
from msahl.study.study import Study

DEFINITIONS = (
    (
        "time loop [s]",
        "least time of the repeats. Start-up, compilation and output are not included; the time "
        "of the complete command includes start-up and output, but not compilation.",
    ),
    (
        "position, estimated",
        "the error that the run itself estimates from a companion run of higher accuracy; the "
        "dashed line of the figure.",
    ),
    (
        "n/a",
        "not computed, because the time of the study was used up (--budget) or the model lacks it.",
    ),
    (
        "error of position, orientation, velocity, angular velocity",
        "norm of the difference from the reference at the output times, in inertial axes (for the "
        "orientation the angle of rotation), of the body for which it is largest.",
    ),
    (
        "error of the reaction, mean over the step",
        "difference of the published reaction, a mean over a step, from the force of the reference "
        "at the middle of the step, of the joint for which it is largest.",
    ),
    (
        "error of the reaction, instantaneous",
        "difference of the force that follows from the accelerations of the run's own state at the "
        "output time (index-1 problem) from the force of the reference at that time.",
    ),
    (
        "energy balance over max KE, over |E(1)|",
        "energy balance error divided by the largest kinetic energy, and by the absolute energy at "
        "the start (Hainge 2010, eq. 3.11).",
    ),
    (
        "virtual work",
        "of each joint over a step, of the joint with the largest: Hainge's definition (2010, eq. "
        "3.16-3.18), which is not zero for the exact motion, and the work of the reaction on both "
        "bodies, which is zero for an ideal joint.",
    ),
    (
        "constraint violation",
        "largest violation of the constraint equations at position level, and its rate (velocity "
        "level).",
    ),
    (
        "within target until",
        "time up to which the error stays below the target. In a chaotic motion it says more than "
        "the largest error.",
    ),
    (
        "order",
        "slope of log(error) over log(step size) with its 95 % interval, fitted to the largest "
        "errors over the longest range of step sizes whose slopes agree within 0.15 and that "
        "extends to the finest step or to rounding errors.",
    ),
)


def write_study(study: Study, folder: Path) -> list[Path]:
    """Write the study to ``folder``; return the paths written, without the pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(folder / "study.csv", as_csv(table_of_all(study)).encode())
    written = write_document(_title(study), build(study, _pictures(study)), folder, "study")
    return [folder / "study.csv", *written]


def build(study: Study, drawn: Sequence[Picture]) -> list[Block]:
    """Return the blocks of the report in their order: the recommendation and its figure first."""
    return [
        Heading(1, _heading(study)),
        Banner("WARN" if study.fastest is None else "PASS", "", tuple(_recommended(study))),
        *_evidence(study, drawn),
        Folded("Definitions", (Items(DEFINITIONS),)),
    ]


def _evidence(study: Study, drawn: Sequence[Picture]) -> list[Block]:
    """Return what the recommendation rests on: the figure and its numbers; the rest is folded."""
    tables = ((metric, metric_table(study, key)) for key, metric in METRIC_OF.items())
    return [
        *_output_hint(study),
        *_stopped(study),
        *drawn[:1],
        *comparison_table(study),
        Paragraph(study.reference.description),
        *_failures(study),
        Folded("Time and largest errors of all runs", (cost_table(study),)),
        Folded("Other errors", tuple(drawn[1:])),
        Folded("Observed orders", (order_table(study),)),
        Folded(
            "Root mean square and largest value of each error",
            tuple(
                block
                for metric, table in tables
                if table.rows
                for block in (Heading(3, metric.name.capitalize()), table)
            ),
        ),
    ]


def _heading(study: Study) -> str:
    return f"Error against run time: {_title(study)}"


def _title(study: Study) -> str:
    return study.plan.model.simulation.title.strip() or "study"


def _recommended(study: Study) -> list[Block]:
    """Return the recommendation, with its command on a line of its own."""
    text, best = recommendation(study), study.fastest
    if best is None:
        return [Paragraph(text)]
    command = _command(study, best)
    before, after = text.split(f" {command}. ", 1)
    return [Paragraph(before), Code(command), Paragraph(after)]


def recommendation(study: Study) -> str:
    """Return sentences on the fastest run that meets the target and on what it gains."""
    plan, best = study.plan, study.fastest
    wanted = _wanted(study)
    if best is None:
        return f"No run of this study has {wanted}; {_most_accurate(study)}"
    wanted += " at every output time"
    if study.reference.horizon < plan.model.simulation.t_final:
        wanted += (
            f" up to t = {study.reference.horizon:.4g} s, after which there are no reference values"
        )
    sentences = [
        f"The fastest run with {wanted} is: {_command(study, best)}.",
        f"Its {_error_and_time(study, best)}.",
        *_gain(study, best),
    ]
    if all((r.largest(plan.metric) or 0.0) <= FLAT for r in study.runs if r.trial.completed):
        sentences.append(
            "In every run this error is rounding error, so it does not show which run is accurate: "
            "choose another --metric, such as orientation."
        )
    if resolve(plan.model.simulation).adaptive and not best.trial.case.chooses_steps:
        sentences.append("Remove the tolerance that the deck sets before you make this run.")
    return " ".join(sentences)


def _wanted(study: Study) -> str:
    """Describe the error that the target allows."""
    name, limit = METRIC_OF[study.plan.metric].name, f"{study.plan.target:g}{_unit(study)}"
    if "," in name:
        return f"an error of at most {limit} ({name})"
    article = "an" if name[0] in "aeiou" else "a"
    return f"{article} {name} error of at most {limit}"


def _unit(study: Study) -> str:
    unit = METRIC_OF[study.plan.metric].unit
    return "" if unit == "1" else f" {unit}"


def _command(study: Study, run: StudyRun) -> str:
    """Return the command line of a run."""
    return command_line(study.command(run.trial.case))


def _error_and_time(study: Study, run: StudyRun) -> str:
    """Describe error and time of a run."""
    error = run.largest(study.plan.metric)
    known = "unknown" if error is None else f"{error:.2e}{_unit(study)}"
    command = study.commands.get(run.trial.case)
    total = f", the complete command {command.seconds:.2g} s" if command else ""
    return f"largest error is {known}; the time loop takes {run.trial.seconds:.3g} s{total}"


def _gain(study: Study, best: StudyRun) -> list[str]:
    """Compare a run with the one with the deck's own settings."""
    deck_run = study.deck_run
    if deck_run is None or deck_run is best or not deck_run.trial.completed:
        return []
    error, old = best.largest(study.plan.metric), deck_run.largest(study.plan.metric)
    words = _times(deck_run.trial.seconds / max(best.trial.seconds, 1e-9), "faster", "slower")
    if error and old and max(error, old) > FLAT:
        words += " and " + _times(old / error, "more accurate", "less accurate")
    return [
        f"It is {words} than the run with the deck's own settings "
        f"({describe_options(deck_run)}), whose {_error_and_time(study, deck_run)}."
    ]


def _times(ratio: float, better: str, worse: str) -> str:
    factor, word = (ratio, better) if ratio >= 1.0 else (1.0 / ratio, worse)
    return f"{float(f'{factor:.2g}'):g} times {word}"


def _output_hint(study: Study) -> list[Block]:
    """Say how to get more output times from a run at large steps."""
    best, deck_run = study.fastest, study.deck_run
    if best is None or deck_run is None or len(best.trial.run.time) >= len(deck_run.trial.run.time):
        return []
    interval = float(deck_run.trial.run.time[1])
    return [
        Paragraph(
            f"This run writes {len(best.trial.run.time)} output times. To get those of the run "
            f"with the deck's own settings, add --output-interval {interval:.6g}: the results "
            "between the ends of steps are then computed from the polynomials of the steps."
        )
    ]


def _most_accurate(study: Study) -> str:
    """Describe the most accurate run of a study in which none meets the target."""
    key = study.plan.metric
    known = [r for r in study.runs if r.trial.completed and r.largest(key) is not None]
    if not known:
        return "none has such an error, because the model lacks it or no run was completed."
    best = min(known, key=lambda r: r.largest(key) or 0.0)
    time = best.errors.within_until(key, study.plan.target)
    until = "" if time is None else f" and stays within the target until t = {time:.4g} s"
    return (
        f"the most accurate one, {describe_options(best)}, has {best.largest(key):.2e}"
        f"{_unit(study)}{until}."
    )


def _stopped(study: Study) -> list[Block]:
    words = (
        "The study was stopped before all of its runs were made; the results below are of the "
        "completed ones."
    )
    return [Paragraph(words)] if study.stopped else []


def _failures(study: Study) -> list[Block]:
    failed = [run.trial for run in study.runs if not run.trial.completed]
    items = tuple(
        (
            f"{t.scheme}, tolerance = {t.case.size:g} m"
            if t.case.chooses_steps
            else f"{t.scheme}, dt = {t.case.size:g} s",
            t.report.message,
        )
        for t in failed
    )
    return [Heading(2, "Runs that did not reach the end time"), Items(items)] if items else []


def _pictures(study: Study) -> list[Picture]:
    from msahl.study.pictures import pictures

    with style():
        return [as_picture(name, caption, figure) for name, caption, figure in pictures(study)]
