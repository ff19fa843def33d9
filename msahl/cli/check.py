"""The command ``msahl check``: report the faults of decks."""

import sys
from collections.abc import Sequence
from pathlib import Path

import click

from msahl.cli.console import BAD_INPUT
from msahl.cli.decks import read
from msahl.cli.options import DECK, set_option
from msahl.model.settings import EQUILIBRIUM
from msahl.printable import printable, shown_path
from msahl.terminal import echo


@click.command(short_help="Report the faults of decks.")
@click.argument("decks", metavar="DECK...", nargs=-1, required=True, type=DECK)
@set_option
def check(decks: tuple[Path, ...], settings: tuple[str, ...]) -> None:
    """Report every fault of the decks, with file, line, element and remedy. No run is made. Of a
    deck that starts at an equilibrium, find it and say where it is.

    Example: msahl check decks/thesis/*.xml
    """
    faulty = False
    for deck in decks:
        model, faults = read(deck, thorough=True, settings=settings)
        if model is not None and any(shape.file for shape in model.shapes):
            from msahl.post.scene.shapes import mesh_faults

            faults = mesh_faults(model, [deck.parent])
        start = ""
        if model is not None and not faults and model.simulation.start == EQUILIBRIUM:
            start, faults = _start(deck, settings)
        faulty |= bool(faults)
        good = f"{shown_path(deck)}: good{start}"
        echo("\n".join(faults) if faults else good, err=bool(faults))
    if faulty:
        sys.exit(BAD_INPUT)


def _start(deck: Path, settings: Sequence[str]) -> tuple[str, list[str]]:
    """The equilibrium at which a deck starts, in words, and why it is not found."""
    from msahl.analysis.equilibria.begin import beginning, in_words
    from msahl.cli.decks import job_of
    from msahl.start.velocities import StartError

    try:
        start = beginning(job_of(deck, {}, settings)).start
    except StartError as error:
        return "", [f"{shown_path(deck)}: {printable(str(error))}"]
    return f"; {in_words(start or {})}", []
