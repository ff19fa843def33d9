"""The folder of results: what may be written there, and how a new run takes an old one's place.

A run writes into its folder, or, if that holds a complete run, into ``incomplete`` inside it. So
the complete results stay as they are until the new ones are complete as well. Then ``run.json`` in
``incomplete`` says "completed", which decides: from now on the new files count, wherever they are,
and are moved up one by one, ``run.json`` last. Whoever is interrupted there leaves the rest to the
next reader or run.
"""

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from msahl.results.write import CHECKPOINT, DECK, INFO, PART, TABLES

INCOMPLETE = "incomplete"
"""Folder inside that of a complete run, with the run that is to take its place."""
NAMES = tuple(n + end for n in (*TABLES, DECK, INFO, CHECKPOINT) for end in ("", PART))
"""Files that a run may write or remove."""
HEAD = b'{"layout":'
"""How a checkpoint begins."""


class FolderError(Exception):
    """A folder that must not be written into; the message names the reason and the remedy."""


def claim(folder: Path, deck: Path, about: dict[str, Any]) -> Path:
    """Where a new run of ``deck``, which ``about`` describes, is to write: ``folder`` or a folder
    inside it. Raises ``FolderError`` if anything there could be lost.
    """
    finish(folder)
    held = info(folder)
    if not held and any(not path.name.startswith(".") for path in folder.iterdir()):
        raise FolderError(
            f"{folder}: not empty, and not the results of a run; choose another folder with -o"
        )
    if held and not _is_same_deck(folder, deck, held, about):
        raise FolderError(
            f"{folder}: holds the results of another deck, {_path(held)}; choose another folder "
            "with -o, or remove this one"
        )
    work = place(folder)
    for target in (folder, work):
        _spare(target, deck)
    if work != folder:
        work.mkdir(exist_ok=True)
        if not info(work) and any((work / name).exists() for name in NAMES):
            raise FolderError(f"{work}: not a folder of msahl's; choose another folder with -o")
    return work


def place(folder: Path) -> Path:
    """Where a run that is not complete stands, or a new one would."""
    if info(folder).get("status") != "completed":
        return folder
    work = folder / INCOMPLETE
    if work.is_symlink() or (work.exists() and not work.is_dir()):
        raise FolderError(f"{work}: not a folder of msahl's; remove it, or choose another with -o")
    return work


def finish(folder: Path) -> None:
    """Move a run that is complete inside ``folder`` to its place, if there is one."""
    work = folder / INCOMPLETE
    if not _is_replacing(work):
        return
    for name in set(TABLES) - set(_tables(work)):
        (folder / name).unlink(missing_ok=True)
    for name in (*TABLES, DECK, INFO):
        if (work / name).is_file():
            (work / name).replace(folder / name)
    with suppress(OSError):  # something else is kept there
        work.rmdir()


def find(folder: Path, name: str) -> Path | None:
    """Path of the file ``name`` of the run in ``folder``, complete or partial; None if there is
    none.
    """
    work = folder / INCOMPLETE
    paths = [folder / name, folder / (name + PART)]
    if _is_replacing(work):
        if name in TABLES and name not in _tables(work):
            return None
        paths = [work / name, folder / name]
    return next((path for path in paths if path.is_file()), None)


def info(folder: Path) -> dict[str, Any]:
    """What ``run.json`` says of the run in ``folder``, finished or not; empty if there is none."""
    for name in (INFO, INFO + PART):
        try:
            found = json.loads((folder / name).read_bytes())
        except (OSError, ValueError, RecursionError):
            continue
        if isinstance(found, dict) and "msahl" in found and isinstance(found.get("deck"), dict):
            return found
    return {}


def relative(deck: Path, folder: Path) -> str:
    """Path of the ``deck`` as seen from ``folder``, which stays true if both are moved together."""
    try:
        return os.path.relpath(deck, folder.resolve())
    except ValueError:  # another drive
        return str(deck.absolute())


def _is_replacing(work: Path) -> bool:
    return not work.is_symlink() and info(work).get("status") == "completed"


def tables(work: Path) -> list[str]:
    """Names of the tables there are in ``work``, complete or not."""
    return [n for n in TABLES if (work / n).is_file() or (work / (n + PART)).is_file()]


def _tables(work: Path) -> list[str]:
    """Names of the tables of the run in ``work``, those that are moved already among them."""
    return [name for name in info(work).get("tables", ()) if name in TABLES]


def _is_same_deck(folder: Path, deck: Path, held: dict[str, Any], about: dict[str, Any]) -> bool:
    """Whether the results that ``folder`` holds are of the same file, or of one just like it."""
    before = held["deck"]
    if before.get("digest") == about["deck"]["digest"]:
        return True
    seen = before.get("relative")
    if not isinstance(seen, str):  # of a version that did not tell
        return bool(before.get("path") == about["deck"]["path"])
    other = Path(os.path.normpath(folder.resolve() / seen))
    # Results that were moved away from their deck tell no more than its path.
    moved = before.get("path") == about["deck"]["path"] and not other.exists()
    return moved or other == Path(os.path.normpath(deck.absolute()))


def _path(held: dict[str, Any]) -> str:
    return str(held["deck"].get("path"))


def _spare(folder: Path, deck: Path) -> None:
    """Raise ``FolderError`` if a run in ``folder`` would write over its own deck, or over a file
    that is none of a run's.
    """
    if deck.parent.resolve() == folder.resolve() and deck.name in NAMES:
        raise FolderError(
            f"{deck}: the run would write over its deck; choose another folder with -o"
        )
    for name in (CHECKPOINT, CHECKPOINT + PART):
        path = folder / name
        if path.is_symlink() or not path.exists():
            continue
        if not path.is_file() or not path.read_bytes()[: len(HEAD)] == HEAD[: path.stat().st_size]:
            raise FolderError(f"{path}: not a checkpoint of msahl's; move it elsewhere")
