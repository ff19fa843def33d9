"""The command ``msahl kinematics``: its folder is read as that of a run, and says what made it."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import msahl
from msahl.cli.main import main
from msahl.post.cli import main as post

DECKS = Path(__file__).parents[2] / "decks"
SLIDER_CRANK = DECKS / "mechanisms/slider_crank.xml"


def call(*words):
    """Run the command with these words."""
    return CliRunner().invoke(main, ["kinematics", *(str(word) for word in words)])


@pytest.mark.slow
def test_a_folder_that_msahl_post_reads(tmp_path):
    folder = tmp_path / "out"
    result = call(SLIDER_CRANK, "--step", 0.02, "--t-final", 0.2, "-o", folder)
    assert result.exit_code == 0, result.output
    assert "PASS: 11 output times to t = 0.2 s" in result.output
    info = json.loads((folder / "run.json").read_text())
    assert info["command"] == "kinematics"
    assert "none" in info["options"]["scheme"]
    assert info["kinematics"]["redundantEquations"] == 3
    assert info["kinematics"]["errorBars"]["position"] < 1e-14
    rows = np.genfromtxt(folder / "joints.csv", delimiter=",", names=True, deletechars="")
    assert rows["Pivot.angle"] == pytest.approx(np.pi / 6.0 + 10.0 * rows["time"], abs=1e-13)
    report = CliRunner().invoke(post, ["report", str(folder)])
    assert report.exit_code == 0, report.output
    text = (folder / "report/report.md").read_text()
    assert "msahl kinematics, 11 output times to 0.2 s" in text
    assert "discretisation error" not in text
    verdict = CliRunner().invoke(post, ["verdict", str(folder)])
    assert "PASS" in verdict.output


@pytest.mark.slow
def test_a_motion_beyond_reach_exits_with_its_status(tmp_path):
    deck = tmp_path / "pushed.xml"
    text = SLIDER_CRANK.read_text()
    text = text.replace("<joint>Pivot</joint>", "<joint>Guide</joint>")
    text = text.replace("<coordinate>angle<", "<coordinate>slide<")
    text = text.replace('name="speed" units="rad/sec">10', 'name="speed" units="m/sec">0.1')
    deck.write_text(text)
    folder = tmp_path / "out"
    result = call(deck, "--every", 10, "-o", folder)
    assert result.exit_code == 3
    assert "limit position at t = 0.184484853432 s" in result.output
    info = json.loads((folder / "run.json").read_text())
    assert info["status"] == "not converged"
    assert info["verdict"]["word"] == "FAIL"
    (position,) = info["kinematics"]["singularPositions"]
    assert set(position["bodies"]) == {"Crank", "Rod"}
    assert "Motor" in position["elements"]
    assert info["time"] == pytest.approx(0.18)


def test_degrees_of_freedom_that_remain_are_named_and_nothing_is_written(tmp_path):
    folder = tmp_path / "out"
    result = call(DECKS / "mechanisms/spatial_slider_crank.xml", "-o", folder)
    assert result.exit_code == 2
    assert "1 degree of freedom remains; Crank, Rod, Slider can move" in result.output
    assert "angle of 'Crank pivot'" in result.output
    assert not (folder / "run.json").exists()


def test_in_python():
    result = msahl.load(SLIDER_CRANK).kinematics(step=0.05, t_final=0.2)
    assert result.completed
    assert result.report["command"] == "kinematics"
    assert result.array("states").shape[0] == 5
    assert result["Slider.ax"].shape == (5,)
