"""The command ``msahl show``: the model of a deck at t = 0, beside its text, in a browser."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from msahl.cli.console import BAD_INPUT, say, stop, writing
from msahl.cli.interruption import stoppable
from msahl.cli.options import DECK, set_option
from msahl.printable import shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.post.show.deck_page import DeckPage

INTERVAL = 0.3
"""Seconds between two looks at the files of a deck."""

SAVING = 0.05
"""Seconds in which a file that is being saved changes once more."""

Stamp = tuple[tuple[Path, int, int], ...]


@click.command(short_help="Show the model of a deck in a browser.")
@click.argument("deck", type=DECK)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write the page to FILE (default: results/DECK.html).",
)
@click.option("--open", "is_opened", is_flag=True, help="Open the page in a browser.")
@click.option(
    "--watch",
    "is_monitored",
    is_flag=True,
    help="Serve the page on this machine; reload it when DECK is saved.",
)
@set_option
def show(
    deck: Path, output: Path | None, is_opened: bool, is_monitored: bool, settings: tuple[str, ...]
) -> None:
    """Show the model of DECK at t = 0 beside its text, its structure and its faults.

    Writes one HTML file that needs no network. An element that is selected in the text, in the list
    or in the view is marked in all three. Of a deck with faults, what can be read is shown, and
    the exit status is 2.

    With --watch nothing is written: the page is served at an address that is printed, on this
    machine alone, and is loaded again whenever the deck, its parts or its meshes are saved. Ctrl-C
    ends this.

    Example: msahl show decks/machines/robot.xml --open
    """
    if is_monitored and output is not None:
        raise click.UsageError("--watch serves the page and writes no file; omit -o")
    if is_monitored:
        _monitor(deck, settings, is_opened)
        return
    from msahl.post.show.deck_page import show_deck
    from msahl.results.write import replace_file

    page = show_deck(deck, settings)
    if not deck.exists():
        stop("\n".join(map(str, page.faults)))
    path = output or Path("results") / f"{deck.stem}.html"
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, page.html.encode())
    _tell(deck, page)
    echo(str(path))
    if is_opened:
        click.launch(str(path))
    if page.faults:
        sys.exit(BAD_INPUT)


def _tell(deck: Path, page: "DeckPage") -> None:
    """Print the faults of the deck."""
    if page.faults:
        say("\n".join(map(str, page.faults)))
    else:
        say(f"{shown_path(deck)}: good")


def _monitor(deck: Path, settings: Sequence[str], is_opened: bool) -> None:
    """Serve the page and keep it up to date until the user ends the program."""
    from msahl.post.show.deck_page import show_deck
    from msahl.post.show.server import PageServer

    server = PageServer()
    before = _stamp((deck,))
    page = show_deck(deck, settings, server.version + 1)
    stamp = _stamp(page.files, before)
    server.replace(page.html)
    server.start()
    _tell(deck, page)
    echo(server.address)
    sys.stdout.flush()
    if is_opened:
        click.launch(server.address)
    try:
        with stoppable() as stopped:
            while not stopped():
                time.sleep(INTERVAL)
                if (now := _stamp(page.files)) != stamp:
                    time.sleep(SAVING)
                    if now != (now := _stamp(page.files)):
                        continue  # it is still being written
                    page = show_deck(deck, settings, server.version + 1)
                    stamp = _stamp(page.files, now)
                    server.replace(page.html)
                    _tell(deck, page)
    except KeyboardInterrupt:
        pass
    finally:
        server.close()


def _stamp(files: Sequence[Path], before: Stamp = ()) -> Stamp:
    """Return each file's time of change and size, -1 of one that is missing; of the files in
    ``before`` as they were, so that a change since then is seen."""
    known = {entry[0]: entry for entry in before}
    return tuple(known.get(file) or _look(file) for file in files)


def _look(file: Path) -> tuple[Path, int, int]:
    try:
        status = file.stat()
    except OSError:
        return (file, -1, -1)
    return (file, status.st_mtime_ns, status.st_size)
