"""Sweeps on a Dask cluster: the rows are those of one machine, whatever workers do."""

import signal
import subprocess
import sys
from collections import deque
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.sweep import chunks, cluster
from msahl.sweep.chunks import Order, mismatch, run_chunk
from msahl.sweep.cluster import AHEAD, Cluster
from msahl.sweep.faults import ClusterError
from msahl.sweep.points import (
    ChangedError,
    NotWrittenError,
    Point,
    Resolver,
    kept_folder,
    numeric_versions,
    run_points,
)
from msahl.sweep.pool import MOST_POINTS, Pool
from msahl.sweep.sweep import Hooks, carry_out, check
from msahl.sweep.work import OnFail
from tests.support.models import ROOT
from tests.sweep.decks import DECK
from tests.sweep.fakes import row_of, sweep

distributed = pytest.importorskip("distributed")

VALUES = "L=60,70,80"
MEASURES = ("Rod.z final",)


@pytest.fixture(autouse=True)
def no_process_remains():
    """Processes that wait for more points of a sweep are ended."""
    yield
    for runners in chunks._idle.values():
        for runner in runners:
            runner.close()
    chunks._idle.clear()


def numbered(made):
    """The points of a sweep as a worker is given them."""
    return [(n, f"{n:064x}", cells) for n, cells in enumerate(made.plan, start=1)]


def order_of(made, mark="/nonexistent", **more):
    """The order of the chunks of a sweep, whose deck no worker has."""
    made = check(made)
    source = Resolver(made.job).deck.source
    job = replace(made.job, source=source, **more)
    return Order(job, numeric_versions(), None, mark)


def without_seconds(rows):
    return [{**row, "seconds": None} for row in rows]


# What a worker does -------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_worker_makes_the_rows_of_one_process_without_the_deck(tmp_path):
    made = check(sweep(tmp_path / "s", VALUES, measures=MEASURES))
    order = order_of(made)
    # On the worker's machine the deck's path leads nowhere.
    elsewhere = replace(order.job.source, path=Path("nowhere/deck.xml"))
    order = replace(order, job=replace(order.job, deck="nowhere/deck.xml", source=elsewhere))
    assert Order.unpacked(order.packed()) == order
    points = numbered(made)
    first, last = (run_chunk(order.packed(), part) for part in (points[:2], points[2:]))
    expected = list(run_points(made.job, [Point(*point) for point in points]))
    assert without_seconds(first["rows"] + last["rows"]) == without_seconds(expected)
    assert first["files"] == {}
    # The process was kept for the second chunk.
    ((runner,),) = chunks._idle.values()
    assert len(runner.pool.workers) == 1


@pytest.mark.slow
def test_tables_are_sent_back_or_written_to_a_shared_folder(tmp_path):
    made = check(sweep(tmp_path / "s", VALUES, measures=MEASURES, keep="tables"))
    back = run_chunk(order_of(made).packed(), numbered(made))
    assert not (tmp_path / "s").exists()
    mark = tmp_path / "mark"
    mark.touch()
    shared = run_chunk(order_of(made, str(mark)).packed(), numbered(made))
    assert shared["files"] == {}
    assert without_seconds(shared["rows"]) == without_seconds(back["rows"])
    for row in back["rows"]:
        folder = kept_folder(tmp_path / "s", row["key"])
        assert back["files"][row["key"]] == {p.name: p.read_bytes() for p in folder.iterdir()}
        assert "states.csv" in back["files"][row["key"]]


@pytest.mark.slow
def test_processes_of_an_earlier_sweep_end(tmp_path):
    made = sweep(tmp_path / "s", VALUES)
    run_chunk(order_of(made).packed(), numbered(made)[:1])
    ((before,),) = chunks._idle.values()
    (process,) = before.pool.workers
    other = sweep(tmp_path / "s", VALUES, measures=MEASURES)
    run_chunk(order_of(other).packed(), numbered(other)[:1])
    assert process.process.poll() is not None
    assert len(chunks._idle) == 1


@pytest.mark.slow
def test_the_time_limit_of_a_point_holds_on_a_worker(tmp_path):
    made = sweep(tmp_path / "s", "L=60,60")
    slow = replace(made.job, options={"dt": 1e-6, "t_final": 60.0})  # takes minutes
    order = order_of(replace(made, job=slow))
    ran = run_chunk(replace(order, timeout=0.2).packed(), numbered(made)[:1])
    (row,) = ran["rows"]
    assert (row["status"], row["limit"]) == ("timed out", 0.2)
    assert row["message"] == "took longer than 0.2 s (--timeout)"


