"""The command ``msahl kinematics``: a completely prescribed motion, without integrating."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.cli.compiling import computing
from msahl.cli.console import INTERRUPTED, OTHER_FOLDER, STATUS, say, writing
from msahl.cli.decks import job_of
from msahl.cli.options import DECK, NumberType, output_option, quiet_option, set_option
from msahl.cli.progress import progress_in_time
from msahl.printable import printable, shown_path

if TYPE_CHECKING:
    from msahl.analysis.kinematics.solution import Prepared
    from msahl.results.job import Job
    from msahl.run.report import Report


@click.command(short_help="Compute a completely prescribed motion.")
@click.argument("deck", type=DECK)
@output_option("results/<deck's name>_kinematics")
@set_option
@click.option(
    "--step",
    type=NumberType(0.0, min_open=True),
    metavar="S",
    help="Set the time between output times in seconds (default: the deck's).",
)
@click.option(
    "--t-final",
    type=NumberType(0.0, min_open=True),
    metavar="S",
    help="Set the end in seconds (default: tFinal of the deck).",
)
@click.option(
    "--every",
    type=click.IntRange(1),
    metavar="N",
    default=1,
    help="Compute only every Nth output time, and the last one (default: 1).",
)
@quiet_option
def kinematics(
    deck: Path,
    output: Path | None,
    settings: tuple[str, ...],
    step: float | None,
    t_final: float | None,
    every: int,
    quiet: bool,
) -> None:
    """Compute positions, velocities, accelerations and reactions of DECK, whose prescribed motions
    leave no degrees of freedom.

    The constraint equations are solved at each output time to round-off, without integrating.
    Singular positions (dead points) are found between output times as well and reported with their
    time, the bodies that can move there and the loads that can grow without bound. Writes the
    tables of a run, always with accelerations and with the reactions at the output times, so that
    msahl-post reads the folder as that of a run; run.json names this command. Exits with status 3
    if the motion cannot be followed to its end.

    Example: msahl kinematics decks/mechanisms/stewart.xml
    """
    from msahl.analysis.kinematics.solution import options_of, prepare
    from msahl.results.lock import locked

    job = job_of(deck, options_of(step, t_final), settings)
    folder = output or Path("results") / f"{deck.stem}_kinematics"
    with writing(folder, OTHER_FOLDER), computing(deck, quiet):
        prepared = prepare(job.model)  # what cannot be computed leaves the folder as it is
        with locked(folder):
            status = _carry_out(job, prepared, folder, every, quiet)
    sys.exit(status)


def _carry_out(job: "Job", prepared: "Prepared", folder: Path, every: int, quiet: bool) -> int:
    """Compute the motion into the locked folder; returns the exit status."""
    from msahl.analysis.kinematics.solution import follow, output_times
    from msahl.analysis.kinematics.verdict import kinematics_as_json, report_of
    from msahl.results import session
    from msahl.results.folder import claim

    began = time.perf_counter()
    about = _about(job, folder, every)
    work = claim(folder, job.source.path, about)
    results = session.begin(work, job.model, job.text, about)
    times = output_times(job.model, every)
    try:
        with results, progress_in_time(not quiet, float(times[-1]), "kinematics") as show:
            found = follow(prepared, times, results, show)
            results.complete = found.complete
    except KeyboardInterrupt:
        say(f"{shown_path(job.source.path)}: interrupted; the tables are not complete")
        return INTERRUPTED
    report = report_of(found, job.model.simulation.t_final)
    report.seconds["total"] = time.perf_counter() - began
    session.end(folder, work, about, {**report.as_json(), "kinematics": kinematics_as_json(found)})
    _tell(job.source.path, folder if found.complete else work, report, quiet)
    return STATUS[report.status]


def _about(job: "Job", folder: Path, every: int) -> dict[str, Any]:
    """Return the head of ``run.json``, with what the command did in place of a scheme."""
    from msahl.analysis.kinematics.verdict import COMMAND, SCHEME, SOLVER

    about = job.about(folder)
    options = {**about["options"], "scheme": SCHEME, "solver": SOLVER, "every": every}
    options |= dict.fromkeys(("tolerance", "localTolerance", "damping", "rotationUpdate", "degree"))
    return {**about, "command": COMMAND, "options": options}


def _tell(deck: Path, folder: Path, report: "Report", quiet: bool) -> None:
    """Print warnings, why the motion ends early, and the verdict."""
    lines = [f"WARN: {text}" for text in report.warnings]
    lines += [report.message] if report.message else []
    if not quiet:
        checks = report.verdict["checks"]
        names = ("completion", "accuracy", "constraintViolation", "energy", "reactions")
        texts = [checks[name]["text"] for name in names if name in checks]
        lines.append(f"{report.verdict['word']}: {'; '.join(texts)} -> {shown_path(folder)}")
    for line in lines:
        say(f"{shown_path(deck)}: {printable(line)}")
