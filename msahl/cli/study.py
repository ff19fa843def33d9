"""The command ``msahl study``; ``msahl.cli`` loads it when it is asked for."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from msahl.cli.main import BAD_INPUT, NOT_CONVERGED, NOT_WRITTEN, Folder, Number, stoppable
from msahl.model.scheme import AUTO, choices
from msahl.printable import shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.study.study import Study

METRIC_KEYS = (
    "position",
    "orientation",
    "velocity",
    "angular_velocity",
    "mean_reaction",
    "instantaneous_reaction",
    "energy_over_kinetic",
)


START = 0.2
"""Seconds that Python takes to come to the command."""
WRITING = 2.4
"""Seconds kept for drawing and writing the report, and for ending."""
COMMANDS = 1.6
"""Seconds kept for running the recommended command and the deck's own."""


@click.command()
@click.argument("deck", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=Folder(path_type=Path), metavar="DIR",
              help="Folder of the report (default: studies/<deck's name>).")  # fmt: skip
@click.option("--dt", "steps", type=Number(min=0.0, min_open=True), multiple=True,
              metavar="S", help="Step size in seconds; repeat for more (default: chosen so that "
              "the errors span 1e-2 to 1e-10 where they can).")  # fmt: skip
@click.option("--scheme", "schemes", type=click.Choice(choices()), multiple=True,
              help="Scheme to study; repeat for more (default: all).")  # fmt: skip
@click.option("--budget", type=Number(min=1.0), default=10.0, show_default=True,
              metavar="S", help="Time in seconds that the study may take where it chooses the "
              "steps; compiling is not counted.")  # fmt: skip
@click.option("--reference", default="auto", show_default=True, metavar="KIND",
              help="True values: 'exact' (closed form), 'independent' (another integrator), the "
              "folder of a run, or 'auto': exact if there is a closed form, else independent, else "
              "msahl's own runs at small steps.")  # fmt: skip
@click.option("--repeat", type=click.IntRange(min=1), metavar="N",
              help="Run each case N times and take the least time (default: 3 with --dt, else as "
              "often as there is time for).")  # fmt: skip
@click.option("--target", type=Number(min=0.0, min_open=True), default=1e-6,
              show_default=True,
              help="Largest error allowed, in the unit of --metric.")  # fmt: skip
@click.option("--metric", type=click.Choice(METRIC_KEYS), default="position",
              show_default=True, help="Error that the target limits.")  # fmt: skip
@click.option(
    "--t-final", type=Number(), metavar="S", help="End [s], instead of the deck's tFinal."
)
def study(
    deck: Path,
    output: Path | None,
    steps: tuple[float, ...],
    schemes: tuple[str, ...],
    reference: str,
    budget: float,
    repeat: int | None,
    target: float,
    metric: str,
    t_final: float | None,
) -> None:
    """Run DECK with many schemes and steps, and recommend the fastest run for a given error.

    Writes study.html, study.md with its pictures, and study.csv: the error against true values and
    the time of each run.

    Example: msahl study decks/thesis/double_pendulum_89.xml --target 1e-4
    """
    entered = time.perf_counter()
    from msahl.deck import DeckError, check_simulation, read_deck
    from msahl.jit.compiled import working_clock
    from msahl.results.read import ResultError
    from msahl.start.velocities import StartError
    from msahl.study.plan import Plan
    from msahl.study.report import recommendation, write_study
    from msahl.study.study import find_reference
    from msahl.study.study import study as run_study

    folder = output or Path("studies") / deck.stem
    try:
        model = read_deck(deck)
        dt = model.simulation.dt
        if t_final is not None:
            model = replace(model, simulation=replace(model.simulation, t_final=t_final))
        given = [replace(model.simulation, dt=step) for step in steps or (dt,)]
        faults = [fault for simulation in given for fault in check_simulation(simulation)]
        if faults:
            raise ResultError("\n".join(faults))
        if steps and set(schemes) == {AUTO}:
            raise ResultError(f"--dt: the scheme {AUTO} chooses its steps; name another --scheme")
        plan = Plan(model, steps, schemes, reference, repeat, target, metric, budget)
        folder.mkdir(parents=True, exist_ok=True)  # what cannot be written is told before the work
        began = working_clock() - (time.perf_counter() - entered) - START
        until = began + budget - WRITING
        with stoppable() as stopped, _shown(deck, began, budget) as (tell, progress):
            progress("reference")
            known = find_reference(plan)
            result = run_study(plan, progress, stopped, known, tell, until - COMMANDS)
            result = replace(result, deck=str(deck), given_end=t_final)
            _time_commands(result, stopped, until, progress)
    except DeckError as error:
        _stop("\n".join(map(str, error.faults)))
    except ResultError as error:
        _stop(f"msahl study: {error}")
    except StartError as error:
        _stop(f"{shown_path(deck)}: {error}")
    except OSError as error:
        _stop(_unwritten(error, folder))
    if not result.runs:
        echo(f"{shown_path(deck)}: stopped before a run had ended; nothing was written", err=True)
        sys.exit(128 + stopped.signal)
    try:
        for path in write_study(result, folder):
            echo(str(path))
    except OSError as error:
        _stop(_unwritten(error, folder), NOT_WRITTEN)
    echo(f"{shown_path(deck)}: {recommendation(result)}", err=True)
    if stopped.signal:
        echo(f"{shown_path(deck)}: stopped; the report is of the runs made until then", err=True)
        sys.exit(128 + stopped.signal)
    if not any(point.trial.completed for point in result.runs):
        sys.exit(NOT_CONVERGED)


def _time_commands(
    result: "Study", stopped: Callable[[], bool], until: float, progress: Callable[[str], Any]
) -> None:
    """Run the recommended command and the deck's own, and note what they took."""
    from msahl.jit.compiled import working_clock
    from msahl.study.command import command_arguments, run_command

    for point in (result.fastest, result.deck_run):
        if point is None or stopped() or result.plan.steps:
            continue
        words = command_arguments(point.trial.case, result.plan, result.deck, result.given_end)
        progress("the command itself")
        seconds = until - working_clock()
        made = run_command(words, point.trial.case, result.plan, result.reference, seconds)
        if made is not None:
            result.commands[point.trial.case] = made


def _stop(message: str, status: int = BAD_INPUT) -> NoReturn:
    echo(message, err=True)
    sys.exit(status)


def _unwritten(error: OSError, folder: Path) -> str:
    where = error.filename or folder
    return f"{where}: {error.strerror or error}; make room there, or choose another folder with -o"


@contextmanager
def _shown(
    deck: Path, began: float, budget: float
) -> Iterator[tuple[Callable[[str], Any], Callable[[str], Any]]]:
    """Where to tell of finished curves, and of each run: a bar of the time on a terminal, elsewhere
    lines.
    """
    from msahl.jit.compiled import STOPWATCH, working_clock

    def tell(line: str) -> None:
        echo(f"{shown_path(deck)}: {line}", err=True)

    def compiling() -> None:
        if not told:
            told.append(True)
            tell("compiling kernels for this kind of model (once; this may take minutes)")

    told: list[bool] = []
    STOPWATCH.tell = compiling
    try:
        if not sys.stderr.isatty():
            yield tell, lambda words: None
            return
        bar: Any = click.progressbar(
            length=round(10 * budget),
            label="studying",
            file=sys.stderr,
            item_show_func=lambda words: words or "",
            show_eta=False,
        )

        def progress(words: str) -> None:
            bar.update(round(10 * (working_clock() - began)) - bar.pos, words)

        with bar:
            yield lambda line: None, progress
    finally:
        STOPWATCH.tell = lambda: None
