"""How a run writes into its folder: claimed and locked, the tables, ``run.json`` at the end.

Every command that leaves the files of a run does so, and so do results in memory.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from msahl.model import Model
from msahl.results.checkpoint import remove_checkpoint
from msahl.results.checksums import CHECKSUMS, checksums
from msahl.results.folder import claim, finish, tables
from msahl.results.lock import locked
from msahl.results.write import INFO, RunFolder, write_beginning, write_json
from msahl.run.report import COMPLETED


def begin(
    work: Path,
    model: Model,
    text: bytes,
    about: dict[str, Any],
    ends: dict[str, int] | None = None,
) -> RunFolder:
    """Begin a run in the claimed folder ``work``, and return the sink of its tables, or resume it
    where they end: of a ``model``, whose deck is the ``text``, with the head ``about`` of
    ``run.json``.
    """
    write_beginning(work, {**about, "status": "running", "pid": os.getpid()})
    return RunFolder(work, model, text, ends)


def end(folder: Path, work: Path, about: dict[str, Any], report: Mapping[str, Any]) -> None:
    """Write ``run.json`` of a run in ``work``; if it completed, its files take their place in the
    ``folder``.
    """
    write_json(work / INFO, {**about, **report, **files_of(work)})
    if report.get("status") == COMPLETED:
        remove_checkpoint(work)
        finish(folder)


def files_of(work: Path) -> dict[str, Any]:
    """Return what ``run.json`` says of the files of the run in ``work``."""
    return {"tables": tables(work), CHECKSUMS: checksums(work)}


def write_run(
    folder: Path,
    deck: Path,
    model: Model,
    text: bytes,
    about: dict[str, Any],
    report: Mapping[str, Any],
    arrays: Mapping[str, np.ndarray],
) -> None:
    """Write a run that has ended, of the ``deck`` of this path, with its tables into ``folder``; a
    complete run of the same deck there is replaced as soon as the new one is complete.

    Raises ``FolderError`` or ``FolderInUseError`` if that is not possible, ``OSError`` if the disk
    fails; then the files are marked as those of a run that did not complete.
    """
    with locked(folder):
        work = claim(folder, deck, about)
        with begin(work, model, text, about) as files:
            files.write(arrays)
            files.complete = report.get("status") == COMPLETED
        end(folder, work, about, report)
