"""The command ``msahl new``: write a commented deck to start from.

A template is a deck in ``msahl/deck/templates``, or an element's example in ``decks/joints`` or
``decks/forces``. ``--list`` shows the first words of its opening comment. A deck that is written
names the installed schema, so that editors complete and explain its elements.
"""

import re
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

import click

from msahl.cli.console import stop, writing
from msahl.printable import shown_path
from msahl.resources import folder
from msahl.terminal import echo

_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_ROOT = re.compile(r"<data\b[^>]*>")


@cache
def decks() -> dict[str, Traversable]:
    """All templates by name: complete models first, then one for each element."""
    folders = [files("msahl.deck").joinpath("templates")]
    folders += [folder("decks").joinpath(name) for name in ("joints", "forces")]
    return {
        entry.name.removesuffix(".xml"): entry
        for place in folders
        for entry in sorted(place.iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith(".xml")
    }


def names() -> list[str]:
    """Names of all templates."""
    return list(decks())


def template(name: str) -> str:
    """The text of the template of this name."""
    return decks()[name].read_text(encoding="utf-8")


def new_deck(name: str) -> str:
    """The text of the template of this name, with the address of the installed schema."""
    schema = (folder("schemas") / "msaHLData.xsd").resolve().as_uri()
    root = f'<data xmlns:xsi="{_XSI}"\n      xsi:noNamespaceSchemaLocation="{schema}">'
    head, comment_end, deck = template(name).partition("-->")
    return head + comment_end + _ROOT.sub(lambda _: root, deck, count=1)


def purpose(name: str) -> str:
    """What a template shows: the beginning of its comment."""
    comment = template(name).split("<!--", 1)[1].strip()
    return comment.splitlines()[0].split(":")[0].strip().rstrip(".")


def _list(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print every template with its purpose, and nothing else."""
    if wanted and not context.resilient_parsing:
        width = max(map(len, names()))
        echo("\n".join(f"{name:{width}}  {purpose(name)}" for name in names()))
        context.exit()


def _known(context: click.Context, parameter: click.Parameter, name: str) -> str:
    """The name of a template; for a wrong one, the fault names the most similar ones."""
    if name not in names():
        near = get_close_matches(name, names(), n=3)
        hint = f"did you mean {' or '.join(near)}? " if near else ""
        message = f"no template '{name}'; {hint}use msahl new --list"
        raise click.BadParameter(message, context, parameter)
    return name


@click.command(
    epilog="Use msahl new --list to see all templates: complete models and all elements."
)
@click.argument("name", metavar="TEMPLATE", callback=_known)
@click.option("-o", "--output", type=click.Path(dir_okay=False, allow_dash=True), metavar="FILE",
              help="Write to this file ('-': the terminal; default: TEMPLATE.xml).")  # fmt: skip
@click.option("--list", "listed", is_flag=True, is_eager=True, expose_value=False, callback=_list,
              help="List all templates and what they show.")  # fmt: skip
def new(name: str, output: str | None) -> None:
    """Write a commented deck to start from. No existing file is overwritten.

    The deck names the installed schema, so editors of XML complete and explain its elements.

    Example: msahl new pendulum -o my.xml
    """
    if output == "-":
        click.echo(new_deck(name), nl=False)
        return
    path = Path(output or f"{name}.xml")
    with writing(path, "choose another file with -o"):
        try:
            with path.open("x", encoding="utf-8") as stream:
                stream.write(new_deck(name))
        except FileExistsError:
            stop(f"{shown_path(path)} exists; choose another file with -o")
    echo(f"{shown_path(path)}: next, msahl run {shown_path(path)}", err=True)
