"""The command ``msahl run``: run a deck and write its results."""

import sys
import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.cli.command_line import typed_command
from msahl.cli.console import (
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
from msahl.cli.progress import progress_in_time
from msahl.printable import printable, shown_path
from msahl.records import record

if TYPE_CHECKING:
    from msahl.cli.gradients import GradientsOfRun
    from msahl.results.checkpoint import Checkpoint
    from msahl.results.job import Job
    from msahl.run.mesh_error import FinerMesh
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
    system.csv, beams.csv, amplitudes.csv and signals.csv (if the deck has markers, groups, beams,
    elastic bodies or signals), error.csv (estimated errors of positions and orientations),
    gradients.csv (with --gradient), run.json and deck.xml, the deck as it was run. File names of
    tables end in .part until the run is complete. If DIR holds complete results already, they are
    kept until then, and the new run is written to DIR/incomplete. Exits with status 1 if the
    verdict is FAIL.

    Example: msahl run decks/thesis/double_pendulum_89.xml --dt 0.01 -o results/coarse
    """
    changed = given.pop("settings")
    condition, measures, wrt = (given.pop(name) for name in ("stop_when", "gradient", "wrt"))
    if condition is not None:
        from msahl.deck.overrides import STOP_WHEN

        changed = (*changed, f"{STOP_WHEN}{condition}")
    folder = output or Path("results") / deck.stem
    job = _job(deck, given, changed, quiet, folder if resume else None)
    gradients = _gradients(job, measures, wrt, resume) if measures or wrt else None
    from msahl.jit.progress import CompileError
    from msahl.results.lock import locked
    from msahl.run.snapshot import ResumeError

    if resume and not folder.is_dir():
        stop(f"{shown_path(folder)}: no run to resume; omit --resume to start it")
    try:
        with writing(folder, OTHER_FOLDER), locked(folder):
            status = RunCommand(job, folder, resume, strict, quiet, verbose, gradients).carry_out()
    except (CompileError, ResumeError) as error:
        stop(printable(str(error)))
    except MemoryError:
        message = "the model needs more memory than there is; make its subsystems smaller"
        stop(f"{shown_path(deck)}: {message}")
    sys.exit(status)


def _job(
    deck: Path, given: dict[str, Any], changed: tuple[str, ...], quiet: bool, resumed: Path | None
) -> "Job":
    """The run of ``deck`` with the options ``given`` and ``changed`` numbers, or of the run in the
    folder ``resumed``; faults end the program.
    """
    job = job_to_run(deck, given, changed, quiet, resumed)
    from msahl.deck import DeckError

    try:
        _ = job.text  # reads the parts of the deck, which may have changed meanwhile
    except DeckError as error:
        stop(str(error))
    return job


def _gradients(
    job: "Job", measures: tuple[str, ...], wrt: tuple[str, ...], resume: bool
) -> "GradientsOfRun":
    """The derivatives that are asked for; faults end the program."""
    if resume:
        stop("msahl run: --gradient needs the run from its start; omit --resume")
    from msahl.cli.gradients import GradientsOfRun

    return GradientsOfRun(job, measures, wrt)


@record(slots=False)
class RunCommand:
    """A run to be made or resumed, the locked folder of its results, and what is printed."""

    job: "Job"
    folder: Path
    resume: bool
    strict: bool
    quiet: bool
    verbose: bool
    gradients: "GradientsOfRun | None"

    @cached_property
    def about(self) -> dict[str, Any]:
        """The head of ``run.json``."""
        return self.job.about(self.folder)

    @property
    def deck(self) -> str:
        """The path of the deck, for messages."""
        return shown_path(self.job.source.path)

    def carry_out(self) -> int:
        """Make the run, or resume it; the exit status."""
        started = self._begin()
        if started is None:
            say(f"{self.deck}: the run in {shown_path(self.folder)} is complete")
            return 0
        from msahl.jit.announced import announced

        with stoppable() as stopped:
            report = self._simulate(*started, stopped)
            if self.gradients and report.status == "completed":
                with announced(not self.quiet):
                    self.gradients.compute(report)
            status = self._close(started[0], report, stopped)
            if self.gradients and self.gradients.found is None:
                status = status or NOT_CONVERGED
            return status or self._status_of_verdict(report)

    def _begin(self) -> "tuple[Path, Checkpoint | None] | None":
        """The folder to write into and the checkpoint to resume from; None if the run is
        complete."""
        from msahl.results.checkpoint import is_complete, read_checkpoint
        from msahl.results.folder import claim, finish, info, place

        if not self.resume:
            return claim(self.folder, self.job.source.path, self.about), None
        finish(self.folder)
        work = place(self.folder)
        if not info(work):  # complete, and no other run was started since
            work = self.folder
        if work == self.folder and is_complete(work, self.about):
            return None
        return work, read_checkpoint(work, self.about)

    def _simulate(
        self, work: Path, since: "Checkpoint | None", stopped: Callable[[], bool]
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
            write_checkpoint(work, self.about, Checkpoint(results.ends(), snapshot))

        from msahl.jit.announced import announced

        job, gradients = self.job, self.gradients
        ends, snapshot = (since.ends, since.snapshot) if since else (None, None)
        results = session.begin(work, job.model, job.text, self.about, ends)
        simulation = job.model.simulation
        about = not self.quiet, simulation.t_final, self.deck, simulation.title or "running"
        try:
            with results, announced(not self.quiet), progress_in_time(*about) as show:
                tell = (lambda message: None) if self.quiet else say
                accepted = gradients.record.add if gradients else None
                sink = BothSinks(results, gradients.memory) if gradients else results
                hooks = loop.Hooks(lambda steps, t: show(t), stopped, tell, save, accepted)
                finer = self._finer_mesh()
                report = loop.run(job.model, job.options, sink, hooks, snapshot, True, finer)
                set_alarm(0.0)  # what ends the run now must not be interrupted
                results.complete = report.status == COMPLETED
        except StartError as error:
            return report_without_steps(NOT_STARTED, str(error))
        except KeyboardInterrupt:  # a second request to stop, before the first step ended
            return report_without_steps(INTERRUPTED, "stopped before the first step")
        except OSError as error:  # of the tables' names; other faults of the disk are in the report
            return report_without_steps(UNWRITTEN, not_written(error))
        return report

    def _finer_mesh(self) -> "FinerMesh | None":
        """The model with a finer mesh of its beams, if it has any."""
        if not self.job.model.beams:
            return None
        from msahl.study.more_elements import finer

        return finer(self.job)

    def _close(self, work: Path, report: "Report", stopped: Interruption) -> int:
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
            derivatives = self.gradients.write(work) if self.gradients else {}
            session.end(self.folder, work, self.about, {**report.as_json(), **derivatives})
        except OSError as error:
            say(f"{shown_path(error.filename or work / INFO)}: {error.strerror or error}")
            status = NOT_WRITTEN if complete else status
        self._report(self.folder if complete else work, report)
        if self.gradients:
            self.gradients.tell(self.quiet)
        if not complete and work != self.folder and not self.quiet:
            where = shown_path(self.folder)
            say(f"{self.deck}: the complete results of an earlier run are still in {where}")
        if report.status == "interrupted" and stopped.signal:
            return 128 + stopped.signal
        return status

    def _status_of_verdict(self, report: "Report") -> int:
        """Exit status of a completed run."""
        from msahl.run.verdict import FAIL, WARN

        bad = (WARN, FAIL) if self.strict else (FAIL,)
        return BAD_VERDICT if report.verdict["word"] in bad else 0

    def _report(self, folder: Path, report: "Report") -> None:
        """Print the last messages: warnings, what went wrong, and the verdict."""
        from msahl.run.verdict import FAIL, describe_verdict

        lines = [] if self.quiet else [f"{self.deck}: {text}" for text in report.warnings]
        if report.stop and not self.quiet:
            condition, t = report.stop["condition"], report.stop["time"]
            lines.append(f"{self.deck}: ended at t = {t:g} s, where {condition}")
        for said in (report.events or {}).get("messages", ()) if not self.quiet else ():
            lines.append(f"{self.deck}: t = {said['time']:.9g} s: {said['message']}")
        if report.message:
            lines.append(f"{self.deck}: {report.message}")
        if self.verbose:
            lines += [f"{phase}: {seconds:.3f} s" for phase, seconds in report.seconds.items()]
            lines.append(
                f"{report.unknowns} unknowns in {report.subsystems} subsystems "
                f"({report.planar_subsystems} planar, "
                f"{report.tree_subsystems} in joint coordinates), "
                f"{report.iterations} iterations, {report.factorisations} factorisations, "
                f"{report.scipy_steps} steps by scipy, "
                f"{report.path_steps} by continuation, {report.subdivisions} subdivisions"
            )
        if not self.quiet or report.verdict["word"] == FAIL:
            verdict = describe_verdict(report.verdict)
            lines.append(f"{self.deck}: {verdict} -> {shown_path(folder)}")
        if lines:
            say("\n".join(lines))
