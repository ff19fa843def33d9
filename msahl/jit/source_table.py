"""Keeps the digests of sources of kernels, which a command would compute at every start.

A digest (``reach``) follows from the files of the package that were imported, and from constants
that these compute. The table holds the digests and one sum of what the system says of these files:
size, number, times of the last change of content and of entry. No user can set the last, so an
edited file is noticed although its date was set back. Any difference discards the table.

Only processes of commands use it: elsewhere a program may change constants of imported modules.
"""

import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from msahl.command_process import is_command
from msahl.jit.kernel_store import Store
from msahl.jit.reach import PACKAGE, STARTED, changed

SETTLED = 60.0
"""Seconds before this process that the last change of a file must be older than for its digests to
be kept: what was imported is what is on disk, whatever the resolution of the file's times."""


class SourceTable:
    """Digests of functions by module and name, in a file of a ``folder``; if they cannot be kept
    there, they are computed.
    """

    def __init__(self, folder: Path) -> None:
        self._store, self._name, self._new = Store(folder), _file_name(), False
        found = self._load() if is_command() else None
        self._files: list[str] = found["files"] if found else []
        self._digests: dict[str, str] = found["digests"] if found else {}

    def digest(self, module: str, name: str, compute: Callable[[], str]) -> str:
        """Return the digest of a function: that of the table, else the one that is computed."""
        key = f"{module}:{name}"
        found = self._digests.get(key)
        if found is None:
            found = self._digests[key] = compute()
            self._new = True
        return found

    def save(self) -> None:
        """Keep digests that were computed, if no file may have changed since it was imported."""
        if not (is_command() and self._new) or changed:
            return
        self._new = False
        files = sorted({*self._files, *_imported()})
        state = _state(files, STARTED - SETTLED)
        if state:
            content = {"files": files, "state": state, "digests": self._digests}
            self._store.save(self._name, json.dumps(content).encode())

    def _load(self) -> Any:
        """Return the content of the file; None if there is none of the files as they are."""
        content = self._store.load(self._name)
        found = json.loads(content) if content else None
        return found if found and found["state"] == _state(found["files"]) else None


def _file_name() -> str:
    """Return the name of the table of this package, with these versions of Python and numpy."""
    numpy: Any = sys.modules.get("numpy")
    key = str(PACKAGE), sys.version, getattr(numpy, "__version__", "")
    return f"sources-{hashlib.sha256(repr(key).encode()).hexdigest()[:24]}"


def _imported() -> set[str]:
    """Return the files of the package that are imported, below its folder."""
    start = f"{PACKAGE}{os.sep}"
    files = (getattr(module, "__file__", None) or "" for module in [*sys.modules.values()])
    return {file.removeprefix(start) for file in files if file.startswith(start)}


def _state(files: Iterable[str], latest: float = float("inf")) -> str:
    """Return a sum of what the system says of ``files``; empty if one is not there, or was changed
    after the ``latest`` time [s].
    """
    digest = hashlib.sha256()
    try:
        for file in files:
            found = os.stat(f"{PACKAGE}{os.sep}{file}")  # noqa: PTH116 (a path for each: 2 ms)
            times = found.st_mtime_ns, found.st_ctime_ns
            if max(times) > 1e9 * latest:
                return ""
            digest.update(repr((file, found.st_size, found.st_ino, times)).encode())
    except OSError:
        return ""
    return digest.hexdigest()
