"""Rows of points are those of single runs; keys are equal where the resolved decks are."""

import json

import pytest

import msahl
from msahl.deck import DeckError, read_deck
from msahl.model import Options
from msahl.results.read import read_run
from msahl.run import loop
from msahl.run.tables import MemorySink
from msahl.run.verdict import FAIL
from msahl.sweep.axes import Column
from msahl.sweep.points import (
    ChangedError,
    Job,
    NotWrittenError,
    Point,
    Resolver,
    context_digest,
    point_id,
    run_points,
)
from tests.run.test_mesh_error import strip
from tests.sweep.decks import DECK, QUICK

L = Column("L", "cm")
DT = Column("dt", option=True)


def row_of(job, *cells):
    (row,) = run_points(job, [Point(1, "00", cells)])
    return row


def test_a_row_is_that_of_a_single_run():
    job = Job(str(DECK), (L, DT), QUICK, ("Rod.z final",))
    row = row_of(job, "60", "0.01")
    model = read_deck(DECK, settings=["L=60 cm", "simulation.deltaT=10", "tFinal=0.1"])
    sink = MemorySink()
    report = loop.run(model, Options(), sink, checked=True)
    assert row["measures"] == {"Rod.z final": sink.table("states")[-1, 3]}
    assert (row["status"], row["verdict"]) == (report.status, report.verdict["word"])
    assert row["error"] == report.error["position"]
    assert row["seconds"]["loop"] > 0.0


@pytest.mark.parametrize("keep", ["summary", "tables"])
def test_the_error_of_a_row_includes_that_by_the_mesh_of_beams(tmp_path, keep):
    """One element of degree 1 bends hardly at all, however small the steps are."""
    deck = tmp_path / "deck.xml"
    deck.write_text(strip(1, 1, load=0.5), encoding="utf-8")
    row = row_of(Job(str(deck), (DT,), {"t_final": 0.01}, (), keep, str(tmp_path)), "0.005")
    (single,) = msahl.batch(msahl.load(deck), [{"simulation.deltaT": 0.005}], 1, t_final=0.01)
    error = single.report["error"]
    assert row["verdict"] == single.verdict
    assert row["error"] == error["position"] >= error["mesh"]["error"] > 0.0


def test_points_in_one_call_have_the_rows_of_points_by_themselves():
    job = Job(str(DECK), (L,), QUICK, ("Rod.z final",))
    points = [Point(n, "00", (str(40 + n),)) for n in range(1, 4)]
    together = [row | {"seconds": 0} for row in run_points(job, points)]
    alone = [row | {"seconds": 0} for point in points for row in run_points(job, [point])]
    assert together == alone


def test_job_and_rows_are_json():
    job = Job(str(DECK), (L, DT), QUICK, ("Rod.z final",), "summary", "x", "y")
    assert Job.from_json(json.loads(json.dumps(job.as_json()))) == job
    row = row_of(Job(str(DECK), (L,), QUICK), "60")
    assert json.loads(json.dumps(row)) == row


def key(columns, *cells, **options):
    return Resolver(Job(str(DECK), columns, {**QUICK, **options})).key(cells)


def test_keys_are_equal_where_decks_and_options_are():
    assert key((L,), "80") == key(()) == key((Column("L"),), "80 cm")
    assert key((L,), "80") == key((Column("L"),), "800 mm")
    assert key((L, DT), "80", "0.005") == key((DT, L), "0.005", "80") == key((L, DT), "80", "")
    assert key((L,), "81") != key((L,), "80")
    assert key((L,), "80", every=2) != key((L,), "80")
    assert key((Column("L"),), "-1") != key((Column("L"),), "-2")  # not valid, but not the same


def test_ids_depend_on_context_and_values_but_not_on_the_order_of_columns():
    job = Job(str(DECK), (L, DT), QUICK, digest="d")
    context = context_digest(job)
    assert point_id(context, (L, DT), ("80", "0.1")) == point_id(context, (DT, L), ("0.1", "80"))
    assert point_id(context, (L, DT), ("80", "0.1")) != point_id(context, (L, DT), ("80", "0.2"))
    other = Job(str(DECK), (L, DT), {"t_final": 0.2}, digest="d")
    assert context_digest(other) != context


@pytest.mark.parametrize(
    ("columns", "cells", "status", "words"),
    [
        ((L,), ("-80",), "not valid", "Rod"),
        ((DT,), ("-0.1",), "not valid", "deltaT"),
        ((Column("scheme", option=True), Column("solver", option=True)), ("auto", "root"),
         "not valid", "solver root"),
    ],
)  # fmt: skip
def test_a_point_that_is_not_valid_has_a_row_that_says_why(columns, cells, status, words):
    row = row_of(Job(str(DECK), columns, QUICK), *cells)
    assert (row["status"], row["verdict"], row["measures"]) == (status, "FAIL", {})
    assert words in row["message"]
    assert row["key"]


def test_a_point_without_initial_state_has_not_started():
    column = Column("simulation.stop.when")
    row = row_of(Job(str(DECK), (column,), QUICK), "Hinge.angle < 100")
    assert row["status"] == "not started"
    assert row["message"]


def test_a_step_that_does_not_converge_is_reported():
    row = row_of(
        Job(
            str(DECK),
            (Column("start"),),
            {"dt": 100.0, "t_final": 1000.0, "scheme": "gauss3", "error": "off"},
        ),
        "60",
    )
    assert row["status"] == "not converged"
    assert row["message"]


@pytest.mark.parametrize("keep", ["tables", "all"])
def test_tables_are_kept_in_a_folder_named_by_the_key(tmp_path, keep):
    job = Job(str(DECK), (L,), QUICK, ("Rod.z final",), keep, str(tmp_path))
    row = row_of(job, "60")
    folder = tmp_path / "runs" / row["key"][:16]
    names = {path.name for path in folder.iterdir()}
    assert {"states.csv", "reactions.csv", "joints.csv"} <= names
    assert ("run.json" in names) == ("deck.xml" in names) == (keep == "all")
    assert [path.name for path in (tmp_path / "runs").iterdir()] == [folder.name]
    if keep == "all":
        run = read_run(folder)
        assert run.states["Rod.z"].iloc[-1] == row["measures"]["Rod.z final"]
        assert run.info["set"] == ["L=60 cm"]
        assert run.info["checksums"].keys() == names - {"run.json"}
        with (folder / "joints.csv").open("a") as table:
            table.write("\n")
        assert read_run(folder).info["verdict"]["word"] == FAIL


def test_a_disk_that_takes_no_tables_is_no_outcome(tmp_path):
    (tmp_path / "runs").write_text("a file")
    with pytest.raises(NotWrittenError, match="runs"):
        row_of(Job(str(DECK), (L,), QUICK, (), "all", str(tmp_path)), "60")


def test_a_deck_that_was_changed_is_not_run(tmp_path):
    deck = tmp_path / "deck.xml"
    deck.write_bytes(DECK.read_bytes())
    digest = Resolver(Job(str(deck), (L,))).digest
    deck.write_bytes(DECK.read_bytes().replace(b"<!--", b"<!-- another comment"))
    row_of(Job(str(deck), (L,), QUICK, digest=digest), "60")
    deck.write_bytes(DECK.read_bytes().replace(b"7.8", b"7.9"))
    with pytest.raises(ChangedError, match="was changed"):
        row_of(Job(str(deck), (L,), QUICK, digest=digest), "60")


def test_a_deck_that_is_none_is_a_fault_of_the_deck(tmp_path):
    with pytest.raises(DeckError):
        row_of(Job(str(tmp_path / "none.xml"), (L,), QUICK), "60")
