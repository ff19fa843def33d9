"""The command ``msahl schema``: print the path of the deck's schema, or copy it."""

import shutil
from pathlib import Path

import click

from msahl.cli.console import writing
from msahl.cli.options import FolderType
from msahl.deck.schema import SCHEMA_NAME
from msahl.printable import shown_path
from msahl.resources import folder
from msahl.terminal import echo


@click.command(short_help="Print the path of the deck's schema.")
@click.option("--copy", type=FolderType(path_type=Path), metavar="DIR",
              help="Copy the schema into this folder, and print the path of the copy.")  # fmt: skip
def schema(copy: Path | None) -> None:
    """Print the path of the schema of decks (XSD 1.0), from which editors complete and explain.

    Example: msahl schema --copy .
    """
    source = Path(str(folder("schemas").joinpath(SCHEMA_NAME)))
    path = source if copy is None else copy / SCHEMA_NAME
    with writing(path, "choose another folder"):
        if copy is not None:
            copy.mkdir(parents=True, exist_ok=True)
            if not path.exists() or not path.samefile(source):
                shutil.copyfile(source, path)
    echo(shown_path(path))
