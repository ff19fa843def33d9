"""The command ``msahl new``: a commented deck to start from.

A template is a deck beside the deck room, ``msahl/deck/templates/NAME.xml``, or that of an element,
``decks/joints`` and ``decks/forces``; ``--list`` says of it what its opening comment begins with.
"""

import sys
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

import click

from msahl.printable import shown_path
from msahl.resources import folder
from msahl.terminal import echo

BAD_INPUT = 2


@cache
def decks() -> dict[str, Traversable]:
    """All templates by name: whole scenes first, then one for each element."""
    rooms = [files("msahl.deck").joinpath("templates")]
    rooms += [folder("decks").joinpath(room) for room in ("joints", "forces")]
    return {
        entry.name.removesuffix(".xml"): entry
        for room in rooms
        for entry in sorted(room.iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith(".xml")
    }


def names() -> list[str]:
    """Names of all templates."""
    return list(decks())


def template(name: str) -> str:
    """The deck of this name."""
    return decks()[name].read_text(encoding="utf-8")


def purpose(name: str) -> str:
    """What a template shows: how its comment begins."""
    comment = template(name).split("<!--", 1)[1].strip()
    return comment.splitlines()[0].split(":")[0].strip().rstrip(".")


def _list(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print every template with its purpose, and nothing else."""
    if wanted and not context.resilient_parsing:
        width = max(map(len, names()))
        echo("\n".join(f"{name:{width}}  {purpose(name)}" for name in names()))
        context.exit()


def _known(context: click.Context, parameter: click.Parameter, name: str) -> str:
    """The name of a template; the likely ones are told of a wrong one."""
    if name not in names():
        near = get_close_matches(name, names(), n=3)
        hint = f"did you mean {' or '.join(near)}? " if near else ""
        message = f"no template '{name}'; {hint}msahl new --list says what there is"
        raise click.BadParameter(message, context, parameter)
    return name


@click.command(epilog="msahl new --list says what there is: whole scenes, and every element.")
@click.argument("name", metavar="TEMPLATE", callback=_known)
@click.option("-o", "--output", type=click.Path(dir_okay=False, allow_dash=True), metavar="FILE",
              help="Where the deck goes ('-': the terminal; default: TEMPLATE.xml).")  # fmt: skip
@click.option("--list", "listed", is_flag=True, is_eager=True, expose_value=False, callback=_list,
              help="Say what every template shows.")  # fmt: skip
def new(name: str, output: str | None) -> None:
    """Write a commented deck to start from; no file is ever overwritten.

    Example: msahl new pendulum -o my.xml
    """
    if output == "-":
        click.echo(template(name), nl=False)
        return
    path = Path(output or f"{name}.xml")
    try:
        with path.open("x", encoding="utf-8") as stream:
            stream.write(template(name))
    except FileExistsError:
        _stop(f"{shown_path(path)} exists; choose another file with -o")
    except OSError as error:
        _stop(f"{shown_path(path)}: {error.strerror or error}; choose another file with -o")
    echo(f"{shown_path(path)}: next, msahl run {shown_path(path)}", err=True)


def _stop(message: str) -> None:
    echo(message, err=True)
    sys.exit(BAD_INPUT)
