"""The command ``msahl equilibrium``, and modes at what it finds."""

import json
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import brentq

import msahl
from msahl.cli.main import main
from tests.run.test_resume import interrupted, tables
from tests.support.models import ROOT

DECKS = ROOT / "decks"
START = """<data>
<parameters><parameter name="m" units="kg">2</parameter></parameters>
<system>
<gravity><g3>-9.81</g3></gravity>
<bodies><ground><name>G</name></ground><rigidBody><name>A</name><mass>{m}</mass>
<moi><Ixx>0.1</Ixx><Iyy>0.1</Iyy><Izz>0.1</Izz></moi></rigidBody></bodies>
<joints><revolute><name>H</name><parent><name>G</name><axis><y>1</y></axis></parent>
<child><name>A</name><position><z>0.5</z></position></child>
<initialConditions><angle units="deg">30</angle></initialConditions>
</revolute></joints>
<loads><torsionalSpringDamper><name>S</name><joint>H</joint><stiffness>10</stiffness>
<damping>0.1</damping></torsionalSpringDamper></loads>
</system>
<simulation start="equilibrium"><deltaT>0.01</deltaT><tFinal>1</tFinal></simulation>
</data>"""
"""A pendulum of arm 0.5 m on a spring that is unloaded at 30 deg."""


def angle_at_rest(mass):
    """Angle [rad] of the pendulum: mass g 0.5 sin(angle) = 10 (pi/6 - angle)."""
    return brentq(lambda a: mass * 9.81 * 0.5 * np.sin(a) - 10.0 * (np.pi / 6 - a), 0, 1)


@pytest.fixture
def start(tmp_path):
    path = tmp_path / "start.xml"
    path.write_text(START)
    return path


