"""Elastic bodies in what the program does with models: gradients, batches, resumed runs."""

import shlex

import numpy as np
import pytest

import msahl
from tests.run.test_resume import call, interrupted, tables
from tests.support.models import ROOT

BLADE = ROOT / "decks" / "elastic" / "reduced_blade.xml"
SHORT = {"dt": 0.01, "t_final": 0.1, "error": "off"}


def energy(g):
    """Elastic energy of the blade at the end of a short run [J]."""
    result = msahl.load(BLADE, g=g).run(**SHORT)
    return float(result["Blade.energy"][-1])


def test_gradients_are_those_of_complete_runs():
    found = msahl.load(BLADE).gradient("Blade.energy final", wrt=["g"], **SHORT)
    d = 1e-3  # m/s^2, of 0.2: the energy is nearly quadratic in g, so differences are exact
    wanted = (energy(0.2 + d) - energy(0.2 - d)) / (2.0 * d)
    assert np.ravel(found.jacobian) == pytest.approx([wanted], rel=1e-6)


def test_batches_are_single_runs():
    runs = msahl.batch(msahl.load(BLADE), [{"g": 0.1}, {"g": 0.2}], tables=["work"], **SHORT)
    for g, one in zip((0.1, 0.2), runs, strict=True):
        assert float(one["Blade.energy"][-1]) == energy(g)


def test_a_run_is_resumed_to_the_byte(tmp_path, monkeypatch):
    words = (BLADE, "--dt", 0.01, "--t-final", 0.1)
    result = interrupted(monkeypatch, tmp_path / "out", *words)
    again = result.stderr.split("resume it with: ")[1].splitlines()[0]
    assert call(*shlex.split(again)[2:]).exit_code == 0
    assert call(*words, "-o", tmp_path / "complete").exit_code == 0
    assert tables(tmp_path / "out") == tables(tmp_path / "complete")
