"""Evenly spaced rows of a run's tables."""

import numpy as np
import pytest

from msahl.results.info import ResultError
from msahl.results.sample import read_sample
from tests.support import run_folders


@pytest.fixture
def folder(tmp_path):
    run_folders.write(tmp_path / "run")
    return tmp_path / "run"


def test_all_rows_are_those_of_the_tables(folder) -> None:
    sample = read_sample(folder, 10_000, 1000)
    states, reactions = run_folders.conical_rows()
    assert (sample.tables["states"][1] == states).all()
    assert (sample.tables["reactions"][1] == reactions).all()
    assert (sample.total, sample.stride, sample.partial) == (41, 1, False)


@pytest.mark.parametrize(
    ("most", "rows"), [(10, [0, 5, 10, 15, 20, 25, 30, 35, 40]), (6, [0, 7, 14, 21, 28, 35, 40])]
)
def test_rows_are_evenly_spaced_and_the_last_is_one_of_them(folder, most, rows) -> None:
    sample = read_sample(folder, 10_000, most)
    states, _ = run_folders.conical_rows()
    assert (sample.tables["states"][1] == states[rows]).all()
    assert sample.stride == rows[1]


def test_a_cut_run_is_read_up_to_its_last_complete_row(tmp_path) -> None:
    run_folders.write(tmp_path, complete=False)
    path = tmp_path / "states.csv.part"
    text = path.read_bytes()
    path.write_bytes(text[: text[:-1].rfind(b"\n") - 3])
    sample = read_sample(tmp_path, 10_000, 1000)
    assert sample.partial
    assert (sample.total, len(sample.time)) == (39, 39)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (b"\n0.02,", b"\nnan,", "states.csv:4: time is nan"),
        (b"\n0.02,", b"\n0.002,", "states.csv:4: times must increase"),
        (b"\n0.02,", b"\n0.02,,", "states.csv:4: 14 numbers under 13 columns"),
        (b"\n0.02,", b"\nx,", "states.csv:4: 'x' is not a number"),
        (b"Bob.y", b"Bob.q", "its columns are not those"),
    ],
)
def test_damage_is_reported_with_its_line(folder, old, new, told) -> None:
    path = folder / "states.csv"
    path.write_bytes(path.read_bytes().replace(old, new, 1))
    with pytest.raises(ResultError) as caught:
        read_sample(folder, 10_000, 1000)
    assert told in str(caught.value)


def test_no_rows_and_no_run_are_reported(tmp_path) -> None:
    with pytest.raises(ResultError, match="not the folder of a run"):
        read_sample(tmp_path, 10, 10)
    run_folders.write(tmp_path, states=np.empty((0, 13)), reactions=np.empty((0, 4)))
    with pytest.raises(ResultError, match="no rows yet"):
        read_sample(tmp_path, 10, 10)
