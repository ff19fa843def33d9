"""The folder of results: complete ones stay until new ones are; nothing else is ever lost."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

import msahl.run.loop
from msahl.cli.main import main
from msahl.results import folder as folders
from msahl.results.folder import find
from msahl.results.read import read_info, read_run, read_table
from msahl.results.write import RunFolder, Table
from tests.run.test_failures import GROWING, OPENING
from tests.run.test_resume import interrupted
from tests.support.models import ROOT

SINGLE = ROOT / "decks" / "thesis" / "single_pendulum_45.xml"
FREE = ROOT / "decks" / "basics" / "torque_free.xml"
COMPLETE = {"states.csv", "reactions.csv", "run.json", "deck.xml", "error.csv"}


def run(*words, status=0):
    result = CliRunner().invoke(main, ["run", *map(str, words)])
    assert result.exit_code == status, result.output
    return result.stderr


def contents(folder):
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}


@pytest.fixture
def out(tmp_path):
    """A complete run of ten steps."""
    run(SINGLE, "--dt", 0.01, "--t-final", 0.1, "-o", tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == COMPLETE
    return tmp_path / "out"


# What was complete stays -------------------------------------------------------------------------


def test_a_run_that_is_stopped_leaves_the_complete_one_before_it(out, tmp_path, monkeypatch):
    before = contents(out)
    words = (SINGLE, "--dt", 0.02, "--t-final", 0.2)
    stopped = interrupted(monkeypatch, out, *words)
    assert f"-> {out / 'incomplete'}" in stopped.stderr
    assert f"the complete results of an earlier run are still in {out}" in stopped.stderr
    assert contents(out) == before
    assert read_run(out).time[-1] == 0.1
    assert read_run(out / "incomplete").time[-1] == 0.08
    assert read_info(out / "incomplete")["status"] == "interrupted"
    run(*words, "-o", out, "--resume")
    assert {path.name for path in out.iterdir()} == COMPLETE
    run(*words, "-o", tmp_path / "other")
    for name in ("states.csv", "reactions.csv"):
        assert (out / name).read_bytes() == (tmp_path / "other" / name).read_bytes()


def _no_start(deck, monkeypatch):
    deck.write_text(OPENING)
    return 2


def _no_deck(deck, monkeypatch):
    deck.write_text("<data/>")
    return 2


def _no_step(deck, monkeypatch):
    deck.write_text(GROWING)
    return 3


def _no_workspace(deck, monkeypatch):
    append = Table._append

    def full(self, text):
        if not text.startswith(b"time"):
            raise OSError(28, "No space left on device", str(self.part))
        append(self, text)

    monkeypatch.setattr(Table, "_append", full)
    return 4


def _no_name(deck, monkeypatch):
    """Refused last of all: to give the tables their names."""
    replace = Path.replace

    def refuse(self, target):
        if self.name == "reactions.csv.part":
            raise OSError(28, "No space left on device", str(self))
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", refuse)
    return 4


@pytest.mark.parametrize("fail", [_no_deck, _no_start, _no_step, _no_workspace, _no_name])
def test_a_run_that_fails_leaves_the_complete_one_before_it(tmp_path, monkeypatch, fail):
    deck, out = tmp_path / "deck.xml", tmp_path / "out"
    deck.write_bytes(SINGLE.read_bytes())
    run(deck, "--dt", 0.01, "--t-final", 0.1, "-o", out)
    before = contents(out)
    status = fail(deck, monkeypatch)
    run(deck, "-o", out, status=status)
    assert contents(out) == before


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # no other thread computes here
def test_at_any_kill_the_folder_holds_the_old_or_the_new_run(tmp_path):
    """Killed before each change of a name. A top, which has no reactions, takes the place of a
    pendulum, which has.
    """
    deck, out = tmp_path / "deck.xml", tmp_path / "out"
    deck.write_bytes(SINGLE.read_bytes())
    run(deck, "--dt", 0.01, "--t-final", 0.1, "-o", out)
    old = contents(out)
    deck.write_bytes(FREE.read_bytes())
    run(deck, "--dt", 0.01, "--t-final", 0.1, "-o", tmp_path / "new")
    new = {name: (tmp_path / "new" / name).read_bytes() for name in ("states.csv", "deck.xml")}
    found = []
    for count in range(1, 80):  # each table may be removed and renamed
        for path in (out, out / "incomplete"):
            for name in contents(path) if path.is_dir() else ():
                (path / name).unlink()
        for name, content in old.items():
            (out / name).write_bytes(content)
        # In this process, where nothing is to be compiled: a fork may be killed.
        child = os.fork()
        if child == 0:
            _kill_at(count)
            run(deck, "--dt", 0.01, "--t-final", 0.1, "-o", out)
            os._exit(0)
        _, ended = os.waitpid(child, 0)
        states, reactions = find(out, "states.csv"), find(out, "reactions.csv")
        is_old = states.read_bytes() == old["states.csv"]
        assert is_old or states.read_bytes() == new["states.csv"]
        expected = old if is_old else new
        assert folders.find(out, "deck.xml").read_bytes() == expected["deck.xml"]
        assert (reactions is not None) == is_old
        assert read_info(out)["outputTimes"] == 11
        assert read_run(out).partial is False
        found.append(is_old)
        if not os.WIFSIGNALED(ended):
            break
    assert os.waitstatus_to_exitcode(ended) == 0
    assert found == sorted(found, reverse=True)  # the old run to some change, then the new one
    assert 5 < sum(found) < len(found) - 3
    assert {path.name for path in out.iterdir()} == COMPLETE - {"reactions.csv"}


def _kill_at(count):
    """Have this process killed before it changes a name for the ``count``th time."""
    left = [count]

    def counted(change):
        def wrapped(self, *given, **more):
            left[0] -= 1
            if left[0] == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return change(self, *given, **more)

        return wrapped

    Path.replace, Path.unlink = counted(Path.replace), counted(Path.unlink)


def test_the_next_run_finishes_a_replacement_that_was_killed(out, monkeypatch):
    """Complete inside, and not a file moved yet."""
    with monkeypatch.context() as patch:
        patch.setattr(folders, "finish", lambda folder: None)
        run(SINGLE, "--dt", 0.01, "--t-final", 0.2, "-o", out)
    assert read_run(out).time[-1] == 0.2
    told = run(SINGLE, "--dt", 0.01, "--t-final", 0.2, "-o", out, "--resume")
    assert "is complete" in told
    assert {path.name for path in out.iterdir()} == COMPLETE
    assert read_table(out / "states.csv")["time"].iloc[-1] == 0.2


# What is not a run's is left alone ---------------------------------------------------------------


@pytest.mark.parametrize("name", ["notes.txt", "states.csv", "checkpoint", "deck.xml", "run.json"])
def test_a_folder_that_holds_something_else_is_refused(tmp_path, name):
    (tmp_path / name).write_text("{}")
    told = run(SINGLE, "-o", tmp_path, status=2)
    assert f"{tmp_path}: not empty, and not the results of a run" in told
    assert "choose another folder with -o" in told
    assert contents(tmp_path) == {name: b"{}"}


def test_what_is_beside_results_stays_there(out):
    (out / "notes.txt").write_text("mine")
    (out / "checkpoint").mkdir()  # as others call theirs
    told = run(SINGLE, "--dt", 0.02, "--t-final", 0.2, "-o", out, status=2)
    assert f"{out / 'checkpoint'}: not a checkpoint of msahl" in told
    (out / "checkpoint").rmdir()
    (out / "checkpoint").write_text("of another program")
    run(SINGLE, "--dt", 0.02, "--t-final", 0.2, "-o", out, status=2)
    assert (out / "checkpoint").read_text() == "of another program"
    (out / "checkpoint").unlink()
    run(SINGLE, "--dt", 0.02, "--t-final", 0.2, "-o", out)
    assert (out / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("name", ["deck.xml", "own.xml"])
def test_a_deck_is_never_written_over(tmp_path, name):
    deck = tmp_path / name
    deck.write_bytes(SINGLE.read_bytes())
    run(deck, "-o", tmp_path, status=2)
    assert contents(tmp_path) == {name: SINGLE.read_bytes()}


def test_the_deck_of_a_run_is_not_written_over_by_its_own_run(out):
    deck = out / "deck.xml"
    deck.write_bytes(deck.read_bytes() + b"<!-- edited -->\n")
    before = contents(out)
    told = run(deck, "--dt", 0.02, "-o", out, status=2)
    assert "choose another folder with -o" in told
    assert contents(out) == before


def test_two_decks_of_one_name_do_not_share_their_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("x", "y"):
        (tmp_path / name).mkdir()
    (tmp_path / "x" / "m.xml").write_bytes(SINGLE.read_bytes())
    (tmp_path / "y" / "m.xml").write_bytes(FREE.read_bytes())
    words = ("--dt", 0.01, "--t-final", 0.1)
    run("x/m.xml", *words)
    before = contents(tmp_path / "results" / "m")
    told = run("y/m.xml", *words, status=2)
    assert "results/m: holds the results of another deck, x/m.xml; choose another folder" in told
    assert contents(tmp_path / "results" / "m") == before
    # As seen from another folder, or with all that is here moved elsewhere, it is the same deck.
    (tmp_path / "x" / "m.xml").write_bytes(SINGLE.read_bytes() + b"\n")
    monkeypatch.chdir(tmp_path / "x")
    run("m.xml", *words, "-o", "../results/m")
    (tmp_path / "x").rename(tmp_path / "moved")
    monkeypatch.chdir(tmp_path)
    run("moved/m.xml", *words, "-o", "results/m")  # the same text


# Links -------------------------------------------------------------------------------------------


LINKED = ("states.csv", "states.csv.part", "reactions.csv.part", "run.json.part", ".run.json",
          "deck.xml", "deck.xml.part", "checkpoint", "checkpoint.part")  # fmt: skip


@pytest.mark.parametrize("kind", ["symbolic", "hard"])
@pytest.mark.parametrize("before", ["complete", "stopped"])
def test_links_are_replaced_and_not_followed(tmp_path, monkeypatch, before, kind):
    """Links to a file of the user's in the place of every file that the run writes."""
    precious, out = tmp_path / "precious", tmp_path / "out"
    precious.write_bytes(folders.HEAD)  # as a checkpoint begins: hard links to others are refused
    words = (SINGLE, "--dt", 0.01, "--t-final", 0.1)
    work = out
    if before == "complete":
        run(*words, "-o", out)
        work = out / "incomplete"
        work.mkdir()
        (work / "run.json").write_bytes((out / "run.json").read_bytes().replace(b"comp", b"inco"))
    else:
        interrupted(monkeypatch, out, *words)
    for name in LINKED:
        (work / name).unlink(missing_ok=True)
        if kind == "hard":
            os.link(precious, work / name)
        else:
            (work / name).symlink_to(precious)
    for setting in ("SAVE_SECONDS", "CHUNK_SECONDS"):  # checkpoints are written as well
        monkeypatch.setattr(msahl.run.loop, setting, 0.0)
    monkeypatch.setattr(msahl.run.loop, "SAVE_SHARE", 1e9)
    run(*words, "-o", out)
    assert precious.read_bytes() == folders.HEAD
    assert precious.stat().st_nlink == 1
    assert not any(path.is_symlink() for path in out.iterdir())
    assert {path.name for path in out.iterdir()} >= COMPLETE


