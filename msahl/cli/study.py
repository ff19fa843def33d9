"""The command ``msahl study``: compare schemes and step sizes on a deck."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.cli.console import NOT_CONVERGED, OTHER_FOLDER, say, stop, writing
from msahl.cli.decks import model_to_run
from msahl.cli.interruption import Interruption, stoppable
from msahl.cli.options import DECK, NumberType, output_option, set_option
from msahl.model.scheme import AUTO, choices
from msahl.printable import shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.study.plan import Plan
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


SPACE = f"free some disk space, or {OTHER_FOLDER}"
"""Remedy for results that cannot be written."""
START_SECONDS = 0.2
"""Time that Python takes to start the command [s]."""
WRITING_SECONDS = 2.4
"""Time reserved for drawing and writing the report, and for ending [s]."""
COMMAND_SECONDS = 1.6
"""Time reserved for running the recommended command and the deck's own [s]."""


@click.command(short_help="Compare schemes and step sizes on a deck.")
@click.argument("deck", type=DECK)
@output_option("studies/<deck's name>")
@click.option("--dt", "steps", type=NumberType(min=0.0, min_open=True), multiple=True,
              metavar="S", help="Study this step size in seconds; repeat for more (default: chosen "
              "so that the errors cover 1e-2 to 1e-10 where they can).")  # fmt: skip
@click.option("--scheme", "schemes", type=click.Choice(choices()), multiple=True,
              help="Study this scheme; repeat for more (default: all but rk4, rk8).")  # fmt: skip
@click.option("--budget", type=NumberType(min=1.0), default=10.0, show_default=True,
              metavar="S", help="Set the seconds that the study may compute where it chooses the "
              "step sizes: compiling is not counted, nor the time of other programs.")  # fmt: skip
@click.option("--reference", default="auto", show_default=True, metavar="KIND",
              help="Choose the true values: 'independent' (another integrator), the folder of a "
              "run, or 'auto': independent or, where that takes too long, msahl's own runs with "
              "small steps.")  # fmt: skip
@click.option("--repeat", "repeats", type=click.IntRange(min=1), metavar="N",
              help="Run each case N times and take the shortest time (default: 3 with --dt, else "
              "as often as there is time for).")  # fmt: skip
@click.option("--target", type=NumberType(min=0.0, min_open=True), default=1e-6,
              show_default=True, help="Set the largest error allowed, in the unit of "
              "--metric.")  # fmt: skip
@click.option("--metric", type=click.Choice(METRIC_KEYS),
              help="Choose the error that the target limits (default: position, or orientation "
              "where no body's reference point moves).")  # fmt: skip
@click.option("--t-final", type=NumberType(), metavar="S",
              help="Set the end of the runs in seconds (default: tFinal of the deck).")  # fmt: skip
@click.option("--over", type=click.Choice(["elements"]),
              help="Study the error in space instead: run with once, twice and four times the "
              "elements of each beam, at the deck's step size, and extrapolate.")  # fmt: skip
@set_option
def study(deck: Path, output: Path | None, **given: Any) -> None:
    """Run DECK with many schemes and step sizes, and recommend the fastest run for a given error.

    Writes study.html, study.md with its pictures, and study.csv: the error against true values and
    the time of each run.

    Example: msahl study decks/thesis/double_pendulum_89.xml --target 1e-4
    """
    entered = time.thread_time()
    from msahl.deck import DeckError
    from msahl.results.read import ResultError
    from msahl.start.velocities import StartError

    over = given.pop("over")
    if over:
        _study_elements(deck, given, output)
        return
    folder = output or Path("studies") / deck.stem
    try:
        with writing(folder, SPACE):
            plan = _plan(deck, given)
            folder.mkdir(parents=True, exist_ok=True)  # reports a fault before the work is done
            result, stopped = _carry_out(plan, deck, given, entered)
    except DeckError as error:
        stop("\n".join(map(str, error.faults)))
    except ResultError as error:
        stop(f"msahl study: {error}")
    except StartError as error:
        stop(f"{shown_path(deck)}: {error}")
    _write(result, stopped, deck, folder)


def _study_elements(deck: Path, given: dict[str, Any], output: Path | None) -> None:
    """Print the error in space of a deck's beams; end the program with its status."""
    from msahl.deck import DeckError
    from msahl.deck.source import Source
    from msahl.model import Model
    from msahl.results.read import ResultError
    from msahl.start.velocities import StartError
    from msahl.study.elements import space_error

    unused = [name for name in ("steps", "schemes", "repeats") if given[name]]
    if unused or output is not None:
        stop("--over elements runs the deck as it is: omit -o, --dt, --scheme and --repeat")

    def prepared(model: Model) -> Model:
        end = given["t_final"]
        simulation = model.simulation
        simulation = simulation if end is None else replace(simulation, t_final=end)
        return replace(model, simulation=simulation, stops=())

    def tell(words: str) -> None:
        echo(f"{shown_path(deck)}: {words}", err=True)

    try:
        found = space_error(Source.of_file(deck), given["settings"], prepared, tell)
    except DeckError as error:
        stop("\n".join(map(str, error.faults)))
    except (ResultError, StartError) as error:
        stop(f"msahl study: {error}")
    for line in found.lines():
        echo(line)


