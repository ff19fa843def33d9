"""Implement the subcommands that draw: plot and report."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.post.commands.shared import path_parameter, picture_formats, print_note, read_metrics
from msahl.printable import printable
from msahl.terminal import echo, writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from msahl.post.run_graphs import Choice
    from msahl.results.read import Run

KINDS = (
    *("linkage", "path", "path3d", "drives", "signals", "markers", "groups", "amplitudes"),
    *("joints", "positions", "reactions", "energy", "error", "constraints", "work"),
)
PLANES = ("xy", "xz", "yz", "yx", "zx", "zy")


@click.command(short_help="Draw figures of one run or of several.")
@click.argument("words", metavar="RUN... [KIND]...", nargs=-1, required=True)
@click.option(
    "--columns",
    multiple=True,
    metavar="GLOB,...",
    help="Draw the columns of any table that match, such as 'Crank.*', against time; may be "
    "repeated.",
)
@click.option(
    "--phase",
    "phases",
    nargs=2,
    multiple=True,
    metavar="A B",
    help="Draw column B over column A; may be repeated.",
)
@click.option(
    "--plane",
    type=click.Choice(PLANES),
    default=None,
    help="Draw linkage and path in this plane (default: the one that shows most of the motion).",
)
@click.option(
    "--body", "bodies", multiple=True, metavar="NAME", help="Draw only this body; may be repeated."
)
@click.option(
    "--joint",
    "joints",
    multiple=True,
    metavar="NAME",
    help="Draw only this joint, coupling or motion; may be repeated.",
)
@picture_formats
@path_parameter(
    "-o", "--output", metavar="DIR", help="Write the figures to DIR (default: RUN/plots)."
)
def plot(words: tuple[str, ...], output: Path | None, forms: tuple[str, ...], **given: Any) -> None:
    """Draw figures of one run, or compare several; print the files written.

    KIND is linkage (the bodies at a few instants), path, path3d, drives (loads that produce a given
    motion), signals (and loads of actuators), markers, groups, joints, positions, reactions,
    energy, error, constraints or work. Without a KIND, --columns and --phase, all kinds for which
    RUN has data are drawn. Several runs share --columns, --phase, path and path3d.

    \b
    Examples:
        msahl-post plot results/top_1 path --plane xy --format svg
        msahl-post plot results/four_bar --columns 'Crank.v*,Rocker.w*'
        msahl-post plot results/four_bar --phase Crank.x Crank.vx
        msahl-post plot results/coarse results/fine --columns 'Bob.x'
    """
    from msahl.jit.announced import announced
    from msahl.post.draw import save, style
    from msahl.post.run_graphs import Choice
    from msahl.post.summary import partial_note
    from msahl.results.read import read_run

    folders, kinds = _sort(words)
    runs = [read_run(folder) for folder in folders]
    for run in runs:
        print_note(run, partial_note(run))
    choice = Choice(given["plane"] or "", given["bodies"], given["joints"])
    place = output or folders[0] / "plots"
    with style(), announced(True), writing(place):
        drawn = _drawn(runs, kinds, choice, given["columns"], given["phases"])
        paths = save(drawn, forms, place)
    for path in paths:
        echo(str(path))


def _sort(words: Sequence[str]) -> tuple[list[Path], list[str]]:
    """Return the folders of runs, and the kinds of pictures, among the words of the command; the
    first word is a folder.
    """
    folders, kinds = [Path(words[0])], []
    for word in words[1:]:
        if word in KINDS:
            kinds.append(word)
        elif Path(word).exists():
            folders.append(Path(word))
        else:
            listed = ", ".join(KINDS)
            message = f"'{printable(word)}' is neither a folder nor a kind of picture ({listed})"
            raise click.BadParameter(message, param_hint="RUN... [KIND]...")
    return folders, kinds


def _drawn(
    runs: Sequence["Run"],
    kinds: Sequence[str],
    choice: "Choice",
    columns: Sequence[str],
    phases: Sequence[tuple[str, str]],
) -> Iterator[tuple[str, "Figure"]]:
    """Yield name and figure of all that was asked for."""
    from msahl.post.figures import comparisons, figures
    from msahl.post.histories import histories, phase
    from msahl.post.metrics import compute_metrics

    if columns:
        yield histories(runs, columns)
    for k, (abscissa, ordinate) in enumerate(phases):
        name, figure = phase(runs, abscissa, ordinate)
        yield f"{name}-{k + 1}" if k else name, figure
    if (columns or phases) and not kinds:
        return
    if len(runs) > 1:
        yield from comparisons(runs, choice, kinds)
    else:
        yield from figures(runs[0], compute_metrics(runs[0]), choice, kinds)


@click.command()
@path_parameter("run", metavar="RUN")
@path_parameter(
    "-o", "--output", metavar="DIR", help="Write the report to DIR (default: RUN/report)."
)
def report(run: Path, output: Path | None) -> None:
    """Write a report on a run.

    report.html is a page in one file: verdict, motion in three dimensions, graphs of what the deck
    defines (loads of actuators, signals, markers), of joint coordinates, positions, reactions and
    energies, accuracy; open it in a browser. report.md has the
    same figures as text, with its pictures beside it, for terminals and logs. Prints both paths.

    Example: msahl-post report results/double_pendulum_89
    """
    from msahl.post.run_report import write_report

    ((_, metrics),), (read,) = read_metrics((run,))
    place = output or run / "report"
    with writing(place):
        paths = write_report(read, metrics, place)
    for path in paths:
        echo(str(path))
