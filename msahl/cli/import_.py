"""The command ``msahl import``: make a deck of a machine in another program's format."""

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.cli.console import say, stop, writing
from msahl.printable import printable, shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.importers import Imported, Note

KINDS = ("inertia", "not carried over", "changed")
"""Kinds of notes, in the order in which they are printed."""
AT = {"pose": "--at", "rates": "--rate"}
"""Options that give numbers of joints by name."""


@click.command("import", short_help="Make a deck of a URDF, SDF or MJCF file.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, allow_dash=True),
    metavar="DECK",
    help="Write this deck ('-': the terminal; default: FILE's name with _deck.xml).",
)
@click.option("--overwrite", is_flag=True, help="Replace the deck if it exists.")
@click.option(
    "--base",
    type=click.Choice(("fixed", "free")),
    default="fixed",
    help="Fix the roots of a URDF to the ground, or let them move (default: fixed).",
)
@click.option(
    "--keep-fixed",
    is_flag=True,
    help="Keep links with mass that are fixed to others as bodies on rigid joints "
    "(default: one body).",
)
@click.option(
    "--repair",
    is_flag=True,
    help="Replace impossible inertias by the nearest possible ones, and give moving "
    "links without mass a tiny one.",
)
@click.option(
    "--at",
    "pose",
    multiple=True,
    metavar="JOINT=VALUE",
    help="Start with this coordinate of a joint, in rad or m; repeat for more.",
)
@click.option(
    "--rate",
    "rates",
    multiple=True,
    metavar="JOINT=VALUE",
    help="Start with this rate of a joint, in rad/s or m/s; repeat for more.",
)
@click.option("--key", default="", metavar="NAME", help="Start at this keyframe of MJCF.")
@click.option(
    "--contacts",
    type=click.Choice(("all", "limits", "none")),
    default="all",
    help="Make stops of the limits of joints and contacts of shapes with planes, stops alone, or "
    "none of both (default: all).",
)
@click.option(
    "--restitution",
    type=click.FloatRange(0.0, 1.0),
    default=0.0,
    metavar="E",
    help="Set the coefficient of restitution of stops and contacts, from 0 to 1 (default: 0).",
)
@click.option(
    "--packages",
    multiple=True,
    metavar="DIR",
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    help="Look for meshes, packages and included files below this folder, too; repeat for more.",
)
@click.option(
    "--copy-meshes", is_flag=True, help="Copy meshes from elsewhere into a folder beside the deck."
)
@click.option("-q", "--quiet", is_flag=True, help="Print only faults.")
def import_(file: Path, output: str | None, overwrite: bool, quiet: bool, **given: Any) -> None:
    """Make a deck of FILE, in URDF, SDF or MJCF, and list what is not carried over, by element.

    Example: msahl import robot.urdf -o robot.xml
    """
    target = Path(f"{file.stem}_deck.xml" if output in (None, "-") else str(output))
    taken = output != "-" and target.exists()
    if taken and (not overwrite or (file.exists() and target.samefile(file))):
        stop(f"{shown_path(target)} exists; choose another file with -o, or --overwrite")
    found = _imported(file, target, given)
    if not quiet:
        _print_notes(found.notes, err=output == "-")
    if output == "-":
        click.echo(found.source.data, nl=False)
        return
    copies = {target.parent / name: mesh for name, mesh in found.copies.items()}
    for copy in () if overwrite else copies:
        if copy.exists():
            stop(f"{shown_path(copy)} exists; choose another deck with -o, or --overwrite")
    with writing(target, "choose another file with -o"):
        for copy, mesh in copies.items():
            copy.parent.mkdir(exist_ok=True)
            shutil.copyfile(mesh, copy)
        target.write_bytes(found.source.data)
    say(f"{shown_path(target)}: next, msahl run {shown_path(target)}")


def _imported(file: Path, target: Path, given: dict[str, Any]) -> "Imported":
    """The deck of a file; faults end the program."""
    from msahl.deck import DeckError
    from msahl.importers import ImportOptions, import_file

    given |= {name: _values(option, given[name]) for name, option in AT.items()}
    try:
        return import_file(file, ImportOptions(**given), target)
    except DeckError as error:
        stop(str(error))


def _values(option: str, words: Iterable[str]) -> dict[str, float]:
    """The values of joints by name that an option gives."""
    from msahl.importers.reading import floats

    values = {}
    for given in words:
        name, sign, text = given.rpartition("=")
        numbers = floats(text)
        if not sign or numbers is None or len(numbers) != 1:
            expected = "expected JOINT=VALUE, such as elbow=0.5"
            stop(f"msahl import: {option} {printable(given)}: {expected}")
        values[name] = numbers[0]
    return values


def _print_notes(notes: Iterable["Note"], err: bool) -> None:
    """Print the notes: each message once, and below it the elements that it is about."""
    groups: dict[tuple[str, str], list[Note]] = {}
    for note in notes:
        groups.setdefault((note.kind, note.message), []).append(note)
    for kind, message in sorted(groups, key=lambda group: KINDS.index(group[0])):
        echo(f"{kind}: {printable(message)}", err=err)
        for note in groups[kind, message]:
            echo(f"    {shown_path(note.file)}:{note.line}: {printable(note.where)}", err=err)
