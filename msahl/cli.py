"""The command ``msahl``: arguments in, exit status out; the only place of the engine that prints.

Exit status: 0 good, 2 bad deck or usage, 3 a step did not converge, 130 interrupted. Modules are
imported where a command needs them, so that ``msahl check`` starts without a compiler.
"""

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

import click

import msahl
from msahl.schemes import DAMPING, choices, split

if TYPE_CHECKING:
    from msahl.model import Model
    from msahl.run import Report

BAD_INPUT, NOT_CONVERGED, INTERRUPTED = 2, 3, 130
STATUS = {"completed": 0, "not converged": NOT_CONVERGED, "interrupted": INTERRUPTED}

STARTED = time.perf_counter()
"""When this module was entered; what Python needs to come so far is not in our seconds."""

Deck = click.Path(path_type=Path)


ELSEWHERE = {"new": "msahl.templates", "study": "msahl.study.cli"}
"""Commands of other rooms, and the modules they are loaded from when asked for."""


class Commands(click.Group):
    """The group, with the commands of other rooms."""

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
        click.echo("\n".join(faults) if faults else f"{deck}: good", err=bool(faults))
    if faulty:
        sys.exit(BAD_INPUT)


@main.command()
@click.argument("deck", type=Deck)
def explain(deck: Path) -> None:
    """Say what running DECK takes: freedoms, unknowns, and what is left out and why.

    Example: msahl explain decks/thesis/double_pendulum_89.xml
    """
    model = _model_to_run(deck, {})
    from msahl.explain import explain as lines
    from msahl.solve.initial import StartError

    try:
        click.echo("\n".join(lines(model)))
    except StartError as error:
        _stop(f"{deck}: {error}")


@main.command()
@click.argument("deck", type=Deck)
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="DIR",
              help="Folder of the results (default: results/<deck's name>).")  # fmt: skip
@click.option("--dt", type=float, metavar="S", help="Step [s], instead of the deck's deltaT.")
@click.option("--t-final", type=float, metavar="S", help="End [s], instead of the deck's tFinal.")
@click.option("--scheme", type=click.Choice(choices()),
              help="'preserving' keeps the energy, 'decaying' takes it from vibrations quicker "
              "than the step; both of order 2. 'gauss1' to 'gauss5' are of order 2 to 10, with the "
              "energy nearly kept. Instead of the deck's; else preserving.")  # fmt: skip
@click.option("--damping", type=click.FloatRange(0.0, 1.0), metavar="D",
              help="Of 'decaying', how much of such a vibration a step takes, 0 to 1; instead of "
              f"the deck's; else {DAMPING:g}.")  # fmt: skip
@click.option("--solver", type=click.Choice(["auto", "newton", "root"]), default="auto",
              show_default=True, help="'newton' is compiled, 'root' is scipy.optimize.root, "
              "'auto' is newton with root for the first step and every hard one.")  # fmt: skip
@click.option("--every", type=click.IntRange(min=1), default=1, show_default=True, metavar="N",
              help="Write every Nth step (the last one always).")  # fmt: skip
@click.option("--reactions", type=click.Choice(["mean", "station"]),
              help="Reactions of a row: 'mean' over the step before it, or 'station', at its own "
              "time. Instead of the deck's; else mean.")  # fmt: skip
