"""The folder of a sweep: journal, tables, what is computed again, faults of the disk."""

import errno
import json
import os
import subprocess
import sys
import tracemalloc
from dataclasses import replace

import pytest

from msahl.deck import DeckError
from msahl.sweep import journal as journal_module
from msahl.sweep.faults import PlanError, StoreError
from msahl.sweep.journal import journal_lines, line_of
from msahl.sweep.plan import read_plan
from msahl.sweep.points import Point
from msahl.sweep.store import claim, read_info, sweep_lock
from msahl.sweep.sweep import Hooks, Sweep, carry_out, check
from msahl.sweep.work import OnFail, Work
from tests.sweep.decks import DECK
from tests.sweep.fakes import FakeScheduler, InProcess, open_store, row_of, sweep


def lines(folder):
    return (folder / "journal.jsonl").read_text().splitlines()


def test_runs_csv_has_one_row_for_each_point_in_order(tmp_path):
    made = sweep(tmp_path / "s", "L=60,80 cm", "r=5,10", measures=("Rod.z max",))
    counts = carry_out(made, FakeScheduler({3: 1}, chunk=3))
    assert (counts.points, counts.done, counts.failed, counts.good) == (4, 4, 1, False)
    text = (tmp_path / "s" / "runs.csv").read_text().splitlines()
    assert text[0] == "point,L [cm],r,status,verdict,error,Rod.z max,message,key"
    assert text[1].startswith("1,60,5,completed,PASS,0.25,1,,")
    assert text[3].startswith("3,80,5,not converged,FAIL,0.25,,it diverged,")
    assert len(text) == 5
    assert (tmp_path / "s" / "seconds.csv").read_text().splitlines()[1] == "1,,0.5,,,"
    info = read_info(tmp_path / "s")
    assert (info["status"], info["done"], info["failed"]) == ("complete", 4, 1)
    assert info["plan"]["points"] == 4
    assert list(read_plan(tmp_path / "s" / "plan.csv")) == list(made.plan)


def test_an_unchanged_sweep_computes_nothing_and_changes_no_byte(tmp_path):
    made = sweep(tmp_path / "s", "L=60,80,100 cm")
    carry_out(made, FakeScheduler())
    before = (tmp_path / "s" / "runs.csv").read_bytes(), lines(tmp_path / "s")
    again = FakeScheduler()
    carry_out(made, again)
    assert again.ran == []
    assert ((tmp_path / "s" / "runs.csv").read_bytes(), lines(tmp_path / "s")) == before


def test_every_column_of_runs_csv_has_a_head_of_its_own(tmp_path):
    made = sweep(tmp_path / "s", "L=60,80 cm", measures=("verdict", "error", "steps"))
    carry_out(made, FakeScheduler())
    text = (tmp_path / "s" / "runs.csv").read_text().splitlines()
    assert text[0] == "point,L [cm],status,verdict,error,steps,message,key"
    assert text[1].startswith("1,60,completed,PASS,0.25,1,,")

    deck = tmp_path / "deck.xml"
    deck.write_text(DECK.read_text().replace('name="r"', 'name="key"').replace("r^2", "key^2"))
    made = sweep(tmp_path / "t", "key=5,6")
    with pytest.raises(PlanError, match="'key' would be the head of two columns"):
        carry_out(replace(made, job=replace(made.job, deck=str(deck))), FakeScheduler())


