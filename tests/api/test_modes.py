"""Modes by the Python API: those of the command, by name, over a parameter, in files."""

import numpy as np
import pytest

import msahl
from msahl import OptionError
from tests.support.models import ROOT

BICYCLE = ROOT / "decks/mechanisms/bicycle.xml"


def test_modes_of_a_model(tmp_path):
    found = msahl.load(BICYCLE, v=4).modes()
    assert (found.zeros, found.rigid, found.degrees_of_freedom) == (6, 4, 3)
    assert np.abs(found.eigenvalues - (0.41325331521125 + 3.07910818603206j)).min() <= 1e-12
    assert found.warnings == []
    shape = found.shape(8)
    assert set(shape) == set(msahl.load(BICYCLE).modes().shape(1))
    # The front wheel's side is the largest displacement; the fork steers more than the frame yaws.
    assert abs(shape["FrontWheel.y"]) == pytest.approx(1.0)
    assert abs(shape["Fork.rz"]) > abs(shape["Frame.rz"])
    with pytest.raises(OptionError, match="mode: it is 10; it must be an integer from 1 to 9"):
        found.shape(10)
    assert found.frame["frequency"].tolist() == found.frequency.tolist()
    assert sorted(p.name for p in found.write(tmp_path).iterdir()) == ["modes.csv", "shapes.csv"]
    assert found.page(tmp_path / "page.html").stat().st_size > 100_000
    assert "unstable: 1 mode" in repr(found)
    assert "damping ratio" in found._repr_html_()


def test_modes_over_a_parameter(tmp_path):
    rotor = msahl.load(ROOT / "decks/mechanisms/rotor.xml", d=0)
    found = rotor.modes_over("speed", [0, 200, 400])
    assert len(found.frame) == 12
    assert found.critical["order"].tolist() == [1.0, 1.0, 1.0]
    folder = found.write(tmp_path / "rotor")
    assert {path.name for path in folder.iterdir()} == {
        "campbell.csv",
        "campbell.json",
        "critical.csv",
    }
    with pytest.raises(msahl.DeckError, match="did you mean speed"):
        rotor.modes_over("sped", [1, 2])