def call(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


@pytest.mark.slow
def test_tables_of_a_pendulum_that_hangs_and_stands(tmp_path):
    deck = DECKS / "basics/parameters.xml"
    result = call("equilibrium", deck, "--starts", 6, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "2 equilibria" in result.output
    assert result.output.count("residual 0 N to round-off") == 2
    assert "stable" in result.output
    assert "unstable" in result.output
    rows = np.genfromtxt(tmp_path / "out/states.csv", delimiter=",", names=True)
    assert sorted(rows["Rodz"]) == pytest.approx([-0.4, 0.4], abs=1e-12)
    loads = np.genfromtxt(tmp_path / "out/reactions.csv", delimiter=",", names=True)
    # The hinge carries the weight of 1.9603538158 kg; z is up.
    assert loads["HingeFz"] == pytest.approx([1.9603538158 * 9.80665] * 2, rel=1e-9)
    assert list(rows["equilibrium"]) == [1.0, 2.0]


@pytest.mark.slow
def test_a_deck_without_equilibrium_exits_with_its_status():
    result = call("equilibrium", DECKS / "basics/ballistic_point.xml")
    assert result.exit_code == 3
    assert "no equilibrium was found" in result.output
    # No other configuration has one either: the point falls.
    assert "nothing resists what acts on body 'Point', force along z" in result.output
    assert "--starts" not in result.output
    for others in (["modes"], ["linearize", "--input", "Point.Fz", "--output", "Point.z"]):
        result = call(
            others[0], DECKS / "basics/ballistic_point.xml", *others[1:], "--at", "equilibrium"
        )
        assert result.exit_code == 3


def test_a_rotation_that_is_impossible_is_refused():
    deck = DECKS / "basics/parameters.xml"
    result = call("equilibrium", deck, "--rotation", 0, 0, 3)
    assert result.exit_code == 2
    assert "rotate steadily" in result.output
    assert "joint '" in result.output


def test_modes_at_an_equilibrium():
    result = call("modes", DECKS / "basics/parameters.xml", "--at", "equilibrium")
    assert result.exit_code == 0, result.output
    assert "WARN" not in result.output
    # Of a rod of 0.8 m: sqrt(m g L/2 / (m (L^2/3 + r^2/4))) / (2 pi), r = 10 mm.
    frequency = np.sqrt(9.80665 * 0.4 / (0.64 / 3 + 0.01**2 / 4)) / (2 * np.pi)
    assert f"{frequency:.9g}" in result.output
    assert call("modes", DECKS / "basics/parameters.xml", "--at", "never").exit_code == 2


def test_decks_that_are_written_begin_at_the_equilibria(start, tmp_path):
    result = call("equilibrium", start, "--starts", 3, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    rows = np.genfromtxt(tmp_path / "out/joints.csv", delimiter=",", names=True, ndmin=1)
    loads = np.genfromtxt(tmp_path / "out/loads.csv", delimiter=",", names=True, ndmin=1)
    assert rows["Hangle"][0] == pytest.approx(angle_at_rest(2.0), rel=1e-12)
    moment = -2.0 * 9.81 * 0.5 * np.sin(rows["Hangle"])
    assert loads["Sload"] == pytest.approx(moment, abs=1e-9)
    for number, angle in enumerate(rows["Hangle"].tolist(), start=1):
        model = msahl.load(tmp_path / f"out/equilibrium{number}.xml")
        assert model.run(t_final=0.01).frame("joints")["H.angle"][0] == pytest.approx(angle, 1e-14)


def test_a_run_starts_at_its_equilibrium_and_stays(start, tmp_path):
    result = call("run", start, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "starts at an equilibrium" in result.output
    told = json.loads((tmp_path / "out/run.json").read_bytes())["start"]
    assert told["at"] == "equilibrium"
    assert told["stability"] == "stable, all motions are damped"
    rows = np.genfromtxt(tmp_path / "out/joints.csv", delimiter=",", names=True)
    assert rows["Hangle"] == pytest.approx(angle_at_rest(2.0), abs=1e-12)
    checked = call("check", start)
    assert checked.exit_code == 0
    assert "good; starts at an equilibrium" in checked.output
    # deck.xml begins there, without another search.
    again = call("run", tmp_path / "out/deck.xml", "-o", tmp_path / "again")
    assert "starts at" not in again.output
    files = [tmp_path / folder / "states.csv" for folder in ("out", "again")]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_run_leaves_the_equilibrium_with_the_rate_that_the_deck_gives(start, tmp_path):
    text = start.read_text().replace("</angle>", "</angle><angleRate>0.5</angleRate>")
    start.write_text(text)
    result = call("run", start, "--t-final", "0.1", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "with the velocities that the deck gives" in result.output
    rows = np.genfromtxt(tmp_path / "out/joints.csv", delimiter=",", names=True)
    assert rows["Hangle"][0] == pytest.approx(angle_at_rest(2.0), abs=1e-12)
    assert rows["HangleRate"][0] == pytest.approx(0.5, rel=1e-12)


def test_a_run_is_resumed_from_the_equilibrium_at_which_it_began(start, tmp_path, monkeypatch):
    assert call("run", start, "-o", tmp_path / "complete").exit_code == 0
    result = interrupted(monkeypatch, tmp_path / "parts", start)
    assert "resume it with" in result.output
    # Another search might end elsewhere in the last digits.
    monkeypatch.setattr(
        "msahl.analysis.equilibria.begin.find", lambda *_: pytest.fail("searched again")
    )
    result = call("run", start, "-o", tmp_path / "parts", "--resume")
    assert result.exit_code == 0, result.output
    assert tables(tmp_path / "complete") == tables(tmp_path / "parts")


@pytest.mark.slow
def test_every_point_of_a_sweep_finds_its_own_equilibrium(start, tmp_path):
    result = call("sweep", start, "--set", "m=1,2,3", "--measure", "H.angle initial",
                  "--keep", "tables", "-o", tmp_path / "out")  # fmt: skip
    assert result.exit_code == 0, result.output
    rows = np.genfromtxt(tmp_path / "out/runs.csv", delimiter=",", names=True, dtype=None)
    expected = [angle_at_rest(mass) for mass in (1.0, 2.0, 3.0)]
    assert list(rows["Hangle_initial"]) == pytest.approx(expected, rel=1e-12)


def test_the_python_api_starts_at_equilibria_too(start):
    found = list(msahl.batch(msahl.load(start), [{"m": 1.0}, {"m": 3.0}], jobs=1))
    angles = [result.frame("joints")["H.angle"].iloc[0] for result in found]
    assert angles == pytest.approx([angle_at_rest(1.0), angle_at_rest(3.0)], rel=1e-12)


def test_a_start_without_equilibrium_is_a_fault(start, tmp_path, monkeypatch):
    monkeypatch.setattr("msahl.analysis.equilibria.begin.find", lambda *_: None)
    for command in (("run", start, "-o", tmp_path / "out"), ("check", start), ("explain", start)):
        result = call(*command)
        assert result.exit_code == 2
        assert "no equilibrium was found" in result.output


def test_a_motion_that_moves_at_the_start_is_held_with_a_warning():
    result = call("equilibrium", DECKS / "mechanisms/four_bar.xml")
    assert result.exit_code == 0
    assert "WARN: motion 'Motor' is held where it begins, but moves at t = 0" in result.output


@pytest.mark.slow
def test_equilibria_in_python(start):
    model = msahl.load(start)
    rest = model.equilibrium()
    assert rest["H.angle"] == pytest.approx(angle_at_rest(2.0), rel=1e-12)
    assert rest.stability == "stable, all motions are damped"
    assert rest["S.load"] == rest.frame("loads")["S.load"].iloc[0]
    with pytest.raises(KeyError, match="no table has a column"):
        rest["H.angel"]
    found = model.equilibria(starts=4)
    assert found[0]["H.angle"] == pytest.approx(rest["H.angle"], rel=1e-12)
    later = rest.model.with_(**{"A.mass": 3.0}).run(t_final=0.5)
    assert abs(later["H.angleRate"]).max() > 0.01
    assert rest.model.modes().frequency == pytest.approx(model.modes().frequency, rel=1e-9)


@pytest.mark.slow
def test_a_path_under_growing_loads(tmp_path):
    deck = str(ROOT / "decks" / "mechanisms" / "snap_through.xml")
    result = call("equilibrium", deck, "--load-path", "1", "-o", tmp_path)
    assert result.output.count("limit point") == 2
    path = np.genfromtxt(tmp_path / "path.csv", delimiter=",", names=True)
    limits = path["loadFactor"][path["critical"] == 1.0]
    # 2 k z (l0/l - 1) where l^3 = l0, over 30 N; they are found to 1e-10 of the path.
    assert np.allclose(limits, (0.331663898591, -0.331663898591), rtol=1e-9)
    states = np.genfromtxt(tmp_path / "states.csv", delimiter=",", names=True, deletechars="")
    assert states["point"][-1] == len(path)
    assert states["Block.z"][-1] == pytest.approx(-0.416014680898, abs=1e-10)


def test_equilibria_of_beams_load_neither_scipy_nor_pandas():
    """They take longer to import than the search."""
    deck = str(DECKS / "elastic/bend45.xml")
    code = (
        "import sys; from msahl.cli.main import main;"
        f"main(['equilibrium', {deck!r}, '-q'], standalone_mode=False);"
        "print(*{'scipy', 'pandas', 'matplotlib'} & set(sys.modules))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == []


def test_few_elements_have_a_large_error_in_space():
    deck = DECKS / "elastic/bend45.xml"
    few = call("equilibrium", deck, "--set", "Bend.elements=1")
    assert few.exit_code == 0, few.output
    assert "WARN: the elements of the beams are too few: the error in space is" in few.output
    enough = call("equilibrium", deck)
    # The tip's own error is 3.8e-8 m.
    assert "error in space: 4.0e-08 m, by an equilibrium with twice the elements" in enough.output
    assert "WARN" not in enough.output


def test_energy_of_a_group_contains_that_of_springs(start, tmp_path):
    group = "<groups><group><name>All</name></group></groups>\n<loads>"
    start.write_text(START.replace("<loads>", group))
    result = call("equilibrium", start, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    row = np.genfromtxt(tmp_path / "out/system.csv", delimiter=",", names=True)
    a = angle_at_rest(2.0)
    energy = -2.0 * 9.81 * 0.5 * np.cos(a) + 5.0 * (np.pi / 6 - a) ** 2
    # The search ends at residuals of machine epsilons of the weight.
    assert float(row["Allpotential"]) == pytest.approx(energy, rel=1e-12)
