"""Commands leave their process at once, and nobody can tell but by the clock."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.models import ROOT

SINGLE = ROOT / "decks" / "thesis" / "single_pendulum_45.xml"

PROGRAM = """
import sys
{first}
class Kept:
    def __del__(self):
        print("torn down")
kept = Kept()
from msahl.command_process import run_command
def program():
    print("printed")
    sys.stderr.write("said")
    {last}
run_command(lambda: program)
"""


def leave(last="sys.exit(3)", first="", flags=(), **settings):
    """A process whose program ends with the statement ``last``."""
    code = PROGRAM.format(first=first, last=last)
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    given = {"capture_output": True, "text": True, "env": buffered} | settings
    return subprocess.run([sys.executable, *flags, "-c", code], check=False, **given)


@pytest.mark.parametrize(
    ("last", "status"),
    [("return", 0), ("sys.exit()", 0), ("sys.exit(3)", 3), ("sys.exit(-1)", 255), ("return 2", 2)],
)
def test_the_status_is_kept_all_is_printed_and_nothing_torn_down(last, status):
    done = leave(last)
    assert (done.returncode, done.stdout, done.stderr) == (status, "printed\n", "said")


@pytest.mark.parametrize(("last", "words"), [("sys.exit('no')", "no"), ("1 / 0", "division")])
def test_messages_and_faults_are_left_to_python(last, words):
    done = leave(last)
    assert done.returncode == 1
    assert words in done.stderr
    assert done.stdout == "printed\ntorn down\n"


@pytest.mark.parametrize(
    ("observer", "flags"),
    [
        ("sys.settrace(lambda *given: None)", ()),
        ("sys.setprofile(lambda *given: None)", ()),
        ("", ("-X", "dev")),
        ("", ("-i",)),
        ("import atexit; del atexit._run_exitfuncs", ()),
    ],
    ids=["tracer", "profiler", "dev", "interactive", "no atexit"],
)
def test_python_ends_processes_that_are_observed(observer, flags):
    code = (
        f"import sys; from msahl.command_process import can_leave\n{observer}\nprint(can_leave())"
    )
    for given, answer in ((code, "False\n"), (code.replace(observer or "?", ""), "True\n")):
        command = [sys.executable, *(flags if answer == "False\n" else ()), "-c", given]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
        assert done.stdout == answer


def test_python_ends_a_process_that_cannot_be_left():
    done = leave(first="import atexit; del atexit._run_exitfuncs")
    assert (done.returncode, done.stdout) == (3, "printed\ntorn down\n")


def test_what_others_registered_is_done_once_and_in_order():
    first = "import atexit; atexit.register(print, 'last'); atexit.register(print, 'first')"
    assert leave(first=first).stdout == "printed\nfirst\nlast\n"


def test_threads_that_work_are_waited_for():
    last = (
        "import threading, time; "
        "threading.Thread(target=lambda: (time.sleep(0.2), print('worked'))).start(); sys.exit(3)"
    )
    done = leave(last)
    assert (done.returncode, done.stdout) == (3, "printed\nworked\ntorn down\n")


def test_output_that_nobody_can_take_is_reported_by_python():
    with Path("/dev/full").open("w") as full:
        done = leave(capture_output=False, stdout=full, stderr=subprocess.PIPE)
    assert done.returncode == 120
    assert "No space left" in done.stderr


ENTRY = "import sys; sys.argv[0] = 'msahl'; from msahl.cli.{} import main; main()"


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [("--version",), ("check", SINGLE), ("check", "none.xml"), ("run", "--dt", "no"), ()]
)
def test_a_command_says_the_same_by_both_entries(words):
    def call(entry):
        command = [sys.executable, "-c", ENTRY.format(entry), *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return done.returncode, done.stdout, done.stderr

    assert call("start") == call("main")
