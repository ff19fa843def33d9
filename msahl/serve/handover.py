"""The part of the client that talks to a server. Like ``client``, it imports Python's core only."""

import _signal  # type: ignore[import-not-found]
import _socket
import os
import sys

from msahl.serve.client import ACCEPTED, ENDED, KILLED, PATIENCE, READY, REFUSED
from msahl.serve.request import packed

PASSED = (
    _signal.SIGHUP, _signal.SIGINT, _signal.SIGQUIT, _signal.SIGUSR1, _signal.SIGUSR2,
    _signal.SIGTERM, _signal.SIGCONT, _signal.SIGTSTP,
)  # fmt: skip
"""Signals that are passed on."""
LOST = 128 + _signal.SIGKILL


class Signals:
    """Passes signals on to the other process, as soon as it is known."""

    def __init__(self) -> None:
        self.process = -1
        self.early: list[int] = []
        self.before = {number: _signal.getsignal(number) for number in PASSED}

    def ignored(self) -> list[int]:
        """Return the signals that this process ignores since its start, as by nohup."""
        return [number for number, way in self.before.items() if way == _signal.SIG_IGN]

    def catch(self) -> None:
        """Begin to note signals."""
        for number in PASSED:
            _signal.signal(number, self._note)

    def release(self) -> None:
        """Let signals do what they did before; those noted meanwhile do it now."""
        for number, way in self.before.items():
            _signal.signal(number, way)
        for number in self.early:
            os.kill(os.getpid(), number)

    def pass_to(self, process: int) -> None:
        """Pass on what was noted, and what will be, to a process."""
        try:
            self.process = os.pidfd_open(process)
        except ProcessLookupError:  # it has ended already
            return
        except OSError:  # they end this process, and the server ends the other
            return self.release()
        for number in self.early:
            self._note(number, None)

    def _note(self, number: int, frame: object) -> None:
        if self.process < 0:
            self.early.append(number)
            return
        stops = number == _signal.SIGTSTP  # which means nothing to a process without a terminal
        try:
            _signal.pidfd_send_signal(self.process, _signal.SIGSTOP if stops else number)
        except ProcessLookupError:  # it has just ended
            pass
        if stops:
            os.kill(os.getpid(), _signal.SIGSTOP)


def hand_over(path: str, words: list[str]) -> int | None:
    """Have the server at ``path`` carry out a command line; return its exit status, or None if it
    does not. Raises ``OSError`` before anything was handed over.
    """
    files = [number for number in range(3) if _is_open(number)]  # before others take their numbers
    connection = _socket.socket(_socket.AF_UNIX, _socket.SOCK_STREAM)
    try:
        connection.settimeout(PATIENCE)
        connection.connect(path)
        if peer(connection)[1] != os.geteuid() or connection.recv(1) != READY:
            return None
        connection.settimeout(None)
        return _ask(connection, words, files)
    finally:
        connection.close()


def _ask(connection: _socket.socket, words: list[str], files: list[int]) -> int | None:
    """Send the request to a server that is ready, and wait for the end of the command."""
    signals = Signals()
    here = os.open(".", os.O_PATH | os.O_DIRECTORY)
    request = packed(words, signals.ignored(), files)
    answer = b""
    signals.catch()
    try:
        _send(connection, request, [*files, here])
        answer = _receive(connection, 5)
    finally:
        os.close(here)
        if answer[:1] != ACCEPTED:
            signals.release()
    if answer[:1] != ACCEPTED:
        return None
    signals.pass_to(int.from_bytes(answer[1:], "little"))
    try:
        return _end(_receive(connection, 2))
    except OSError:  # it was handed over, so it must not be carried out again
        return LOST


def peer(connection: _socket.socket) -> tuple[int, int]:
    """Return process and user at the other end of a connection."""
    size = 12  # struct ucred: process, user, group
    found = connection.getsockopt(_socket.SOL_SOCKET, _socket.SO_PEERCRED, size)
    return int.from_bytes(found[:4], sys.byteorder), int.from_bytes(found[4:8], sys.byteorder)


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True


def _send(connection: _socket.socket, request: bytes, files: list[int]) -> None:
    numbers = b"".join(number.to_bytes(4, sys.byteorder) for number in files)
    passed = [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, numbers)]
    sent = connection.sendmsg([request], passed)
    connection.sendall(request[sent:])


def _receive(connection: _socket.socket, size: int) -> bytes:
    """Receive so many bytes, or fewer if the other end closes."""
    found = b""
    while len(found) < size:
        part = connection.recv(size - len(found))
        if not part or found + part == REFUSED:
            break
        found += part
    return found


def _end(answer: bytes) -> int:
    """Return the exit status of the other process, or end by the signal that it ended by."""
    if answer[:1] == ENDED:
        return answer[1]
    if answer[:1] == KILLED:
        return _die(answer[1])
    os.write(2, b"msahl: the process that carried out the command was killed with its server\n")
    return LOST


def _die(number: int) -> int:
    if number != _signal.SIGKILL:
        _signal.signal(number, _signal.SIG_DFL)
    os.kill(os.getpid(), number)
    return 128 + number