@pytest.mark.slow
def test_a_worker_with_other_software_or_another_deck_refuses(tmp_path):
    order = order_of(sweep(tmp_path / "s", VALUES))
    other = replace(order, versions={**order.versions, "numpy": "1.0"})
    kind, words = run_chunk(other.packed(), [])["fatal"]
    assert kind == "VersionError"
    assert words == f"numpy {numeric_versions()['numpy']} instead of 1.0"
    assert mismatch({"a": "1"}, {}) == "a is missing instead of 1"
    changed = replace(order, job=replace(order.job, digest="0" * 64))
    points = numbered(sweep(tmp_path / "s", VALUES))
    kind, words = run_chunk(changed.packed(), points[:1])["fatal"]
    assert kind == "ChangedError"


# What this process does, with workers that are made up --------------------------------------------


class FakeFuture:
    """A chunk that ends at once: with rows, or with an exception."""

    status = "finished"

    def __init__(self, result):
        self.ended = result

    def add_done_callback(self, function):
        function(self)

    def result(self, timeout=None):
        if isinstance(self.ended, BaseException):
            raise self.ended
        return self.ended


class FakeClient:
    """A client of two workers with one thread each; ``answer`` makes what a chunk returns."""

    status = "running"

    def __init__(self, answer, versions=None):
        self.answer, self.sizes, self.versions = answer, [], versions or numeric_versions()

    def nthreads(self):
        return {"a": 1, "b": 1}

    def run(self, function, on_error):
        assert function is numeric_versions
        return {"a": self.versions}

    def submit(self, function, order, points, pure):
        assert function is run_chunk
        self.sizes.append(len(points))
        return FakeFuture(self.answer([Point(*point) for point in points]))


class FakeCluster(Cluster):
    """A cluster that needs no connection; it notes how many points are under way."""

    def __init__(self, client, **more):
        super().__init__("fake:1", **more)
        self.client, self.most = client, 0

    @contextmanager
    def _connected(self, stopped):
        yield

    def _fill(self):
        super()._fill()
        assert len(self.chunks) <= 2 * AHEAD
        self.most = max(self.most, sum(map(len, self.chunks.values())))


def good(points):
    rows = [row_of(point, measures=dict.fromkeys(MEASURES, 1.0)) for point in points]
    return {"rows": rows, "files": {}, "seconds": 1e-5 * len(points)}


def test_few_points_of_a_large_plan_are_under_way(tmp_path):
    made = sweep(tmp_path / "s", "L=60:100:10000")
    fake = FakeCluster(FakeClient(good))
    assert carry_out(made, fake).done == 10_000
    assert fake.most <= 2 * AHEAD * MOST_POINTS
    assert max(fake.client.sizes) == MOST_POINTS
    assert fake.client.sizes[0] == 1  # until it is known how long a point takes
    assert fake.client.sizes[-1] < 10  # so that all workers end together


def test_chunks_of_lost_workers_are_run_again(tmp_path):
    lost = deque([OSError("connection"), TimeoutError(), distributed.CancelledError("key")])
    fake = FakeCluster(FakeClient(lambda points: lost.popleft() if lost else good(points)))
    counts = carry_out(sweep(tmp_path / "s", VALUES, measures=MEASURES), fake)
    assert (counts.done, counts.failed) == (3, 0)
    assert not lost


def test_a_point_that_kills_workers_fails_alone(tmp_path):
    def answer(points):
        if any(point.number == 2 for point in points):
            return distributed.KilledWorker("key", None, 3)
        return good(points)

    fake = FakeCluster(FakeClient(answer))
    fake.seconds_per_point = 0.1
    counts = carry_out(sweep(tmp_path / "s", "L=60:100:40", measures=MEASURES), fake)
    assert (counts.done, counts.statuses["crashed"]) == (40, 1)
    assert "the process that ran it ended without a result" in counts.first_failure
    assert counts.first_failure.startswith("point 2:")


