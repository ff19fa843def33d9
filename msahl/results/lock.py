"""One run at a time in a folder.

The folder itself is locked, by the system: nothing is left behind by a process that is killed.
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
def locked(folder: Path) -> Iterator[None]:
    """Keep other runs out of ``folder``, which is made if it is not there.

    Raises ``FolderInUseError``, and ``OSError`` if it cannot be made. Where the system or the file
    system has no such locks there is none.
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
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FolderInUseError(
                f"{folder}: {_owner(folder)} is writing a run there; wait for its end, stop it, or "
                "choose another folder with -o"
            ) from None
        except OSError:  # a network drive that cannot lock a folder
            pass
        yield
    finally:
        os.close(descriptor)


def _owner(folder: Path) -> str:
    """The process at work in ``folder``, as it told itself."""
    for part in (folder / INCOMPLETE / (INFO + PART), folder / (INFO + PART)):
        try:
            return f"process {json.loads(part.read_bytes())['pid']}"
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            pass
    return "another process"  # it has only begun
