"""The command ``msahl``: arguments in, exit status out; the only place of the engine that prints.

Exit status: 0 good, 1 the verdict is FAIL (with --strict also WARN), 2 bad deck or usage, 3 a step
did not converge, 4 rows could not be written, 128 + n stopped by signal n (130 interrupted, 143
terminated). Modules are imported where a command needs them, so that ``msahl check`` starts without
a compiler.
"""

import math
import os
import shlex
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

import click
from click.core import ParameterSource

import msahl
from msahl.model.scheme import CAYLEY, DAMPING, EXPONENTIAL, choices, split
from msahl.printable import printable, shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.model import Model
    from msahl.results.checkpoint import Checkpoint
    from msahl.run.loop import Options, Report

BAD_VERDICT, BAD_INPUT, NOT_CONVERGED, NOT_WRITTEN, INTERRUPTED = 1, 2, 3, 4, 130
STATUS = {
    "completed": 0,
    "not started": BAD_INPUT,
    "not converged": NOT_CONVERGED,
    "not written": NOT_WRITTEN,
    "interrupted": INTERRUPTED,
}
"""Exit status of a run by how it ended; 143 instead of 130 where it was told to terminate."""

GRACE = 0.5
"""Seconds in which a loop of steps should have answered a signal."""
STARTED = time.perf_counter()
"""When this module was entered; what Python needs to come so far is not in our seconds."""

Deck = click.Path(path_type=Path)


class Folder(click.Path):
    """A folder's path; an empty one is a variable that was not set, and not the present folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path, or a fault told with the option's name."""
        if not str(value):
            self.fail("it is empty; name a folder", param, ctx)
        return super().convert(value, param, ctx)


