"""A command that a server carries out is the same as without one; see ``msahl serve``."""

import contextlib
import json
import os
import pty
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from msahl.entry import ask
from msahl.serve import client
from msahl.serve.server import Server, Sources
from tests.support.models import ROOT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="servers need Linux")

DECK = ROOT / "decks" / "thesis" / "single_pendulum_45.xml"
SHORT = ("run", DECK, "--t-final", "0.02", "--solver", "newton")
LONG = ("run", DECK, "--t-final", "100000", "--solver", "newton", "--error", "off")
MSAHL = (sys.executable, "-c", "from msahl.entry import main; main()")
SECONDS = 120
"""Time limit; nothing takes that long unless it hangs."""
SERVED = (
    *MSAHL[:2],
    "import sys; sys.modules['msahl.cli.start'] = None; import msahl.serve.handover as handover; "
    f"handover.PATIENCE = {SECONDS}; {MSAHL[2]}",
)
"""A client that cannot carry out a command itself, and waits for a server on a busy machine."""


def start(*words, program=SERVED, **settings):
    kept = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "cwd": settings.pop("cwd", None)}
    return subprocess.Popen([*map(str, (*program, *words))], **{**kept, **settings})


def call(*words, **settings):
    """Exit status, and what was printed."""
    process = start(*words, **settings)
    out, err = process.communicate(timeout=SECONDS)
    return process.returncode, out, err


def alone(*words, **settings):
    """The same without a server."""
    environment = settings.pop("env", dict(os.environ))
    program = (MSAHL[2] if word == SERVED[2] else word for word in settings.pop("program", MSAHL))
    return call(*words, env={**environment, "MSAHL_SERVER": "0"}, program=program, **settings)


def msahl(*words, **settings):
    """With a server or without."""
    return call(*words, program=settings.pop("program", MSAHL), **settings)


@pytest.fixture(scope="module")
def runtime(tmp_path_factory):
    """The folder of a server that runs, and is ended after the tests."""
    place = tmp_path_factory.mktemp("run")
    before = os.environ.get("XDG_RUNTIME_DIR")
    os.environ["XDG_RUNTIME_DIR"] = str(place)
    try:
        status, _, err = msahl("serve")
        assert status == 0, err
        yield place
        msahl("serve", "--stop")
    finally:
        os.environ.pop("XDG_RUNTIME_DIR")
        if before is not None:
            os.environ["XDG_RUNTIME_DIR"] = before


@pytest.fixture
def process(runtime):
    """The server's process, when it carries out nothing."""
    _, _, err = msahl("serve")
    number = int(re.search(rb"process (\d+)", err)[1])
    wait_for(lambda: not children(number))
    return number


def children(process):
    return Path(f"/proc/{process}/task/{process}/children").read_text().split()


def wait_for(condition):
    until = time.monotonic() + SECONDS
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


def started(process):
    """Wait for a copy of the server; its process."""
    wait_for(lambda: children(process))
    return int(children(process)[0])


def writes(folder):
    """Whether a run has written rows."""
    table = folder / "states.csv.part"
    return lambda: table.exists() and table.stat().st_size > 4096


def files(folder):
    """The content of all files of results; of run.json what does not depend on the clock."""
    found = {path.name: path.read_bytes() for path in folder.iterdir()}
    about = json.loads(found.pop("run.json"))
    for name in ("seconds", "started", "ended", "pid", "command", "date", "finished"):
        about.pop(name, None)
    return found, about


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize(
    "words",
    [
        ("check", DECK),
        ("check", "missing.xml"),
        ("run", "missing.xml"),
        ("run", DECK, "--dt", "-1"),
        ("run", DECK, "--no-such-option"),
        ("run", "--help"),
        ("schema",),
        ("explain", DECK, "verdict"),
        ("equilibrium", DECK),
        ("kinematics", DECK),
        ("inverse", DECK),
    ],
    ids=lambda words: " ".join(Path(word).name for word in map(str, words)),
)
def test_same_output_and_exit_status(runtime, words, tmp_path):
    assert call(*words, cwd=tmp_path) == alone(*words, cwd=tmp_path)


@pytest.mark.slow
def test_a_run_writes_the_same_files(runtime, tmp_path):
    for given in ((), ("--solver", "auto"), ("--set", "L=2"), ("--dt", "0.5")):
        one, other = tmp_path / "one", tmp_path / "other"
        results = call(*SHORT, *given, "-o", one), alone(*SHORT, *given, "-o", other)
        statuses, _, printed = zip(*results, strict=True)
        assert statuses[0] == statuses[1]
        assert printed[0].replace(b"one", b"other") == printed[1]
        if one.exists():
            assert files(one) == files(other)
            shutil.rmtree(one)
            shutil.rmtree(other)