def test_a_stopped_sweep_goes_on_and_ends_with_the_same_bytes(tmp_path):
    made, undisturbed = (
        sweep(tmp_path / "a", "L=60:100:7 cm"),
        sweep(tmp_path / "b", "L=60:100:7 cm"),
    )
    carry_out(undisturbed, FakeScheduler())
    counts = carry_out(made, FakeScheduler(most=3))
    assert counts.done == 3
    assert not (tmp_path / "a" / "runs.csv").exists()
    assert len((tmp_path / "a" / "runs.csv.part").read_text().splitlines()) == 4
    assert read_info(tmp_path / "a")["status"] == "stopped"
    rest = FakeScheduler()
    carry_out(made, rest)
    assert rest.ran == [4, 5, 6, 7]
    assert not (tmp_path / "a" / "runs.csv.part").exists()
    for name in ("runs.csv", "plan.csv"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_an_extended_sweep_computes_only_what_is_new(tmp_path):
    carry_out(sweep(tmp_path / "s", "L=60,80 cm"), FakeScheduler())
    more = FakeScheduler()
    carry_out(sweep(tmp_path / "s", "L=60,70,80,90 cm"), more)
    assert more.ran == [2, 4]
    assert len((tmp_path / "s" / "runs.csv").read_text().splitlines()) == 5


def test_points_with_the_same_resolved_deck_are_not_computed_again(tmp_path):
    """Another axis, other words for the same numbers: the keys of outcomes are those of decks."""
    carry_out(sweep(tmp_path / "s", "L=60,80 cm"), InProcess())
    before = (tmp_path / "s" / "runs.csv").read_text().splitlines()
    more = FakeScheduler()
    carry_out(sweep(tmp_path / "s", "L=600,800 mm", "start=60,50 deg"), more)
    assert more.ran == [2, 4]  # 60 degrees are the deck's own
    after = (tmp_path / "s" / "runs.csv").read_text().splitlines()
    assert before[1].split(",")[2:] == after[1].split(",")[3:]
    assert before[2].split(",")[2:] == after[3].split(",")[3:]


def test_outcomes_of_other_software_are_computed_again(tmp_path):
    """Even if their keys are equal, as those of decks with faults are."""
    carry_out(sweep(tmp_path / "s", "L=60,80 cm"), InProcess())
    journal = tmp_path / "s" / "journal.jsonl"
    rows = [row | {"software": "0123456789ab"} for _, row in journal_lines(journal)]
    journal.write_bytes(b"".join(map(line_of, rows)))
    again = FakeScheduler()
    carry_out(sweep(tmp_path / "s", "L=600,800 mm"), again)
    assert again.ran == [1, 2]


def test_a_new_measure_is_computed_and_an_old_one_is_there(tmp_path):
    carry_out(sweep(tmp_path / "s", "L=60,80 cm", measures=("Rod.z max",)), FakeScheduler())
    more = FakeScheduler()
    carry_out(sweep(tmp_path / "s", "L=60,80 cm", measures=("Rod.z max", "Rod.x max")), more)
    assert more.ran == [1, 2]
    less = FakeScheduler()
    carry_out(sweep(tmp_path / "s", "L=60,80 cm", measures=("Rod.x max",)), less)
    assert less.ran == []


def test_other_options_are_other_points(tmp_path):
    made = sweep(tmp_path / "s", "L=60,80 cm")
    carry_out(made, FakeScheduler())
    other = FakeScheduler()
    carry_out(replace(made, job=replace(made.job, options={"t_final": 0.2})), other)
    assert other.ran == [1, 2]


def test_points_that_appear_twice_are_computed_once(tmp_path):
    once = FakeScheduler()
    counts = carry_out(sweep(tmp_path / "s", "L=60,80,60 cm"), once)
    assert once.ran == [1, 2]
    assert (counts.points, counts.done) == (3, 3)


def test_tables_that_are_missing_are_computed_again(tmp_path):
    made = sweep(tmp_path / "s", "L=60,80 cm", keep="tables")
    carry_out(made, FakeScheduler())
    again = FakeScheduler()
    carry_out(made, again)  # the fake scheduler has written no tables
    assert again.ran == [1, 2]


def test_failed_points_are_tried_again_only_by_retry_or_with_more_time(tmp_path):
    made = sweep(tmp_path / "s", "L=60,80,100 cm", timeout=1.0)
    carry_out(made, FakeScheduler({2: 1}))
    again = FakeScheduler()
    carry_out(made, again)
    assert again.ran == []
    carry_out(replace(made, on_fail=OnFail("retry", 1)), again)
    assert again.ran == [2]
    late = {"status": "timed out", "limit": 1.0, "measures": {}}
    assert made.usable(late)
    assert replace(made, timeout=0.5).usable(late)
    assert not replace(made, timeout=2.0).usable(late)
    assert not replace(made, timeout=None).usable(late)


@pytest.mark.parametrize("torn", [b'{"id": "00', b"\x00\x00\x00", b"{}", b"[1]", b'{"id": 3}\n'])
def test_torn_lines_are_ignored_and_the_point_is_run_again(tmp_path, torn):
    made, folder = sweep(tmp_path / "s", "L=60,80,100 cm"), tmp_path / "s"
    carry_out(made, FakeScheduler())
    undisturbed = (folder / "runs.csv").read_bytes()
    text = (folder / "journal.jsonl").read_bytes().splitlines(keepends=True)
    (folder / "journal.jsonl").write_bytes(b"".join(text[:2]) + torn)
    again = FakeScheduler()
    carry_out(made, again)
    assert again.ran == [3]
    assert (folder / "runs.csv").read_bytes() == undisturbed
    assert len(list(journal_lines(folder / "journal.jsonl"))) == 3


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b'"error":0.25', b'"error":0.2'),
        (b'"point":2', b'"point":3'),
        (b'"verdict":"PASS"', b'"verdict":"FAIL"'),
        (b'"status":"completed"', b'"status":[]'),
        (b'"measures":{', b'"measures":{"Rod.z max":7.0,'),
        (b'"key":"', b'"key":"0'),
        (b',"sum":', b',"x":1,"sum":'),
        (b"}\n", b"} \n"),
        (b"{", b"[{"),
    ],
)
def test_a_line_that_was_changed_is_no_outcome(tmp_path, old, new):
    made, folder = sweep(tmp_path / "s", "L=60,80,100 cm"), tmp_path / "s"
    carry_out(made, FakeScheduler())
    undisturbed = (folder / "runs.csv").read_bytes()
    text = (folder / "journal.jsonl").read_bytes().splitlines(keepends=True)
    assert old in text[1]
    text[1] = text[1].replace(old, new, 1)
    (folder / "journal.jsonl").write_bytes(b"".join(text))
    again = FakeScheduler()
    carry_out(made, again)
    assert again.ran == [2]
    assert (folder / "runs.csv").read_bytes() == undisturbed


