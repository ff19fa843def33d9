"""The command ``msahl sweep``: plans in words, faults before the first run, exit statuses."""

import errno
import os
import signal
import subprocess
import sys
import time

import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.cli.sweep import duration, progress_line
from msahl.sweep import journal as journal_module
from msahl.sweep import pool
from msahl.sweep.journal import journal_lines
from msahl.sweep.store import Counts, read_info
from tests.sweep.decks import DECK
from tests.sweep.fakes import InProcess


def sweep(folder, *words, deck=DECK):
    given = ("sweep", str(deck), "-o", str(folder), "--t-final", "0.1", *words)
    return CliRunner().invoke(main, given)


@pytest.fixture(autouse=True)
def _in_process(monkeypatch):
    monkeypatch.setattr(pool, "Pool", InProcess)


def rows(folder):
    return (folder / "runs.csv").read_text().splitlines()


def test_a_seed_has_64_bits(tmp_path):
    words = ("sweep", DECK, "--set", "L~uniform(60,80) cm", "--sample", "random:1", "--dry-run")
    for seed, status in ((2**64 - 1, 0), (2**64, 2), (-1, 2)):
        ran = CliRunner().invoke(main, [*map(str, words), "--seed", str(seed)])
        assert ran.exit_code == status, ran.output


def test_a_sweep_and_the_same_again(tmp_path):
    words = ("--set", "L=60:100:3 cm", "--over", "dt=0.01,0.005", "--measure", "Rod.z max")
    result = sweep(tmp_path / "s", *words)
    assert result.exit_code == 0, result.stderr
    assert result.stderr.splitlines() == [
        "L = 60, 80, 100 cm (3 values)",
        "--dt = 0.01, 0.005 (2 values)",
        "6 points",
        f"{DECK}: all 6 points are done -> {tmp_path}/s/runs.csv",
    ]
    assert rows(tmp_path / "s")[0] == "point,L [cm],--dt,status,verdict,error,Rod.z max,message,key"
    again = sweep(tmp_path / "s", *words)
    assert "6 of them are done already, 0 remain" in again.stderr
    assert sweep(tmp_path / "s", *words, "-q").output == ""


def test_dry_run_prints_the_plan_and_writes_nothing(tmp_path):
    words = (
        "--set",
        "start=10,20",
        "--set",
        "L~normal(80,4) cm",
        "--sample",
        "sobol:6",
        "--dry-run",
    )
    result = sweep(tmp_path / "s", *words, "--measure", "Rod.z max", "--dry-run")
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert lines[:5] == [
        "start = 10, 20 (2 values)",
        "L ~ normal(80, 4) cm",
        "12 points (sobol:6, seed 0)",
        "note: a Sobol sequence is balanced for powers of 2 only; sobol:4 or sobol:8 covers the "
        "ranges more evenly than sobol:6",
        "measure: Rod.z max",
    ]
    assert lines[-1] == f"0 of 12 points are done in {tmp_path}/s"
    assert not (tmp_path / "s").exists()


def test_points_of_a_file(tmp_path):
    plan = tmp_path / "plan.csv"
    plan.write_text("L [cm],--dt\n60,0.01\n80,\n")
    result = sweep(tmp_path / "s", "--plan", str(plan), "--set", "start=30")
    assert result.exit_code == 0
    assert [row.split(",")[:4] for row in rows(tmp_path / "s")[1:]] == [
        ["1", "60", "0.01", "30"],
        ["2", "80", "", "30"],
    ]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "nothing to vary"),
        (("--set", "L=a"), "'a' is not a value"),
        (("--set", "Lx=1,2"), "no such number or parameter; did you mean L?"),
        (("--set", "L=1,2 kg"), "kg"),
        (("--set", "L=-1,-2"), "Rod"),
        (("--over", "stride=1,2"), "no option '--stride'"),
        (("--over", "scheme=euler"), "'euler' is not one of"),
        (("--over", "t-final=1,2"), "is varied by the plan; omit the option --t-final"),
        (("--set", "L~uniform(1,2)"), "--sample"),
        (("--set", "L=1,2", "--sample", "lhs:3"), "no distribution"),
        (("--set", "L=1,2", "--set", "r=1,2,3", "--zip"), "same number of values"),
        (("--set", "L=1,2", "--measure", "Rod.q max"), "no table has a column 'Rod.q'"),
        (("--set", "L=1,2", "--measure", "Rod.z most"), "such as 'Tip.z max'"),
        (("--set", "L=1,2", "--on-fail", "shrug"), "continue, stop or retry:N"),
        (("--plan", "none.csv"), "cannot be read"),
        (("--plan", "none.csv", "--zip"), "omit --zip"),
        (("--set", "L=1,2", "--timeout", "0"), "timeout"),
        (("--set", "L=1,2", "--jobs", "0"), "jobs"),
    ],
)
def test_a_bad_plan_is_refused_before_the_first_run(tmp_path, words, message):
    result = sweep(tmp_path / "s", *words)
    assert result.exit_code == 2
    assert message in result.stderr
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "s").exists()