@pytest.mark.parametrize(
    ("answer", "error", "message"),
    [
        (
            {"fatal": ["VersionError", "numpy 1 instead of 2"]},
            ClusterError,
            "other software.*numpy",
        ),
        ({"fatal": ["ChangedError", "another deck"]}, ChangedError, "another deck"),
        ({"fatal": ["NotWrittenError", "disk full"]}, NotWrittenError, "disk full"),
        ({"fatal": ["PoolError", "no process"]}, ClusterError, "no process"),
        (ModuleNotFoundError("no", name="msahl"), ClusterError, "has no package msahl; install"),
        (ZeroDivisionError("ours"), ClusterError, "a worker failed: ZeroDivisionError: ours"),
    ],
)
def test_what_is_fatal_ends_the_sweep_with_a_sentence(tmp_path, answer, error, message):
    with pytest.raises(error, match=message):
        carry_out(sweep(tmp_path / "s", VALUES), FakeCluster(FakeClient(lambda points: answer)))


def test_workers_with_other_versions_are_refused_before_the_first_point(tmp_path):
    client = FakeClient(good, {**numeric_versions(), "msahl": "0.0.1"})
    with pytest.raises(ClusterError, match=r"the worker a has other software .*: msahl 0.0.1 inst"):
        carry_out(sweep(tmp_path / "s", VALUES), FakeCluster(client))
    assert client.sizes == []
    client = FakeClient(good)
    client.run = lambda function, on_error: {"a": ModuleNotFoundError("no", name="msahl")}
    with pytest.raises(
        ClusterError, match="the worker a has no package msahl; install msahl there"
    ):
        carry_out(sweep(tmp_path / "s", VALUES), FakeCluster(client))


def test_without_workers_it_waits_and_says_so(tmp_path):
    told, client = [], FakeClient(good)
    client.nthreads = lambda: {}
    asked = iter([False, False, True])
    fake = FakeCluster(client, tell=told.append)
    counts = carry_out(
        sweep(tmp_path / "s", VALUES), fake, Hooks(stopped=lambda: next(asked, True))
    )
    assert counts.done == 0
    assert told == ["waiting for workers at fake:1"]


def test_a_lost_scheduler_ends_the_sweep(tmp_path):
    client = FakeClient(good)
    client.status = "closed"
    with pytest.raises(ClusterError, match="lost the scheduler at fake:1; what was done is kept"):
        carry_out(sweep(tmp_path / "s", VALUES), FakeCluster(client))


def test_tables_that_were_sent_back_are_kept_and_a_full_disk_ends_the_sweep(tmp_path):
    def answer(points):
        rows = [row_of(point) for point in points]
        return {"rows": rows, "files": {row["key"]: {"states.csv": b"x"} for row in rows},
                "seconds": 1.0}  # fmt: skip

    made = sweep(tmp_path / "s", VALUES, keep="tables")
    carry_out(made, FakeCluster(FakeClient(answer)))
    kept = sorted((tmp_path / "s" / "runs").glob("*/states.csv"))
    assert len(kept) == 3
    assert not [path for path in (tmp_path / "s").rglob("*") if path.name.startswith(".sweep")]
    other = sweep(tmp_path / "full", VALUES, keep="tables")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "journal.jsonl").touch()
    (tmp_path / "full" / "runs").touch()  # a file where a folder has to be
    with pytest.raises(NotWrittenError, match="runs"):
        carry_out(other, FakeCluster(FakeClient(answer)))


def test_policies_for_failures_hold_on_a_cluster(tmp_path):
    def answer(points):
        return {"rows": [row_of(p, "not converged", verdict="FAIL") for p in points], "files": {},
                "seconds": 1.0}  # fmt: skip

    made = sweep(tmp_path / "a", VALUES, on_fail=OnFail("stop"))
    assert carry_out(made, FakeCluster(FakeClient(answer))).done == 1
    client = FakeClient(answer)
    made = sweep(tmp_path / "b", VALUES, on_fail=OnFail("retry", 2))
    assert carry_out(made, FakeCluster(client)).failed == 3
    assert sum(client.sizes) == 9


def call(*words):
    return CliRunner().invoke(main, ["sweep", *map(str, words)])


