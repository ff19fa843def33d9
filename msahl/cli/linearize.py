"""The command ``msahl linearize``: a deck's model as matrices A, B, C, D."""

from pathlib import Path
from typing import Any

import click

from msahl.cli.compiling import computing
from msahl.cli.console import print_report, writing
from msahl.cli.decks import model_to_run
from msahl.cli.options import DECK, at_option, quiet_option, set_option


@click.command(short_help="Linearise a deck's model for control.")
@click.argument("deck", type=DECK)
@click.option(
    "--input",
    "inputs",
    multiple=True,
    metavar="NAME",
    help="Take as input an actuator, load, motion, signal or auxiliary state of the deck, a load "
    "along JOINT.COORDINATE, or a force MARKER.Fx; repeat for more.",
)
@click.option(
    "--output",
    "outputs",
    multiple=True,
    metavar="COLUMN",
    help="Take as output a column of the tables of results, such as Tip.z; repeat for more.",
)
@at_option
@click.option(
    "--states",
    type=click.Choice(("coordinates", "nullspace")),
    default="coordinates",
    help="Choose as states coordinates of joints and bodies with their rates, or an orthonormal "
    "basis of all motions (default: coordinates).",
)
@click.option(
    "-o",
    "file",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write matrices, names, units and values to this file: .npz, .mat or .json.",
)
@set_option
@quiet_option
def linearize(
    deck: Path,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    file: Path | None,
    settings: tuple[str, ...],
    quiet: bool,
    **wanted: Any,
) -> None:
    """Compute the matrices of DECK's model, x' = A x + B w and y = C x + D w, at a point.

    x, w and y are changes of states, inputs and outputs from their values there. The states are as
    few as the joints allow (closed loops, redundant and non-holonomic joints), with auxiliary ones.
    Prints poles and steady gains, and how well the matrices agree with differences of the nonlinear
    equations. Warns if the point is neither an equilibrium nor a steady motion.

    Example: msahl linearize decks/machines/cart_pole.xml --input Motor --output Slide.slide
    """
    model = model_to_run(deck, {}, settings)
    from msahl.analysis.equilibria.at import point_at
    from msahl.analysis.linear_models.files import check_suffix
    from msahl.analysis.linear_models.linearize import linearize as linearized
    from msahl.analysis.linear_models.model_lines import report

    with computing(deck, quiet):
        if file is not None:
            check_suffix(file)
        found = linearized(point_at(model, wanted["at"]), inputs, outputs, wanted["states"])
    print_report(lambda: report(found), found.warnings, quiet)
    if file is not None:
        with writing(file):
            file.parent.mkdir(parents=True, exist_ok=True)
            found.save(file)
