"""Finds the server of ``msahl serve``, if one runs, and states what passes between them.

This is imported at every start, so it needs nothing but modules that are part of Python's core.

The server says READY, the client sends its request with its open files, and the process that
carries it out answers ACCEPTED or REFUSED. From then on this process only passes on the signals
that it receives, and ends in the same way as the other.
"""

import os
import sys

SERVED = frozenset({"check", "equilibrium", "explain", "inverse", "kinematics", "run", "schema"})
"""Commands that a server carries out: those that can be short, and need one thread."""
READY, ACCEPTED, REFUSED, ENDED, KILLED = b"h", b"a", b"r", b"e", b"s"
"""Answers to a client; ACCEPTED is followed by the process, ENDED by the exit status, KILLED by the
signal."""
SWITCH = "MSAHL_SERVER"
"""Variable of the environment; no server is asked where it is 0."""
PATIENCE = 2.0
"""Seconds in which a server says READY; one that does not is left alone."""
ELSEWHERE = ("/dev/", "/proc/")
"""Parts of paths that mean something else in another process."""


def socket_path() -> str:
    """Return the place of this user's server of this installation."""
    own, prefix = os.stat(__file__), os.stat(sys.prefix)
    return f"{folder()}/{own.st_dev:x}-{own.st_ino:x}-{prefix.st_ino:x}"


def folder() -> str:
    """Return the folder of this user's servers."""
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    return f"{runtime}/msahl" if runtime.startswith("/") else f"/tmp/msahl-{os.geteuid()}"


def is_own(path: str) -> bool:
    """Whether a folder belongs to this user, and nobody else can write or look into it."""
    found = os.lstat(path)
    return found.st_mode & 0o170077 == 0o040000 and found.st_uid == os.geteuid()


def server_for(words: list[str]) -> str:
    """Return the socket of a server that may carry out a command line; empty if there is none."""
    if len(words) < 2 or words[1] not in SERVED or sys.platform != "linux":
        return ""
    if os.environ.get(SWITCH) == "0" or any(part in word for word in words for part in ELSEWHERE):
        return ""
    try:
        path = socket_path()
        return path if is_own(folder()) and os.path.exists(path) else ""
    except OSError:
        return ""
