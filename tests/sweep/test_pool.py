"""Worker processes: rows are those of one process; deaths, time limits and faults of workers."""

import os
import signal
import sys
from dataclasses import replace

import pytest

from msahl.sweep.journal import journal_lines
from msahl.sweep.points import NotWrittenError
from msahl.sweep.pool import MOST_DEATHS, Pool, PoolError
from msahl.sweep.sweep import carry_out
from msahl.sweep.work import OnFail
from tests.sweep.fakes import InProcess, sweep

# Workers are processes that start anew, several for each test.
pytestmark = pytest.mark.slow

BEHAVIOUR = '''
"""Imported by every Python of the test: some points misbehave."""
import os, sys, time
from pathlib import Path

if sys.argv[:1] == ["-m"] or "msahl.sweep.worker" in " ".join(sys.orig_argv):
    import msahl.sweep.points as points

    run = points._run_point
    marks = Path(os.environ["MSAHL_TEST_MARKS"])

    def misbehave(resolver, point):
        what = os.environ.get(f"MSAHL_TEST_POINT_{point.number}", "")
        kind, _, times = what.partition(":")
        mark = marks / f"{point.number}-{os.getpid()}"
        if kind and (not times or len(list(marks.glob(f"{point.number}-*"))) < int(times)):
            mark.touch()
            if kind == "die":
                os.kill(os.getpid(), 9)
            if kind == "sleep":
                time.sleep(60)
            if kind == "raise":
                raise ZeroDivisionError("a fault of ours")
            if kind == "print":
                print("noise", flush=True)
        return run(resolver, point)

    points._run_point = misbehave
'''


