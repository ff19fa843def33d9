"""Locks a folder of results, so that one run at a time writes into it.

The operating system locks the folder itself, so a killed process leaves no lock behind. Windows
cannot open a folder: there an empty file ``.lock`` in it is locked, which stays.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from msahl.locks import lock
from msahl.results.folder import INCOMPLETE
from msahl.results.write import INFO, PART


class FolderInUseError(Exception):
    """Another run is writing into the folder; the message names its process and the remedy."""


@contextmanager
def locked(folder: Path, shared: bool = False) -> Iterator[None]:
    """Lock ``folder``, which is created if it does not exist; ``shared`` locks exclude only those
    that are not.

    Raises ``FolderInUseError``, and ``OSError`` if it cannot be created. There is no lock where
    the file system has none.
    """
    folder.mkdir(parents=True, exist_ok=True)
    descriptor = _opened(folder)
    try:
        if not lock(descriptor, shared):
            raise FolderInUseError(
                f"{folder}: {_owner(folder)} is writing a run there; wait for its end, stop it, or "
                "choose another folder with -o"
            )
        yield
    finally:
        os.close(descriptor)


def _opened(folder: Path) -> int:
    """Return a descriptor of what is locked."""
    if os.name == "nt":
        return os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o666)
    return os.open(folder, os.O_RDONLY)


def _owner(folder: Path) -> str:
    """The process that writes into ``folder``, as its ``run.json`` says."""
    for part in (folder / INCOMPLETE / (INFO + PART), folder / (INFO + PART)):
        try:
            return f"process {json.loads(part.read_bytes())['pid']}"
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            pass
    return "another process"  # it has not written run.json yet
