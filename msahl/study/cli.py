"""The command ``msahl study``; ``msahl.cli`` loads it when it is asked for."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from msahl.cli import BAD_INPUT, NOT_CONVERGED, NOT_WRITTEN, Folder, Number, stoppable
from msahl.printable import shown_path
from msahl.schemes import AUTO, choices
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.study.study import Plan

MEASURE_KEYS = (
    "position",
    "orientation",
    "velocity",
    "spin",
    "mean_reaction",
    "station_reaction",
    "energy_over_kinetic",
)


STEPPED = tuple(scheme for scheme in choices() if scheme != AUTO)
"""Schemes whose step is given."""


@click.command()
@click.argument("deck", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=Folder(path_type=Path), metavar="DIR",
              help="Folder of the report (default: studies/<deck's name>).")  # fmt: skip
@click.option("--dt", "steps", type=Number(min=0.0, min_open=True), multiple=True,
              metavar="S", help="Step [s]; repeat for more (default: 0.1 0.04 0.01 0.004 0.002 "
              "0.001 0.0004, or eight times to an eighth of the deck's).")  # fmt: skip
@click.option("--scheme", "schemes", type=click.Choice(STEPPED), multiple=True,
              help="Repeat for more (default: those of order 2).")  # fmt: skip
@click.option("--reference", default="auto", show_default=True, metavar="KIND",
              help="True values: 'exact' (closed form), 'independent' (another integrator), 'auto' "
              "(the first of these there is), or the folder of a run.")  # fmt: skip
@click.option("--repeat", type=click.IntRange(min=1), default=3, show_default=True, metavar="N",
              help="Runs of each case; their median counts.")  # fmt: skip
@click.option("--target", type=Number(min=0.0, min_open=True), default=1e-6,
              show_default=True, help="Largest error wanted, in the measure's unit.")  # fmt: skip
@click.option("--measure", type=click.Choice(MEASURE_KEYS), default="position",
              show_default=True, help="What the target is of.")  # fmt: skip
@click.option(
    "--t-final", type=Number(), metavar="S", help="End [s], instead of the deck's tFinal."
)
def study(
    deck: Path,
    output: Path | None,
    steps: tuple[float, ...],
    schemes: tuple[str, ...],
    reference: str,
    repeat: int,
    target: float,
    measure: str,
    t_final: float | None,
) -> None:
    """Say how wrong DECK is at each step, what that costs, and which run to choose.

    Writes study.csv, study.md with its pictures, and study.html.

    Example: msahl study decks/thesis/double_pendulum_89.xml --target 1e-4
    """
    from msahl.deck import DeckError, check_simulation, read_deck
    from msahl.results.read import ResultError
    from msahl.solve.initial import StartError
    from msahl.study.report import recommendation, write_study
    from msahl.study.runs import with_step
    from msahl.study.study import Plan, find_reference
    from msahl.study.study import study as carry_out

    folder = output or Path("studies") / deck.stem
    try:
        model = read_deck(deck)
        dt, end = model.simulation.dt, model.simulation.t_final
        model = with_step(model, dt, end if t_final is None else t_final)
        given = [with_step(model, step).simulation for step in steps or (dt,)]
        faults = [fault for simulation in given for fault in check_simulation(simulation)]
        if faults:
            raise ResultError("\n".join(faults))
        plan = Plan(model, steps, schemes, reference, repeat, target, measure)
        folder.mkdir(parents=True, exist_ok=True)  # what cannot be written is told before the work
        known = find_reference(plan)  # may take long, and is stopped at once
        with stoppable() as stopped, _progress(plan) as progress:
            result = carry_out(plan, progress, stopped, known)
    except DeckError as error:
        _stop("\n".join(map(str, error.faults)))
    except ResultError as error:
        _stop(f"msahl study: {error}")
    except StartError as error:
        _stop(f"{shown_path(deck)}: {error}")
    except OSError as error:
        _stop(_unwritten(error, folder))
    if not result.points:
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
    if not any(point.trial.completed for point in result.points):
        sys.exit(NOT_CONVERGED)


def _stop(message: str, status: int = BAD_INPUT) -> NoReturn:
    echo(message, err=True)
    sys.exit(status)


def _unwritten(error: OSError, folder: Path) -> str:
    where = error.filename or folder
    return f"{where}: {error.strerror or error}; make room there, or choose another folder with -o"


@contextmanager
def _progress(plan: "Plan") -> Iterator[Callable[[int], Any]]:
    """A bar of steps on a terminal, nothing elsewhere."""
    from msahl.study.study import planned_steps

    if not sys.stderr.isatty():
        yield lambda steps: None
        return
    bar: Any = click.progressbar(length=planned_steps(plan), label="studying", file=sys.stderr)
    with bar:
        yield bar.update