def _plan(deck: Path, given: dict[str, Any]) -> "Plan":
    """The plan of the study; raises ``ResultError`` if the options do not fit together."""
    from msahl.deck import check_simulation
    from msahl.results.read import ResultError
    from msahl.study.plan import Plan

    model, steps = model_to_run(deck, {}, given["settings"]), given["steps"]
    model = replace(model, stops=())  # runs that are compared have the same end
    if given["t_final"] is not None:
        model = replace(model, simulation=replace(model.simulation, t_final=given["t_final"]))
    cases = [replace(model.simulation, dt=step) for step in steps or (model.simulation.dt,)]
    faults = [fault for simulation in cases for fault in check_simulation(simulation)]
    if faults:
        raise ResultError("\n".join(faults))
    if steps and set(given["schemes"]) == {AUTO}:
        raise ResultError(
            f"--dt: the scheme {AUTO} chooses its step size; name another --scheme, or omit --dt"
        )
    names = ("steps", "schemes", "reference", "repeats", "target", "budget")
    metric = given["metric"] or Plan.metric
    return Plan(model, metric=metric, **{name: given[name] for name in names})


def _carry_out(
    plan: "Plan", deck: Path, given: dict[str, Any], entered: float
) -> "tuple[Study, Interruption]":
    """Make the runs; the command was called when this thread had computed for ``entered`` [s]."""
    from msahl.jit.compiled import working_clock
    from msahl.study.study import default_metric, find_reference
    from msahl.study.study import study as run_study

    began = working_clock() - (time.thread_time() - entered) - START_SECONDS
    until = began + plan.budget - WRITING_SECONDS
    with stoppable() as stopped, _shown(deck, plan.budget, began) as (tell, progress):
        progress("reference")
        known = find_reference(plan)
        if given["metric"] is None:
            plan = replace(plan, metric=default_metric(plan, known))
        result = run_study(plan, progress, stopped, known, tell, until - COMMAND_SECONDS)
        result = replace(
            result, deck=str(deck), given_end=given["t_final"], settings=given["settings"]
        )
        _time_commands(result, stopped, until, progress)
    return result, stopped


def _write(result: "Study", stopped: Interruption, deck: Path, folder: Path) -> None:
    """Write the report, and end the program with the status of the study."""
    from msahl.study.page import recommendation, write_study

    if not result.runs and not stopped.signal:
        stop(
            f"{shown_path(deck)}: the budget of {result.plan.budget:g} s was used up before a run "
            f"had ended; nothing was written. Try --budget {4.0 * result.plan.budget:g}",
            NOT_CONVERGED,
        )
    if not result.runs:
        say(f"{shown_path(deck)}: stopped before a run had ended; nothing was written")
        sys.exit(128 + stopped.signal)
    with writing(folder, SPACE):
        for path in write_study(result, folder):
            echo(str(path))
    say(f"{shown_path(deck)}: {recommendation(result)}")
    if stopped.signal:
        say(f"{shown_path(deck)}: stopped; the report contains the runs that had ended")
        sys.exit(128 + stopped.signal)
    if not any(point.trial.completed for point in result.runs):
        sys.exit(NOT_CONVERGED)


def _time_commands(
    result: "Study", stopped: Callable[[], bool], until: float, progress: Callable[[str], Any]
) -> None:
    """Run the recommended command and the deck's own, and record their times."""
    from msahl.jit.compiled import working_clock
    from msahl.study.command import run_command

    # The commands are not computed here: a clock of this thread stops meanwhile.
    deadline = time.perf_counter() + until - working_clock()
    for point in (result.fastest, result.deck_run):
        if point is None or stopped() or result.plan.steps:
            continue
        words = result.command(point.trial.case)
        progress("the command itself")
        seconds = deadline - time.perf_counter()
        made = run_command(words, point.trial.case, result.plan, result.reference, seconds)
        if made is not None:
            result.commands[point.trial.case] = made


@contextmanager
def _shown(
    deck: Path, budget: float, began: float
) -> Iterator[tuple[Callable[[str], Any], Callable[[str], Any]]]:
    """Functions that report finished curves and each run: a progress bar of the time on a
    terminal, elsewhere lines.
    """
    from msahl.jit.announced import ProgressLines
    from msahl.jit.compiled import STOPWATCH, working_clock

    def tell(line: str) -> None:
        echo(f"{shown_path(deck)}: {line}", err=True)

    def compiling() -> None:
        if not announced:
            announced.append(True)
            tell("compiling kernels for this kind of model (once; this may take minutes)")

    announced: list[bool] = []
    STOPWATCH.tell = compiling
    try:
        if not sys.stderr.isatty():
            STOPWATCH.listen = ProgressLines()
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
        STOPWATCH.tell, STOPWATCH.listen = (lambda: None), (lambda progress: None)