def test_the_commands_are_carried_out_by_the_server(runtime, process, tmp_path):
    run = start(*LONG, "-o", tmp_path / "run")
    copy = started(process)
    wait_for(writes(tmp_path / "run"))
    assert json.loads((tmp_path / "run" / "run.json.part").read_bytes())["pid"] == copy
    run.send_signal(signal.SIGINT)
    run.communicate(timeout=SECONDS)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_ends_the_run_as_without(runtime, process, tmp_path, number):
    endings = []
    for program in (SERVED, ("env", "MSAHL_SERVER=0", *MSAHL)):
        folder = tmp_path / "run"
        run = start(*LONG, "-o", folder, program=program)
        wait_for(writes(folder))
        run.send_signal(number)
        _, err = run.communicate(timeout=SECONDS)
        endings.append((run.returncode, re.sub(rb"[0-9.e+-]+", b"#", err)))
        shutil.rmtree(folder)
    assert endings[0] == endings[1]
    assert endings[0][0] == 128 + number


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1])
def test_a_signal_that_kills_kills_both(runtime, process, tmp_path, number):
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip("the tests ignore it, as under nohup, and so does what they start")
    run = start(*LONG, "-o", tmp_path / "run")
    started(process)
    wait_for(writes(tmp_path / "run"))
    run.send_signal(number)
    run.communicate(timeout=SECONDS)
    assert run.returncode == -number
    wait_for(lambda: not children(process))


def test_what_was_ignored_is_ignored(runtime, process, tmp_path):
    run = start(*LONG, "-o", tmp_path / "run", program=("nohup", *SERVED))
    started(process)
    wait_for(writes(tmp_path / "run"))
    run.send_signal(signal.SIGHUP)  # the lower number is received first
    run.send_signal(signal.SIGTERM)
    run.communicate(timeout=SECONDS)
    assert run.returncode == 128 + signal.SIGTERM


def test_a_stopped_client_stops_the_run(runtime, process, tmp_path):
    run = start(*LONG, "-o", tmp_path / "run")
    copy = started(process)
    wait_for(writes(tmp_path / "run"))

    def state(number):
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]

    run.send_signal(signal.SIGTSTP)
    wait_for(lambda: state(copy) == state(run.pid) == "T")
    run.send_signal(signal.SIGCONT)
    wait_for(lambda: "T" not in (state(copy), state(run.pid)))
    run.send_signal(signal.SIGTERM)
    run.communicate(timeout=SECONDS)


def test_a_killed_client_ends_its_run(runtime, process, tmp_path):
    run = start(*LONG, "-o", tmp_path / "run")
    started(process)
    run.kill()
    run.communicate(timeout=SECONDS)
    wait_for(lambda: not children(process))


def test_a_killed_run_is_reported_and_the_server_lives(runtime, process, tmp_path):
    run = start(*LONG, "-o", tmp_path / "run")
    copy = started(process)
    wait_for(writes(tmp_path / "run"))
    os.kill(copy, signal.SIGSEGV)
    run.communicate(timeout=SECONDS)
    assert run.returncode == -signal.SIGSEGV
    assert call("schema") == alone("schema")
    assert not children(process)


def test_working_folder_umask_and_environment_are_those_of_the_caller(runtime, tmp_path):
    program = ("sh", "-c", 'umask 027; exec "$0" "$@"', *SERVED)
    status, _, err = call(*SHORT, "-o", "here", program=program, cwd=tmp_path)
    assert status == 0, err
    assert (tmp_path / "here" / "states.csv").stat().st_mode & 0o777 == 0o640
    assert b"-> here" in err


def test_a_limit_is_taken_over(runtime, tmp_path):
    program = ("sh", "-c", 'ulimit -f 1; exec "$0" "$@"', *SERVED)
    words = (*SHORT, "--t-final", "10", "-o", "run")
    served = call(*words, program=program, cwd=tmp_path)
    shutil.rmtree(tmp_path / "run")
    assert served == alone(*words, program=program, cwd=tmp_path)
    assert served[0] != 0


