"""Implement the subcommand ``msahl-post sweep``: tables, pictures and page of a sweep."""

from pathlib import Path

import click

from msahl.post.commands.shared import path_parameter, picture_formats, print_table, table_format
from msahl.printable import shown_path
from msahl.terminal import echo, writing

GOALS = ("min", "max")


@click.command(short_help="Evaluate a sweep: statistics and pictures.")
@table_format
@click.option(
    "--best",
    nargs=2,
    type=(str, click.Choice(GOALS)),
    metavar="MEASURE min|max",
    default=None,
    help="Print only the point at which MEASURE is least or largest.",
)
@picture_formats
@path_parameter(
    "-o", "--output", metavar="DIR", help="Write the page to DIR (default: FOLDER/report)."
)
@path_parameter("folder", metavar="FOLDER")
def sweep(
    folder: Path,
    best: tuple[str, str] | None,
    form: str | None,
    forms: tuple[str, ...],
    output: Path | None,
) -> None:
    """Evaluate a sweep: print its statistics, draw its pictures and write a page.

    FOLDER is one that msahl sweep has written. What is drawn follows from its plan: measures over
    one parameter, maps over two, histograms and Sobol indices of samples, scatter matrices, error
    over time of options. Points that failed are part of no statistic; all tables count them.
    With --csv or --json only the statistics are printed, and no files are written.

    \b
    Examples:
        msahl-post sweep sweeps/rod
        msahl-post sweep sweeps/rod --best "Tip.z max" min
    """
    from msahl.post.sweep import sweep_tables as tables
    from msahl.post.sweep.read import read_sweep

    read = read_sweep(folder)
    where = shown_path(folder)
    if best is not None:
        chosen, note = tables.best(read, read.measure(best[0]), best[1])
        if note:
            echo(f"{where}: {note}", err=True)
        print_table(chosen if form else chosen.transposed(), form)
        return
    echo(f"{where}: {tables.outcome(read)}", err=bool(form))
    print_table(tables.statistics_table(read), form)
    if form:
        return
    found = tables.all_indices(read)
    if found:
        echo("Sobol indices:")
        print_table(tables.indices_table(found), form)
    from msahl.post.sweep.sweep_page import write_sweep_page

    place = output or folder / "report"
    with writing(place):
        paths = write_sweep_page(read, found, place, forms)
    for path in paths:
        echo(str(path))
