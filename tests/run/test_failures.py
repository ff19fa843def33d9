"""Ways a run can go wrong: each ends in a message, a status, complete rows and a run.json."""

import json
import re
import signal
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

import msahl.run.loop
from msahl.cli import console
from msahl.cli.interruption import Interruption
from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.jit import compiled
from msahl.jit.kernel_store import Store
from msahl.results.lock import locked
from msahl.results.read import read_run, read_table
from msahl.results.write import RESERVED, RunFolder, Table, write_beginning, write_json
from msahl.study import page
from msahl.study.plan import Plan
from msahl.study.runs import with_step
from msahl.study.search import Search
from msahl.study.study import study
from tests.cli.test_commands import BLASTED
from tests.run.test_resume import interrupted, stop_after
from tests.support.models import ROOT, pendulum

SINGLE = ROOT / "decks" / "thesis" / "single_pendulum_45.xml"
SHORT = (SINGLE, "--dt", 0.01, "--t-final", 0.2)


def call(command, *words):
    return CliRunner().invoke(main, [command, *map(str, words)])


def info(folder):
    return json.loads((folder / "run.json").read_text())


def tables(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.csv")}


def test_the_documents_list_the_statuses():
    """The table of docs/results.md has every status of a run, and that of a bad verdict."""
    text = (ROOT / "docs" / "results.md").read_text()
    listed = dict(re.findall(r"^\| (\d+) \| `([a-z ]+)` \|", text, flags=re.MULTILINE))
    statuses = {str(number): status for status, number in console.STATUS.items()}
    assert listed == statuses | {"143": "interrupted", str(console.BAD_VERDICT): "completed"}


# The disk ----------------------------------------------------------------------------------------

SMALL_FILES = """
import resource, sys
from msahl.cli.main import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv.pop(1)), resource.RLIM_INFINITY))
import msahl.run.loop
msahl.run.loop.SAVE_SECONDS, msahl.run.loop.SAVE_SHARE, msahl.run.loop.CHUNK_SECONDS = 0.0, 0.1, 0.0
main()
"""


@pytest.mark.slow
def test_rows_before_a_full_disk_are_complete_and_the_run_can_go_on(tmp_path):
    """Files may not grow beyond 20 kB, far less than a run of 200 rows of 13 doubles writes."""
    words = [str(word) for word in (SINGLE, "--dt", 0.01, "--t-final", 2.0)]
    assert call("run", *words, "-o", tmp_path / "complete").exit_code == 0  # compiles, too
    command = [sys.executable, "-c", SMALL_FILES, "20000", "run", *words, "-o", tmp_path / "out"]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 4, ran.stderr
    told = info(tmp_path / "out")
    assert told["status"] == "not written"
    assert told["message"] in ran.stderr
    assert "states.csv.part: File too large; rows up to t = " in told["message"]
    assert "Free some disk space" in told["message"]
    assert "Traceback" not in ran.stderr
    run = read_run(tmp_path / "out")
    assert len(run.states) == len(run.reactions) == told["outputTimes"] == told["steps"] + 1 > 50
    for name in ("states.csv", "reactions.csv"):
        complete = (tmp_path / "complete" / name).read_bytes()
        part = (tmp_path / "out" / f"{name}.part").read_bytes()
        assert part.endswith(b"\n")
        assert complete.startswith(part)
    assert call("run", *words, "-o", tmp_path / "out", "--resume").exit_code == 0
    assert tables(tmp_path / "out") == tables(tmp_path / "complete")


def test_a_table_that_cannot_be_written_takes_no_row_of_the_others(tmp_path, monkeypatch):
    rows = np.ones((3, 13))
    with RunFolder(tmp_path, pendulum(), b"<deck/>") as results:
        results.write({"states": rows, "reactions": rows[:, :4]})
        ends = results.ends()
        append = Table._append

        def full(self, text):
            if self.path.name == "reactions.csv":
                append(self, text[:5])
                raise OSError(28, "No space left on device", str(self.part))
            append(self, text)

        monkeypatch.setattr(Table, "_append", full)
        with pytest.raises(OSError, match="No space"):
            results.write({"states": rows, "reactions": rows[:, :4]})
        assert results.ends() == ends
    for name, end in ends.items():
        assert (tmp_path / f"{name}.part").stat().st_size == end
    assert len(read_table(tmp_path / "states.csv.part")) == 3


def test_run_json_has_its_space_from_the_start(tmp_path):
    write_beginning(tmp_path, {"status": "running", "pid": 1})
    part = tmp_path / "run.json.part"
    assert json.loads(part.read_text())["status"] == "running"
    before = part.stat()
    assert before.st_size > RESERVED
    write_json(tmp_path / "run.json", {"status": "not written"})
    # The same file, written over: no more workspace is needed.
    assert (tmp_path / "run.json").stat().st_ino == before.st_ino
    assert info(tmp_path) == {"status": "not written"}


@pytest.mark.parametrize("below", ["", "out"])
def test_a_file_in_the_place_of_the_folder_is_named(tmp_path, below):
    (tmp_path / "file").write_text("a file")
    for command in ("run", "study"):
        result = call(command, SINGLE, "-o", tmp_path / "file" / below)
        assert result.exit_code == 4, result.output
        assert str(tmp_path / "file") in result.stderr
        assert "choose another folder with -o" in result.stderr
    assert (tmp_path / "file").read_text() == "a file"


def test_compiled_code_that_cannot_be_kept_is_reported_and_the_run_goes_on(tmp_path, monkeypatch):
    """A cache that others can write to is not trusted: code is compiled and not kept."""
    unsafe = Store(tmp_path / "root" / "sources")
    unsafe.save("points-auto", b"")
    unsafe.folder.chmod(0o777)
    monkeypatch.setattr(compiled, "STORE", unsafe)
    assert unsafe.load("code") is None  # as for the first kernel that is not in memory
    result = call("run", *SHORT, "-o", tmp_path / "out")
    assert result.exit_code == 0
    assert result.stderr.count(f"{unsafe.folder} can be written to by other users") == 1
    assert "NUMBA_CACHE_DIR" in result.stderr
    assert info(tmp_path / "out")["status"] == "completed"


# Two runs in one folder --------------------------------------------------------------------------


def test_a_folder_in_use_is_left_alone_and_the_process_named(tmp_path):
    with locked(tmp_path):
        write_beginning(tmp_path, {"pid": 4711, "msahl": "0", "deck": {"path": str(SINGLE)}})
        for more in ((), ("--resume",)):
            result = call("run", *SHORT, "-o", tmp_path, *more)
            assert result.exit_code == 2
            assert f"{tmp_path}: process 4711 is writing a run there" in result.stderr
            assert "choose another folder with -o" in result.stderr
        assert [path.name for path in tmp_path.iterdir()] == ["run.json.part"]
    assert call("run", *SHORT, "-o", tmp_path).exit_code == 0


HOLD = """
import os, signal, sys
from pathlib import Path
from msahl.results.lock import locked
with locked(Path(sys.argv[1])):
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_process_leaves_no_lock(tmp_path):
    killed = subprocess.run([sys.executable, "-c", HOLD, str(tmp_path)], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert call("run", *SHORT, "-o", tmp_path).exit_code == 0


# Stopped -----------------------------------------------------------------------------------------


def test_a_second_signal_stops_at_once_with_complete_rows(tmp_path, monkeypatch):
    """It comes in the middle of a write; the rows of that chunk go, those before stay."""
    append, writes = Table._append, []

    def interrupt(self, text):
        writes.append(self.path.name)
        if len(writes) == 13:  # three heads and three rows of three tables: then states again
            append(self, text[: len(text) // 2])
            raise KeyboardInterrupt
        append(self, text)

    with monkeypatch.context() as patch:
        patch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.0)
        patch.setattr(Table, "_append", interrupt)
        result = call("run", *SHORT, "-o", tmp_path)
    assert result.exit_code == 130
    assert "stopped at once, after t = 0.02 s" in result.stderr
    told = info(tmp_path)
    assert (told["status"], told["outputTimes"], told["steps"]) == ("interrupted", 3, 2)
    states = (tmp_path / "states.csv.part").read_text()
    assert states.endswith("\n")
    assert states.count("\n") == 4


@pytest.mark.parametrize("scheme", ["decaying", "gauss2"])
def test_figures_of_a_run_stopped_at_once_are_of_its_rows(tmp_path, monkeypatch, scheme):
    publish, calls = msahl.run.loop.TimeLoop._publish, []

    def interrupt(self, times, errors):
        calls.append(times)
        if len(calls) == 4:  # the start, and two steps before
            raise KeyboardInterrupt
        return publish(self, times, errors)

    options = ("run", *SHORT, "--scheme", scheme)
    with monkeypatch.context() as patch:
        patch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.0)
        patch.setattr(msahl.run.loop.TimeLoop, "_publish", interrupt)
        assert call(*options, "-o", tmp_path / "stopped").exit_code == 130
    assert call(*options, "--t-final", "0.02", "-o", tmp_path / "complete").exit_code == 0
    stopped, complete = info(tmp_path / "stopped"), info(tmp_path / "complete")
    assert stopped["steps"] == complete["steps"] == 2
    assert stopped["extremes"] == complete["extremes"]
    assert stopped["iterations"] > complete["iterations"]


def test_a_second_signal_before_the_first_step_is_in_run_json(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("msahl.run.subsystem.SubsystemIntegrator.show_start", interrupt)
    result = call("run", *SHORT, "-o", tmp_path)
    assert result.exit_code == 130
    assert "stopped before the first step; start again" in result.stderr
    assert info(tmp_path)["status"] == "interrupted"


def test_a_command_that_is_interrupted_says_so_in_one_line(monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("msahl.cli.check.read", interrupt)
    result = call("check", SINGLE)
    assert (result.exit_code, result.stderr) == (130, "msahl: interrupted\n")


# Starts and steps --------------------------------------------------------------------------------


OPENING = BLASTED.replace(
    "</z></position></init", "</z></position><velocity><v3>1</v3></velocity></init"
).replace("<deltaT>", '<assembly velocity="refuse"/><deltaT>')
"""A velocity that the joint does not allow, and a deck that wants no other."""


def test_a_start_that_cannot_be_is_in_run_json(tmp_path):
    deck = tmp_path / "deck.xml"
    deck.write_text(OPENING)
    result = call("run", deck, "-o", tmp_path / "out")
    assert result.exit_code == 2
    told = info(tmp_path / "out")
    assert (told["status"], told["outputTimes"]) == ("not started", 0)
    assert told["message"] in result.stderr
    assert "initial velocities open a joint" in told["message"]


GROWING = BLASTED.replace(
    "<zForce>1e100</zForce></force>",
    "</force><law><table><entry><t>0</t><value>0</value></entry>"
    "<entry><t>0.1</t><value>0</value></entry>"
    "<entry><t>0.2</t><value>1e100</value></entry></table></law>",
)
"""Nothing pushes for 0.1 s, and then more than any number can tell."""


def test_a_failed_run_fails_at_the_same_step_when_it_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.0)
    monkeypatch.setattr(msahl.run.loop, "SAVE_SECONDS", 0.0)
    deck, out = tmp_path / "deck.xml", tmp_path / "out"
    deck.write_text(GROWING)
    first = call("run", deck, "-o", out)
    assert first.exit_code == 3, first.output
    before, rows = info(out), (out / "states.csv.part").read_bytes()
    assert (before["status"], before["resumed"]) == ("not converged", [])
    assert before["steps"] > 5
    again = call("run", deck, "-o", out, "--resume")
    assert again.exit_code == 3
    after = info(out)
    assert len(after["resumed"]) == 1
    for key in ("status", "message", "steps", "outputTimes", "subdivisions"):
        assert after[key] == before[key]
    assert (out / "states.csv.part").read_bytes() == rows
    finer = call("run", deck, "-o", out, "--resume", "--dt", 0.005)
    assert finer.exit_code == 2
    assert "dt was 0.01, is 0.005 now" in finer.stderr


# Many runs ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_study_without_a_start_or_a_run_to_its_end_says_so(tmp_path):
    deck = tmp_path / "deck.xml"
    deck.write_text(OPENING)
    result = call("study", deck, "--repeat", 1, "-o", tmp_path / "none")
    assert result.exit_code == 2
    assert "initial velocities open a joint" in result.stderr
    deck.write_text(GROWING)
    assert call("run", deck, "-o", tmp_path / "true").exit_code == 3
    words = ("--repeat", 1, "--dt", 0.02, "--dt", 0.01, "--reference", tmp_path / "true")
    result = call("study", deck, *words, "-o", tmp_path / "out")
    assert result.exit_code == 3, result.output
    assert "Runs that did not reach the end time" in (tmp_path / "out" / "study.md").read_text()


def test_a_stopped_study_reports_the_runs_it_has_made(tmp_path, monkeypatch):
    """A step a chunk: 10, 20 and 40 steps, after some to warm up, so the last is cut."""
    asked = stop_after(55)
    monkeypatch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.0)

    def ask(self):
        if not self.signal and asked():
            self.note(signal.SIGTERM, None)
        return self.signal != 0

    monkeypatch.setattr(Interruption, "__call__", ask)
    monkeypatch.setattr(page, "_pictures", lambda study: [])
    words = (SINGLE, "--dt", 0.1, "--dt", 0.05, "--dt", 0.025, "--t-final", 1, "--repeat", 2)
    result = call("study", *words, "--scheme", "preserving", "-o", tmp_path)
    assert result.exit_code == 143, result.output
    assert "the report contains the runs that had ended" in result.stderr
    assert "stopped before all of its runs were made" in (tmp_path / "study.md").read_text()
    rows = (tmp_path / "study.csv").read_text().splitlines()
    assert len(rows) == 3  # the head, and the runs at 0.1 and 0.05 s


def test_a_study_whose_budget_is_used_up_at_once_names_the_remedy(tmp_path, monkeypatch):
    """Every run takes longer than it may, as on a busy machine."""
    monkeypatch.setattr(Search, "run", lambda *_: None)
    monkeypatch.setattr(Search, "left", -1.0)
    words = (SINGLE, "--t-final", 0.1, "--scheme", "preserving", "--budget", 5)
    result = call("study", *words, "-o", tmp_path)
    assert result.exit_code == 3, result.output
    assert "the budget of 5 s was used up before a run had ended" in result.stderr
    assert "Try --budget 20" in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_study_stopped_before_its_first_run_writes_nothing(tmp_path, monkeypatch):
    def ask(self):
        self.signal = signal.SIGINT
        return True

    monkeypatch.setattr(Interruption, "__call__", ask)
    result = call("study", SINGLE, "--dt", 0.1, "--t-final", 1, "-o", tmp_path)
    assert result.exit_code == 130
    assert "stopped before a run had ended; nothing was written" in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_study_keeps_the_repeats_it_has():
    model = with_step(read_deck(SINGLE), 0.1, 1.0)
    plan = Plan(model, (0.1, 0.05), ("preserving",), repeats=2)
    ran = []
    result = study(plan, ran.append, lambda: len(ran) == 3)
    assert (result.stopped, ran) == (True, ["preserving 0.1", "preserving 0.05", "preserving 0.1"])
    assert [point.trial.dt for point in result.runs] == [0.1, 0.05]
    complete = study(plan)
    errors = [[p.largest("position") for p in r.runs][:2] for r in (result, complete)]
    assert errors[0] == errors[1]


# Interrupted, then another command ---------------------------------------------------------------


def test_an_interrupted_run_can_be_read_and_begun_anew(tmp_path, monkeypatch):
    interrupted(monkeypatch, tmp_path, *SHORT)
    assert len(read_run(tmp_path).states) == 5
    assert call("run", *SHORT, "-o", tmp_path).exit_code == 0
    assert info(tmp_path)["resumed"] == []
    assert not (tmp_path / "checkpoint").exists()