class Number(click.FloatRange):
    """A finite number, within a range if one is given."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number, or a fault told with the option's name."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


ELSEWHERE = {"new": "msahl.cli.templates", "study": "msahl.cli.study"}
"""Commands of other rooms, and the modules they are loaded from when asked for."""


class Commands(click.Group):
    """The group, with the commands of other rooms."""

    def main(self, *args: Any, **settings: Any) -> Any:
        """Enter the program."""
        _open_standard_streams()
        return super().main(*args, **settings)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; one line and the status of an interrupted run where it is stopped."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            _say("msahl: interrupted")
            ctx.exit(INTERRUPTED)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands."""
        return sorted([*super().list_commands(ctx), *ELSEWHERE])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of this name, from its room if it is not one of ours."""
        if cmd_name not in ELSEWHERE:
            return super().get_command(ctx, cmd_name)
        command: click.Command = getattr(import_module(ELSEWHERE[cmd_name]), cmd_name)
        return command


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(msahl.__version__, prog_name="msahl")
def main() -> None:
    """Simulate spatial multibody systems, and know how wrong the numbers are.

    A deck (XML) goes in, tables (CSV) come out. Start with: msahl run DECK. How good the result is
    tells msahl-post.
    """


@main.command()
@click.argument("decks", metavar="DECK...", nargs=-1, required=True, type=Deck)
def check(decks: tuple[Path, ...]) -> None:
    """Report every fault of the decks, each with file, line, element and remedy; run nothing.

    Example: msahl check decks/thesis/*.xml
    """
    faulty = False
    for deck in decks:
        model, faults = _read(deck, thorough=True)
        faulty |= model is None
        echo("\n".join(faults) if faults else f"{shown_path(deck)}: good", err=bool(faults))
    if faulty:
        sys.exit(BAD_INPUT)


@main.command()
@click.argument("deck", type=Deck)
def explain(deck: Path) -> None:
    """Say what running DECK takes: freedoms, unknowns, and what is left out and why.

    Example: msahl explain decks/thesis/double_pendulum_89.xml
    """
    model = _model_to_run(deck, {})
    from msahl.run.explain import explain as lines
    from msahl.start.velocities import StartError

    try:
        echo("\n".join(lines(model)))
    except StartError as error:
        _stop(f"{shown_path(deck)}: {error}")


@main.command()
@click.argument("deck", type=Deck)
@click.option("-o", "--output", type=Folder(path_type=Path), metavar="DIR",
              help="Folder of the results (default: results/<deck's name>).")  # fmt: skip
@click.option("--dt", type=Number(), metavar="S", help="Step [s], instead of the deck's deltaT.")
@click.option(
    "--t-final", type=Number(), metavar="S", help="End [s], instead of the deck's tFinal."
)
@click.option("--scheme", type=click.Choice(choices()),
              help="'preserving' keeps the energy, 'decaying' takes it from vibrations quicker "
              "than the step; both of order 2. 'gauss1' to 'gauss5' are of order 2 to 10, with the "
              "energy nearly kept; 'radau1' to 'radau3' of order 1, 3, 5, and take energy as "
              "'decaying' does; 'auto' is the cheapest gauss for the tolerance. Instead of the "
              "deck's; else preserving.")  # fmt: skip
@click.option("--damping", type=Number(0.0, 1.0), metavar="D",
              help="Of 'decaying', how much of such a vibration a step takes, 0 to 1; instead of "
              f"the deck's; else {DAMPING:g}.")  # fmt: skip
@click.option("--rotation-update", type=click.Choice([CAYLEY, EXPONENTIAL]),
              help="Of the schemes of order 2: the rotation of a step is the 'cayley' "
              "transform of h times the mean angular velocity, which keeps the angular momentum of "
              "joined bodies to round-off, or its 'exponential', which is more accurate for fast "
              "rotations. Default: the deck's, else cayley.")  # fmt: skip
@click.option("--solver", type=click.Choice(["auto", "newton", "root"]), default="auto",
              show_default=True, help="'newton' is compiled, 'root' is scipy.optimize.root, "
              "'auto' is newton with root for the first step and every hard one.")  # fmt: skip
@click.option("--tolerance", type=Number(), metavar="TOL",
              help="Choose the steps of gauss, radau or auto so that the global error of positions "
              "at the output times is no more than TOL [m], as far as its estimate shows. Instead "
              "of the deck's (default of auto: 1e-6).")  # fmt: skip
@click.option("--local-tolerance", type=Number(), metavar="TOL",
              help="Choose the steps so that their own errors add up to no more than TOL [m], "
              "without regard to what the motion makes of them.")  # fmt: skip
@click.option("--output-interval", "interval", type=Number(), metavar="S",
              help="Time [s] between rows, if not the step; any for gauss, radau, auto, whole "
              "steps for the others. Instead of the deck's.")  # fmt: skip
@click.option("--every", type=click.IntRange(1, 10**9), default=1, show_default=True, metavar="N",
              help="Write every Nth row (the last one always).")  # fmt: skip
@click.option("--reactions", type=click.Choice(["mean", "instantaneous"]),
              help="Reactions in the tables: 'mean' over the step before each output time, or "
              "'instantaneous', at the output time. Default: the deck's, else mean.")  # fmt: skip
@click.option("--error", type=click.Choice(["estimate", "local", "off"]),
              help="'estimate' the global error by a more accurate companion run, add up the "
              "'local' errors of the steps, or 'off'. Default: estimate, unless that takes more "
              "than a second and longer than the run.")  # fmt: skip
@click.option("--accuracy", type=Number(min=0.0, min_open=True),
              metavar="TOL", help="Largest error of positions [m] that passes, and up to which "
              "time the run has it. Instead of the deck's (default: 1 % of the model's size).",
              )  # fmt: skip
@click.option("--full", is_flag=True, help="Leave nothing out of the equations (see explain).")
@click.option("--resume", is_flag=True, help="Go on with the run in DIR that was stopped; give the "
              "deck and options that it began with.")  # fmt: skip
@click.option("--strict", is_flag=True, help="Exit with status 1 on WARN as well as on FAIL.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but faults.")
@click.option("-v", "--verbose", is_flag=True, help="Say what every phase took.")
def run(
    deck: Path,
    output: Path | None,
    dt: float | None,
    t_final: float | None,
    scheme: str | None,
    damping: float | None,
    rotation_update: str | None,
    solver: str,
    tolerance: float | None,
    local_tolerance: float | None,
    interval: float | None,
    every: int,
    reactions: str | None,
    error: str | None,
    accuracy: float | None,
    full: bool,
    resume: bool,
    strict: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Run DECK and write its states and joint reactions.

    Writes states.csv, reactions.csv (if there are joints or motions), work.csv (if there are loads
    or motions), error.csv (estimated errors of positions and orientations), run.json and deck.xml,
    the deck as it ran. Tables end in .part until the run is complete. Complete results that DIR
    holds already are kept until then: the new run is written to DIR/incomplete. Exits with status 1
    if the verdict is FAIL.

    Example: msahl run decks/thesis/double_pendulum_89.xml --dt 0.01 -o results/coarse
    """
    name, degree = split(scheme) if scheme else (None, None)
    given: dict[str, Any] = {
        "dt": dt,
        "t_final": t_final,
        "scheme": name,
        "degree": degree,
        "damping": damping,
        "rotation_update": rotation_update,
        "reactions": reactions,
        "tolerance": tolerance,
        "local_tolerance": local_tolerance,
        "interval": interval,
    }
    model = _model_to_run(deck, given)
    from msahl.deck import effective_deck
    from msahl.model import local_tolerance_of, tolerance_of
    from msahl.results.folder import FolderError
    from msahl.results.lock import FolderInUseError, locked
    from msahl.run.loop import Options
    from msahl.run.snapshot import ResumeError

    if solver == "root" and local_tolerance_of(model) is not None:
        _stop("msahl run: --solver root takes the steps it is given; omit it or the tolerance")
    if error in ("local", "off") and tolerance_of(model) is not None:
        _stop(
            f"msahl run: --error {error}: a tolerance of the global error needs its estimate; "
            "give --local-tolerance instead"
        )
    folder = output or Path("results") / deck.stem
    try:
        job = Job(
            deck,
            folder,
            model,
            Options(solver, every, full, accuracy, error),
            effective_deck(deck, **given),
        )
        if resume and not folder.is_dir():
            raise ResumeError(f"{shown_path(folder)}: no run there; leave --resume out to begin it")
        with locked(folder):
            begun = _begin(job, resume)
            if begun is None:
                _say(f"{shown_path(deck)}: the run in {shown_path(folder)} is complete")
                return
            with stoppable() as stopped:
                report = _simulate(job, *begun, stopped, shown=not quiet)
                status = _close(job, begun[0], report, stopped, quiet, verbose)
                status = status or _judged(report, strict)
    except OSError as error:
        where = shown_path(error.filename or folder)
        _stop(f"{where}: {error.strerror or error}; choose another folder with -o")
    except (FolderError, FolderInUseError, ResumeError) as error:
        _stop(printable(str(error)))
    except MemoryError:
        where = shown_path(deck)
        _stop(f"{where}: the scene needs more memory than there is; make its islands smaller")
    sys.exit(status)


class Interruption:
    """Whether the user asked to stop. A second request stops at once, as KeyboardInterrupt, and so
    does the first if nobody has asked for it after ``GRACE`` seconds, in what is no loop of steps.
    """

    def __init__(self) -> None:
        self.signal = 0

    def __call__(self) -> bool:
        """Whether a stop was asked for."""
        if self.signal:
            _set_alarm(0.0)
        return self.signal != 0

    def note(self, number: int, frame: FrameType | None) -> None:
        """Signal handler."""
        if self.signal:
            raise KeyboardInterrupt
        self.signal = number
        _set_alarm(GRACE)

    def insist(self, number: int, frame: FrameType | None) -> None:
        """Signal handler of the alarm."""
        raise KeyboardInterrupt


def _set_alarm(seconds: float) -> None:
    """Have the process send itself SIGALRM, where the system can do that; 0 for never."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)


def _say(message: str) -> None:
    """Write to stderr, if anyone still reads it: a run's results do not depend on that."""
    try:
        echo(message, err=True)
    except OSError:
        # What is left in the buffer would fail again when Python ends, and spoil the exit status.
        with suppress(OSError), Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), sys.stderr.fileno())


def _stop(message: str) -> NoReturn:
    _say(message)
    sys.exit(BAD_INPUT)


def _open_standard_streams() -> None:
    """Open what is closed of stdin, stdout and stderr: a table would be given its descriptor, and
    whatever writes there would write into the table.
    """
    while True:
        descriptor = os.open(os.devnull, os.O_RDWR)
        if descriptor > 2:
            break
    os.close(descriptor)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115


def _read(deck: Path, thorough: bool = False) -> tuple["Model | None", list[str]]:
    from msahl.deck import DeckError, read_deck

    try:
        return read_deck(deck, thorough), []
    except DeckError as error:
        return None, [str(fault) for fault in error.faults]


def _model_to_run(deck: Path, given: dict[str, Any]) -> "Model":
    from msahl.deck import check_simulation

    model, faults = _read(deck)
    if model is None:
        _stop("\n".join(faults))
    changes = {name: value for name, value in given.items() if value is not None}
    if {"tolerance", "local_tolerance"} & changes.keys():
        changes = {"tolerance": None, "local_tolerance": None, **changes}
    simulation = replace(model.simulation, **changes)
    faults = check_simulation(simulation)
    if faults:
        _stop("\n".join(f"msahl run: {fault}" for fault in faults))
    return replace(model, simulation=simulation)


@dataclass(frozen=True)
class Job:
    """A run to be made: the deck's path, folder of the results, and the deck as it runs."""

    deck: Path
    folder: Path
    model: "Model"
    options: "Options"
    text: bytes

    @cached_property
    def about(self) -> dict[str, Any]:
        """The head of ``run.json``: all that its rows depend on."""
        from msahl.deck import deck_digest
        from msahl.model import decay_of, degree_of, is_exponential, reactions_of, tolerance_of
        from msahl.results.folder import relative

        simulation = self.model.simulation
        return {
            **_versions(),
            "deck": {
                "path": click.format_filename(self.deck),
                "relative": click.format_filename(relative(self.deck, self.folder)),
                "digest": deck_digest(self.text),
            },
            "options": {
                **({"degree": degree_of(self.model)} if degree_of(self.model) else {}),
                "dt": simulation.dt,
                "tFinal": simulation.t_final,
                "scheme": simulation.scheme,
                "damping": simulation.damping if decay_of(self.model).chi > 0.0 else 0.0,
                **({"rotationUpdate": EXPONENTIAL} if is_exponential(self.model) else {}),
                "solver": self.options.solver,
                "every": self.options.every,
                "full": self.options.full,
                "error": self.options.error,
                "accuracy": self.options.accuracy,
                "reactions": reactions_of(self.model),
                "outputInterval": simulation.output_interval,
                "tolerance": tolerance_of(self.model),
                "localTolerance": self.model.simulation.local_tolerance,
            },
        }


def _begin(job: Job, resume: bool) -> "tuple[Path, Checkpoint | None] | None":
    """Where the job's run is to write, and where it goes on; None where it is complete."""
    from msahl.results.checkpoint import is_complete, read_checkpoint
    from msahl.results.folder import claim, finish, info, place

    if not resume:
        return claim(job.folder, job.deck, job.about), None
    finish(job.folder)
    work = place(job.folder)
    if not info(work):  # complete, and no other begun since
        work = job.folder
    if work == job.folder and is_complete(work, job.about):
        return None
    return work, read_checkpoint(work, job.about)


def _simulate(
    job: Job,
    work: Path,
    since: "Checkpoint | None",
    stopped: Callable[[], bool],
    shown: bool,
) -> "Report":
    """Run into the folder ``work``; what happened, faults of the start and of the disk included."""
    from msahl.results.checkpoint import Checkpoint, write_checkpoint
    from msahl.results.write import RunFolder, write_beginning
    from msahl.run.loop import no_run, not_written
    from msahl.run.loop import run as simulate
    from msahl.run.snapshot import Snapshot
    from msahl.start.velocities import StartError

    def tell(message: str) -> None:
        if shown:
            _say(message)

    def save(snapshot: Snapshot) -> None:
        results.to_disk()
        write_checkpoint(work, job.about, Checkpoint(results.ends(), snapshot))

    ends, snapshot = (since.ends, since.snapshot) if since else (None, None)
    write_beginning(work, {"status": "running", "pid": os.getpid(), **job.about})
    results = RunFolder(work, job.model, job.text, ends)
    try:
        with results, _progress(job.model, shown) as progress:
            report = simulate(
                job.model, job.options, results, progress, stopped, tell, save, snapshot
            )
            _set_alarm(0.0)  # what ends the run now is not to be broken off
            results.whole = report.status == "completed"
    except StartError as error:
        return no_run("not started", str(error))
    except KeyboardInterrupt:  # a second request to stop, before there was a step to end
        return no_run("interrupted", "stopped before the first step")
    except OSError as error:  # of the tables' names: what else the disk refuses is in the report
        return no_run("not written", not_written(error))
    return report


def _close(
    job: Job,
    work: Path,
    report: "Report",
    stopped: "Interruption",
    quiet: bool,
    verbose: bool,
) -> int:
    """End a run, however it went: ``run.json``, the last words on stderr, the exit status."""
    from msahl.results.checkpoint import is_kept, remove_checkpoint
    from msahl.results.folder import finish, tables
    from msahl.results.write import INFO, write_json

    report.seconds["total"] = time.perf_counter() - STARTED
    if report.status in ("interrupted", "not written"):
        resume = is_kept(work)
        again = "go on" if resume else "begin anew (there is no checkpoint yet)"
        report.message += f"; {again} with: {_command(resume)}"
    status, complete = STATUS[report.status], report.status == "completed"
    try:
        write_json(work / INFO, {**job.about, "tables": tables(work), **report.as_json()})
        if complete:
            remove_checkpoint(work)
            finish(job.folder)
    except OSError as error:
        _say(f"{shown_path(error.filename or work / INFO)}: {error.strerror or error}")
        status = NOT_WRITTEN if complete else status
    _tell(job.deck, job.folder if complete else work, report, quiet, verbose)
    if not complete and work != job.folder and not quiet:
        earlier = f"the complete results of an earlier run are still in {shown_path(job.folder)}"
        _say(f"{shown_path(job.deck)}: {earlier}")
    if report.status == "interrupted" and stopped.signal:
        return 128 + stopped.signal
    return status


def _judged(report: "Report", strict: bool) -> int:
    """Exit status of a completed run by its verdict."""
    from msahl.run.verdict import FAIL, WARN

    return BAD_VERDICT if report.verdict["word"] in ((WARN, FAIL) if strict else (FAIL,)) else 0


def _command(resume: bool) -> str:
    """The command line under way, with ``--resume`` or without."""
    context = click.get_current_context()
    words = ["msahl", "run"]
    for parameter in context.command.params:
        name = str(parameter.name)
        given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if not given or name == "resume":
            continue
        if isinstance(parameter, click.Option):
            words.append(max(parameter.opts, key=len))
        if not (isinstance(parameter, click.Option) and parameter.is_flag):
            words.append(str(context.params[name]))
    return shlex.join([*words, "--resume"] if resume else words)


@contextmanager
def stoppable() -> Iterator[Interruption]:
    """Turn the first SIGINT or SIGTERM into a request that the loop honours between chunks."""
    interruption = Interruption()
    handlers = dict.fromkeys((signal.SIGINT, signal.SIGTERM), interruption.note)
    if hasattr(signal, "setitimer"):
        handlers[signal.SIGALRM] = interruption.insist
    before = {number: signal.signal(number, handle) for number, handle in handlers.items()}
    try:
        yield interruption
    finally:
        _set_alarm(0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _progress(model: "Model", shown: bool) -> Iterator[Callable[[int, float], Any]]:
    """A bar of steps and simulated time on a terminal, nothing elsewhere."""
    if not shown or not sys.stderr.isatty():
        yield lambda steps, t: None
        return
    from msahl.run.loop import Grid

    t_final = model.simulation.t_final
    bar: Any = click.progressbar(
        length=Grid.of(model.simulation).n,
        label=model.simulation.title or "running",
        file=sys.stderr,
        item_show_func=lambda t: "" if t is None else f"t = {t:.4g} of {t_final:g} s",
    )
    with bar:
        yield lambda steps, t: bar.update(steps - bar.pos, t)


def _versions() -> dict[str, str]:
    import platform
    from importlib.metadata import version

    packages = ("numba", "numpy", "scipy")
    versions = {package: version(package) for package in packages}
    return {"msahl": msahl.__version__, "python": platform.python_version(), **versions}


def _tell(deck: Path, folder: Path, report: "Report", quiet: bool, verbose: bool) -> None:
    """The last lines on stderr: warnings, what went wrong, and the verdict."""
    from msahl.run.verdict import FAIL

    lines = [] if quiet else [f"{shown_path(deck)}: {warning}" for warning in report.warnings]
    if report.message:
        lines.append(f"{shown_path(deck)}: {report.message}")
    if verbose:
        lines += [f"{phase}: {seconds:.3f} s" for phase, seconds in report.seconds.items()]
        lines.append(
            f"{report.unknowns} unknowns in {report.subsystems} subsystems "
            f"({report.planar_subsystems} planar), {report.iterations} iterations, "
            f"{report.factorisations} factorisations, "
            f"{report.scipy_steps} steps by scipy, {report.subdivisions} subdivisions"
        )
    if not quiet or report.verdict["word"] == FAIL:
        lines.append(f"{shown_path(deck)}: {_judgement(report.verdict)} -> {shown_path(folder)}")
    if lines:
        _say("\n".join(lines))


def _judgement(verdict: dict[str, Any]) -> str:
    """The verdict's word and reasons; of a good run the figures that made it pass."""
    checks = verdict["checks"]
    names = ("completion", "energy", "constraintViolation", "accuracy", "reactions")
    told = [checks[name]["text"] for name in names if name in checks]
    return f"{verdict['word']}: {'; '.join(verdict['reasons'] or told)}"
