"""The folder of results: what may be written there, and how a new run replaces an old one.

A run writes into its folder, or, if that holds a complete run, into ``incomplete`` inside it. So
the complete results remain until the new ones are complete as well. As soon as ``run.json`` in
``incomplete`` says "completed", the new files are valid, wherever they are, and are moved up one by
one, ``run.json`` last. If that is interrupted, the next reader or run moves the rest.
"""

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from msahl.results.write import CHECKPOINT, DECK, INFO, PART, TABLE_FILES

INCOMPLETE = "incomplete"
"""Folder inside that of a complete run, for the run that is to replace it."""
NAMES = tuple(n + end for n in (*TABLE_FILES, DECK, INFO, CHECKPOINT) for end in ("", PART))
"""Files that a run may write or remove."""
HEAD = b'{"layout":'
"""First bytes of a checkpoint."""


class FolderError(Exception):
    """A folder that must not be written into; the message names the reason and the remedy."""


def claim(folder: Path, deck: Path, about: dict[str, Any]) -> Path:
    """Return the folder into which a new run of ``deck``, which ``about`` describes, writes:
    ``folder`` or one inside it. Raises ``FolderError`` if anything there could be lost.
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
        _require_unprotected(target, deck)
    if work != folder:
        work.mkdir(exist_ok=True)
        if not info(work) and any((work / name).exists() for name in NAMES):
            raise FolderError(f"{work}: not written by msahl; choose another folder with -o")
    return work


def place(folder: Path) -> Path:
    """Return the folder of a run that is not complete, or of a new one."""
    if info(folder).get("status") != "completed":
        return folder
    work = folder / INCOMPLETE
    if work.is_symlink() or (work.exists() and not work.is_dir()):
        raise FolderError(f"{work}: not written by msahl; remove it, or choose a folder with -o")
    return work


def finish(folder: Path) -> None:
    """Move a run that has completed in ``incomplete`` to its place, if there is one."""
    work = folder / INCOMPLETE
    if not _is_replacing(work):
        return
    for name in set(TABLE_FILES) - set(_tables(work)):
        (folder / name).unlink(missing_ok=True)
    for name in (*TABLE_FILES, DECK, INFO):
        if (work / name).is_file():
            (work / name).replace(folder / name)
    with suppress(OSError):  # it holds other files, too
        work.rmdir()


def find(folder: Path, name: str) -> Path | None:
    """Path of the file ``name`` of the run in ``folder``, complete or partial; None if there is
    none.
    """
    work = folder / INCOMPLETE
    paths = [folder / name, folder / (name + PART)]
    if _is_replacing(work):
        if name in TABLE_FILES and name not in _tables(work):
            return None
        paths = [work / name, folder / name]
    return next((path for path in paths if path.is_file()), None)


def info(folder: Path) -> dict[str, Any]:
    """The content of ``run.json`` in ``folder``, complete or not; empty if there is none."""
    for name in (INFO, INFO + PART):
        try:
            found = json.loads((folder / name).read_bytes())
        except (OSError, ValueError, RecursionError):
            continue
        if isinstance(found, dict) and "msahl" in found and isinstance(found.get("deck"), dict):
            return found
    return {}


def relative(deck: Path, folder: Path) -> str:
    """Path of the ``deck`` relative to ``folder``, which remains valid if both are moved."""
    try:
        return os.path.relpath(deck, folder.resolve())
    except ValueError:  # on another disk
        return str(deck.absolute())


def _is_replacing(work: Path) -> bool:
    return not work.is_symlink() and info(work).get("status") == "completed"


def tables(work: Path) -> list[str]:
    """File names of the tables in ``work``, complete or not."""
    return [n for n in TABLE_FILES if (work / n).is_file() or (work / (n + PART)).is_file()]


def _tables(work: Path) -> list[str]:
    """File names of the tables of the run in ``work``, also of those that were moved already."""
    return [name for name in info(work).get("tables", ()) if name in TABLE_FILES]


def _is_same_deck(folder: Path, deck: Path, held: dict[str, Any], about: dict[str, Any]) -> bool:
    """Whether the results in ``folder`` are of the same deck file, or of one with its content."""
    before = held["deck"]
    if before.get("digest") == about["deck"]["digest"]:
        return True
    seen = before.get("relative")
    if not isinstance(seen, str):  # run.json of an earlier version
        return bool(before.get("path") == about["deck"]["path"])
    other = Path(os.path.normpath(folder.resolve() / seen))
    # Of results that were moved away from their deck only its path is known.
    moved = before.get("path") == about["deck"]["path"] and not other.exists()
    return moved or other == Path(os.path.normpath(deck.absolute()))


def _path(held: dict[str, Any]) -> str:
    return str(held["deck"].get("path"))


def _require_unprotected(folder: Path, deck: Path) -> None:
    """Raise ``FolderError`` if a run in ``folder`` would overwrite its own deck, or a file that no
    run wrote.
    """
    if deck.parent.resolve() == folder.resolve() and deck.name in NAMES:
        raise FolderError(
            f"{deck}: the run would overwrite its deck; choose another folder with -o"
        )
    for name in (CHECKPOINT, CHECKPOINT + PART):
        path = folder / name
        if path.is_symlink() or not path.exists():
            continue
        if not path.is_file() or not path.read_bytes()[: len(HEAD)] == HEAD[: path.stat().st_size]:
            raise FolderError(f"{path}: not a checkpoint of msahl; move it elsewhere")
