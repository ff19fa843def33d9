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

BAR = """<data><system><gravity><g3>-9.81</g3></gravity>
<bodies><ground><name>G</name></ground><beam><name>Bar</name><elements>1</elements>
<centreLine><straight><start/><end><x>1</x></end></straight></centreLine>
<section><circle><radius>0.02</radius></circle></section>
<material><youngsModulus>1e7</youngsModulus><poissonsRatio>0.4</poissonsRatio>
<density>1000</density></material></beam></bodies>
<joints><revolute><name>J</name><parent><name>G</name><axis><y>1</y></axis></parent>
<child><name node="first">Bar</name></child></revolute></joints></system>
<simulation><deltaT>0.005</deltaT><tFinal>0.05</tFinal></simulation></data>"""


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


def test_the_energy_balance_of_a_run_with_beams_has_their_elastic_energy(tmp_path):
    """A bar of rubber, hinged at one end, falls from the horizontal, and bends."""
    (tmp_path / "bar.xml").write_text(BAR)
    result = CliRunner().invoke(
        msahl, ["run", str(tmp_path / "bar.xml"), "--error", "off", "-o", str(tmp_path / "r")]
    )
    assert result.exit_code == 0, result.output
    run = read_run(tmp_path / "r")
    energy = compute_metrics(run).energy
    assert run.work["Bar.energy"].max() > 1e-6
    # The run adds up strains from step to step, each with its round-off; the largest is 1e-2.
    np.testing.assert_allclose(energy.elastic, run.work["Bar.energy"], rtol=0.0, atol=1e-12)
    balance = energy.total - energy.total[0]
    assert abs(balance).max() < 1e-10 * energy.kinetic.max()


def test_a_sample_of_a_run_is_that_of_its_files(folder):
    run = read_run(folder)
    for numbers, most in ((10**9, 10**9), (10**9, 40)):
        one, other = sample_run(run, numbers, most), read_sample(folder, numbers, most)
        assert (one.total, one.stride, one.partial) == (other.total, other.stride, other.partial)
        assert one.tables.keys() == other.tables.keys()
        for name, (columns, rows) in other.tables.items():
            assert one.tables[name][0] == columns
            np.testing.assert_array_equal(one.tables[name][1], rows)