@pytest.fixture
def behave(tmp_path, monkeypatch):
    """Let points of worker processes misbehave: behave(3, "die")."""
    (tmp_path / "site").mkdir()
    (tmp_path / "marks").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(BEHAVIOUR)
    path = os.pathsep.join(filter(None, (str(tmp_path / "site"), os.environ.get("PYTHONPATH"))))
    monkeypatch.setenv("PYTHONPATH", path)
    monkeypatch.setenv("MSAHL_TEST_MARKS", str(tmp_path / "marks"))

    def set_behaviour(point, what):
        monkeypatch.setenv(f"MSAHL_TEST_POINT_{point}", what)

    return set_behaviour


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Lines of runs.csv of five points."""
    folder = tmp_path_factory.mktemp("undisturbed") / "s"
    carry_out(five(folder), InProcess())
    return (folder / "runs.csv").read_text().splitlines()


def five(folder, **more):
    return sweep(folder, "L=60:100:5 cm", measures=("Rod.z final",), **more)


def ran(folder, scheduler, **more):
    counts = carry_out(five(folder, **more), scheduler)
    return counts, (folder / "runs.csv").read_text().splitlines()


def test_the_number_of_processes_changes_no_byte_and_none_remains(tmp_path, undisturbed):
    scheduler = Pool(2)
    assert ran(tmp_path / "s", scheduler)[1] == undisturbed
    assert scheduler.workers == []


def test_points_of_a_worker_that_dies_are_run_again(tmp_path, behave, undisturbed):
    behave(1, "die:1")
    behave(4, f"die:{MOST_DEATHS - 1}")
    counts, lines = ran(tmp_path / "s", Pool(2))
    assert counts.good
    assert lines == undisturbed


def test_a_point_at_which_a_worker_died_is_run_after_the_others(tmp_path, behave, undisturbed):
    behave(2, f"die:{MOST_DEATHS - 1}")
    _, lines = ran(tmp_path / "s", Pool(1))
    assert lines == undisturbed
    order = [row["point"] for _, row in journal_lines(tmp_path / "s" / "journal.jsonl")]
    assert order == [1, 3, 4, 5, 2]


def test_a_point_that_kills_its_workers_has_failed(tmp_path, behave, undisturbed):
    behave(3, "die")
    counts, lines = ran(tmp_path / "s", Pool(2))
    assert counts.statuses == {"completed": 4, "crashed": 1}
    assert lines[:3] + lines[4:] == undisturbed[:3] + undisturbed[4:]
    assert lines[3] == (
        "3,80,crashed,FAIL,,,the process that ran it ended without a result, 3 times,".replace(
            "the process that ran it ended without a result, 3 times",
            '"the process that ran it ended without a result, 3 times"',
        )
    )


def test_a_point_that_takes_too_long_has_failed(tmp_path, behave, undisturbed):
    behave(2, "sleep")
    counts, lines = ran(tmp_path / "s", Pool(2, timeout=2.0), timeout=2.0)
    assert counts.statuses == {"completed": 4, "timed out": 1}
    assert lines[2] == "2,70,timed out,FAIL,,,took longer than 2 s (--timeout),"
    assert lines[3:] == undisturbed[3:]


def test_a_point_that_took_too_long_may_be_tried_again(tmp_path, behave, undisturbed):
    behave(2, "sleep:1")
    retry = OnFail("retry", 1)
    counts, lines = ran(tmp_path / "s", Pool(1, timeout=2.0), timeout=2.0, on_fail=retry)
    assert counts.good
    assert lines == undisturbed


def test_a_fault_of_ours_is_a_failed_point_and_noise_does_no_harm(tmp_path, behave, undisturbed):
    behave(3, "raise")
    behave(5, "print")
    counts, lines = ran(tmp_path / "s", Pool(1))
    assert counts.statuses == {"completed": 4, "crashed": 1}
    assert lines[3] == "3,80,crashed,FAIL,,,ZeroDivisionError: a fault of ours,"
    assert lines[4:] == undisturbed[4:]


def test_a_process_that_cannot_be_started_ends_the_sweep(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", str(tmp_path / "none"))
    with pytest.raises(PoolError, match="no process can be started: No such file"):
        carry_out(five(tmp_path / "s"), Pool(1))


def test_a_worker_that_cannot_write_tables_ends_the_sweep(tmp_path):
    made = five(tmp_path / "s", keep="all")
    folder = tmp_path / "elsewhere"
    folder.write_text("no folder")
    job = replace(made.job, folder=str(folder))
    with pytest.raises(NotWrittenError):
        carry_out(replace(made, job=job), Pool(1))


def test_workers_that_cannot_start_end_the_sweep(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(PoolError, match="exit status 1"):
        carry_out(five(tmp_path / "s"), Pool(1))


@pytest.mark.skipif(sys.platform != "linux", reason="children are found in /proc")
def test_a_worker_ends_with_its_sweep(tmp_path):
    """Of a main process that was killed no worker remains, even in the middle of a point."""
    import subprocess
    import time

    script = (
        "import sys; from pathlib import Path\n"
        "from tests.sweep.fakes import sweep; from msahl.sweep.sweep import carry_out\n"
        "from msahl.sweep.pool import Pool; from dataclasses import replace\n"
        "made = sweep(Path(sys.argv[1]), 'L=60:100:5 cm')\n"
        "slow = {'dt': 1e-5, 't_final': 1000.0, 'error': 'off'}\n"
        "carry_out(replace(made, job=replace(made.job, options=slow)), Pool(1))\n"
    )
    with subprocess.Popen([sys.executable, "-c", script, str(tmp_path / "s")]) as main:
        worker = None
        for _ in range(600):
            worker = worker or child_of(main.pid)
            if worker and cpu_seconds(worker) > 1.0:  # it has started and runs
                break
            time.sleep(0.05)
        assert worker is not None
        main.send_signal(signal.SIGKILL)
    for _ in range(200):
        if not is_alive(worker):
            return
        time.sleep(0.05)
    pytest.fail("the worker is still there after 10 s")


def child_of(pid):
    from pathlib import Path

    found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return int(found[0]) if found else None


def cpu_seconds(pid):
    from pathlib import Path

    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return int(fields[11]) / os.sysconf("SC_CLK_TCK")


def is_alive(pid):
    from pathlib import Path

    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_files_of_the_users_folder_are_not_taken_for_modules_of_python(tmp_path, monkeypatch):
    for name in ("queue", "signal", "decimal"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('not a module of Python')")
    monkeypatch.chdir(tmp_path)
    made = sweep(tmp_path / "s", "L=60,70 cm")
    assert carry_out(made, Pool(1)).good
