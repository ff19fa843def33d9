"""The command ``msahl modes``: eigenvalues, frequencies, damping and mode shapes of a deck."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.cli.compiling import computing
from msahl.cli.console import print_report, say, writing
from msahl.cli.decks import model_to_run
from msahl.cli.options import DECK, NumberType, at_option, output_option, quiet_option, set_option
from msahl.printable import shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.analysis.linearised.point import Point
    from msahl.analysis.modes.solution import Modes


@click.command(short_help="Compute the modes of a deck's model.")
@click.argument("deck", type=DECK)
@output_option("none; nothing is written")
@set_option
@at_option
@click.option(
    "--number",
    type=click.IntRange(1),
    metavar="N",
    help="Compute the N modes nearest to zero, or to --near, besides those that are zero (default: "
    "all; of more than 100 bodies, or with beams, 10).",
)
@click.option(
    "--near",
    type=NumberType(0.0),
    metavar="HZ",
    default=0.0,
    help="Compute modes near this frequency in hertz (default: 0, the lowest).",
)
@click.option(
    "--method",
    type=click.Choice(("auto", "dense", "sparse")),
    default="auto",
    help="Choose dense or sparse matrices (default: auto, dense up to 100 bodies and without "
    "beams).",
)
@click.option(
    "--over",
    metavar="NAME=VALUES",
    help="Follow the modes over values of a parameter or number of the deck, such as v=0:10:41 "
    '(first:last:count), "L=60:100:5 cm" or k=1e3:1e6:7:log (a Campbell diagram).',
)
@click.option(
    "--order",
    "orders",
    type=NumberType(0.0, min_open=True),
    multiple=True,
    metavar="N",
    help="With --over a speed: find where a frequency is N times the speed; repeat for more "
    "(default: 1 if the values are angular velocities).",
)
@click.option(
    "--page",
    "has_page",
    is_flag=True,
    help="Also write modes.html into the folder of -o: the modes in motion, in three dimensions.",
)
@quiet_option
def modes(
    deck: Path,
    output: Path | None,
    settings: tuple[str, ...],
    at: "float | str",
    quiet: bool,
    **wanted: Any,
) -> None:
    """Compute eigenvalues, natural frequencies, damping ratios and mode shapes of DECK.

    The model is linearised at t = 0, at another time or at an equilibrium, with all joints (closed
    loops, redundant and non-holonomic ones), damping, gyroscopic terms and auxiliary states. Each
    eigenvalue has an error bar. Warns if the motion is neither an equilibrium nor steady. With -o,
    writes modes.csv and shapes.csv. With --over, modes are followed over a parameter, and critical
    values are found; -o writes campbell.csv and critical.csv, which msahl-post modes draws.

    \b
    Examples:
        msahl modes decks/mechanisms/bicycle.xml --set v=4
        msahl modes decks/mechanisms/rotor.xml --over speed=0:400:41 -o results/rotor
    """
    fault = _contradiction(output, wanted)
    if fault:
        raise click.UsageError(fault)
    if wanted["over"]:
        from msahl.cli.modes_over import modes_over

        modes_over(deck, output, settings, at, quiet, wanted)
        return
    model = model_to_run(deck, {}, settings)
    from msahl.analysis.equilibria.at import point_at
    from msahl.analysis.modes.files import write_modes
    from msahl.analysis.modes.mode_lines import report
    from msahl.analysis.modes.solution import modes as modes_of

    with computing(deck, quiet):
        point = point_at(model, at)
        found = modes_of(point, wanted["number"], wanted["near"], wanted["method"])
    print_report(lambda: report(point, found), found.warnings, quiet)
    if output is not None:
        with writing(output):
            write_modes(output, point, found)
        if wanted["has_page"]:
            _write_page(output, point, found, deck)


def _contradiction(output: Path | None, wanted: Mapping[str, Any]) -> str:
    """Return which options do not fit together; empty if all do."""
    if wanted["orders"] and not wanted["over"]:
        return "--order needs --over"
    if wanted["has_page"] and wanted["over"]:
        return "--page shows the modes at one value; omit --over"
    return "--page needs a folder: -o DIR" if wanted["has_page"] and output is None else ""


def _write_page(folder: Path, point: "Point", found: "Modes", deck: Path) -> None:
    """Write modes.html into the ``folder``, and print its path."""
    from msahl.post.view import viewer_page
    from msahl.post.view.modes import show_modes
    from msahl.results.write import replace_file

    path = folder / "modes.html"
    try:
        with writing(path):
            replace_file(path, viewer_page([show_modes(point, found, deck)]).encode())
    except ValueError as error:
        say(f"{shown_path(deck)}: no page: {error}")
        return
    echo(shown_path(path))
