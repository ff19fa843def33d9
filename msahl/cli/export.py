"""The command ``msahl export``: results for other programs."""

from pathlib import Path

import click

from msahl.cli.compiling import computing
from msahl.cli.console import OTHER_FOLDER, say, writing
from msahl.cli.options import NumberType, output_option, quiet_option
from msahl.printable import shown_path

FORMATS = ("nastran", "abaqus")


@click.group(short_help="Write loads of a run for other programs.")
def export() -> None:
    """Write results for other programs.

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
