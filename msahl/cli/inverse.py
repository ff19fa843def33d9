"""The command ``msahl inverse``: the loads that produce a given motion."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.cli.compiling import computing
from msahl.cli.console import BAD_VERDICT, OTHER_FOLDER, say, stop, writing
from msahl.cli.decks import job_of
from msahl.cli.options import DECK, NumberType, output_option, quiet_option, set_option
from msahl.cli.progress import progress
from msahl.printable import printable, shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.api.inverse import InverseResult

FAIL = "FAIL"
TABLE = click.Path(path_type=Path)


@click.command(short_help="Compute the loads that produce a given motion.")
@click.argument("deck", type=DECK)
@click.option(
    "--motion",
    type=TABLE,
    required=True,
    metavar="TABLE",
    help="Follow the motion in this CSV table, with columns of joints.csv, markers.csv or "
    "states.csv, or in this folder of a run.",
)
@click.option(
    "--map",
    "columns",
    multiple=True,
    metavar="COLUMN=COORDINATE:UNIT",
    help="Take a column of the table as this coordinate in this unit, such as q1=Elbow.angle:deg; "
    "several separated by commas, or repeated (default: columns are named as those of a run, with "
    "their unit behind them if it is not SI: 'Elbow.angle [deg]').",
)
@click.option(
    "--loads",
    multiple=True,
    metavar="NAME,NAME",
    help="Compute the loads of these drives: actuators and prescribed motions of the deck by name, "
    "or ideal motors at coordinates of joints, such as Elbow.angle; may be repeated (default: all "
    "actuators and prescribed motions, or, without any, motors at the coordinates of the table).",
)
@click.option(
    "--weight",
    "weights",
    multiple=True,
    metavar="NAME=W",
    help="If loads are not unique, give a drive this weight in the least sum of squares; repeat "
    "for more (default: 1).",
)
@click.option(
    "--smooth",
    type=NumberType(0.0, min_open=True),
    metavar="NOISE",
    help="Smooth the table, whose values have noise of this standard deviation in m or rad "
    "(default: splines pass through all values).",
)
@click.option(
    "--companion",
    type=TABLE,
    metavar="TABLE",
    help="Add to the error bars how far the loads of this table differ, which has the same motion "
    "with other errors: of a run with another step, or of another measurement (default: none, "
    "or the error that the run in --motion estimated).",
)
@output_option("none; nothing is written")
@set_option
@quiet_option
def inverse(
    deck: Path,
    motion: Path,
    output: Path | None,
    settings: tuple[str, ...],
    quiet: bool,
    **wanted: Any,
) -> None:
    """Compute the loads of drives that produce a given motion of the model of DECK.

    The motion may contain as many coordinates as determine all bodies, with closed loops, or more.
    The laws of the drives in the deck do not count; all other forces do. Reports each load with its
    error bar, power and work, and whether it is unique. With -o, writes drives.csv and the tables
    of a run, for msahl-post. Exits with status 1 if the verdict is FAIL.

    Example: msahl inverse decks/machines/robot.xml --motion results/robot
    """
    _require_other_folder(output, motion, wanted["companion"])
    result = _result(deck, settings, motion, quiet, wanted)
    if not quiet:
        echo("\n".join(printable(line) for line in result.lines))
    elif result.reasons:
        say("\n".join(printable(reason) for reason in result.reasons))
    if output is not None:
        with writing(output, OTHER_FOLDER):
            result.write(output)
    if result.verdict == FAIL:
        sys.exit(BAD_VERDICT)


def _result(
    deck: Path, settings: tuple[str, ...], motion: Path, quiet: bool, wanted: Mapping[str, Any]
) -> "InverseResult":
    """Return the loads; faults end the program."""
    job = job_of(deck, {}, settings)
    from msahl.analysis.inverse.columns import mapping_of
    from msahl.api.inverse import Wanted, loads_of

    names = [name.strip() for text in wanted["loads"] for name in text.split(",") if name.strip()]
    weights, noise = _weights(wanted["weights"]), wanted["smooth"] or 0.0
    with computing(deck, quiet), progress(not quiet, "inverse") as show:
        columns = mapping_of(wanted["columns"])
        asked = Wanted(motion, names, weights, noise, wanted["companion"], columns)
        return loads_of(job, asked, show)


def _weights(texts: tuple[str, ...]) -> dict[str, float]:
    """Return the weights by the drives' names; a fault ends the program."""
    found = {}
    for text in texts:
        name, _, number = text.rpartition("=")
        try:
            found[name.strip()] = float(number)
        except ValueError:
            stop(f"--weight {printable(text)}: give a name and a number, such as Motor=2")
    return found


def _require_other_folder(output: Path | None, *given: Path | None) -> None:
    """End the program if the results would replace the run that has the motion."""
    for path in given:
        if output is not None and path is not None and output.resolve() == path.resolve():
            stop(f"-o {shown_path(output)}: it holds the motion; name another folder")
