"""Carries out a request in a process that takes the place of the client's.

It has the client's open files, working folder, mask of permissions, environment, command line,
limits, priority and processors; what it cannot take over, it refuses. It ends as Python would, but
without taking the program apart.
"""

import atexit
import os
import resource
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from msahl.serve.client import ACCEPTED, ENDED, REFUSED
from msahl.serve.handover import PASSED, peer
from msahl.serve.received import Request

LIMITS = [getattr(resource, name) for name in dir(resource) if name.startswith("RLIMIT_")]
PLACES = ("root", "ns/mnt", "ns/pid", "ns/user", "ns/net", "ns/ipc", "ns/uts")
"""What a container or a sandbox has of its own."""
BROKEN = 120
"""Python's exit status where the last of its output cannot be written."""


class CannotError(Exception):
    """This process cannot become what the client is."""


def carry_out(request: Request, connection: socket.socket, program: Callable[[], object]) -> int:
    """Become the process of a client, run the program, and tell the client how it ended."""
    connection.settimeout(None)
    try:
        _become(request, peer(connection)[0])
    except (CannotError, OSError, ValueError):
        connection.send(REFUSED)
        return 0
    connection.send(ACCEPTED + os.getpid().to_bytes(4, "little"))
    status = _status(program)
    with suppress(OSError):  # the client is not there any more
        connection.send(ENDED + bytes([status]))
    return status


def _become(request: Request, client: int) -> None:
    """Take over everything of the process of a client."""
    _take_limits(client)
    *files, here = request.descriptors
    os.fchdir(here)
    os.umask(request.umask)
    os.environb.clear()
    os.environb.update(request.environment)
    time.tzset()
    sys.argv[:] = request.words
    _take_files(dict(zip(request.files, files, strict=True)))
    for descriptor in request.descriptors:
        os.close(descriptor)
    for number in PASSED:
        usual = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
        signal.signal(number, signal.SIG_IGN if number in request.ignored else usual)


def _take_limits(client: int) -> None:
    """Take over limits, priority and processors; raises ``CannotError`` in another namespace."""
    for place in PLACES:
        if Path(f"/proc/{client}/{place}").readlink() != Path(f"/proc/self/{place}").readlink():
            raise CannotError(place)
    for limit in LIMITS:
        wanted = resource.prlimit(client, limit)
        if wanted != resource.getrlimit(limit):
            resource.setrlimit(limit, wanted)
    niceness = os.getpriority(os.PRIO_PROCESS, client)
    if niceness != os.getpriority(os.PRIO_PROCESS, 0):
        os.setpriority(os.PRIO_PROCESS, 0, niceness)
    os.sched_setaffinity(0, os.sched_getaffinity(client))


def _take_files(files: dict[int, int]) -> None:
    """Put the client's files in the place of stdin, stdout and stderr; none where it has none."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        stream = getattr(sys, f"__{name}__")
        if number not in files:
            os.close(number)
            made = None
        else:
            os.dup2(files[number], number)
            lines = number == 2 or os.isatty(number)
            made = open(  # noqa: SIM115 - as Python opens it at its start
                number, "w" if number else "r", 1 if lines else -1, stream.encoding,
                stream.errors, closefd=False,
            )  # fmt: skip
        setattr(sys, name, made)


def _status(program: Callable[[], object]) -> int:
    """Run the program; return its exit status."""
    try:
        program()
        status = 0
    except SystemExit as end:
        if not isinstance(end.code, int | None):
            print(end.code, file=sys.stderr)
        status = 1 if not isinstance(end.code, int | None) else (end.code or 0) & 0xFF
    except BaseException:
        sys.excepthook(*sys.exc_info())  # type: ignore[arg-type]
        status = 1
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    try:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except (OSError, ValueError):
        status = BROKEN
    return status
