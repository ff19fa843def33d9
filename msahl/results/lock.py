"""Locks a folder of results, so that one run at a time writes into it.

The operating system locks the folder itself, so a killed process leaves no lock behind.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from msahl.results.folder import INCOMPLETE
from msahl.results.write import INFO, PART


class FolderInUseError(Exception):
    """Another run is writing into the folder; the message names its process and the remedy."""


@contextmanager
def locked(folder: Path, shared: bool = False) -> Iterator[None]:
    """Lock ``folder``, which is created if it does not exist; ``shared`` locks exclude only those
    that are not.

    Raises ``FolderInUseError``, and ``OSError`` if it cannot be created. There is no lock where
    the operating system or the file system has none.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        import fcntl
    except ImportError:  # not a Unix
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
            fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FolderInUseError(
                f"{folder}: {_owner(folder)} is writing a run there; wait for its end, stop it, or "
                "choose another folder with -o"
            ) from None
        except OSError:  # a network file system that cannot lock a folder
            pass
        yield
    finally:
        os.close(descriptor)


def _owner(folder: Path) -> str:
    """The process that writes into ``folder``, as its ``run.json`` says."""
    for part in (folder / INCOMPLETE / (INFO + PART), folder / (INFO + PART)):
        try:
            return f"process {json.loads(part.read_bytes())['pid']}"
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            pass
    return "another process"  # it has not written run.json yet
