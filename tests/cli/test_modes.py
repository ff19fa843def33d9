"""The command ``msahl modes``: what it prints and writes."""

import numpy as np
import pandas as pd
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


@pytest.mark.slow
def test_modes_over_a_parameter(tmp_path):
    folder = tmp_path / "out"
    result = call(DECKS / "mechanisms/rotor.xml", "--over", "speed=0:4000:5 rpm", "-o", folder)
    assert result.exit_code == 0, result.output
    assert "5 values from 0 to 4000 rpm" in result.output
    assert "is at 1x the speed, forward whirl" in result.output
    rows = np.genfromtxt(folder / "campbell.csv", delimiter=",", names=True)
    assert set(rows["value"]) == {0.0, 1000.0, 2000.0, 3000.0, 4000.0}
    assert set(rows["mode"]) == {1.0, 2.0, 3.0, 4.0}
    critical = np.genfromtxt(folder / "critical.csv", delimiter=",", names=True)
    # In revolutions per minute, each at its own frequency.
    assert critical["value"] / 60.0 == pytest.approx(critical["imaginary"] / (2.0 * np.pi))
    twice = call(DECKS / "mechanisms/rotor.xml", "--over", "speed=0:400:5", "--order", "2")
    assert "is at 2x the speed" in twice.output


@pytest.mark.parametrize(
    ("over", "expected"),
    [
        ("v=0:a", "'0:a' is not a value"),
        ("v~uniform(0,1)", "give a range or a list of values"),
        ("v={rR},{rF}", "give numbers with one unit"),
        ("z=1,2", "did you mean zH, zB"),
        ("v", "write NAME=VALUES"),
    ],
)
def test_faults_of_what_is_varied(over, expected):
    result = call(DECKS / "mechanisms/bicycle.xml", "--over", over)
    assert result.exit_code == 2
    assert expected in result.output
    assert "uniform" not in result.output.replace(over, "")


def test_an_order_needs_a_speed():
    bicycle = DECKS / "mechanisms/bicycle.xml"
    result = call(bicycle, "--over", "v=1,2", "--order", "1")
    assert result.exit_code == 2
    assert "unit of angular velocity" in result.output
    assert call(bicycle, "--order", "1").exit_code == 2


ROTOR = """<data><parameters><parameter name="spin" units="rpm">1200</parameter></parameters>
<system><gravity><g3>-10</g3></gravity><bodies><ground><name>G</name></ground>
<rigidBody><name>Frame</name><mass>4</mass><moi><Ixx>2</Ixx><Iyy>2</Iyy><Izz>2</Izz></moi>
</rigidBody><rigidBody><name>Disc</name><mass>1</mass>
<moi><Ixx>0.1</Ixx><Iyy>0.2</Iyy><Izz>0.1</Izz></moi></rigidBody></bodies><joints><revolute>
<name>Bearing</name><parent><name>Frame</name><axis><y>1</y></axis></parent>
<child><name>Disc</name></child>
<initialConditions><angleRate>{spin}</angleRate></initialConditions></revolute></joints>
<loads><springDamper><name>Left</name><parent><name>G</name><position><z>2</z><y>1</y></position>
</parent><child><name>Frame</name><position><y>1</y></position></child><stiffness>500</stiffness>
</springDamper><springDamper><name>Right</name><parent><name>G</name><position><z>2</z><y>-1</y>
</position></parent><child><name>Frame</name><position><y>-1</y></position></child>
<stiffness>500</stiffness></springDamper></loads></system>
<simulation start="equilibrium"><deltaT>0.01</deltaT><tFinal>0.02</tFinal></simulation></data>"""


def test_a_rotor_spins_about_the_equilibrium_at_which_its_deck_starts(tmp_path):
    deck = tmp_path / "rotor.xml"
    deck.write_text(ROTOR)
    result = call(deck, "-o", tmp_path / "modes")
    assert result.exit_code == 0, result.output
    assert "steady motion" in result.output
    assert "velocities that the deck gives" in result.output
    # Pitch and yaw of the frame are coupled by the angular momentum of the disc.
    shapes = pd.read_csv(tmp_path / "modes/shapes.csv")
    pitch, yaw = (
        np.hypot(shapes[f"Frame.{c}.real"], shapes[f"Frame.{c}.imaginary"]) for c in ("rx", "rz")
    )
    assert ((pitch > 0.1) & (yaw > 0.01)).any()
    run = CliRunner().invoke(main, ["run", str(deck), "-o", str(tmp_path / "run"), "-q"])
    assert run.exit_code == 0, run.output
    states = pd.read_csv(tmp_path / "run/states.csv")
    # 50 N on two springs of 500 N/m: 5 cm lower; 1200 rpm.
    assert states["Frame.z"][0] == pytest.approx(-0.05, rel=1e-9)
    assert states["Disc.wy"][0] == pytest.approx(40.0 * np.pi, rel=1e-12)


@pytest.mark.slow
def test_speeds_are_those_of_bodies(tmp_path):
    deck = tmp_path / "rotor.xml"
    deck.write_text(ROTOR)
    words = (deck, "--over", "spin=20:300:3")
    assert "1x the speed" in call(*words).output
    still = ROTOR.replace("<angleRate>{spin}</angleRate>", "<angleRate>3</angleRate>")
    deck.write_text(still)
    result = call(*words)
    assert result.exit_code == 0, result.output
    assert "the speed" not in result.output
    assert "WARN: no body rotates faster or slower with spin" in result.output


def test_a_model_that_cannot_move_has_no_modes(tmp_path):
    four_bar = DECKS / "mechanisms/four_bar.xml"
    result = call(four_bar, "--page", "-o", tmp_path)
    assert result.exit_code == 0, result.output
    assert "0 degrees of freedom" in result.output
    assert "no mode moves a body" in result.output
    assert len((tmp_path / "modes.csv").read_text().splitlines()) == 1
    over = call(four_bar, "--over", "Crank.mass=1,2", "-o", tmp_path)
    assert over.exit_code == 0, over.output
    assert "no critical values" in over.output
