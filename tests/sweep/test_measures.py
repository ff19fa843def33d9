"""Measures have the values that the tables of a run have, and name what is missing."""

import numpy as np
import pytest

from msahl.deck import read_deck
from msahl.model import Options
from msahl.post.events import crossings
from msahl.results.read import read_run
from msahl.run import loop
from msahl.run.tables import MemorySink
from msahl.sweep.faults import PlanError
from msahl.sweep.measures import (
    FIGURES,
    STATISTICS,
    evaluate,
    parse_measures,
    require_columns,
    tables_needed,
)
from msahl.sweep.points import Job, Point, run_points
from tests.sweep.decks import DECK


@pytest.fixture(scope="module")
def ran():
    model, sink = read_deck(DECK, settings=["tFinal=2"]), MemorySink()
    return model, loop.run(model, Options(), sink, checked=True), sink


def measured(ran, *texts):
    model, report, sink = ran
    return evaluate(parse_measures(texts), model, report, sink.table)


def test_statistics_are_those_of_the_column(ran):
    model, _, sink = ran
    z = sink.table("states")[:, 3]
    values, message = measured(ran, *(f"Rod.z {kind}" for kind in STATISTICS))
    expected = [z.max(), z.min(), np.abs(z).max(), z.mean(), np.sqrt(np.mean(z**2)), np.ptp(z)]
    assert list(values.values()) == pytest.approx([*expected, z[-1], z[0]], rel=1e-14)
    assert not message
    assert tables_needed(parse_measures(["Rod.z max"]), model) == ["states"]


def test_a_vector_is_measured_by_its_norm(ran):
    force = np.linalg.norm(ran[2].table("reactions")[:, 1:4], axis=1)
    assert measured(ran, "Hinge.F absmax")[0] == {"Hinge.F absmax": force.max()}


def test_values_at_a_time(ran):
    rows = ran[2].table("states")
    values, _ = measured(ran, "Rod.x at 0.5", "Rod.x at 0.5 s", "Rod.x at 0.5012")
    assert values["Rod.x at 0.5"] == values["Rod.x at 0.5 s"] == rows[100, 1]
    # The cubic through four output times; its error, of fourth order, is about 1e-10.
    x = np.polynomial.Polynomial.fit(rows[99:103, 0], rows[99:103, 1], 3)
    assert values["Rod.x at 0.5012"] == pytest.approx(x(0.5012), abs=1e-8)
    assert measured(ran, "Rod.x at 99")[1] == "Rod.x at 99: the run ends at 2 s"


def test_the_time_of_a_value_is_that_of_msahl_post_events(tmp_path):
    job = Job(str(DECK), (), {"t_final": 2.0}, ("time of Hinge.angle = 0",), "all", str(tmp_path))
    (row,) = run_points(job, [Point(1, "00", ())])
    run = read_run(tmp_path / "runs" / row["key"][:16])
    first = crossings(run, "Hinge.angle", 0.0)[0].time
    assert row["measures"] == {"time of Hinge.angle = 0": first}


def test_a_value_that_is_not_passed_has_no_time(ran):
    values, message = measured(ran, "time of Hinge.angle = 7")
    assert values == {"time of Hinge.angle = 7": None}
    assert message == "time of Hinge.angle = 7: the column does not pass the value"


def test_figures_are_those_of_the_report(ran):
    report = ran[1]
    values, _ = measured(ran, *FIGURES)
    assert values["verdict"] == report.verdict["word"]
    assert values["error"] == report.error["position"]
    assert values["steps"] == report.steps
    assert values["outputTimes"] == report.output_times
    assert values["energyErrorMax"] == report.extremes["energyErrorMax"]
    assert values["seconds"] == report.seconds["loop"]
    assert set(report.extremes) <= set(FIGURES)


@pytest.mark.parametrize(
    "text", ["Tip.z", "max", "Tip.z median", "time of Crank.angle", "Tip.z at noon", ""]
)
def test_a_text_that_is_no_measure(text):
    with pytest.raises(PlanError, match="--measure"):
        parse_measures([text])


def test_a_column_that_no_table_has_is_named_with_those_near_it(ran):
    with pytest.raises(PlanError, match=r"no table has a column 'Rod.zz'.*Rod\.z"):
        require_columns(parse_measures(["Rod.zz max", "Rod.z max"]), ran[0])
    values, message = measured(ran, "Rod.zz max")
    assert values == {"Rod.zz max": None}
    assert "no table has a column 'Rod.zz'" in message


def test_all_faults_are_reported_and_repeats_counted_once():
    with pytest.raises(PlanError) as fault:
        parse_measures(["a", "b"])
    assert len(fault.value.faults) == 2
    assert len(parse_measures(["Rod.z max", "Rod.z  max"])) == 1