@pytest.mark.slow
def test_large_output_and_a_reader_that_has_seen_enough(runtime, tmp_path):
    """A line for each of many faults, 60 kB."""
    body = "<rigidBody><name>{}</name><mass>-1</mass></rigidBody>"
    bodies = "".join(body.format(f"B{k}" * 300) for k in range(200))
    (tmp_path / "deck.xml").write_text(f"<data><system><bodies>{bodies}</bodies></system></data>")
    served = call("check", "deck.xml", cwd=tmp_path)
    assert served == alone("check", "deck.xml", cwd=tmp_path)
    assert len(served[1] + served[2]) > 60_000
    for program in (SERVED, ("env", "MSAHL_SERVER=0", *MSAHL)):
        line = f"{shlex.join(program)} check deck.xml 2>&1 | head -c 10; echo ${{PIPESTATUS[0]}}"
        found = subprocess.run(["bash", "-c", line], cwd=tmp_path, capture_output=True, check=True)
        assert found.stdout.endswith(b"2\n"), found.stdout
        assert found.stderr == b""


@pytest.mark.slow
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", ">/dev/full"])
def test_closed_and_full_files(runtime, closed, tmp_path):
    program = ("sh", "-c", f'exec "$0" "$@" {closed}', *SERVED)
    assert call("schema", program=program) == alone("schema", program=program)
    words = (*SHORT, "-o", "run")
    assert call(*words, program=program, cwd=tmp_path) == alone(
        *words, program=program, cwd=tmp_path
    )


def test_a_terminal_is_a_terminal(runtime, tmp_path):
    """Bars and colours depend on it."""
    shown = []
    for program in (SERVED, ("env", "MSAHL_SERVER=0", *MSAHL)):
        ours, theirs = pty.openpty()
        words = (*SHORT, "-o", tmp_path / "run")
        run = start(*words, program=program, stdout=theirs, stderr=theirs)
        assert run.wait(timeout=SECONDS) == 0
        os.close(theirs)
        shown.append(last_of_terminal(ours))
    assert shown[0] == shown[1]
    assert b"100%" in shown[0]


def last_of_terminal(terminal):
    """What stands on a terminal at the end: bars begin their line again, on a slow machine more
    often."""
    printed = b""
    with suppress(OSError):  # nobody has it open any more
        while part := os.read(terminal, 1 << 12):
            printed += part
    os.close(terminal)
    return printed.replace(b"\r\n", b"\n").rpartition(b"\r")[2]


def test_another_environment_is_not_served(runtime, tmp_path):
    """A variable that counts when the program is loaded."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    status, _, err = call("schema", env=environment)
    assert status == 1
    assert b"ImportError" in err or b"ModuleNotFoundError" in err
    assert msahl("schema", env=environment) == call("schema")


@pytest.mark.skipif(not shutil.which("setpriv"), reason="setpriv is not installed")
def test_a_process_with_other_rights_is_not_served(runtime):
    """It must not get by the server what it may not do itself."""
    status, _, err = call("schema", program=("setpriv", "--no-new-privs", *SERVED))
    assert status == 1
    assert b"ImportError" in err or b"ModuleNotFoundError" in err


def test_files_of_the_process_itself_are_not_served():
    assert ask(["msahl", "check", "/dev/fd/3"]) is None
    assert ask(["msahl", "sweep", "deck.xml"]) is None
    assert ask(["msahl"]) is None


# Without a server -------------------------------------------------------------------------------


@pytest.fixture
def place(tmp_path, monkeypatch):
    """An empty folder of servers of this user."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    folder = Path(client.folder())
    folder.mkdir(mode=0o700)
    return Path(client.socket_path())


def test_a_dead_server_is_passed_over(place):
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(place))
    listener.close()
    assert ask(["msahl", "schema"]) is None


def test_a_silent_server_is_passed_over(place, monkeypatch):
    monkeypatch.setattr("msahl.serve.handover.PATIENCE", 0.01)
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(place))
    listener.listen()
    assert ask(["msahl", "schema"]) is None
    listener.close()


@contextmanager
def answering(place, *answers):
    """A server that says that it is ready, and to the first request what is given."""

    def answer():
        connection, _ = listener.accept()
        with connection:
            connection.send(client.READY)
            connection.recv(1 << 20)
            connection.send(b"".join(answers))
            # To close with something unread would break off what the client reads.
            connection.shutdown(socket.SHUT_WR)
            with contextlib.suppress(OSError):
                while connection.recv(1 << 20):
                    pass

    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(place))
        listener.listen()
        listener.settimeout(SECONDS)
        server = threading.Thread(target=answer)
        server.start()
        yield
        server.join()


def test_a_command_that_ended_before_its_process_was_known_is_not_repeated(place):
    """The client was not awake meanwhile; that process does not exist any more."""
    with subprocess.Popen(["true"]) as ended:
        ended.wait()
    known = ended.pid.to_bytes(4, "little")
    with answering(place, client.ACCEPTED, known, client.ENDED, b"\3"):
        assert call("schema") == (3, b"", b"")


