"""The command ``msahl run``: run a deck and write its results."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.cli.command_line import typed_command
from msahl.cli.compiling import announced
from msahl.cli.console import (
    BAD_INPUT,
    BAD_VERDICT,
    NOT_CONVERGED,
    NOT_WRITTEN,
    OTHER_FOLDER,
    STATUS,
    say,
    stop,
    writing,
)
from msahl.cli.decks import job_to_run
from msahl.cli.interruption import Interruption, set_alarm, stoppable
from msahl.cli.options import DECK, output_option, run_options, set_option
from msahl.printable import printable, shown_path

if TYPE_CHECKING:
    from msahl.cli.gradients import GradientsOfRun
    from msahl.model import Model
    from msahl.results.checkpoint import Checkpoint
    from msahl.results.job import Job
    from msahl.run.report import Report

STARTED = time.perf_counter()
"""When this module was imported; the time that Python needs before is not counted."""


@click.command(short_help="Run a deck and write its results.")
@click.argument("deck", type=DECK)
@output_option("results/<deck's name>")
@set_option
@click.option(
    "--stop-when",
    metavar="CONDITION",
    help="End the run when a condition of the motion "
    "begins to hold, such as 'Crank.angle > 2*pi' (default: <stop> of the deck, else "
    "none).",
)
@run_options
@click.option(
    "--gradient",
    multiple=True,
    metavar="MEASURE",
    help="Compute the derivatives of a measure, such as 'Tip.z final' (see msahl sweep --measure), "
    "by the numbers of --wrt; repeat for more.",
)
@click.option(
    "--wrt",
    multiple=True,
    metavar="NAMES",
    help="Numbers of the deck, named as for --set and separated by commas, by which --gradient "
    "differentiates.",
)
@click.option("--resume", is_flag=True, help="Resume the interrupted run in DIR. Give the deck and "
              "the options with which it was started.")  # fmt: skip
@click.option("--strict", is_flag=True, help="Exit with status 1 on WARN as well as on FAIL.")
@click.option("-q", "--quiet", is_flag=True, help="Print only faults.")
@click.option("-v", "--verbose", is_flag=True, help="Print the time and work of every phase.")
def run(
    deck: Path,
    output: Path | None,
    resume: bool,
    strict: bool,
    quiet: bool,
    verbose: bool,
    **given: Any,
) -> None:
    """Run DECK and write its states and joint reactions.

    Writes states.csv, reactions.csv (if there are joints or motions), joints.csv (coordinates of
    joints that have angles or slides), work.csv (if there are loads or motions), markers.csv,
    system.csv and signals.csv (if the deck has markers, groups or signals), error.csv (estimated
    errors of positions and orientations), gradients.csv (with --gradient), run.json and deck.xml,
    the deck as it was run. File names of tables end in .part until the run is complete. If DIR
    holds complete results already, they are kept until then, and the new run is written to
    DIR/incomplete. Exits with status 1 if the verdict is FAIL.

    Example: msahl run decks/thesis/double_pendulum_89.xml --dt 0.01 -o results/coarse
    """
    changed = given.pop("settings")
    condition, measures, wrt = (given.pop(name) for name in ("stop_when", "gradient", "wrt"))
    if condition is not None:
        from msahl.deck.overrides import STOP_WHEN

        changed = (*changed, f"{STOP_WHEN}{condition}")
    folder = output or Path("results") / deck.stem
    task = make_task(deck, folder, given, changed, resume, quiet)
    gradients = _gradients(task, measures, wrt, resume) if measures or wrt else None
    from msahl.jit.progress import CompileError
    from msahl.results.lock import locked
    from msahl.run.snapshot import ResumeError

    if resume and not task.folder.is_dir():
        stop(f"{shown_path(task.folder)}: no run to resume; omit --resume to start it")
    try:
        with writing(task.folder, OTHER_FOLDER, BAD_INPUT), locked(task.folder):
            status = carry_out(task, resume, strict, Talk(quiet, verbose), gradients)
    except (CompileError, ResumeError) as error:
        stop(printable(str(error)))
    except MemoryError:
        message = "the model needs more memory than there is; make its subsystems smaller"
        stop(f"{shown_path(deck)}: {message}")
    sys.exit(status)


@dataclass(frozen=True)
class Talk:
    """How much a run prints."""

    quiet: bool
    verbose: bool


@dataclass(frozen=True)
class Task:
    """A run to be made, and the folder of its results."""

    job: "Job"
    folder: Path

    @property
    def deck(self) -> Path:
        """The path of the deck."""
        return self.job.source.path

    @cached_property
    def about(self) -> dict[str, Any]:
        """The head of ``run.json``."""
        return self.job.about(self.folder)


def make_task(
    deck: Path,
    folder: Path,
    given: dict[str, Any],
    changed: tuple[str, ...],
    resume: bool = False,
    quiet: bool = False,
) -> Task:
    """The run of ``deck`` into ``folder`` with the options ``given`` and ``changed`` numbers;
    faults end the program."""
    job = job_to_run(deck, given, changed, quiet, folder if resume else None)
    task = Task(job, folder)
    from msahl.deck import DeckError

    try:
        _ = task.job.text  # reads the parts of the deck, which may have changed meanwhile
    except DeckError as error:
        stop(str(error))
    return task


def _gradients(
    task: Task, measures: tuple[str, ...], wrt: tuple[str, ...], resume: bool
) -> "GradientsOfRun":
    """The derivatives that are asked for; faults end the program."""
    if resume:
        stop("msahl run: --gradient needs the run from its start; omit --resume")
    from msahl.cli.gradients import GradientsOfRun

    return GradientsOfRun(task.job, measures, wrt)


def carry_out(
    task: Task,
    resume: bool,
    strict: bool,
    talk: Talk,
    gradients: "GradientsOfRun | None" = None,
) -> int:
    """Make the run, or resume it, in the locked folder; the exit status."""
    started = _begin(task, resume)
    if started is None:
        say(f"{shown_path(task.deck)}: the run in {shown_path(task.folder)} is complete")
        return 0
    with stoppable() as stopped:
        report = _simulate(task, *started, stopped, talk, gradients)
        if gradients and report.status == "completed":
            gradients.compute(report)
        status = _close(task, started[0], report, stopped, talk, gradients)
        if gradients and gradients.found is None:
            status = status or NOT_CONVERGED
        return status or _status_of_verdict(report, strict)


def _begin(task: Task, resume: bool) -> "tuple[Path, Checkpoint | None] | None":
    """The folder to write into and the checkpoint to resume from; None if the run is complete."""
    from msahl.results.checkpoint import is_complete, read_checkpoint
    from msahl.results.folder import claim, finish, info, place

    if not resume:
        return claim(task.folder, task.deck, task.about), None
    finish(task.folder)
    work = place(task.folder)
    if not info(work):  # complete, and no other run was started since
        work = task.folder
    if work == task.folder and is_complete(work, task.about):
        return None
    return work, read_checkpoint(work, task.about)


def _simulate(
    task: Task,
    work: Path,
    since: "Checkpoint | None",
    stopped: Callable[[], bool],
    talk: Talk,
    gradients: "GradientsOfRun | None",
) -> "Report":
    """Run into the folder ``work``; the report covers faults of the start and of the disk."""
    from msahl.results import session
    from msahl.results.checkpoint import Checkpoint, write_checkpoint
    from msahl.run import loop
    from msahl.run.messages import not_written
    from msahl.run.report import COMPLETED, INTERRUPTED, NOT_STARTED, report_without_steps
    from msahl.run.report import NOT_WRITTEN as UNWRITTEN
    from msahl.run.snapshot import Snapshot
    from msahl.run.tables import BothSinks
    from msahl.start.velocities import StartError

    def save(snapshot: Snapshot) -> None:
        results.flush()
        write_checkpoint(work, task.about, Checkpoint(results.ends(), snapshot))

    job = task.job
    ends, snapshot = (since.ends, since.snapshot) if since else (None, None)
    results = session.begin(work, job.model, job.text, task.about, ends)
    try:
        with results, announced(not talk.quiet), _progress(job.model, not talk.quiet) as progress:
            tell = (lambda message: None) if talk.quiet else say
            accepted = gradients.record.add if gradients else None
            sink = BothSinks(results, gradients.memory) if gradients else results
            hooks = loop.Hooks(progress, stopped, tell, save, accepted)
            report = loop.run(job.model, job.options, sink, hooks, snapshot, checked=True)
            set_alarm(0.0)  # what ends the run now must not be interrupted
            results.complete = report.status == COMPLETED
    except StartError as error:
        return report_without_steps(NOT_STARTED, str(error))
    except KeyboardInterrupt:  # a second request to stop, before the first step ended
        return report_without_steps(INTERRUPTED, "stopped before the first step")
    except OSError as error:  # of the tables' names; other faults of the disk are in the report
        return report_without_steps(UNWRITTEN, not_written(error))
    return report


def _close(
    task: Task,
    work: Path,
    report: "Report",
    stopped: Interruption,
    talk: Talk,
    gradients: "GradientsOfRun | None",
) -> int:
    """End a run, however it went: ``run.json``, the last messages, the exit status."""
    from msahl.results import session
    from msahl.results.checkpoint import has_checkpoint
    from msahl.results.write import INFO

    report.seconds["total"] = time.perf_counter() - STARTED
    if report.status in ("interrupted", "not written"):
        resume = has_checkpoint(work)
        command = typed_command({"resume"}) + (" --resume" if resume else "")
        again = "resume it" if resume else "start again (there is no checkpoint yet)"
        report.message += f"; {again} with: {command}"
    status, complete = STATUS[report.status], report.status == "completed"
    try:
        derivatives = gradients.write(work) if gradients else {}
        session.end(task.folder, work, task.about, {**report.as_json(), **derivatives})
    except OSError as error:
        say(f"{shown_path(error.filename or work / INFO)}: {error.strerror or error}")
        status = NOT_WRITTEN if complete else status
    _tell(task.deck, task.folder if complete else work, report, talk)
    if gradients:
        gradients.tell(talk.quiet)
    if not complete and work != task.folder and not talk.quiet:
        earlier = f"the complete results of an earlier run are still in {shown_path(task.folder)}"
        say(f"{shown_path(task.deck)}: {earlier}")
    if report.status == "interrupted" and stopped.signal:
        return 128 + stopped.signal
    return status


def _status_of_verdict(report: "Report", strict: bool) -> int:
    """Exit status of a completed run."""
    from msahl.run.verdict import FAIL, WARN

    return BAD_VERDICT if report.verdict["word"] in ((WARN, FAIL) if strict else (FAIL,)) else 0


@contextmanager
def _progress(model: "Model", shown: bool) -> Iterator[Callable[[int, float], Any]]:
    """A progress bar of steps and simulated time on a terminal, nothing elsewhere."""
    if not shown or not sys.stderr.isatty():
        yield lambda steps, t: None
        return
    from msahl.run.time_grid import TimeGrid

    t_final = model.simulation.t_final
    bar: Any = click.progressbar(
        length=TimeGrid.of_steps(model.simulation).n,
        label=model.simulation.title or "running",
        file=sys.stderr,
        item_show_func=lambda t: "" if t is None else f"t = {t:.4g} of {t_final:g} s",
    )
    with bar:
        yield lambda steps, t: bar.update(steps - bar.pos, t)


def _tell(deck: Path, folder: Path, report: "Report", talk: Talk) -> None:
    """Print the last messages: warnings, what went wrong, and the verdict."""
    from msahl.run.verdict import FAIL, describe_verdict

    lines = [] if talk.quiet else [f"{shown_path(deck)}: {text}" for text in report.warnings]
    if report.stop and not talk.quiet:
        condition, t = report.stop["condition"], report.stop["time"]
        lines.append(f"{shown_path(deck)}: ended at t = {t:g} s, where {condition}")
    if report.message:
        lines.append(f"{shown_path(deck)}: {report.message}")
    if talk.verbose:
        lines += [f"{phase}: {seconds:.3f} s" for phase, seconds in report.seconds.items()]
        lines.append(
            f"{report.unknowns} unknowns in {report.subsystems} subsystems "
            f"({report.planar_subsystems} planar), {report.iterations} iterations, "
            f"{report.factorisations} factorisations, {report.scipy_steps} steps by scipy, "
            f"{report.path_steps} by continuation, {report.subdivisions} subdivisions"
        )
    if not talk.quiet or report.verdict["word"] == FAIL:
        verdict = describe_verdict(report.verdict)
        lines.append(f"{shown_path(deck)}: {verdict} -> {shown_path(folder)}")
    if lines:
        say("\n".join(lines))
