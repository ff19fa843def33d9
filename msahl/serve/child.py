"""Carries out a request in a process that takes the place of the client's.

It has the client's open files, working folder, mask of permissions, environment, command line,
limits, priority and processors; what it cannot take over, it refuses. It ends as Python would, but
without taking the program apart.
"""

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

from msahl.command_process import finish
from msahl.serve.client import ACCEPTED, ENDED, REFUSED
from msahl.serve.handover import PASSED, peer
from msahl.serve.received import Request

LIMITS = [getattr(resource, name) for name in dir(resource) if name.startswith("RLIMIT_")]
PLACES = ("root", "ns/mnt", "ns/pid", "ns/user", "ns/net", "ns/ipc", "ns/uts")
"""What a container or a sandbox has of its own."""
RIGHTS = ("Uid", "Gid", "Groups", "CapEff", "NoNewPrivs", "Seccomp")
"""Lines of a process's status on what it may do."""
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
    """Take over limits, priority and processors; raises ``CannotError`` in another namespace, or
    with other rights.
    """
    for place in PLACES:
        if Path(f"/proc/{client}/{place}").readlink() != Path(f"/proc/self/{place}").readlink():
            raise CannotError(place)
    if _rights(f"{client}") != _rights("self"):
        raise CannotError("rights")
    for limit in LIMITS:
        wanted = resource.prlimit(client, limit)
        if wanted != resource.getrlimit(limit):
            resource.setrlimit(limit, wanted)
    niceness = os.getpriority(os.PRIO_PROCESS, client)
    if niceness != os.getpriority(os.PRIO_PROCESS, 0):
        os.setpriority(os.PRIO_PROCESS, 0, niceness)
    os.sched_setaffinity(0, os.sched_getaffinity(client))


def _rights(process: str) -> list[str]:
    """Return what a process may do, in the words of the system."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return [line for line in lines if line.partition(":")[0] in RIGHTS]


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
    status: object = None
    try:
        program()
    except SystemExit as end:
        status = end.code
    except BaseException:
        sys.excepthook(*sys.exc_info())  # type: ignore[arg-type]
        status = 1
    if not isinstance(status, int | None):
        print(status, file=sys.stderr)
        status = 1
    threading._shutdown()  # type: ignore[attr-defined]
    try:
        finish()
    except (OSError, ValueError):
        return BROKEN
    return (status or 0) & 0xFF
