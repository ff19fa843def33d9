"""Shards of a sweep: each runs its points alone, and their journals make the tables of all."""

import subprocess
import sys
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.sweep import pool
from msahl.sweep.faults import PlanError, StoreError
from msahl.sweep.journal import Journal
from msahl.sweep.store import sweep_lock
from msahl.sweep.sweep import carry_out
from msahl.sweep.work import Nobody, parse_shard
from tests.sweep.decks import DECK
from tests.sweep.fakes import FakeScheduler, sweep

SETS = "L=60:100:11"


def shard(folder, k, n, scheduler=None, **more):
    """Run one shard; return what was counted, and the scheduler with the points that it ran."""
    scheduler = scheduler or FakeScheduler()
    counts = carry_out(
        sweep(folder, SETS, share=(k, n), journal=f"journal-{k}-of-{n}.jsonl", **more), scheduler
    )
    return counts, scheduler


def names(folder):
    return {path.name for path in folder.iterdir()}


def test_shards_run_every_nth_point_and_write_journals_only(tmp_path):
    counts, scheduler = shard(tmp_path, 2, 3)
    assert scheduler.ran == [2, 5, 8, 11]
    assert (counts.points, counts.done) == (4, 4)
    assert names(tmp_path) == {"plan.csv", "sweep.json", "journal-2-of-3.jsonl"}


def test_merged_shards_have_the_bytes_of_one_sweep(tmp_path):
    for k in (3, 1, 2):
        shard(tmp_path / "shards", k, 3)
    carry_out(sweep(tmp_path / "one", SETS), FakeScheduler())
    assert carry_out(sweep(tmp_path / "shards", SETS), Nobody()).done == 11
    merged = (tmp_path / "shards" / "runs.csv").read_bytes()
    assert merged == (tmp_path / "one" / "runs.csv").read_bytes()
    assert merged.count(b"\n") == 12


def test_journals_of_several_machines_are_put_into_one_folder(tmp_path):
    for k in (1, 2):
        shard(tmp_path / f"machine{k}", k, 2)
    (tmp_path / "machine2" / "journal-2-of-2.jsonl").rename(
        tmp_path / "machine1" / "journal-2-of-2.jsonl"
    )
    counts = carry_out(sweep(tmp_path / "machine1", SETS), scheduler := FakeScheduler())
    assert (counts.done, scheduler.ran) == (11, [])


def test_a_shard_goes_on_where_it_was(tmp_path):
    shard(tmp_path, 1, 2, FakeScheduler(most=2))
    assert shard(tmp_path, 1, 2)[1].ran == [5, 7, 9, 11]


@pytest.mark.slow
def test_the_commands_of_shards_and_their_merge(tmp_path):
    words = ["sweep", str(DECK), "--set", "L=60,70", "--t-final", "0.1", "-o", str(tmp_path)]
    one = CliRunner().invoke(main, [*words, "--shard", "1/2", "--jobs", "1"])
    assert one.exit_code == 0, one.output
    assert "all 1 points of shard 1/2 are done; after all shards: msahl sweep" in one.stderr
    merge = one.stderr.partition("after all shards: ")[2].split()
    assert merge[-1] == "--merge"
    assert not {"--shard", "--jobs"} & set(merge)
    result = CliRunner().invoke(main, merge[1:])
    assert result.exit_code == 1
    assert "1 of 2 points have no outcome; run their shards" in result.stderr
    assert not (tmp_path / "runs.csv").exists()
    assert CliRunner().invoke(main, [*words, "--shard", "2/2", "--jobs", "1"]).exit_code == 0
    result = CliRunner().invoke(main, merge[1:])
    assert result.exit_code == 0, result.output
    assert len((tmp_path / "runs.csv").read_text().splitlines()) == 3


@pytest.mark.parametrize("text", ["", "1", "0/2", "3/2", "1/0", "-1/2", "a/b", "1/2/3", "1.0/2"])
def test_a_shard_is_two_numbers(text):
    with pytest.raises(PlanError, match="write k/n"):
        parse_shard(text)
    assert parse_shard("2/10") == (2, 10)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--shard", "1/2", "--merge"), "--merge collects all shards; omit --shard"),
        (("--jobs", "2", "--merge"), "--jobs and --merge exclude each other"),
        (("--jobs", "2", "--scheduler", "a:1"), "--jobs and --scheduler exclude each other"),
    ],
)
def test_options_that_exclude_each_other(tmp_path, words, message):
    base = ["sweep", str(DECK), "--set", "L=60,70", "-o", str(tmp_path / "s")]
    result = CliRunner().invoke(main, [*base, *words])
    assert result.exit_code == 2
    assert message in result.stderr


def test_shards_run_side_by_side_but_not_beside_a_merge(tmp_path):
    with sweep_lock(tmp_path, shared=True):
        shard(tmp_path, 1, 2)
        with pytest.raises(StoreError, match="is running a sweep there"):
            carry_out(sweep(tmp_path, SETS), FakeScheduler())
    with sweep_lock(tmp_path), pytest.raises(StoreError, match="is running a sweep there"):
        shard(tmp_path, 2, 2)


def test_one_shard_is_not_run_twice_at_a_time(tmp_path):
    journal = Journal(tmp_path / "journal-1-of-2.jsonl")
    journal.lock()
    code = (
        "import sys; from pathlib import Path\n"
        "from msahl.sweep.faults import StoreError; from msahl.sweep.journal import Journal\n"
        "try: Journal(Path(sys.argv[1])).lock()\n"
        "except StoreError as error: print(error)"
    )
    command = [sys.executable, "-c", code, str(journal.path)]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "another process is running the same points" in ran.stdout
    journal.close()
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ran.stdout == ""


def test_there_are_at_most_as_many_workers_as_cores_and_points(monkeypatch):
    """A second worker starts when the first has compiled, and a third has no point left."""

    class Idle:
        source, ready, points = 0, False, ()  # busy

        def __init__(self, job):
            pass

    monkeypatch.setattr(pool, "cores", lambda: 3)
    monkeypatch.setattr(pool, "Worker", Idle)
    many = pool.Pool(10_000)
    assert many.jobs == 3
    monkeypatch.setattr(many, "job", None, raising=False)
    many.selector = SimpleNamespace(register=lambda *given: None)
    many.work = SimpleNamespace(left=2)
    for seconds, workers in ((0.0, 1), (0.1, 2)):
        many.seconds_per_point = seconds
        many._fill()
        assert len(many.workers) == workers
