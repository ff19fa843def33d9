"""--set changes parameters and numbers by their paths; what is wrong names the nearest ones."""

import pytest

from msahl.deck import DeckError, read_deck
from tests.deck.test_parameters import PARAMETERS, deck
from tests.support.effective import effective_deck
from tests.support.models import ROOT

REVOLUTE = ROOT / "decks" / "joints" / "revolute.xml"


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "deck.xml"
    path.write_text(deck(mass="{m}", x="{L/2}", phi="{a}"))
    return path


@pytest.mark.parametrize(
    ("setting", "of", "value"),
    [
        ("L=1 m", lambda m: m.bodies[0].position[0], 0.5),
        ("L=90", lambda m: m.bodies[0].position[0], 0.45),
        (" L = 9e1 cm ", lambda m: m.bodies[0].position[0], 0.45),
        ("L={2*r}", lambda m: m.bodies[0].position[0], 0.01),
        ("m=3", lambda m: m.bodies[0].mass, 3.0),
        ("m=3 g", lambda m: m.bodies[0].mass, 0.003),
        ("Rod.mass=3", lambda m: m.bodies[0].mass, 3.0),
        ("Rod.mass=3 g", lambda m: m.bodies[0].mass, 0.003),
        ("Rod.position.x=-2 in", lambda m: m.bodies[0].position[0], -0.0508),
        ("Rod.x=7", lambda m: m.bodies[0].position[0], 7.0),
        ("Rod.initialConditions.position.x={L}", lambda m: m.bodies[0].position[0], 0.8),
        ("simulation.deltaT=20 ms", lambda m: m.simulation.dt, 0.02),
        ("deltaT=.1", lambda m: m.simulation.dt, 0.1),
        ("simulation.damping=0.25", lambda m: m.simulation.damping, 0.25),
    ],
)
def test_numbers_are_changed(path, setting, of, value):
    assert of(read_deck(path, settings=[setting])) == value
    path.write_bytes(effective_deck(path, settings=[setting]))
    assert of(read_deck(path)) == value


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("Rod.mas=3", "the deck has no such number; did you mean Rod.mass"),
        ("Rodd.mass=3", "did you mean Rod.mass"),
        ("Length=3", "no element or parameter 'Length'; known here: L, r"),
        ("rh=3", "did you mean rho"),
        ("L", "write NAME=VALUE"),
        ("L=", "write NAME=VALUE"),
        ("=3", "write NAME=VALUE"),
        ("L=nan", "write NAME=VALUE"),
        ("L=3 kg", "'kg' does not fit; the parameter is given in cm"),
        ("m=3 cm", "'cm' does not fit; the parameter is given in kg"),
        ("L=3 mmm", "unknown unit 'mmm'; did you mean mm"),
        ("Rod.mass=3 m", "'m' is no unit of it; expected one of kg, g, slug, lbm"),
        ("Rod.u2=3 m", "it is a plain number; omit the unit"),
        ("simulation.damping=3 m", "it is a plain number; omit the unit"),
        ("Rod.name=3", "the deck has no such number"),
        ("Rod.__class__=3", "the deck has no such number"),
        ("Rod.mass']=3", "the deck has no such number"),
    ],
)
def test_wrong_settings(path, setting, message):
    with pytest.raises(DeckError) as error:
        read_deck(path, settings=[setting])
    assert str(error.value).startswith(f"{path}: --set {setting}: ")
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("setting", "place", "message"),
    [
        ("L={q}", "parameter 'L'", "unknown name 'q'"),
        ("L=1e400", "parameter 'L'", "1e400 is too large"),
        ("Rod.mass=-1", "body 'Rod', mass", "mass"),
        ("simulation.damping={2*n}", "simulation", "it goes from 0 to 1"),
    ],
)
def test_faults_of_what_a_setting_changed_name_the_option(path, setting, place, message):
    with pytest.raises(DeckError) as error:
        read_deck(path, settings=[setting])
    (fault,) = error.value.faults
    assert str(fault).startswith(f"{path}: --set {setting}: {place}: ")
    assert message in str(fault)


def test_all_wrong_settings_are_given_at_once(path):
    with pytest.raises(DeckError) as error:
        read_deck(path, settings=["x", "Rod.mas=1", "L={m}"])
    assert len(error.value.faults) == 3


def test_a_setting_may_repair_a_deck(tmp_path):
    path = tmp_path / "deck.xml"
    path.write_text(deck(mass="-1"))
    assert read_deck(path, settings=["Rod.mass=1"]).bodies[0].mass == 1.0


def test_numbers_of_a_deck_without_parameters(tmp_path):
    model = read_deck(REVOLUTE, settings=["simulation.deltaT=0.02"])
    assert model.simulation.dt == 0.02
    path = tmp_path / "deck.xml"
    path.write_bytes(effective_deck(REVOLUTE, settings=["simulation.deltaT=0.02"]))
    assert read_deck(path) == model


def test_an_ambiguous_path_lists_what_it_may_mean(tmp_path):
    path = tmp_path / "deck.xml"
    ends = "<parent><name>Base</name><position><z>1</z></position></parent>"
    ends += "<child><name>Rod</name><position><z>1</z></position></child>"
    joint = f"<joints><spherical><name>J.1</name>{ends}</spherical></joints></system>"
    path.write_text(deck(parameters=PARAMETERS).replace("</system>", joint))
    with pytest.raises(DeckError, match=r"2 such numbers: J.1.parent.position.z, J.1.child"):
        read_deck(path, settings=["J.1.position.z=3"])
    joint = read_deck(path, settings=["J.1.child.z=1.0", "J.1.parent.z=1"]).joints[0]
    assert joint.child_point == (0.0, 0.0, 1.0)