def test_a_line_that_is_changed_while_a_sweep_runs_is_no_outcome(tmp_path):
    made, folder = sweep(tmp_path / "s", "L=60,80,100 cm"), tmp_path / "s"
    carry_out(made, FakeScheduler())
    store = check(made).open_store()
    journal = folder / "journal.jsonl"
    journal.write_bytes(journal.read_bytes().replace(b'"error":0.25', b'"error":0.75', 1))
    assert [row is None for _, _, row in store.rows(made.plan)] == [True, False, False]
    store.close()


def test_a_finished_sweep_of_another_user_is_done(tmp_path, monkeypatch):
    made, folder = sweep(tmp_path / "s", "L=60,80 cm"), tmp_path / "s"
    carry_out(made, FakeScheduler())
    before = {path: path.stat().st_mtime_ns for path in (folder, *folder.iterdir())}
    opened, access = os.open, os.access

    def refuses(path, flags, *rest, **more):
        if flags & (os.O_WRONLY | os.O_RDWR) and str(path).startswith(str(folder)):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return opened(path, flags, *rest, **more)

    monkeypatch.setattr(os, "open", refuses)  # tests may be run by root, who may write everywhere
    monkeypatch.setattr(os, "access", lambda path, *mode: path != folder and access(path, *mode))
    again = FakeScheduler()
    assert carry_out(made, again).good
    assert again.ran == []
    assert {path: path.stat().st_mtime_ns for path in (folder, *folder.iterdir())} == before
    with pytest.raises(PermissionError):
        carry_out(sweep(folder, "L=60,90 cm"), FakeScheduler())