def test_a_link_in_the_place_of_the_inner_folder_is_refused(out, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (out / "incomplete").symlink_to(tmp_path / "elsewhere")
    told = run(SINGLE, "--dt", 0.02, "-o", out, status=2)
    assert f"{out / 'incomplete'}: not written by msahl" in told
    assert not any((tmp_path / "elsewhere").iterdir())


def test_a_table_that_became_a_link_is_not_gone_on_with(tmp_path, monkeypatch):
    words = (SINGLE, "--dt", 0.01, "--t-final", 0.1)
    interrupted(monkeypatch, tmp_path / "out", *words)
    part = tmp_path / "out" / "states.csv.part"
    (tmp_path / "precious").write_bytes(part.read_bytes())
    before = (tmp_path / "precious").read_bytes()
    part.unlink()
    part.symlink_to(tmp_path / "precious")
    run(*words, "-o", tmp_path / "out", "--resume", status=4)
    assert (tmp_path / "precious").read_bytes() == before


# The folder's own end, and that of stderr ---------------------------------------------------------


def test_a_folder_removed_during_the_run_is_reported(tmp_path, monkeypatch):
    def remove(self, *tables):
        for path in self.folder.iterdir():
            path.unlink()
        self.folder.rmdir()

    monkeypatch.setattr(RunFolder, "write", remove)
    told = run(SINGLE, "--dt", 0.01, "--t-final", 0.01, "-o", tmp_path / "out", status=4)
    assert "the folder was removed or renamed while the run wrote into it" in told
    assert "Free some disk space" not in told


def test_an_empty_name_is_no_folder():
    assert "--output" in run(SINGLE, "-o", "", status=2)


@pytest.mark.parametrize("closed", ["2>&-", "2>&- >&- <&-", "2> >(exec <&-; sleep 0.1)"])
def test_results_do_not_depend_on_who_reads_stderr(tmp_path, closed):
    """A closed stderr, and a pipe whose reader has gone: the status is the run's own."""
    words = f"run {SINGLE} --dt 0.01 --t-final 0.1 -o {tmp_path / 'out'}"
    code = "import time; time.sleep(0.2); from msahl.cli.main import main; main()"
    program = f"{sys.executable} -c '{code}'"
    ended = subprocess.run(["bash", "-c", f"{program} {words} {closed}"], check=False)
    assert ended.returncode == 0
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "completed"
