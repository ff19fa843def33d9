"""The templates of machines do what their headers say."""

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.algebra.rotation import matrix
from msahl.cli.main import main
from msahl.cli.new import decks
from msahl.deck import read_deck
from msahl.post.cli import main as post
from msahl.run.verdict import PASS
from msahl.system.names import signal_columns
from tests.support.models import simulate_and_estimate as simulate

MACHINES = ("robot", "vehicle", "engine", "satellite", "pid")


@pytest.fixture(scope="module")
def runs():
    """Runs of the templates by name, each made once."""
    made = {}

    def run(name):
        if name not in made:
            made[name] = simulate(read_deck(decks()[name]))
        return made[name]

    return run


def signal(run, name):
    return run.signals[:, signal_columns(run.model).index(name)]


def angle_about(run, body, axis):
    """Angle of a body's rotation about a coordinate axis of the ground at the end [deg]."""
    R = np.array(matrix(tuple(run.of("orientation", body)[-1])))
    one, other = (axis + 1) % 3, (axis + 2) % 3
    return np.degrees(np.arctan2(R[other, one], R[one, one]))


@pytest.mark.parametrize("name", MACHINES)
def test_the_commands_read_a_machine(tmp_path, name):
    deck, out = str(decks()[name]), str(tmp_path / "run")
    run = CliRunner().invoke(main, ["run", deck, "-o", out, "--t-final", "0.2", "--error", "off"])
    assert run.exit_code == 0, run.output
    energy = CliRunner().invoke(post, ["energy", out, "--csv"])
    assert energy.exit_code == 0, energy.output


@pytest.mark.parametrize("name", MACHINES)
def test_a_machine_runs_and_keeps_its_energy(runs, name):
    report = runs(name).report
    assert report.status == "completed"
    assert report.verdict["word"] == PASS
    # Round-off of up to 5000 steps ; actuators and states are within the balance.
    assert report.extremes["energyErrorMaxRelative"] < 1e-11


def test_the_robot_comes_to_its_angles(runs):
    run = runs("robot")
    # About -y, so from x to z.
    assert -angle_about(run, 0, 1) == pytest.approx(60.0, abs=0.1)
    assert -angle_about(run, 1, 1) == pytest.approx(15.0, abs=0.1)


def test_the_vehicle_climbs_the_ramp(runs):
    run = runs("vehicle")
    late = run.time > 2.0
    assert run.of("position", 1)[late, 2] == pytest.approx(0.75, abs=2e-3)


def test_the_engine_swings_about_its_speed(runs):
    run = runs("engine")
    late = run.time > 0.6
    assert run.of("spin", 0)[late, 1].mean() == pytest.approx(105.0, abs=5.0)
    # From -30 degrees to 15 revolutions, where a condition ends the run.
    assert run.time[-1] == pytest.approx(0.9, abs=0.05)
    assert angle_about(run, 0, 1) == pytest.approx(0.0, abs=1e-9)


def test_the_satellite_comes_to_its_orientation(runs):
    run = runs("satellite")
    assert np.degrees(4 * np.arctan(np.linalg.norm(run.of("orientation", 0)[-1]) / 4)) < 1.0
    momentum = 10.0 * run.of("spin", 0)[:, 2] + 0.4 * run.of("spin", 1)[:, 2]
    assert np.abs(momentum).max() < 1e-12


def test_the_integral_carries_the_weight(runs):
    run = runs("pid")
    assert -angle_about(run, 0, 1) == pytest.approx(40.0, abs=0.2)
    assert 30.0 * signal(run, "integral")[-1] == pytest.approx(2.52, abs=0.01)