def open_files():
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.mark.parametrize("answer", [client.REFUSED, b""], ids=["refused", "closed"])
def test_signals_do_what_they_did_where_nothing_was_handed_over(place, answer):
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    files = open_files()
    with answering(place, answer):
        assert ask(["msahl", "schema"]) is None
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
    assert open_files() == files


def test_a_copy_that_has_ended_is_not_killed(place, monkeypatch):
    """Its client is gone as well, and its number may be another process's by now."""
    monkeypatch.setattr(os, "kill", lambda *given: pytest.fail("killed"))
    server = Server(lambda: None, list, lambda names: None, Sources([]), 1.0)
    with socket.socket(socket.AF_UNIX) as connection:
        server._abandon(os.getpid(), connection)


def test_a_server_that_can_make_no_copy_refuses(place, monkeypatch):
    monkeypatch.setattr(os, "fork", lambda: (_ for _ in ()).throw(BlockingIOError))
    server = Server(lambda: None, list, lambda names: None, Sources([]), 1.0)
    files = open_files()
    with socket.socket(socket.AF_UNIX) as connection:
        assert not server._fork(None, connection)
    assert open_files() == files


@pytest.mark.parametrize("mode", [0o777, 0o720, 0o750])
def test_a_folder_that_others_can_enter_is_not_trusted(place, mode):
    place.parent.chmod(mode)
    place.touch()
    assert ask(["msahl", "schema"]) is None


def test_a_folder_of_another_user_is_not_trusted(place, monkeypatch):
    place.touch()
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    assert ask(["msahl", "schema"]) is None


def test_the_socket_of_another_user_is_refused(place, monkeypatch):
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(place))
    listener.listen()
    monkeypatch.setattr("msahl.serve.handover.peer", lambda connection: (1, os.geteuid() + 1))
    assert ask(["msahl", "schema"]) is None
    listener.close()


@pytest.mark.slow
def test_an_idle_server_ends(tmp_path):
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)}
    assert msahl("serve", "--idle", "0.01", env=environment)[0] == 0
    wait_for(lambda: not any((tmp_path / "msahl").iterdir()))


@pytest.mark.slow
def test_a_change_of_the_program_ends_the_server(tmp_path):
    """Two versions: that of the server, and what was installed since."""
    copy = tmp_path / "copy"
    shutil.copytree(ROOT / "msahl", copy / "msahl", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "schemas", copy / "schemas")
    shutil.copytree(ROOT / "decks" / "joints", copy / "decks" / "joints")
    place = {"XDG_RUNTIME_DIR": str(tmp_path), "PYTHONPATH": str(copy)}
    environment = {**os.environ, **place}
    program = (sys.executable, "-P", "-c", MSAHL[2])
    assert msahl("serve", env=environment, program=program)[0] == 0
    (path,) = (tmp_path / "msahl").iterdir()
    before = msahl("run", "--help", env=environment, program=program)
    (copy / "msahl" / "version.py").write_text('"""Another."""\n\nVERSION = "0.2.0"\n')
    assert msahl("run", "--help", env=environment, program=program) == before
    wait_for(lambda: not path.exists())


@pytest.mark.slow
def test_a_killed_server_leaves_the_run_to_its_end(tmp_path):
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)}
    _, _, err = msahl("serve", env=environment)
    process = int(re.search(rb"process (\d+)", err)[1])
    run = start(*LONG, "-o", tmp_path / "run", env=environment)
    started(process)
    wait_for(writes(tmp_path / "run"))
    os.kill(process, signal.SIGKILL)
    run.send_signal(signal.SIGINT)
    run.communicate(timeout=SECONDS)
    assert run.returncode == 128 + signal.SIGINT
    # The socket that it left behind is no server.
    assert msahl("schema", env=environment) == alone("schema", env=environment)
    assert msahl("serve", env=environment)[0] == 0
    assert msahl("serve", "--stop", env=environment)[0] == 0
    assert msahl("serve", "--stop", env=environment)[2] == b"msahl serve: no server is running\n"


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("make"), reason="make is not installed")
def test_a_makefile_of_many_runs(runtime, tmp_path):
    command = f'{MSAHL[0]} -c "{SERVED[2]}" run {DECK} --error off --solver newton'
    (tmp_path / "Makefile").write_text(
        "all: $(foreach k,$(shell seq 30),$(k).run)\n"
        f"%.run:\n\t@{command} --t-final 0.0$* -q -o $@\n"
    )
    subprocess.run(["make", "-s", "-j2"], cwd=tmp_path, check=True, timeout=600)
    assert len([path for path in tmp_path.glob("*.run") if (path / "states.csv").is_file()]) == 30
