"""The command ``msahl export``: results and models for other programs."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from msahl.cli.compiling import computing
from msahl.cli.console import OTHER_FOLDER, say, stop, writing
from msahl.cli.options import (
    DECK,
    NumberType,
    click_option,
    output_option,
    quiet_option,
    set_option,
)
from msahl.printable import shown_path
from msahl.run.options import OPTIONS

FORMATS = ("nastran", "abaqus")


@click.group(short_help="Write loads of a run, or a model, for other programs.")
def export() -> None:
    """Write results or models for other programs.

    Example: msahl export loads results/arm
    """


@export.command(short_help="Write the loads of bodies for finite elements.")
@click.argument("run", type=click.Path(path_type=Path))
@output_option("RUN/loads")
@click.option(
    "--at",
    "times",
    multiple=True,
    type=NumberType(),
    metavar="S",
    help="Write the loads at the output time nearest to S seconds; repeat for more (default: where "
    "the force or the moment of a joint is the largest).",
)
@click.option("--all", "everything", is_flag=True, help="Write the loads at all output times.")
@click.option(
    "--cards",
    "formats",
    multiple=True,
    type=click.Choice(FORMATS),
    help="Write load cards for this program as well; those of abaqus are for CalculiX, too; repeat "
    "for both.",
)
@quiet_option
def loads(
    run: Path,
    output: Path | None,
    times: tuple[float, ...],
    everything: bool,
    formats: tuple[str, ...],
    quiet: bool,
) -> None:
    """Write the loads of every body of RUN: reactions, applied loads, gravity and inertia loads.

    Forces and moments are in the axes of their body, and in balance.

    Example: msahl export loads results/arm --cards nastran
    """
    from msahl.post.loads.export import instants_of, texts, write_loads
    from msahl.results.read import read_run

    if times and everything:
        raise click.UsageError("--at and --all exclude each other; give one of them")
    with computing(run, quiet):
        found = read_run(run)
        instants = instants_of(found, times, everything)
    folder = output or run / "loads"
    files = texts(found, instants, formats)
    with writing(folder, OTHER_FOLDER):
        write_loads(folder, files)
    if not quiet:
        shown = ", ".join(f"{instant.time:g}" for instant in instants[:10])
        more = ", ..." if len(instants) > 10 else ""
        say(f"{shown_path(folder)}: {len(files)} files, loads at {shown}{more} s")


def stepping_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of a run that decide on its steps, and not on what is known of its error."""
    for option in reversed(OPTIONS):
        if option.name not in ("tolerance", "error", "accuracy", "every"):
            command = click_option(option)(command)
    return command


@export.command("fmu", short_help="Write a deck as an FMU for co-simulation.")
@click.argument("deck", type=DECK)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the FMU to this file (default: DECK.fmu, in the current folder).",
)
@click.option(
    "--fmi",
    "version",
    type=click.Choice(("2", "3")),
    default="2",
    help="Choose FMI 2.0 or 3.0 (default: 2).",
)
@set_option
@stepping_options
@quiet_option
def export_fmu(
    deck: Path,
    output: Path | None,
    version: str,
    settings: tuple[str, ...],
    quiet: bool,
    **given: Any,
) -> None:
    """Write DECK as an FMU for co-simulation, which another program advances.

    Its inputs are the deck's inputs, its parameters those of the deck and the numbers of loads, its
    outputs the columns of all tables. It needs a Python with msahl where it runs.

    Example: msahl export fmu cart.xml --fmi 3
    """
    from msahl.api.model import load
    from msahl.deck import DeckError
    from msahl.fmu.export import fmu

    changes: Any = {name: value for name, _, value in (each.partition("=") for each in settings)}
    options: Any = {name: value for name, value in given.items() if value is not None}
    try:
        model = load(deck, **changes)
    except DeckError as error:
        stop(str(error))
    with computing(deck, quiet):
        written = fmu(model, options, deck.stem, version)
    target = output or Path(f"{deck.stem}.fmu")
    with writing(target, "choose another file with -o"):
        target.write_bytes(written)
    if not quiet:
        say(f"{shown_path(target)}: FMI {version}.0 for co-simulation, {len(written) / 1e6:.1f} MB")
