"""Locks open files against other processes, by what the operating system has for it.

A lock ends with the descriptor, however the process ends. Unix locks by ``flock``; Windows locks
bytes, so there one byte is locked that no file has, far behind its end, and a file can be read and
appended to meanwhile.
"""

import os
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from types import ModuleType
from typing import Any

PLACE = 2**31 - 2
"""The byte that Windows locks; its locks cannot lie beyond 2 GB."""


def lock(descriptor: int, shared: bool = False) -> bool:
    """Lock an open file without waiting; ``shared`` locks exclude only those that are not (on
    Windows all). Return False if another process has locked it.

    Nothing is locked where the system or the file system cannot do it, such as a network's.
    """
    for name, attempt in WAYS.items():
        with suppress(ImportError):
            return attempt(import_module(name), descriptor, shared)
    return True


def _lock_by_fcntl(fcntl: Any, descriptor: int, shared: bool) -> bool:
    kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    try:
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a network file system that cannot lock
        pass
    return True


def _lock_by_msvcrt(msvcrt: Any, descriptor: int, shared: bool) -> bool:
    place = os.lseek(descriptor, 0, os.SEEK_CUR)
    try:
        os.lseek(descriptor, PLACE, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    except PermissionError:
        return False
    except OSError:
        pass
    finally:
        os.lseek(descriptor, place, os.SEEK_SET)
    return True


WAYS: dict[str, Callable[[ModuleType, int, bool], bool]] = {
    "fcntl": _lock_by_fcntl,
    "msvcrt": _lock_by_msvcrt,
}
"""Modules of Python that can lock, each on its system alone."""
