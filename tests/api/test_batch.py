"""Batches: results are those of single runs to the bit, whatever process makes them."""

import os
import signal
from pathlib import Path

import pandas as pd
import pytest

import msahl
from msahl.api import batch as batches

DECKS = Path(__file__).parents[2] / "decks"
ROD = DECKS / "basics" / "parameters.xml"
SAMPLES = [{"L": 0.5}, {"L": "90 cm", "r": 12}, {"start": 10}, {}, {"start": 10}]
SHORT = {"t_final": 0.05}


def figures(result):
    """All that a run found out but for the seconds."""
    return {name: value for name, value in result.report.items() if name != "seconds"}


def assert_same(result, other):
    assert result.tables == other.tables
    for name in result.tables:
        assert result.array(name).tobytes() == other.array(name).tobytes(), name
    assert figures(result) == figures(other)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("jobs", "options"),
    [(1, {}), (2, {"scheme": "gauss3"}), (None, {})],
    ids=["one process", "two", "as many as cores"],
)
def test_results_are_those_of_single_runs(jobs, options):
    model = msahl.load(ROD)
    results = list(msahl.batch(model, SAMPLES, jobs, **SHORT, **options))
    assert len(results) == len(SAMPLES)
    for sample, result in zip(SAMPLES, results, strict=True):
        single = model.with_(**sample).run(**SHORT, **options)
        assert_same(result, single)
        assert result.records == single.records
        assert result.states.equals(single.states)


def test_samples_may_be_a_frame():
    model = msahl.load(ROD)
    samples = pd.DataFrame({"L": [0.5, 0.6], "start": [10.0, 20.0]})
    results = list(msahl.batch(model, samples, 1, **SHORT))
    for sample, result in zip(samples.to_dict("records"), results, strict=True):
        assert_same(result, model.with_(**sample).run(**SHORT))


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_only_the_tables_wanted_are_returned(jobs):
    results = msahl.batch(msahl.load(ROD), SAMPLES[:2], jobs, tables=["states"], **SHORT)
    assert [result.tables for result in results] == [("states",), ("states",)]


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_sample_that_cannot_be_run_raises(jobs):
    model = msahl.load(ROD)
    samples = [{"L": 0.5}, {"L": -1.0}, {"L": 0.6}]
    results = msahl.batch(model, samples, jobs, **SHORT)
    assert next(results).completed
    with pytest.raises(msahl.DeckError, match="mass"):
        next(results)
    kept = list(msahl.batch(model, samples, jobs, errors="return", **SHORT))
    assert [isinstance(result, msahl.DeckError) for result in kept] == [False, True, False]


@pytest.mark.parametrize("jobs", [1, 2])
def test_exceptions_are_the_same_from_every_process(jobs):
    samples = [{"L": -1}, {"L": None}, {}]
    first, second, third = msahl.batch(msahl.load(ROD), samples, jobs, errors="return", **SHORT)
    assert isinstance(first, msahl.DeckError)
    assert len(first.faults) == 2
    assert str(second) == "L: it is None; give a finite number, or a text such as '80 cm'"
    assert second.faults == (str(second),)
    assert third.completed


@pytest.mark.parametrize("samples", [[5], ["L"], {"L": [0.5, 0.6]}])
def test_samples_that_are_none_are_refused(samples):
    with pytest.raises(msahl.OptionError, match="give a list of"):
        list(msahl.batch(msahl.load(ROD), samples, 2, **SHORT))


def test_a_result_with_some_tables_only_is_not_written_as_a_run(tmp_path):
    (result,) = msahl.batch(msahl.load(ROD), [{}], 1, tables=["states"], **SHORT)
    with pytest.raises(msahl.ResultError, match="did not keep reactions, joints, error"):
        result.write(tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_wrong_use_is_reported_before_the_first_run():
    model = msahl.load(ROD)
    for wrong in ({"jobs": 0}, {"errors": "skip"}, {"tables": ["stats"]}, {"every": 0}):
        with pytest.raises(msahl.OptionError, match=next(iter(wrong))):
            msahl.batch(model, [], **wrong)


@pytest.mark.slow
def test_samples_are_taken_as_results_are():
    taken = []

    def samples():
        for k in range(100_000):
            taken.append(k)
            yield {"start": k % 90}

    results = msahl.batch(msahl.load(ROD), samples(), 2, **SHORT)
    for _ in range(3):
        next(results)
    assert len(taken) <= 1 + 2 * batches.AHEAD * batches.MOST_SAMPLES
    results.close()


@pytest.fixture
def started(monkeypatch):
    """The processes that batches start."""
    processes = []

    class Noted(batches._Worker):
        def __init__(self, begin):
            super().__init__(begin)
            processes.append(self.process)

    monkeypatch.setattr(batches, "_Worker", Noted)
    return processes


@pytest.mark.slow
def test_there_are_at_most_as_many_processes_as_samples_and_cores(monkeypatch, started):
    monkeypatch.setattr(batches, "cores", lambda: 3)
    assert len(list(msahl.batch(msahl.load(ROD), SAMPLES[:2], 1000, **SHORT))) == 2
    assert len(started) == 2
    assert len(list(msahl.batch(msahl.load(ROD), iter(SAMPLES[:4]), 1000, **SHORT))) == 4
    assert len(started) == 2 + 3


@pytest.mark.slow
def test_a_process_that_is_killed_ends_the_batch(started):
    samples = ({"start": k % 90} for k in range(1000))
    results = msahl.batch(msahl.load(ROD), samples, 2, **SHORT)
    next(results)
    for process in started:
        os.kill(process.pid, signal.SIGKILL)
    with pytest.raises(msahl.BatchError, match="ended with exit status -9"):
        list(results)
    assert all(process.poll() is not None for process in started)


def test_no_process_is_started_for_a_few_short_runs(monkeypatch):
    monkeypatch.setattr(batches, "_Worker", None)
    monkeypatch.setattr(batches, "START_SECONDS", 1e6)
    assert len(list(msahl.batch(msahl.load(ROD), SAMPLES, **SHORT))) == len(SAMPLES)