def test_the_message_without_dask_names_the_remedy(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = call(DECK, "--set", VALUES, "-o", tmp_path / "s", "--scheduler", "host:1", "-q")
    assert result.exit_code == 2
    assert "Dask is not installed here; install it: pip install 'msahl[cluster]'" in result.stderr


@pytest.mark.parametrize("address", ["tcp://head", "tls://head:", "tcp://head:x", "tcp://[::1]"])
def test_an_address_without_port_is_refused_at_once(tmp_path, address):
    """Dask would wait for a minute, also after its message, and end in a traceback."""
    refused = Cluster(address)
    job = sweep(tmp_path, VALUES).job
    with pytest.raises(ClusterError, match="the port of the scheduler is missing"):
        refused.run(job, None, lambda: False)


@pytest.mark.parametrize("address", ["head", "head.example.org", "10.0.0.1", "head:", "scheduler"])
def test_a_name_alone_is_no_address_and_no_file_to_wait_for(tmp_path, address):
    with pytest.raises(ClusterError, match="neither an address nor a file") as refused:
        Cluster(address).run(sweep(tmp_path, VALUES).job, None, lambda: False)
    assert f"as in tcp://{address.rstrip(':')}:8786" in str(refused.value)


def test_no_file_is_written_into_a_folder_that_there_is_not(tmp_path):
    with pytest.raises(ClusterError, match=f"there is no folder {tmp_path / 'none'}"):
        Cluster(f"{tmp_path / 'none'}/s.json").run(sweep(tmp_path, VALUES).job, None, lambda: True)


@pytest.mark.parametrize("address", ["./file", "file.json"])
def test_it_is_said_that_a_file_is_waited_for(tmp_path, address, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = []
    with pytest.raises(ClusterError, match="no scheduler has written this file"):
        Cluster(address, tell=told.append)._where(lambda: True)
    assert told == [f"waiting for the file {address} of a scheduler"]
    (tmp_path / address).write_text("{}")
    assert Cluster(address)._where(lambda: True) == {"scheduler_file": address}


def test_the_message_without_scheduler_names_its_address(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT_SECONDS", 0.2)
    base = (DECK, "--set", VALUES, "-o", tmp_path / "s", "-q", "--scheduler")
    result = call(*base, "tcp://127.0.0.1:9")
    assert result.exit_code == 2
    assert "no scheduler at tcp://127.0.0.1:9: " in result.stderr
    result = call(*base, tmp_path / "scheduler.json")
    assert result.exit_code == 2
    assert "scheduler.json: no scheduler has written this file; start one" in result.stderr


# A real scheduler and two workers -----------------------------------------------------------------


def start(program, *words):
    """A process of Dask that writes no messages."""
    return subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.dask_{program}", "--no-dashboard", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=ROOT.parent,  # the deck's path leads nowhere from there
    )


@pytest.fixture
def dask(tmp_path):
    """The file of a scheduler on the loopback, and its two workers."""
    file = tmp_path / "scheduler.json"
    processes = [start("scheduler", "--host", "127.0.0.1", "--port", "0",
                       "--scheduler-file", str(file))]  # fmt: skip
    words = ("--scheduler-file", str(file), "--nthreads", "1", "--no-nanny", "--local-directory",
             str(tmp_path / "dask"))  # fmt: skip
    processes += [start("worker", *words) for _ in range(2)]
    yield file, processes[1:]
    for process in processes:
        process.kill()
        process.wait()


@pytest.mark.slow
def test_rows_are_those_of_two_processes_although_a_worker_is_killed(dask, tmp_path, monkeypatch):
    file, workers = dask
    monkeypatch.chdir(DECK.parent)
    # One point in three has a deck with a fault, which is worded alike everywhere.
    sets = ("L=60:100:20 cm", "start=10,-30,1e200")
    made = sweep(tmp_path / "dask", *sets, measures=MEASURES)
    made = replace(made, job=replace(made.job, deck=DECK.name))

    def kill_one(counts):
        if counts.done >= 10 and workers[0].poll() is None:
            workers[0].send_signal(signal.SIGKILL)

    counts = carry_out(made, Cluster(str(file)), Hooks(progress=kill_one))
    assert workers[0].wait() == -signal.SIGKILL
    assert (counts.done, counts.statuses["completed"]) == (60, 40)
    local = replace(made, folder=tmp_path / "local")
    carry_out(replace(local, job=replace(local.job, folder=str(local.folder))), Pool(2))
    written = (tmp_path / "dask" / "runs.csv").read_bytes()
    assert written == (tmp_path / "local" / "runs.csv").read_bytes()
    assert written.count(b"\n") == 61
