"""The command ``msahl new``: a commented deck to start from.

A template is a deck beside the deck room, ``msahl/deck/templates/NAME.xml``; the first sentence of
its opening comment is what ``--list`` says of it.
"""

import sys
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

import click

BAD_INPUT = 2


def folder() -> Traversable:
    """Where the templates are."""
    return files("msahl.deck").joinpath("templates")


def names() -> list[str]:
    """Names of all templates."""
    found = [entry.name for entry in folder().iterdir()]
    return sorted(name.removesuffix(".xml") for name in found if name.endswith(".xml"))


def template(name: str) -> str:
    """The deck of this name."""
    return folder().joinpath(f"{name}.xml").read_text(encoding="utf-8")


def purpose(name: str) -> str:
    """What a template shows: the first line of its comment."""
    comment = template(name).split("<!--", 1)[1]
    return comment.strip().splitlines()[0].strip().rstrip(".")


def _list(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print every template with its purpose, and nothing else."""
    if wanted and not context.resilient_parsing:
        width = max(map(len, names()))
        click.echo("\n".join(f"{name:{width}}  {purpose(name)}" for name in names()))
        context.exit()


@click.command(epilog=f"Templates: {', '.join(names())}.")
@click.argument("name", metavar="TEMPLATE", type=click.Choice(names()))
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
        _stop(f"{path} exists; choose another file with -o")
    except OSError as error:
        _stop(f"{path}: {error.strerror or error}; choose another file with -o")
    click.echo(f"{path}: next, msahl run {path}", err=True)


def _stop(message: str) -> None:
    click.echo(message, err=True)
    sys.exit(BAD_INPUT)
