"""Implement the subcommand ``msahl-post export``: the motion of a run for other programs."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from msahl.post.commands.shared import path_parameter, tell_notes
from msahl.printable import shown_path
from msahl.terminal import echo, writing

if TYPE_CHECKING:
    from msahl.post.glb.exported_run import Exported


@click.command(short_help="Write the motion for other programs (glTF).")
@path_parameter("run", metavar="RUN")
@click.option("--glb", is_flag=True, help="Write animated glTF 2.0 in its binary form.")
@path_parameter("-o", "--output", metavar="FILE", help="Write to FILE (default: RUN/NAME.glb).")
def export(run: Path, glb: bool, output: Path | None) -> None:
    """Write the motion of a run for other programs; print the file written.

    A GLB file opens in Blender, PowerPoint, the viewers of Windows and macOS, and in web pages by
    <model-viewer>. It contains the shapes of all bodies and their motion at as many output times
    as are needed to interpolate between them; stderr says how exactly.

    Example: msahl-post export results/four_bar --glb
    """
    if not glb:
        raise click.UsageError("no format is given; add --glb")
    from msahl.post.glb.exported_run import export_run
    from msahl.results.write import replace_file

    made = export_run(run)
    path = output or run / f"{run.resolve().name}.glb"
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, made.data)
    tell_notes(run, made.notes)
    echo(f"{shown_path(path)}: {_exactness(made)}", err=True)
    echo(str(path))


def _exactness(made: "Exported") -> str:
    """Say how many poses the file has and how exact it is."""
    what = f"at most {made.keys} poses of each body, of {made.read} output times"
    if made.read < made.total:
        what += f" that were read of {made.total}"
    return (
        f"{what}; interpolated with an error of at most {made.position:.1e} m and "
        f"{made.orientation:.1e} rad at these"
    )
