"""Results in Python: columns, frames, figures of the run, files, pictures."""

import pickle
from html import escape

import numpy as np
import pytest

import msahl
from msahl.run.error_estimate import NO_ERRORS
from msahl.run.tables import MemorySink
from tests.support.models import ROOT

SINGLE = ROOT / "decks" / "thesis" / "single_pendulum_45.xml"
FOUR_BAR = ROOT / "decks" / "mechanisms" / "four_bar.xml"


@pytest.fixture(scope="module")
def result():
    return msahl.load(FOUR_BAR).run(t_final=0.5)


def test_frames_share_the_memory_of_arrays(result):
    assert list(result.states.columns) == result.columns("states")
    assert np.shares_memory(result.states.to_numpy(), result.array("states"))
    assert result.states is result.states
    assert result["time"] is not None
    assert np.array_equal(result.time, result.states["time"])


def test_columns_of_all_tables_are_found_by_name(result):
    for table in result.tables:
        for name in result.columns(table)[1:]:
            assert np.array_equal(result[name], result.frame(table)[name])
    with pytest.raises(KeyError, match=r"no column 'Crank.nonsense'"):
        result["Crank.nonsense"]


def test_rows_stay_when_the_companion_ends_before_the_run():
    sink = MemorySink()
    for rows in (np.zeros((1, 7)), np.ones((3, 7)), NO_ERRORS):
        sink.write({"error": rows})
    assert sink.table("error").shape == (4, 7)


def test_a_table_that_the_run_lacks_is_a_fault_in_words(result):
    assert "markers" not in result.tables
    with pytest.raises(msahl.ResultError, match="no table 'markers'; it has states"):
        _ = result.markers


def test_the_report_is_that_of_the_run(result):
    assert result.completed
    assert result.status == "completed"
    assert result.message == ""
    assert result.verdict == result.report["verdict"]["word"]
    assert result.error == result.report["error"]["position"] > 0.0
    assert result.seconds.keys() >= {"prepare", "loop", "total"}
    assert result.report["steps"] == len(result.time) - 1
    assert result.errors["position"].max() <= result.error


def test_an_error_that_was_not_estimated_is_none():
    result = msahl.load(SINGLE).run(dt=0.01, t_final=0.1, error="off")
    assert result.error is None
    assert result.verdict == "DONE"
    assert "not estimated" in result._repr_html_()


def test_a_run_that_ends_early_keeps_its_rows(tmp_path):
    failed = msahl.load(BLASTED).run()
    assert failed.status == "not converged"
    assert failed.verdict == "FAIL"
    assert failed.message
    assert escape(failed.message) in failed._repr_html_()
    failed.write(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} >= {"states.csv.part", "run.json"}
    assert msahl.read(tmp_path).status == "not converged"


BLASTED = """<data><system><bodies><ground><name>Base</name></ground>
<rigidBody><name>Bob</name><mass>2</mass><moi><Ixx>.1</Ixx><Iyy>.1</Iyy><Izz>.1</Izz></moi>
<initialConditions><position><z>5</z></position></initialConditions></rigidBody></bodies>
<joints><spherical><name>Pivot</name><parent><name>Base</name></parent>
<child><name>Bob</name><position><z>-5</z></position></child></spherical></joints>
<loads><concentrated><name>Blast</name><body>Bob</body><position><z>1</z></position>
<force basis="Bob"><xForce>1e100</xForce><zForce>1e100</zForce></force></concentrated></loads>
</system><simulation><deltaT>0.01</deltaT><tFinal>1</tFinal></simulation></data>"""
"""No step of it can be solved: a force of 1e100 N that rotates with the body that it rotates."""


def test_results_are_written_and_read_back(result, tmp_path):
    result.write(tmp_path / "a")
    again = msahl.read(tmp_path / "a")
    assert again.tables == result.tables
    for name in result.tables:
        assert np.array_equal(again.array(name), result.array(name))
    assert again.verdict == result.verdict
    assert again.error == result.error
    again.write(tmp_path / "b")
    for path in (tmp_path / "a").iterdir():
        assert (tmp_path / "b" / path.name).read_bytes() == path.read_bytes(), path.name


def test_results_do_not_replace_those_of_another_deck(result, tmp_path):
    from msahl.results.folder import FolderError

    result.write(tmp_path)
    result.write(tmp_path)
    with pytest.raises(FolderError, match="holds the results of another deck"):
        msahl.load(SINGLE).run(t_final=0.1).write(tmp_path)
    with pytest.raises(msahl.ResultError, match="not the folder of a run"):
        msahl.read(tmp_path / "nowhere")


def test_results_can_be_sent_to_other_processes(result):
    copy = pickle.loads(pickle.dumps(result))
    assert copy.report == result.report
    assert np.array_equal(copy.array("states"), result.array("states"))


@pytest.mark.slow
def test_pictures_are_those_of_the_command(result, tmp_path):
    from click.testing import CliRunner

    from msahl.post.cli import main

    pictures = result.plot("path", "energy", plane="xz")
    assert list(pictures) == ["path-xz", "energy"]
    paths = pictures.save(tmp_path / "own")
    assert pictures._repr_html_().count("<img") == 2
    result.write(tmp_path / "run")
    words = ["plot", tmp_path / "run", "path", "energy", "--plane", "xz", "-o", tmp_path / "post"]
    assert CliRunner().invoke(main, list(map(str, words))).exit_code == 0
    for path in paths:
        assert path.read_bytes() == (tmp_path / "post" / path.name).read_bytes()
    with pytest.raises(msahl.ResultError, match="no body 'Bib' in the model"):
        result.plot("path", bodies=("Bib",))


def test_a_result_shows_itself(result):
    assert repr(result).startswith("<Result of ")
    assert "estimated position error" in result._repr_html_()
