"""A process that runs a command and nothing else: how it begins, and how it ends.

At the end of a process Python frees every object and closes every library, a sixth of the time of a
short run, although the system frees all of them. So a command that has written everything leaves at
once. Processes that use the Python API do not come here.
"""

import atexit
import gc
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NoReturn

YOUNG = 200_000
"""New objects after which Python looks for unreachable ones, of which a command has few. Its own
number is 700 or 2000: it would look through all objects many times while modules are imported."""

_is_command = False


def is_command() -> bool:
    """Return whether this process runs a command and nothing else: the package is as on disk."""
    return _is_command


def run_command(load: Callable[[], Callable[[], Any]]) -> NoReturn:
    """Load the program of a command, run it and leave the process with its exit status.

    A fault that the program does not handle, and an exit status that is a message, are Python's.
    """
    global _is_command
    _is_command = True
    gc.set_threshold(YOUNG, *gc.get_threshold()[1:])
    try:
        status = load()()
    except SystemExit as end:
        status = end.code
    if (status is None or isinstance(status, int)) and can_leave():
        with suppress(OSError, ValueError):  # something is not printed, which Python reports, too
            finish()
            os._exit((status or 0) & 0xFF)
    sys.exit(status)


def can_leave() -> bool:
    """Return whether nothing is left to be done by Python at the end of this process."""
    observed = sys.gettrace() or sys.getprofile() or sys.flags.inspect or sys.flags.dev_mode
    if observed or os.environ.get("PYTHONINSPECT") or not hasattr(atexit, "_run_exitfuncs"):
        return False
    others = (one for one in threading.enumerate() if one is not threading.current_thread())
    return all(one.daemon for one in others)


def finish() -> None:
    """Do what others registered for the end, and print what is kept; raises ``OSError`` or
    ``ValueError`` if that cannot be printed."""
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
