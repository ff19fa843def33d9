"""Implement the subcommand ``msahl-post modes``: diagrams of modes over a parameter."""

from pathlib import Path

import click

from msahl.post.commands.shared import path_parameter, picture_formats
from msahl.terminal import echo, writing


@click.command(short_help="Draw modes over a parameter (Campbell diagram).")
@picture_formats
@path_parameter("-o", "--output", metavar="DIR", help="Write to DIR (default: FOLDER).")
@path_parameter("folder", metavar="FOLDER")
def modes(folder: Path, forms: tuple[str, ...], output: Path | None) -> None:
    """Draw modes over a parameter: the Campbell diagram and the root locus.

    FOLDER is one that msahl modes --over has written. Writes the pictures and campbell.html, a page
    in one file with both, the critical values and the modes; prints the paths.

    Example: msahl-post modes results/rotor
    """
    from msahl.post.campbell import read_diagram, write_diagram

    diagram, place = read_diagram(folder), output or folder
    with writing(place):
        paths = write_diagram(diagram, place, forms)
    for path in paths:
        echo(str(path))
