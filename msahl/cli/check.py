"""The command ``msahl check``: report the faults of decks."""

import sys
from pathlib import Path

import click

from msahl.cli.console import BAD_INPUT
from msahl.cli.decks import read
from msahl.cli.options import DECK, set_option
from msahl.printable import shown_path
from msahl.terminal import echo


@click.command(short_help="Report the faults of decks.")
@click.argument("decks", metavar="DECK...", nargs=-1, required=True, type=DECK)
@set_option
def check(decks: tuple[Path, ...], settings: tuple[str, ...]) -> None:
    """Report every fault of the decks, with file, line, element and remedy. No run is made.

    Example: msahl check decks/thesis/*.xml
    """
    faulty = False
    for deck in decks:
        model, faults = read(deck, thorough=True, settings=settings)
        if model is not None and any(shape.file for shape in model.shapes):
            from msahl.post.scene.shapes import mesh_faults

            faults = mesh_faults(model, [deck.parent])
        faulty |= bool(faults)
        echo("\n".join(faults) if faults else f"{shown_path(deck)}: good", err=bool(faults))
    if faulty:
        sys.exit(BAD_INPUT)
