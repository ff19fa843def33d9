"""The checkpoint: a file in a run's folder from which an interrupted run is resumed.

It is one line of JSON, followed by the doubles of ``Snapshot.memory`` as they are in memory. The
line says which run it belongs to, and how many bytes of its tables are valid. A checkpoint is
written beside the old one, flushed to the disk and then put in its place, after the rows it counts
on. So there is a complete one at any moment, and the tables are as long as it says, or longer.
"""

import json
import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from msahl.printable import shown_path
from msahl.records import record
from msahl.results.info import ResultError, read_info
from msahl.results.write import CHECKPOINT, INFO, PART, create, file_name, write_all
from msahl.run.snapshot import ResumeError, Snapshot
from msahl.run.tables import COLUMNS, STATES

LAYOUT = 6
"""Version of the file and of what a snapshot holds; increased when either changes."""
ANEW = "omit --resume to start again"
DOUBLES = np.dtype("<f8")
VERSIONS = ("msahl", "python", "numba", "numpy", "scipy")
"""Software that a resumed run must share with the interrupted one."""


@record(slots=False)
class Checkpoint:
    """Where a run was interrupted: ``ends`` are the valid bytes of its tables, by file name."""

    ends: dict[str, int]
    snapshot: Snapshot


def write_checkpoint(folder: Path, about: dict[str, Any], checkpoint: Checkpoint) -> None:
    """Write the checkpoint of the run that ``about`` describes, the head of its ``run.json``."""
    snapshot = checkpoint.snapshot
    memory = snapshot.memory.astype(DOUBLES, copy=False).tobytes()
    head = {
        "layout": LAYOUT,
        "about": about,
        "ends": checkpoint.ends,
        "system": snapshot.system,
        "numbers": snapshot.numbers,
    }
    head |= {"check": _checksum(head, memory)}
    path = folder / CHECKPOINT
    part = path.with_name(path.name + PART)
    with create(part) as file:
        write_all(file, json.dumps(head).encode() + b"\n" + memory)
        os.fsync(file.fileno())
    part.replace(path)


def read_checkpoint(folder: Path, about: dict[str, Any]) -> Checkpoint:
    """Read the checkpoint in ``folder`` of the run that ``about`` describes.

    Raises ``ResumeError`` if there is none, or if it belongs to another run: another deck, other
    options or versions.
    """
    path = folder / CHECKPOINT
    if not path.is_file():
        raise ResumeError(
            f"{folder}: no run to resume: there is no checkpoint (a run writes one every few "
            f"seconds, and when it is interrupted); {ANEW}"
        )
    line, _, memory = path.read_bytes().partition(b"\n")
    try:
        head = json.loads(line)
        if head["layout"] != LAYOUT:
            raise ResumeError(f"{path}: written by another version of msahl; {ANEW}")
        if head.pop("check") != _checksum(head, memory):
            raise ResumeError(f"{path}: damaged; {ANEW}")
        _require_same_run(folder, head["about"], about, VERSIONS)
        snapshot = Snapshot(head["system"], head["numbers"], np.frombuffer(memory, DOUBLES))
        _require_rows(folder, head["ends"])
        return Checkpoint(head["ends"], snapshot)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ResumeError(f"{path}: not a checkpoint; {ANEW}") from error


def _checksum(head: dict[str, Any], memory: bytes) -> int:
    """CRC-32 of all that a checkpoint holds."""
    return zlib.crc32(memory, zlib.crc32(json.dumps(head).encode()))


def has_checkpoint(folder: Path) -> bool:
    """Whether there is a checkpoint in ``folder``."""
    return (folder / CHECKPOINT).is_file()


def remove_checkpoint(folder: Path) -> None:
    """Remove the checkpoint of a run that has completed."""
    for name in (CHECKPOINT, CHECKPOINT + PART):
        (folder / name).unlink(missing_ok=True)


def is_complete(folder: Path, about: dict[str, Any]) -> bool:
    """Whether the run that ``about`` describes has completed in ``folder``.

    Raises ``ResumeError`` if another run has, or if its ``run.json`` cannot be read.
    """
    try:
        info = read_info(folder)
    except ResultError as error:
        raise ResumeError(f"{error}, or {ANEW}") from error
    if info.get("status") != "completed" or not (folder / file_name(STATES)).is_file():
        return False
    try:
        _require_same_run(folder, info, about, ())
    except (KeyError, TypeError) as error:
        raise ResumeError(f"{shown_path(folder / INFO)}: not that of a run; {ANEW}") from error
    for path in (folder / file_name(name) for name in COLUMNS):
        if path.is_file() and path.read_bytes().count(b"\n") - 1 != info.get("outputTimes"):
            message = f"it does not have as many rows as run.json says; {ANEW}"
            raise ResumeError(f"{shown_path(path)}: {message}")
    return True


def _require_rows(folder: Path, ends: dict[str, int]) -> None:
    """Raise ``ResumeError`` if a table is shorter than the checkpoint says."""
    for name, end in ends.items():
        paths = [path for path in (folder / (name + PART), folder / name) if path.is_file()]
        if not paths or paths[0].stat().st_size < end:
            raise ResumeError(f"{folder / name}: rows are missing that the run had written; {ANEW}")


def _require_same_run(
    folder: Path, then: dict[str, Any], now: dict[str, Any], versions: tuple[str, ...]
) -> None:
    """Raise ``ResumeError``, which says what differs, unless deck, options and versions are those
    with which the run began.
    """
    changed = _differences(then["options"], now["options"], tuple(now["options"]))
    if changed:
        raise ResumeError(
            f"{folder}: the run there was started with other options: {changed}. Resume it with "
            f"the same options, or {ANEW}"
        )
    if then["deck"]["digest"] != now["deck"]["digest"]:
        raise ResumeError(
            f"{folder}: {now['deck']['path']} is not the deck with which the run there was "
            f"started; that is {folder / 'deck.xml'}. Resume it with that deck, or {ANEW}"
        )
    changed = _differences(then, now, versions)
    if changed:
        raise ResumeError(
            f"{folder}: the run there was started with other software, so that last digits may "
            f"differ: {changed}. Resume it with the same versions, or {ANEW}"
        )


def _differences(then: dict[str, Any], now: dict[str, Any], keys: tuple[str, ...]) -> str:
    """What changed under these ``keys``, in words; empty if nothing did."""
    return "; ".join(
        f"{key} was {then.get(key)}, is {now[key]} now" for key in keys if then.get(key) != now[key]
    )
