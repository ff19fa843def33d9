"""Write a run whose results are in memory as ``msahl run`` writes its own."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from msahl.model import Model
from msahl.results.checkpoint import remove_checkpoint
from msahl.results.folder import claim, finish, tables
from msahl.results.lock import locked
from msahl.results.write import INFO, RunFolder, write_beginning, write_json
from msahl.run.report import COMPLETED


@dataclass(frozen=True)
class FinishedRun:
    """A run that has ended: the path of its deck, its model, the deck as it ran, the head of
    ``run.json`` and the report."""

    deck: Path
    model: Model
    text: bytes
    about: dict[str, Any]
    report: dict[str, Any]


def write_run(folder: Path, run: FinishedRun, arrays: Mapping[str, np.ndarray]) -> None:
    """Write a run with its tables into ``folder``; a complete run of the same deck there is
    replaced as soon as the new one is complete.

    Raises ``FolderError`` or ``FolderInUseError`` if that is not possible, ``OSError`` if the disk
    fails; then the files are marked as those of a run that did not complete.
    """
    complete = run.report.get("status") == COMPLETED
    with locked(folder):
        work = claim(folder, run.deck, run.about)
        write_beginning(work, {**run.about, "status": "running", "pid": os.getpid()})
        with RunFolder(work, run.model, run.text) as files:
            files.write(arrays)
            files.complete = complete
        write_json(work / INFO, {**run.about, "tables": tables(work), **run.report})
        if complete:
            remove_checkpoint(work)
            finish(folder)
