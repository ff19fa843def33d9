"""Locks exclude other processes, on Unix and with what Windows has; Windows itself is emulated."""

import errno
import fcntl
import os
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from msahl.cli import interruption
from msahl.locks import PLACE, lock
from msahl.sweep.faults import StoreError
from msahl.sweep.journal import Journal

WINDOWS = """
import fcntl, os, sys
from types import SimpleNamespace
def locking(descriptor, kind, count):
    try:  # from the present place on, as msvcrt does
        fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, count, 0, os.SEEK_CUR)
    except BlockingIOError as error:
        raise PermissionError(error.errno, error.strerror) from None
sys.modules["msvcrt"] = SimpleNamespace(locking=locking, LK_NBLCK=2)
sys.modules["fcntl"] = None
"""
"""Hides fcntl and puts a msvcrt in its place, with locks of bytes as Windows has them."""
ASK = """
from msahl.locks import lock
print(lock(os.open(sys.argv[1], os.O_RDWR), sys.argv[2] == "shared"))
"""


def other_process_locks(path, prelude, shared=""):
    command = [sys.executable, "-c", prelude + ASK, str(path), shared]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout == "True\n"


def busy():
    """Work that asks nobody; so long only if nothing stops it."""
    until = time.monotonic() + 20.0
    while time.monotonic() < until:
        pass


@pytest.fixture
def opened(tmp_path):
    """A file with a line in it, open for appending, at its begin."""
    path = tmp_path / "file"
    path.write_bytes(b"line\n")
    descriptor = os.open(path, os.O_RDWR | os.O_APPEND)
    yield path, descriptor
    os.close(descriptor)


@pytest.fixture
def windows(monkeypatch):
    """This process without fcntl, and with the emulated msvcrt."""
    monkeypatch.setitem(sys.modules, "fcntl", fcntl)
    monkeypatch.setitem(sys.modules, "msvcrt", None)
    exec(WINDOWS, {})


@pytest.mark.parametrize("prelude", ["import os, sys", WINDOWS], ids=["unix", "windows"])
def test_one_process_at_a_time(opened, prelude, request):
    path, descriptor = opened
    if prelude == WINDOWS:
        request.getfixturevalue("windows")
    assert lock(descriptor)
    assert not other_process_locks(path, prelude)
    assert os.read(descriptor, 4) == b"line"  # the place in the file is as before
    assert path.stat().st_size == 5


@pytest.mark.parametrize("prelude", ["import os, sys", WINDOWS], ids=["unix", "windows"])
def test_the_lock_ends_with_the_process(opened, prelude):
    path, _ = opened
    assert other_process_locks(path, prelude)
    assert other_process_locks(path, prelude)


def test_shared_locks_exclude_only_others(opened):
    path, descriptor = opened
    assert lock(descriptor, shared=True)
    assert other_process_locks(path, "import os, sys", "shared")
    assert not other_process_locks(path, "import os, sys")


def test_windows_locks_a_byte_that_no_file_has(opened, monkeypatch):
    places = []
    told = SimpleNamespace(LK_NBLCK=2, locking=lambda d, *_: places.append(os.lseek(d, 0, 1)))
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", told)
    assert lock(opened[1])
    assert places == [PLACE]


@pytest.mark.parametrize("number", [errno.ENOTSUP, errno.ENOLCK])
def test_a_file_system_without_locks_is_used_all_the_same(opened, monkeypatch, number):
    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)
    assert lock(opened[1])


def test_a_system_without_either_module_locks_nothing(opened, monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", None)
    assert lock(opened[1])


def test_a_journal_is_locked_and_written_to_without_fcntl(tmp_path, windows):
    path = tmp_path / "journal.jsonl"
    path.write_bytes(b"torn")
    journal = Journal(path)
    journal.lock()
    assert not other_process_locks(path, WINDOWS)
    journal.append([b"line\n"])
    journal.close()
    assert path.read_bytes() == b"torn\nline\n"


def test_a_locked_journal_is_refused(tmp_path):
    first, second = Journal(tmp_path / "journal.jsonl"), Journal(tmp_path / "journal.jsonl")
    first.lock()
    with pytest.raises(StoreError, match="another process is running the same points"):
        second.lock()
    first.close()
    second.close()


def test_a_request_that_nobody_asks_for_stops_without_alarms_as_well(monkeypatch):
    """Windows has neither setitimer nor SIGALRM."""
    monkeypatch.delattr(signal, "setitimer")
    monkeypatch.setattr(interruption, "GRACE", 0.01)
    with interruption.stoppable() as stopped:
        os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            busy()
    assert stopped.signal == signal.SIGINT


def test_a_request_that_was_answered_stops_nothing_else_without_alarms(monkeypatch):
    monkeypatch.delattr(signal, "setitimer")
    monkeypatch.setattr(interruption, "GRACE", 0.01)
    with interruption.stoppable() as stopped:
        os.kill(os.getpid(), signal.SIGINT)
        assert stopped()
        time.sleep(0.05)
