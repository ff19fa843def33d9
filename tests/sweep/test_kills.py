"""A sweep whose processes are killed again and again ends with the bytes of an undisturbed one."""

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from tests.support.models import ROOT
from tests.sweep.decks import DECK

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="children are found in /proc")

PATIENCE = 120.0
"""Seconds without any new outcome after which the test fails."""


PENDULUM = (
    *(str(DECK), "--set", "L~uniform(60,100) cm", "--set", "start~normal(60,5)"),
    *("--t-final", "0.2", "--measure", "Rod.z max", "--measure", "Hinge.F absmax"),
)
REBOUNDS = (  # dozens for each ball, whose series end before the runs do
    *(str(ROOT / "decks" / "contact" / "bouncing_ball.xml"),),
    *("--set", "Floor.restitution~uniform(0.3,0.8)", "--set", "Ball.mass~normal(1,0.1)"),
    *("--measure", "Ball.z final", "--measure", "Floor.load max"),
)


def command(scene, folder, points):
    return [
        *(sys.executable, "-m", "tests.support.msahl", "sweep", *scene, "-q", "--jobs", "2"),
        *("--sample", f"lhs:{points}", "--seed", "1", "-o", str(folder)),
    ]


def outcomes(folder):
    """The number of lines in the journal."""
    try:
        return (folder / "journal.jsonl").read_bytes().count(b"\n")
    except OSError:
        return 0


def workers_of(pid):
    """The worker processes of a sweep."""
    found = []
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        try:
            if b"msahl.sweep.worker" in Path(f"/proc/{child}/cmdline").read_bytes():
                found.append(int(child))
        except OSError:
            pass
    return found


def kill_and_go_on(scene, folder, points, kills, seed):
    """Run a sweep and kill its main process or a worker ``kills`` times, each time after some more
    outcomes; return how often which of them was killed."""
    chance, killed = random.Random(seed), {"main": 0, "worker": 0}
    process = subprocess.Popen(command(scene, folder, points))
    try:
        for _ in range(kills):
            wanted = outcomes(folder) + chance.randint(1, max(1, points // (2 * kills)))
            began = time.monotonic()
            while outcomes(folder) < wanted and process.poll() is None:
                assert time.monotonic() - began < PATIENCE, "no progress"
                time.sleep(0.002)
            if process.poll() is not None:  # on a busy machine this loop may come too late
                break
            time.sleep(chance.uniform(0.0, 0.02))
            workers = workers_of(process.pid)
            if workers and chance.random() < 0.5:
                kill(chance.choice(workers))
                killed["worker"] += 1
            else:
                process.kill()
                process.wait()
                killed["main"] += 1
                process = subprocess.Popen(command(scene, folder, points))
        assert process.wait(timeout=600) == 0
    finally:
        process.kill()
        process.wait()
    return killed


def kill(pid):
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def compare(scene, tmp_path, points, kills, seed):
    killed = kill_and_go_on(scene, tmp_path / "killed", points, kills, seed)
    undisturbed = command(scene, tmp_path / "undisturbed", points)
    assert subprocess.run(undisturbed, check=False).returncode == 0
    for name in ("runs.csv", "plan.csv"):
        one, other = (
            (tmp_path / folder / name).read_bytes() for folder in ("killed", "undisturbed")
        )
        assert one == other
    assert (tmp_path / "killed" / "runs.csv").read_bytes().count(b"\n") == points + 1
    return killed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "points", "kills"),
    [(PENDULUM, 160, 16), (REBOUNDS, 32, 8)],
    ids=["pendulum", "rebounds"],
)
def test_many_kills_change_no_byte(scene, points, kills, tmp_path):
    killed = compare(scene, tmp_path, points, kills, seed=20)
    assert sum(killed.values()) == kills
    assert min(killed.values()) >= kills / 8  # which of them depends on when workers start
