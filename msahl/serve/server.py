"""The server: a process with the program loaded, of which a copy carries out each command.

It listens at a socket in a folder of its user, forks for every request and waits for the next. What
a command does, it does in its copy: the server itself changes only by what it loads. It ends when
it was idle for some minutes, when its socket was removed, and when a file of the program or the
folder of installed packages changes: a new start then loads what is there now.
"""

import gc
import os
import selectors
import signal
import socket
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from msahl.serve.child import carry_out
from msahl.serve.client import KILLED, READY, REFUSED, folder, is_own, socket_path
from msahl.serve.handover import peer
from msahl.serve.received import Request, receive
from msahl.serve.request import installation

POLL = 10.0
"""Seconds between two looks at whether the server is still wanted."""
CROWDED = 0.05
"""Seconds until a connection is tried again that could not be taken."""


class Sources:
    """The files from which the program was loaded."""

    def __init__(self, files: Iterable[Path]) -> None:
        self.files = [str(path) for path in files]
        self.known = self._state()

    def changed(self) -> bool:
        """Whether a file is not what it was."""
        return self._state() != self.known

    def _state(self) -> list[tuple[int, int, int]]:
        try:
            found = map(os.stat, self.files)
            return [(state.st_mtime_ns, state.st_size, state.st_ino) for state in found]
        except OSError:
            return []


class Server:
    """Answers at a socket until nobody has asked for ``idle`` seconds.

    ``program`` is what a copy runs, with the client's command line in ``sys.argv``; ``loaded``
    names what it has loaded, and ``load`` loads the same for later copies.
    """

    def __init__(
        self,
        program: Callable[[], object],
        loaded: Callable[[], list[str]],
        load: Callable[[list[str]], object],
        sources: Sources,
        idle: float,
    ) -> None:
        self.program, self.loaded, self.load = program, loaded, load
        self.sources, self.idle = sources, idle
        self.installation = installation()
        self.path = socket_path()
        self.selector = selectors.DefaultSelector()
        self.running: dict[int, tuple[socket.socket, int]] = {}  # by process: client, what it loads
        self.last = time.monotonic()
        self.ends = False

    def serve(self, ready: Callable[[], object]) -> None:
        """Listen, say that it is ``ready``, and answer."""
        self.listener = _listen(self.path)
        self.own = Path(self.path).stat().st_ino
        awake, wake = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda number, frame: None)
        signal.signal(signal.SIGTERM, self._end)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        self.selector.register(self.listener, selectors.EVENT_READ, self._welcome)
        self.selector.register(awake, selectors.EVENT_READ, lambda: self._reap(awake))
        gc.collect()
        gc.freeze()  # so that copies need not copy what they only look through
        ready()
        try:
            while self._is_wanted():
                for key, _ in self.selector.select(min(POLL, self.idle)):
                    key.data()
        finally:
            self.listener.close()
            if self._is_there():
                Path(self.path).unlink()

    def _end(self, number: int, frame: object) -> None:
        self.ends = True

    def _is_there(self) -> bool:
        """Whether the socket is that of this server."""
        try:
            return Path(self.path).stat().st_ino == self.own
        except OSError:
            return False

    def _is_wanted(self) -> bool:
        """Whether there is something to do or to wait for."""
        if self.running:
            return True
        return not self.ends and self._is_there() and time.monotonic() - self.last < self.idle

    def _welcome(self) -> None:
        """Take a new connection, if it is this user's."""
        try:
            connection, _ = self.listener.accept()
        except OSError:  # too many files are open; copies that end close theirs
            time.sleep(CROWDED)
            return
        self.last = time.monotonic()
        if peer(connection)[1] != os.geteuid() or self.ends:
            connection.close()
            return
        self.selector.register(connection, selectors.EVENT_READ, lambda: self._hear(connection))
        with suppress(OSError):
            connection.send(READY)

    def _hear(self, connection: socket.socket) -> None:
        """Take the request of a client."""
        self.selector.unregister(connection)
        try:
            request = receive(connection)
        except OSError:
            request = None
        if request is None:
            connection.close()
            return
        if self.sources.changed():
            self.ends = True
        good = not self.ends and request.installation == self.installation
        if not (good and self._fork(request, connection)):
            with suppress(OSError):
                connection.send(REFUSED)
            connection.close()
        for descriptor in request.descriptors:
            os.close(descriptor)

    def _fork(self, request: Request, connection: socket.socket) -> bool:
        """Carry out a request in a copy of this process; return False if none can be made."""
        pipe: tuple[int, ...] = ()
        try:
            told, tell = pipe = os.pipe2(os.O_CLOEXEC)
            process = os.fork()
        except OSError:  # too many files or processes
            for end in pipe:
                os.close(end)
            return False
        if process:
            os.close(tell)
            self.running[process] = connection, told
            self.selector.register(
                connection, selectors.EVENT_READ, lambda: self._abandon(process, connection)
            )
            return True
        status = 1
        try:
            self._forget()
            known = set(self.loaded())
            status = carry_out(request, connection, self.program)
            new = [name for name in self.loaded() if name not in known]
            os.write(tell, "\n".join(new).encode()[: 1 << 16])
        finally:
            os._exit(status)

    def _forget(self) -> None:
        """Leave what belongs to the server to the server."""
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        self.selector.close()
        self.listener.close()
        for other, told in self.running.values():
            other.close()
            os.close(told)

    def _abandon(self, process: int, connection: socket.socket) -> None:
        """Kill the copy of a client that was killed."""
        if process not in self.running:  # its end was noted just now, together with the client's
            return
        self.selector.unregister(connection)
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)

    def _reap(self, awake: int) -> None:
        """Note which copies have ended, and load what they have loaded."""
        with suppress(BlockingIOError):
            os.read(awake, 1 << 12)
        while self.running:
            process, status = os.waitpid(-1, os.WNOHANG)
            if not process:
                return
            connection, told = self.running.pop(process)
            self._close(connection, status)
            with open(told, "rb") as file:  # noqa: PTH123
                names = file.read().decode().split("\n")
            self.last = time.monotonic()
            with suppress(Exception):  # then later copies load it themselves
                self.load([name for name in names if name])

    def _close(self, connection: socket.socket, status: int) -> None:
        """Tell a client that its copy was killed, unless it ended by itself and has said so."""
        with suppress(KeyError, ValueError):
            self.selector.unregister(connection)
        if os.WIFSIGNALED(status):
            with suppress(OSError):
                connection.send(KILLED + bytes([os.WTERMSIG(status)]))
        connection.close()


def _listen(path: str) -> socket.socket:
    """Return a socket that listens at a path, instead of a dead server's; raises ``OSError`` where
    the folder is not this user's alone."""
    os.makedirs(folder(), mode=0o700, exist_ok=True)  # noqa: PTH103
    if not is_own(folder()):
        raise PermissionError(13, "is not a folder of this user alone", folder())
    with suppress(FileNotFoundError):
        Path(path).unlink()
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path)
    listener.listen(128)
    return listener


def alive(path: str) -> int:
    """Return the process of the server at a path; 0 if there is none."""
    connection = socket.socket(socket.AF_UNIX)
    try:
        connection.settimeout(1.0)
        connection.connect(path)
        process, user = peer(connection)
        return process if user == os.geteuid() else 0
    except OSError:
        return 0
    finally:
        connection.close()
