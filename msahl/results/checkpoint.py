"""The checkpoint: a file in a run's folder from which the run can go on as if it had not stopped.

One line of JSON, then the doubles of ``snapshot.Snapshot.memory`` as they stand in memory. The line
says what run it is of, and how far its tables were good. A checkpoint is written beside the old
one, brought to the disk and then put in its place, after the rows it counts on: at any moment there
is a whole one, and the tables reach as far as it says or further.
"""

import json
import os
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from msahl.printable import shown_path
from msahl.results.info import ResultError, read_info
from msahl.results.write import CHECKPOINT, INFO, PART, REACTIONS, STATES, WORK, create, write_all
from msahl.run.snapshot import ResumeError, Snapshot

LAYOUT = 2
"""Of the file and of what a snapshot holds; counted up when either changes."""
ANEW = "leave --resume out to run it anew"
DOUBLES = np.dtype("<f8")


@dataclass(frozen=True)
class Checkpoint:
    """Where a run stood: ``ends`` are the bytes of its tables, by file name, that hold its rows."""

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
        "scene": snapshot.workspace,
        "numbers": snapshot.numbers,
    }
    head |= {"check": _check(head, memory)}
    path = folder / CHECKPOINT
    part = path.with_name(path.name + PART)
    with create(part) as file:
        write_all(file, json.dumps(head).encode() + b"\n" + memory)
        os.fsync(file.fileno())
    part.replace(path)


def read_checkpoint(folder: Path, about: dict[str, Any]) -> Checkpoint:
    """The checkpoint in ``folder`` of the run that ``about`` describes.

    Raises ``ResumeError`` if there is none, or it is of another run: other deck, options, versions.
    """
    path = folder / CHECKPOINT
    if not path.is_file():
        raise ResumeError(
            f"{folder}: no run that could go on: there is no checkpoint (a run makes one every "
            f"few seconds, and when it is interrupted); {ANEW}"
        )
    line, _, memory = path.read_bytes().partition(b"\n")
    try:
        head = json.loads(line)
        if head["layout"] != LAYOUT:
            raise ResumeError(f"{path}: written by another version of msahl; {ANEW}")
        if head.pop("check") != _check(head, memory):
            raise ResumeError(f"{path}: damaged; {ANEW}")
        _must_be_same(folder, head["about"], about, ("msahl", "python", "numba", "numpy", "scipy"))
        kept = Snapshot(head["scene"], head["numbers"], np.frombuffer(memory, DOUBLES))
        _must_reach(folder, head["ends"])
        return Checkpoint(head["ends"], kept)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ResumeError(f"{path}: not a checkpoint; {ANEW}") from error


def _check(head: dict[str, Any], memory: bytes) -> int:
    """A sum of all that a checkpoint holds, by which damage shows."""
    return zlib.crc32(memory, zlib.crc32(json.dumps(head).encode()))


def is_kept(folder: Path) -> bool:
    """Whether there is a checkpoint in ``folder``."""
    return (folder / CHECKPOINT).is_file()


def remove_checkpoint(folder: Path) -> None:
    """A run that has come to its end needs none."""
    for name in (CHECKPOINT, CHECKPOINT + PART):
        (folder / name).unlink(missing_ok=True)


def is_complete(folder: Path, about: dict[str, Any]) -> bool:
    """Whether the run that ``about`` describes has come to its end in ``folder``.

    Raises ``ResumeError`` if another one has, or its ``run.json`` cannot be read.
    """
    try:
        info = read_info(folder)
    except ResultError as error:
        raise ResumeError(f"{error}, or {ANEW}") from error
    if info.get("status") != "completed" or not (folder / "states.csv").is_file():
        return False
    try:
        _must_be_same(folder, info, about, ())
    except (KeyError, TypeError) as error:
        raise ResumeError(f"{shown_path(folder / INFO)}: not that of a run; {ANEW}") from error
    for path in (folder / name for name in (STATES, REACTIONS, WORK)):
        if path.is_file() and path.read_bytes().count(b"\n") - 1 != info.get("outputTimes"):
            raise ResumeError(f"{shown_path(path)}: has not the rows that run.json says; {ANEW}")
    return True


def _must_reach(folder: Path, ends: dict[str, int]) -> None:
    """Raise ``ResumeError`` if a table is shorter than the checkpoint says."""
    for name, end in ends.items():
        paths = [path for path in (folder / (name + PART), folder / name) if path.is_file()]
        if not paths or paths[0].stat().st_size < end:
            raise ResumeError(f"{folder / name}: rows are missing that the run had written; {ANEW}")


def _must_be_same(
    folder: Path, then: dict[str, Any], now: dict[str, Any], versions: tuple[str, ...]
) -> None:
    """Raise ``ResumeError`` that says what a run was begun with, if that is not what it has now."""
    before, after = then["options"], now["options"]
    others = [
        f"{key} was {before.get(key)}, is {value} now"
        for key, value in after.items()
        if before.get(key) != value
    ]
    if others:
        raise ResumeError(
            f"{folder}: the run there began otherwise: {'; '.join(others)}. Go on with what it "
            f"began with, or {ANEW}"
        )
    if then["deck"]["digest"] != now["deck"]["digest"]:
        raise ResumeError(
            f"{folder}: {now['deck']['path']} is not the deck the run there began with, which is "
            f"{folder / 'deck.xml'}. Go on with that one, or {ANEW}"
        )
    others = [f"{key} was {then.get(key)}, is {now[key]} now" for key in versions
              if then.get(key) != now[key]]  # fmt: skip
    if others:
        raise ResumeError(
            f"{folder}: the run there was begun by other software, whose last digits may differ: "
            f"{'; '.join(others)}. Go on with what it began with, or {ANEW}"
        )
