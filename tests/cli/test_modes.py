"""The command ``msahl modes``: what it prints and writes."""

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from tests.support.models import ROOT

DECKS = ROOT / "decks"


def call(*words):
    return CliRunner().invoke(main, ["modes", *(str(word) for word in words)])


def test_tables_of_the_bicycle(tmp_path):
    result = call(DECKS / "mechanisms/bicycle.xml", "--set", "v=4", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "WARN" not in result.output
    assert "steady motion" in result.output
    rows = np.genfromtxt(tmp_path / "out/modes.csv", delimiter=",", names=True)
    values = rows["real"] + 1j * rows["imaginary"]
    for published in (-12.15861426576447, -1.42944427361326, 0.41325331521125 + 3.07910818603206j):
        assert np.abs(values - published).min() <= 1e-12 * abs(published)
    assert np.all(rows["imaginary"] >= 0.0)
    assert rows["frequency"] == pytest.approx(np.abs(values) / (2.0 * np.pi))
    moving = np.abs(values) > 0.0
    assert rows["damping"][moving] == pytest.approx(-rows["real"][moving] / np.abs(values[moving]))
    text = (tmp_path / "out/shapes.csv").read_text().splitlines()
    assert len(text) == 1 + len(rows)
    head = text[0].split(",")
    assert head[:3] == ["mode", "RearWheel.x.real", "RearWheel.x.imaginary"]
    assert len(head) == 1 + 4 * 6 * 2
    assert not list((tmp_path / "out").glob("*.part"))


def test_a_deck_that_is_not_in_equilibrium_warns():
    result = call(DECKS / "thesis/single_pendulum_45.xml")
    assert result.exit_code == 0
    assert "WARN: this is no equilibrium" in result.output
    assert "no equilibrium" in result.output


def test_another_time_and_auxiliary_states():
    result = call(DECKS / "forces/actuator_motor.xml", "--at", "0.5", "-q")
    assert result.exit_code == 0, result.output
    late = call(DECKS / "thesis/single_pendulum_45.xml", "--at", "0.25")
    assert "at t = 0.25 s" in late.output


def test_faults_end_with_the_status_of_bad_input(tmp_path):
    assert call(tmp_path / "none.xml").exit_code == 2
    assert call(DECKS / "joints/revolute.xml", "--at", "-1").exit_code == 2


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    result = call(DECKS / "joints/revolute.xml", "-q", "-o", tmp_path / "file")
    assert result.exit_code == 4
