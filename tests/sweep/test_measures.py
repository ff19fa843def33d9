"""Measures have the values that the tables of a run have, and name what is missing."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from msahl.deck import read_deck
from msahl.model import Options
from msahl.post.events import crossings
from msahl.post.measures import FIGURES, STATISTICS, evaluate, tables_needed, unit_of
from msahl.results.read import read_run
from msahl.run import loop
from msahl.run.tables import MemorySink
from msahl.sweep.faults import PlanError
from msahl.sweep.measures import parse_measures, require_columns
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
    t, duration = sink.table("states")[:, 0], 2.0
    mean, square = trapezoid(z, t) / duration, trapezoid(z**2, t) / duration
    expected = [z.max(), z.min(), np.abs(z).max(), mean, np.sqrt(square), np.ptp(z)]
    assert list(values.values()) == pytest.approx([*expected, z[-1], z[0]], rel=1e-13)
    assert not message
    assert tables_needed(parse_measures(["Rod.z max"]), model) == ["states"]


def test_a_vector_is_measured_by_its_norm(ran):
    force = np.linalg.norm(ran[2].table("reactions")[:, 1:4], axis=1)
    assert measured(ran, "Hinge.F absmax")[0] == {"Hinge.F absmax": force.max()}


def test_the_displacement_from_the_start(ran):
    model, _, sink = ran
    place = sink.table("states")[:, 1:4]
    away = np.linalg.norm(place - place[0], axis=1)
    texts = ["displacement of Rod max", "displacement of Rod.z final", "displacement of Rod at 0"]
    values, message = measured(ran, *texts)
    assert list(values.values()) == pytest.approx([away.max(), place[-1, 2] - place[0, 2], 0.0])
    assert not message
    assert [unit_of(measure, model) for measure in parse_measures(texts)] == ["m"] * 3
    with pytest.raises(PlanError, match="no table has a column 'Rad'"):
        require_columns(parse_measures(["displacement of Rad max"]), model)


def test_values_at_a_time(ran):
    rows = ran[2].table("states")
    values, _ = measured(ran, "Rod.x at 0.5", "Rod.x at 0.5 s", "Rod.x at 0.5012")
    assert values["Rod.x at 0.5"] == values["Rod.x at 0.5 s"] == rows[100, 1]
    # The cubic through four output times; its error, of fourth order, is about 1e-10.
    x = np.polynomial.Polynomial.fit(rows[99:103, 0], rows[99:103, 1], 3)
    assert values["Rod.x at 0.5012"] == pytest.approx(x(0.5012), abs=1e-8)
    for text in ("Rod.x at 99", "Rod.x at -1"):
        assert measured(ran, text)[1] == f"{text}: the run is from 0 to 2 s"


def test_means_are_over_the_time_whatever_the_output_times(ran):
    model, report, sink = ran
    texts = ("Rod.x mean", "Rod.x rms")
    means, _ = measured(ran, *texts)
    # Dense output in the first half second only: a mean over rows would be that of this part.
    uneven = np.r_[0:100, 100:401:4]
    found, _ = evaluate(parse_measures(texts), model, report, lambda name: sink.table(name)[uneven])
    assert found == pytest.approx(means, abs=2e-4)
    assert abs(sink.table("states")[uneven, 1].mean() - means["Rod.x mean"]) > 0.01
    one, _ = evaluate(parse_measures(texts), model, report, lambda name: sink.table(name)[:1])
    assert list(one.values()) == pytest.approx([sink.table("states")[0, 1]] * 2)


def test_uncertain_times_are_reported(ran):
    model, report, sink = ran
    (measure,) = parse_measures(["time of Hinge.angle = 0"])
    rows = sink.table("joints")[::40].copy()
    rows[:, 1] = np.sin(10.0 * (rows[:, 0] - 0.05))  # three output times a period
    found, reason = evaluate([measure], model, report, lambda name: rows)
    assert found[measure.text] == pytest.approx(0.05, abs=0.1)
    assert "uncertain by 0." in reason
    assert reason.endswith("s; give more output times")


def test_too_few_output_times_are_a_reason_of_their_own(ran):
    model, report, sink = ran
    texts = ["time of Hinge.angle = 0"]
    found = evaluate(parse_measures(texts), model, report, lambda name: sink.table(name)[::100])
    assert found[0] == {texts[0]: None}
    assert "5 output times are too few to interpolate between them" in found[1]


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
