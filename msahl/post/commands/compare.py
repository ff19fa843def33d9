"""Implement the subcommand ``msahl-post compare``: the numbers of two runs."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from msahl.post.commands.shared import DIFFERENT, path_parameter
from msahl.post.tolerance import ATOL, RTOL, Tolerance
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.post.compare import Comparison


@click.command()
@path_parameter("run", metavar="RUN")
@path_parameter("reference", metavar="REFERENCE")
@click.option(
    "--rtol",
    type=click.FloatRange(min=0),
    default=RTOL,
    show_default=True,
    help="Set the relative tolerance.",
)
@click.option(
    "--atol",
    type=click.FloatRange(min=0),
    default=ATOL,
    show_default=True,
    help="Set the absolute tolerance, in the unit of the column.",
)
@click.option(
    "--columns",
    metavar="GLOB,...",
    default="",
    help="Compare only columns that match a pattern, such as 'Bob.?,*.Fz'.",
)
@click.option("--until", type=float, metavar="T", help="Compare only times up to T in seconds.")
def compare(
    run: Path, reference: Path, rtol: float, atol: float, columns: str, until: float | None
) -> None:
    """Compare the numbers of two runs.

    RUN and REFERENCE are folders of runs, or CSV files. Values a of RUN and b of REFERENCE are
    equal if |a - b| <= atol + rtol |b|. They are matched by time; REFERENCE may have fewer output
    times than RUN, which agree within 1e-9 of the time span.

    Exit status: 0 equal, 1 different (the first and the worst difference are printed), 2 not
    comparable (different columns, or RUN lacks an output time).

    Example: msahl-post compare results/top_1 reference/top_1 --rtol 1e-7
    """
    from msahl.post.compare import compare as compare_tables

    if math.isnan(rtol) or math.isnan(atol):
        raise click.BadParameter("a tolerance must be a number")
    patterns = tuple(pattern.strip() for pattern in columns.split(",") if pattern.strip())
    found = compare_tables(run, reference, Tolerance(rtol, atol), patterns, until)
    for comparison in found:
        echo(_describe(comparison))
    if any(comparison.first for comparison in found):
        click.get_current_context().exit(DIFFERENT)


def _describe(comparison: "Comparison") -> str:
    extent = f"{comparison.rows} output times, {comparison.columns} columns"
    if comparison.first is None:
        return f"{comparison.name}: equal ({extent}, largest difference {comparison.largest:.3g})"
    return (
        f"{comparison.name}: different ({comparison.differing} numbers in {extent})\n"
        f"  first: {comparison.first}\n  worst: {comparison.worst}"
    )