def test_all_faults_are_reported_at_once(tmp_path):
    result = sweep(tmp_path / "s", "--set", "L=a", "--set", "r", "--over", "scheme=euler")
    assert len(result.stderr.splitlines()) == 3


def test_a_deck_that_is_missing_is_a_fault_of_the_deck(tmp_path):
    result = sweep(tmp_path / "s", "--set", "L=1", deck=tmp_path / "none.xml")
    assert result.exit_code == 2
    assert "none.xml: cannot be read" in result.stderr


def test_a_failed_point_is_reported_and_the_others_are_run(tmp_path):
    result = sweep(tmp_path / "s", "--set", "L=60,-1,80 cm")
    assert result.exit_code == 1
    assert "1 failed (1 not valid); first: point 2: not valid: " in result.stderr
    assert [row.split(",")[2] for row in rows(tmp_path / "s")[1:]] == [
        *("completed", "not valid", "completed"),
    ]


def test_stop_leaves_a_sweep_that_goes_on(tmp_path):
    words = ("--set", "L=60,-1,80,100 cm", "--jobs", "1")
    result = sweep(tmp_path / "s", *words, "--on-fail", "stop")
    assert result.exit_code == 1
    assert "stopped because a point failed (--on-fail stop)" in result.stderr
    assert "go on with: msahl sweep" in result.stderr
    assert not (tmp_path / "s" / "runs.csv").exists()
    assert sweep(tmp_path / "s", *words).exit_code == 1
    assert len(rows(tmp_path / "s")) == 5


def test_a_verdict_of_fail_is_an_exit_status(tmp_path):
    result = sweep(tmp_path / "s", "--set", "L=60,80 cm", "--accuracy", "1e-14", "--every", "2")
    assert result.exit_code == 1
    assert "2 completed with the verdict FAIL" in result.stderr


def test_a_full_disk_is_reported_with_the_command_to_go_on(tmp_path, monkeypatch):
    def full(descriptor, content):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(journal_module.os, "write", full)
        result = sweep(tmp_path / "s", "--set", "L=60,80 cm")
    assert result.exit_code == 4
    assert "No space left on device; free some disk space" in result.stderr
    assert "go on with: msahl sweep" in result.stderr
    assert sweep(tmp_path / "s", "--set", "L=60,80 cm").exit_code == 0


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="the system limits no sizes of files")
def test_files_that_may_not_grow_are_a_full_disk(tmp_path):
    """A worker cannot write tables."""
    folder = tmp_path / "s"
    words = ("-m", "tests.support.msahl", "sweep", str(DECK), "-o", str(folder), "--jobs", "1",
             "--set", "L=60:100:5 cm", "--t-final", "0.5", "--keep", "all")  # fmt: skip
    limited = ["sh", "-c", 'ulimit -f 12; exec "$@"', "sh", sys.executable, *words]
    first = subprocess.run(limited, capture_output=True, text=True, check=False)
    assert first.returncode == 4
    assert "File too large; free some disk space" in first.stderr
    assert read_info(folder)["status"] == "stopped"
    assert CliRunner().invoke(main, words[2:]).exit_code == 0
    assert len(rows(folder)) == 6


def test_a_folder_of_something_else_is_refused(tmp_path):
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "letter.txt").write_text("dear")
    result = sweep(tmp_path / "s", "--set", "L=60,80 cm")
    assert result.exit_code == 2
    assert "choose another folder with -o" in result.stderr


@pytest.mark.slow
def test_an_interruption_leaves_a_sweep_that_goes_on(tmp_path):
    folder, number = tmp_path / "s", signal.SIGINT
    words = (
        *("sweep", str(DECK), "-o", str(folder), "--jobs", "1", "--error", "off"),
        *("--set", "L=60:100:2000 cm", "--t-final", "0.1"),
    )
    with subprocess.Popen(
        [sys.executable, "-m", "tests.support.msahl", *words], stderr=subprocess.PIPE, text=True
    ) as process:
        for _ in range(3000):
            if (folder / "journal.jsonl").exists() and any(journal_lines(folder / "journal.jsonl")):
                break
            time.sleep(0.02)
        process.send_signal(number)
        _, stderr = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    done = len(list(journal_lines(folder / "journal.jsonl")))
    assert 0 < done < 2000
    assert f"{done} of 2000 points are done -> {folder}/runs.csv.part" in stderr
    assert "go on with: msahl sweep" in stderr
    assert "Traceback" not in stderr


def test_the_progress_in_words():
    counts = Counts(points=1000, done=300, failed=2)
    assert progress_line(counts, 100, 10.0) == (
        "  300 of 1000 points, 2 failed, 20 points/s, 35 s left"
    )
    slow = Counts(points=1000, done=2)
    assert progress_line(slow, 0, 20.0) == "  2 of 1000 points, 10 s per point, 2.8 h left"
    assert duration(600.0) == "10 min"
