"""A run is evaluated part by part of its output times, with the results of one part."""

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main as msahl
from msahl.post import replay
from msahl.post.metrics import compute_metrics
from msahl.results.read import read_run
from msahl.results.sample import read_sample, sample_run
from tests.support.models import ROOT


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run with joint angles of several revolutions, a motion and redundant joints."""
    folder = tmp_path_factory.mktemp("run")
    deck = ROOT / "decks" / "mechanisms" / "four_bar.xml"
    result = CliRunner().invoke(msahl, ["run", str(deck), "--dt", "0.02", "-o", str(folder)])
    assert result.exit_code == 0, result.output
    return folder


@pytest.mark.parametrize("rows", [1, 2, 7, 50, 151])
def test_parts_give_the_bits_of_one_part(folder, monkeypatch, rows):
    run = read_run(folder)
    once = compute_metrics(run)
    monkeypatch.setattr(replay, "PART", rows * len(run.model.bodies))
    parts = compute_metrics(run)
    for name in ("linear", "rotational", "potential", "elastic"):
        np.testing.assert_array_equal(getattr(parts.energy, name), getattr(once.energy, name))
    for name in ("violation", "rate"):
        found, expected = getattr(parts.constraints, name), getattr(once.constraints, name)
        np.testing.assert_array_equal(found, expected)
    for name in ("hainge", "reaction"):
        np.testing.assert_array_equal(getattr(parts.work, name), getattr(once.work, name))


def test_a_sample_of_a_run_is_that_of_its_files(folder):
    run = read_run(folder)
    for numbers, most in ((10**9, 10**9), (10**9, 40)):
        one, other = sample_run(run, numbers, most), read_sample(folder, numbers, most)
        assert (one.total, one.stride, one.partial) == (other.total, other.stride, other.partial)
        assert one.tables.keys() == other.tables.keys()
        for name, (columns, rows) in other.tables.items():
            assert one.tables[name][0] == columns
            np.testing.assert_array_equal(one.tables[name][1], rows)