def test_numbers_of_the_deck_have_its_units_and_others_their_own(tmp_path):
    sets = ("L=80", "start=60 deg", "Rod.mass=1,2", "Rod.moi.Izz=0.7", "Hinge.child.position.z=0.4")
    carry_out(sweep(tmp_path, *sets), FakeScheduler())
    units = {"L": "cm", "Rod.mass": "kg", "Rod.moi.Izz": "kg cm^2", "Hinge.child.position.z": "SI"}
    assert read_info(tmp_path)["units"] == units


@pytest.mark.parametrize("value", [None, True, 3, "x", [], [1], {}, {"path": 3}, {"relative": 3},
                                   {"relative": "x" * 5000, "path": "\n"}])  # fmt: skip
def test_whatever_sweep_json_holds_a_sweep_goes_on(tmp_path, value):
    """It is written anew, and what was done is in the journal."""
    made, folder = sweep(tmp_path / "s", "L=60,80 cm"), tmp_path / "s"
    carry_out(made, FakeScheduler())
    sound = read_info(folder)
    for key in (None, "deck", "plan", "pid"):
        held = value if key is None else {**sound, key: value}
        (folder / "sweep.json").write_text(json.dumps(held))
        again = FakeScheduler()
        carry_out(made, again)
        assert again.ran == []
        assert read_info(folder) == sound


@pytest.mark.parametrize("cut", range(0, 400, 37))
def test_a_journal_cut_anywhere_is_valid(tmp_path, cut):
    made, folder = sweep(tmp_path / "s", "L=60,80,100 cm"), tmp_path / "s"
    carry_out(made, FakeScheduler())
    undisturbed = (folder / "runs.csv").read_bytes()
    journal = folder / "journal.jsonl"
    os.truncate(journal, journal.stat().st_size - cut)
    carry_out(made, FakeScheduler())
    assert (folder / "runs.csv").read_bytes() == undisturbed


def test_a_full_disk_stops_the_sweep_and_loses_nothing(tmp_path, monkeypatch):
    """Of the third line only a part fits."""
    made, folder, free, write = (
        sweep(tmp_path / "s", "L=60:100:5 cm"),
        tmp_path / "s",
        [900],
        os.write,
    )

    def full(descriptor, content):
        if free[0] <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        part = content[: free[0]]
        free[0] -= len(part)
        return write(descriptor, part)

    with monkeypatch.context() as patch:
        patch.setattr(journal_module.os, "write", full)
        with pytest.raises(OSError, match="No space left"):
            carry_out(made, FakeScheduler())
    done = len(list(journal_lines(folder / "journal.jsonl")))
    assert 0 < done < 5
    rest = FakeScheduler()
    carry_out(made, rest)
    assert rest.ran == list(range(done + 1, 6))


