"""The companion of a view is the run with half the step size, or with smaller local tolerance."""

import numpy as np
import pytest

import msahl
from msahl.cli.main import main as msahl_command
from msahl.post.cli import main as post
from msahl.post.view.companion import companion_of
from msahl.results.sample import read_sample
from msahl.run.tables import STATES
from tests.fuzz.guard import call
from tests.support.models import ROOT

DECK = ROOT / "decks/thesis/double_pendulum_45.xml"


def run_into(folder, *options):
    call(msahl_command, "run", DECK, *options, "-q", "-o", folder)
    return folder


@pytest.mark.parametrize("every", [1, 3])
def test_half_the_step_size_at_the_same_times(tmp_path, every):
    folder = run_into(tmp_path / "run", "--dt", "0.02", "--t-final", "1", "--every", every)
    sample = read_sample(folder, 10**6, 10**6)
    finer = companion_of(sample)
    options = {"dt": 0.01, "output_interval": 0.02, "every": every}
    truth = msahl.load(folder / "deck.xml").run(**options)
    assert np.array_equal(finer.tables[STATES][1], truth.array(STATES))
    assert np.array_equal(finer.time, sample.time)


def test_a_long_run_is_compared_at_the_output_times_that_were_read(tmp_path):
    folder = run_into(tmp_path / "run", "--dt", "0.01", "--t-final", "2")
    sample = read_sample(folder, 10**6, 40)
    assert sample.stride > 1
    assert np.array_equal(companion_of(sample).time, sample.time)


def test_a_controlled_step_size_has_a_smaller_tolerance(tmp_path):
    options = ("--scheme", "auto", "--tolerance", "1e-5", "--t-final", "1")
    sample = read_sample(run_into(tmp_path / "run", *options), 10**6, 10**6)
    finer = companion_of(sample)
    assert np.array_equal(finer.time, sample.time)
    truth = msahl.load(sample.folder / "deck.xml").run(tolerance=1e-10, error="estimate")
    own, other = (
        np.abs(of.tables[STATES][1] - truth.array(STATES)).max() for of in (sample, finer)
    )
    assert 0.0 < other < 0.5 * own  # at order 10 a thousandth halves the steps, at least


def test_the_command(tmp_path):
    folder = run_into(tmp_path / "run", "--dt", "0.02", "--t-final", "1")
    call(post, "view", folder, "--companion")
    assert "with smaller steps" in (folder / "view.html").read_text()
    refused = call(post, "view", folder, folder, "--companion")
    assert refused.exit_code == 2
    assert "not both" in refused.output
