"""What one example may do: no traceback, no time without end, no memory without bound, no file but
its own, nobody called.

Python says what it opens (``sys.addaudithook``); libxml2 does not, so a named pipe and a listening
socket stand where a deck could point to, and must be found untouched.
"""

import fcntl
import os
import re
import resource
import signal
import socket
import struct
import sys
import sysconfig
import tempfile
import termios
import traceback
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from click.testing import CliRunner

import msahl

SECONDS = 300
"""For one example; it takes some tenths of a second, but the first of a kind of model compiles."""
MEMORY = 2 * 2**30
"""Bytes that one example may ask for beyond those in use; it needs some tens of megabytes."""
LONGEST_LINE = 3000
"""Of a message: file, place and remedy, each of them cut."""

PACKAGE = Path(msahl.__file__).resolve().parents[1]
OPEN_TO_ALL = tuple(
    str(path)
    for path in (
        *(PACKAGE / workspace for workspace in ("msahl", "schemas", "decks")),
        *map(Path, {sys.prefix, sys.base_prefix, *sysconfig.get_paths().values()}),
        *map(Path, ("/proc/self", "/dev", "/etc/mime.types", "/etc/localtime", "/usr/share")),
    )
)
"""Where program, libraries and fonts are read from."""
CACHES = ("msahl", "matplotlib", "fontconfig", "numba")
"""Folders of the user's own cache that libraries keep."""
STORE = "msahl.jit.kernel_store"
COMPILER = "msahl.jit.worker"
"""Module of the processes that compile the first of a kind of model."""
CALLS = ("socket.connect", "socket.getaddrinfo", "subprocess.Popen", "os.system", "os.exec",
         "os.posix_spawn", "urllib.Request", "ftplib.connect", "webbrowser.open")  # fmt: skip

_folders: list[Path] = []
"""The folder of the example under way; empty between examples."""
_touched: list[str] = []


def _note(event: str, arguments: tuple) -> None:
    """Audit hook: what an example opens outside its folder, and whom it calls."""
    if not _folders:
        return
    if event == "subprocess.Popen" and COMPILER in arguments[1]:
        return
    if event in CALLS and not str(arguments[0]).startswith("file:"):  # those show as open
        _touched.append(f"{event} {arguments[:2]}")
    elif event == "open" and isinstance(arguments[0], str | bytes):
        # The store opens its files in a folder that it holds open: their names are no paths.
        if sys._getframe(1).f_globals.get("__name__") == STORE:
            return
        path = os.path.abspath(os.fsdecode(arguments[0]))  # noqa: PTH100 - of any string at all
        known = path.startswith((str(_folders[0]), *OPEN_TO_ALL))
        if not known and not any(name in path for name in CACHES):
            _touched.append(f"open {path}")


@cache
def _listen() -> None:
    """Have every event noted from now on: a hook remains, and costs all that runs later."""
    sys.addaudithook(_note)


class Traps:
    """A named pipe and a listening socket for decks to point to."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self.pipe = Path(self._folder.name) / "secret.xml"
        os.mkfifo(self.pipe)
        self._end = os.open(self.pipe, os.O_RDWR | os.O_NONBLOCK)
        self._content = b"<secret>abcdefgh</secret>"
        os.write(self._end, self._content)
        self._socket = socket.create_server(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self.address = f"http://127.0.0.1:{self._socket.getsockname()[1]}/secret.dtd"

    def check(self) -> None:
        """Nobody has read the pipe or knocked at the door."""
        waiting = fcntl.ioctl(self._end, termios.FIONREAD, b"\0" * 4)
        assert struct.unpack("i", waiting)[0] == len(self._content), "the pipe was read"
        try:
            connection, _ = self._socket.accept()
        except BlockingIOError:
            return
        connection.close()
        raise AssertionError("the address was contacted")


TRAPS = Traps()


@contextmanager
def guarded(folder: Path):
    """Hold one example, all of whose files are in ``folder``, to its bounds."""
    _listen()
    _touched.clear()
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, hard))
    before = signal.signal(signal.SIGALRM, _too_long)
    signal.alarm(SECONDS)
    _folders.append(folder.resolve())
    try:
        yield
    finally:
        _folders.clear()
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    assert not _touched, tuple(_touched)
    TRAPS.check()


def _too_long(*_: object) -> None:
    raise AssertionError(f"more than {SECONDS} s")


def call(command, *words):
    """Exit status, output and messages of a command; fails on any exception it lets through."""
    result = CliRunner().invoke(command, [str(word) for word in words])
    error = result.exception
    if error is not None and not isinstance(error, SystemExit):
        lines = traceback.format_exception(error)
        raise AssertionError(f"{words}: a traceback\n{''.join(lines)}") from error
    assert "Traceback" not in result.stderr
    for line in result.stderr.splitlines():
        assert len(line) <= LONGEST_LINE, f"a message of {len(line)} characters: {line[:200]}"
    escapes = re.findall(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", result.output)
    assert not escapes, f"{words}: {escapes} would reach the terminal"
    return result
