"""Plans: order of the points, files of points, faults, memory."""

import tracemalloc
from itertools import islice

import pytest

from msahl.sweep.axes import parse_over, parse_set
from msahl.sweep.faults import PlanError
from msahl.sweep.plan import make_plan, read_plan, with_constants, write_plan
from msahl.sweep.samples import Sample


def axes(*texts):
    return [parse_set(text) for text in texts]


def test_the_last_axis_varies_first():
    plan = make_plan([*axes("a=1,2"), parse_over("dt=0.1,0.2")])
    assert plan.head == ["point", "a", "--dt"]
    assert list(plan) == [("1", "0.1"), ("1", "0.2"), ("2", "0.1"), ("2", "0.2")]
    assert plan.count == 4


def test_zip_goes_side_by_side_and_repeats_single_values():
    plan = make_plan(axes("a=1,2,3", "b=4:6:3", "c=7"), zipped=True)
    assert list(plan) == [("1", "4", "7"), ("2", "5", "7"), ("3", "6", "7")]
    with pytest.raises(PlanError, match="a has 2, b has 3"):
        make_plan(axes("a=1,2", "b=1,2,3"), zipped=True)


def test_a_plan_that_is_written_anew_keeps_its_values(tmp_path):
    path = tmp_path / "plan.csv"
    path.write_text("L,Rod.mass\n60,2\n80,3\n")
    plan = with_constants(read_plan(path), axes("r=5"))
    write_plan(plan, path)  # as by: msahl sweep --plan DIR/plan.csv -o DIR
    assert list(plan) == [("60", "2", "5"), ("80", "3", "5")]
    path.write_text("L\n60\n")
    with pytest.raises(PlanError, match=r"plan.csv: was changed meanwhile; start the sweep again"):
        list(plan)


def test_samples_are_drawn_for_every_combination_of_lists():
    plan = make_plan(axes("a=1,2", "b~uniform(0,1)"), sample=Sample("lhs", 3, 0))
    rows = list(plan)
    assert plan.count == len(rows) == 6
    assert [row[0] for row in rows] == ["1"] * 3 + ["2"] * 3
    assert [row[1] for row in rows[:3]] == [row[1] for row in rows[3:]]


@pytest.mark.parametrize(
    ("texts", "sample", "words"),
    [
        ((), None, "nothing to vary"),
        (("a=1", "a=2"), None, "varied twice"),
        (("a~uniform(0,1)",), None, "--sample lhs:100"),
        (("a=1",), Sample("lhs", 3, 0), "no distribution"),
        (("a~uniform(0,1)", "b=1,2"), Sample("saltelli", 4, 0), "one value"),
        (("a=0:1:100000", "b=0:1:100000"), None, "at most"),
    ],
)
def test_faults_of_axes(texts, sample, words):
    with pytest.raises(PlanError, match=words):
        make_plan(axes(*texts), sample=sample)


def test_a_plan_is_read_back_from_its_file(tmp_path):
    plan = make_plan([*axes("L=60:100:3 cm", "m={a+b}"), parse_over("scheme=gauss2,radau2")])
    write_plan(plan, tmp_path / "plan.csv")
    again = read_plan(tmp_path / "plan.csv")
    assert (again.columns, again.count, list(again)) == (plan.columns, plan.count, list(plan))
    write_plan(again, tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "plan.csv").read_bytes()


def test_a_plan_written_by_hand(tmp_path):
    path = tmp_path / "hand.csv"
    path.write_bytes(b"\xef\xbb\xbfL [cm], Bob.mass ,--dt\r\n60, 1 kg,0.1\r\n\r\n,2,\r\n")
    plan = read_plan(path)
    assert plan.head == ["point", "L [cm]", "Bob.mass", "--dt"]
    assert list(plan) == [("60", "1 kg", "0.1"), ("", "2", "")]  # empty: the deck's own
    more = with_constants(plan, axes("k=3"))
    assert list(more) == [("60", "1 kg", "0.1", "3"), ("", "2", "", "3")]
    with pytest.raises(PlanError, match="take one value"):
        with_constants(plan, axes("k=1,2"))
    with pytest.raises(PlanError, match="column of the plan"):
        with_constants(plan, axes("L=1"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "first line names"),
        ("L\n", "no point below"),
        ("L,L [cm]\n1,2\n", "appears twice"),
        ("--stride\n1\n", "no option '--stride'"),
        ("L,m\n1\n", r"plan.csv:2: 1 cells under 2 columns"),
        ("L\nx\n", r"plan.csv:2: L: 'x' is not a number"),
        ("L [cm]\n1 m\n", "has a unit, and so has its column"),
        ("--scheme\neuler\n", "'euler' is not one of"),
        ('L\n"1\n', "cannot be read as CSV"),
    ],
)
def test_faults_of_files(tmp_path, text, words):
    path = tmp_path / "plan.csv"
    path.write_text(text)
    with pytest.raises(PlanError, match=words):
        read_plan(path)


def test_a_file_that_is_missing_or_no_text(tmp_path):
    with pytest.raises(PlanError, match="cannot be read"):
        read_plan(tmp_path / "none.csv")
    (tmp_path / "bytes.csv").write_bytes(b"L\n\xff\xfe\n")
    with pytest.raises(PlanError, match="cannot be read"):
        read_plan(tmp_path / "bytes.csv")


def test_all_faults_of_a_file_are_reported_but_not_endlessly(tmp_path):
    path = tmp_path / "plan.csv"
    path.write_text("L\n" + "x\n" * 1000)
    with pytest.raises(PlanError) as fault:
        read_plan(path)
    assert len(fault.value.faults) == 21


def test_a_large_plan_takes_no_memory_for_its_points():
    made = make_plan(axes("a=0:1:1000", "b=0:1:1000"))
    tracemalloc.start()
    try:
        assert sum(1 for _ in islice(made, 100_000)) == 100_000
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert made.count == 1_000_000
    assert peak < 100_000  # bytes: less than one per point