@click.option("--full", is_flag=True, help="Leave nothing out of the equations (see explain).")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but faults.")
@click.option("-v", "--verbose", is_flag=True, help="Say what every phase took.")
def run(
    deck: Path,
    output: Path | None,
    dt: float | None,
    t_final: float | None,
    scheme: str | None,
    damping: float | None,
    solver: str,
    every: int,
    reactions: str | None,
    full: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Run DECK and write its states and joint reactions.

    Writes states.csv, reactions.csv (if there are joints or motions), work.csv (if there are loads
    or motions), run.json and deck.xml, the deck as it ran. Tables end in .part until the run is
    whole.

    Example: msahl run decks/thesis/double_pendulum_89.xml --dt 0.01 -o results/coarse
    """
    name, degree = split(scheme) if scheme else (None, None)
    given: dict[str, Any] = {
        "dt": dt,
        "t_final": t_final,
        "scheme": name,
        "degree": degree,
        "damping": damping,
        "reactions": reactions,
    }
    model = _model_to_run(deck, given)
    from msahl.deck import effective_deck
    from msahl.run import Options

    options = Options(solver, every, full)
    folder = output or Path("results") / deck.stem
    from msahl.solve.initial import StartError

    try:
        text = effective_deck(deck, **given)
        report = _simulate(deck, text, model, options, folder, shown=not quiet)
    except OSError as error:
        where = error.filename or folder
        _stop(f"{where}: {error.strerror or error}; choose another folder with -o")
    except StartError as error:
        _stop(f"{deck}: {error}")
    _tell(deck, folder, report, quiet, verbose)
    sys.exit(STATUS[report.status])


class Interruption:
    """Whether the user asked to stop; a second request stops at once."""

    def __init__(self) -> None:
        self.signal = 0

    def __call__(self) -> bool:
        """Whether a stop was asked for."""
        return self.signal != 0

    def note(self, number: int, frame: FrameType | None) -> None:
        """Signal handler."""
        if self.signal:
            raise KeyboardInterrupt
        self.signal = number


def _stop(message: str) -> NoReturn:
    click.echo(message, err=True)
    sys.exit(BAD_INPUT)


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
    simulation = replace(model.simulation, **changes)
    faults = check_simulation(simulation)
    if faults:
        _stop("\n".join(f"msahl run: {fault}" for fault in faults))
    return replace(model, simulation=simulation)


def _simulate(
    deck: Path, text: bytes, model: "Model", options: Any, folder: Path, shown: bool
) -> "Report":
    from msahl.deck import deck_digest
    from msahl.model import decays, degree_of, reactions_of
    from msahl.results.write import RunFolder, write_json
    from msahl.run import run as simulate

    def tell(message: str) -> None:
        if shown:
            click.echo(message, err=True)

    with _stoppable() as stopped, RunFolder(folder, model, text) as results:
        with _progress(model, shown) as progress:
            report = simulate(model, options, results, progress, stopped, tell)
        results.whole = report.status == "completed"
        report.seconds["total"] = time.perf_counter() - STARTED
        content = {
            **_versions(),
            "deck": {"path": str(deck), "digest": deck_digest(text)},
            "options": {
                **({"degree": degree_of(model)} if degree_of(model) else {}),
                "dt": model.simulation.dt,
                "tFinal": model.simulation.t_final,
                "scheme": model.simulation.scheme,
                "damping": model.simulation.damping if decays(model) else 0.0,
                "solver": options.solver,
                "every": options.every,
                "full": options.full,
                "reactions": reactions_of(model),
            },
            **report.as_json(),
        }
        write_json(folder / "run.json", content)
    return report


@contextmanager
def _stoppable() -> Iterator[Interruption]:
    """Turn the first SIGINT or SIGTERM into a request that the loop honours between chunks."""
    interruption = Interruption()
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, interruption.note) for number in signals]
    try:
        yield interruption
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)


@contextmanager
def _progress(model: "Model", shown: bool) -> Iterator[Callable[[int, float], Any]]:
    """A bar of steps and simulated time on a terminal, nothing elsewhere."""
    if not shown or not sys.stderr.isatty():
        yield lambda steps, t: None
        return
    from msahl.run import Grid

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
    """The last lines on stderr: warnings, what went wrong, and how good the run is."""
    lines = [] if quiet else [f"{deck}: {warning}" for warning in report.warnings]
    if report.message:
        lines.append(f"{deck}: {report.message}")
    if verbose:
        lines += [f"{phase}: {seconds:.3f} s" for phase, seconds in report.seconds.items()]
        lines.append(
            f"{report.unknowns} unknowns in {report.islands} islands ({report.planar_islands} "
            f"planar), {report.iterations} iterations, {report.factorisations} factorisations, "
            f"{report.root_steps} steps by scipy, {report.halvings} halvings"
        )
    if not quiet:
        lines.append(f"{deck}: {_quality(report)} -> {folder}")
    if lines:
        click.echo("\n".join(lines), err=True)


def _quality(report: "Report") -> str:
    energy = report.extremes["energyErrorMaxRelative"]
    kept = "" if energy is None else f", energy kept to {energy:.1e} of the largest kinetic energy"
    gap = f", joints closed to {report.extremes['gapMax']:.1e} m" if report.joints else ""
    return f"{report.steps} steps to t = {report.time:g} s{kept}{gap}"
