"""The command ``msahl check``: report the faults of decks."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from msahl.cli.console import BAD_INPUT, say, stop, writing
from msahl.cli.decks import read
from msahl.cli.options import DECK, set_option
from msahl.model.settings import EQUILIBRIUM
from msahl.printable import printable, shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.model import Model


@click.command(short_help="Report the faults of decks.")
@click.argument("decks", metavar="DECK...", nargs=-1, required=True, type=DECK)
@click.option(
    "--repair",
    is_flag=True,
    help="Write each deck that has impossible inertias as NAME_repaired.xml, with the nearest "
    "possible ones.",
)
@set_option
def check(decks: tuple[Path, ...], settings: tuple[str, ...], repair: bool) -> None:
    """Report every fault of the decks, with file, line, element and remedy, and inertias that do
    not fit the shapes of their bodies. No run is made. Of a deck that starts at an equilibrium,
    find it and say where it is.

    Example: msahl check decks/thesis/*.xml
    """
    faulty = False
    for deck in decks:
        model, faults = read(deck, thorough=True, settings=settings)
        if model is not None and any(shape.file for shape in model.shapes):
            from msahl.post.scene.shapes import mesh_faults

            faults = mesh_faults(model, [deck.parent])
        if model is not None and not faults and model.shapes:
            _warn(model, deck)
        if repair and faults:
            _repair(deck)
        start = ""
        if model is not None and not faults and model.simulation.start == EQUILIBRIUM:
            start, faults = _start(deck, settings)
        faulty |= bool(faults)
        good = f"{shown_path(deck)}: good{start}"
        echo("\n".join(faults) if faults else good, err=bool(faults))
    if faulty:
        sys.exit(BAD_INPUT)


def _warn(model: "Model", deck: Path) -> None:
    """Print which inertias do not fit the shapes of their bodies."""
    from msahl.importers.doctor import doubts

    for words in doubts(model, deck.parent):
        say(f"{shown_path(deck)}: WARN: {printable(words)}")


def _repair(deck: Path) -> None:
    """Write a deck with possible inertias beside one that has others."""
    from msahl.deck import DeckError, Source
    from msahl.deck.repair import repaired

    target = deck.with_name(f"{deck.stem}_repaired.xml")
    try:
        data, names = repaired(Source.of_file(deck))
    except DeckError:  # which was reported
        return
    if not names:
        return
    with writing(target, "make the folder writable"):
        try:
            with target.open("xb") as stream:
                stream.write(data)
        except FileExistsError:
            stop(f"{shown_path(target)} exists; move it, or delete it")
    say(f"{shown_path(target)}: the nearest possible inertias of {printable(', '.join(names))}")


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