def test_one_sweep_at_a_time_writes_to_a_folder(tmp_path):
    carry_out(sweep(tmp_path / "s", "L=60 cm"), FakeScheduler())
    script = (
        "import sys, pathlib; from msahl.sweep.store import sweep_lock\n"
        "with sweep_lock(pathlib.Path(sys.argv[1])): print('locked', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path / "s")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as other:
        assert other.stdout.readline() == b"locked\n"
        with pytest.raises(StoreError, match="is running a sweep there"):
            carry_out(sweep(tmp_path / "s", "L=60,70 cm"), FakeScheduler())
        other.stdin.close()
    with sweep_lock(tmp_path / "s"):
        pass


def test_other_folders_are_refused(tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("all of it")
    with pytest.raises(StoreError, match="not the folder of a sweep"):
        carry_out(sweep(tmp_path / "full", "L=60 cm"), FakeScheduler())
    carry_out(sweep(tmp_path / "s", "L=60 cm"), FakeScheduler())
    other = tmp_path / "other.xml"
    other.write_text("<data/>")
    with pytest.raises(StoreError, match="holds a sweep of another deck"):
        claim(tmp_path / "s", str(other))
    with pytest.raises(FileExistsError):
        carry_out(sweep(other, "L=60 cm"), FakeScheduler())


def test_shares_of_a_plan_write_their_own_journals(tmp_path):
    """Two shares, then the sweep itself: it finds all outcomes."""
    made = sweep(tmp_path / "s", "L=60:100:7 cm")
    for k in (1, 2):
        share = FakeScheduler()
        carry_out(replace(made, share=(k, 2), journal=f"journal-{k}-of-2.jsonl"), share)
        assert share.ran == list(range(k, 8, 2))
    all_points = FakeScheduler()
    counts = carry_out(made, all_points)
    assert all_points.ran == []
    assert counts.good
    assert (tmp_path / "s" / "runs.csv").is_file()


def test_a_parquet_file_has_the_rows_of_runs_csv(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    carry_out(sweep(tmp_path / "s", "L=60:100:3 cm", measures=("Rod.z max",)), FakeScheduler())
    path = tmp_path / "s" / "runs.parquet"
    table = parquet.read_table(path).to_pydict()
    assert table["L [cm]"] == [60, 80, 100]
    assert table["Rod.z max"] == [1, 2, 3]
    # Types are those of all rows, not those that the first rows seem to have.
    kinds = {field.name: str(field.type) for field in parquet.read_schema(path)}
    assert kinds["L [cm]"] == kinds["Rod.z max"] == "double"
    assert kinds["message"] == kinds["key"] == "string"


def test_what_killed_processes_left_over_is_removed(tmp_path):
    made, folder = sweep(tmp_path / "s", "L=60:100:3 cm"), tmp_path / "s"
    carry_out(made, FakeScheduler(most=1))
    (folder / "plan.csv.0123.new").write_text("half of it")
    (folder / "runs" / "0123.1.part").mkdir(parents=True)
    (folder / "runs" / "0123").mkdir()
    carry_out(made, FakeScheduler())
    assert {path.name for path in folder.glob("*.new")} == set()
    assert [path.name for path in (folder / "runs").iterdir()] == ["0123"]


def test_progress_is_reported(tmp_path):
    told, begun = [], []
    hooks = Hooks(lambda work: begun.append(work.left), lambda counts: told.append(counts.done))
    carry_out(sweep(tmp_path / "s", "L=60:100:3 cm"), FakeScheduler(), hooks)
    assert (begun, told) == ([3], [1, 2, 3])


def test_many_points_take_little_memory(tmp_path):
    """Beside its digest and the place of its line nothing is kept of a point."""
    made = sweep(tmp_path / "s", "L=60:100:60 cm", "r=5:10:50")
    store = open_store(tmp_path / "s", made)
    tracemalloc.start()
    try:
        work = Work(made.plan, store)
        while not work.finished:
            work.take([row_of(point) for point in work.next(50)])
        store.write_tables(made.plan)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        store.close()
    assert work.counts.good
    # 16 bytes of a digest as an object of 49, twice in a hash table, and a pair of integers.
    assert peak / made.plan.count < 500


def test_a_point_is_a_plain_tuple():
    assert Point(1, "ab", ("2",)) == (1, "ab", ("2",))
    assert isinstance(json.loads(json.dumps(Point(1, "ab", ("2",)))), list)


def test_a_sweep_without_points_in_its_share_is_complete(tmp_path):
    made: Sweep = replace(sweep(tmp_path / "s", "L=60 cm"), share=(2, 2), journal="journal-2.jsonl")
    scheduler = FakeScheduler()
    carry_out(made, scheduler)
    assert scheduler.ran == []


def test_a_deck_that_is_valid_within_the_plan_only_is_swept(tmp_path):
    counts = carry_out(sweep(tmp_path / "s", "L=-1,80,-2 cm"), InProcess())
    assert counts.statuses == {"not valid": 2, "completed": 1}
    with pytest.raises(DeckError, match="must be greater than zero"):
        carry_out(sweep(tmp_path / "t", "L=-1:-99:200 cm"), FakeScheduler())
