"""The command ``msahl equilibrium``, and modes at what it finds."""

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from tests.support.models import ROOT

DECKS = ROOT / "decks"


def call(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def test_tables_of_a_pendulum_that_hangs_and_stands(tmp_path):
    deck = DECKS / "basics/parameters.xml"
    result = call("equilibrium", deck, "--starts", 6, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "2 equilibria" in result.output
    assert "stable" in result.output
    assert "unstable" in result.output
    rows = np.genfromtxt(tmp_path / "out/states.csv", delimiter=",", names=True)
    assert sorted(rows["Rodz"]) == pytest.approx([-0.4, 0.4], abs=1e-12)
    loads = np.genfromtxt(tmp_path / "out/reactions.csv", delimiter=",", names=True)
    # The hinge carries the weight of 1.9603538158 kg; z is up.
    assert loads["HingeFz"] == pytest.approx([1.9603538158 * 9.80665] * 2, rel=1e-9)
    assert list(rows["equilibrium"]) == [1.0, 2.0]


def test_a_deck_without_equilibrium_exits_with_its_status():
    result = call("equilibrium", DECKS / "basics/ballistic_point.xml")
    assert result.exit_code == 3
    assert "no equilibrium was found" in result.output


def test_a_rotation_that_is_impossible_is_refused():
    deck = DECKS / "basics/parameters.xml"
    result = call("equilibrium", deck, "--rotation", 0, 0, 3)
    assert result.exit_code == 2
    assert "rotate steadily" in result.output


def test_modes_at_an_equilibrium():
    result = call("modes", DECKS / "basics/parameters.xml", "--at", "equilibrium")
    assert result.exit_code == 0, result.output
    assert "WARN" not in result.output
    # Of a rod of 0.8 m: sqrt(m g L/2 / (m (L^2/3 + r^2/4))) / (2 pi), r = 10 mm.
    frequency = np.sqrt(9.80665 * 0.4 / (0.64 / 3 + 0.01**2 / 4)) / (2 * np.pi)
    assert f"{frequency:.9g}" in result.output
    assert call("modes", DECKS / "basics/parameters.xml", "--at", "never").exit_code == 2
