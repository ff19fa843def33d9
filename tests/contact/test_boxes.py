"""Boxes and capsules against planes: a contact for each corner or end."""

from dataclasses import replace

import pytest

from msahl.deck import read_deck
from tests.contact.models import run_events
from tests.contact.test_decks import DECKS, faults_of
from tests.support.models import deck

BOX = (DECKS / "falling_box.xml").read_text()
SIZE = "<box><x>0.4</x><y>0.2</y><z>0.2</z></box>\n        <st"
CAPSULE = "<capsuleEnd><x>0.2</x></capsuleEnd><radius>0.05</radius><st"


def read(tmp_path, *changes):
    """The model of the deck with each ``old`` replaced by its ``new``."""
    text = BOX
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "deck.xml"
    path.write_text(text)
    return read_deck(path)


def test_a_box_has_a_contact_at_each_corner(tmp_path):
    contacts = deck("falling_box").contacts
    assert [contact.name for contact in contacts] == [f"Floor.{k}" for k in range(1, 9)]
    corners = {contact.child_point for contact in contacts}
    assert corners == {(x, y, z) for x in (-0.2, 0.2) for y in (-0.1, 0.1) for z in (-0.1, 0.1)}
    flat = read(tmp_path, (SIZE, "<box><x>0.4</x><y>0.2</y></box>\n        <st"))
    assert len(flat.contacts) == 4  # of a plate, without thickness


def test_a_box_that_falls_flat_is_an_oscillator_while_it_touches():
    report, sink, _ = run_events(deck("falling_box"), "gauss3")
    states, loads = sink.table("states"), sink.table("reactions")
    assert states[-1, [3, 9]] == pytest.approx([0.589807632327585, -0.447184809371690], abs=1e-10)
    lower = loads[:, 1:9:2]  # z is the last of a corner's coordinates
    assert loads[:, 2:9:2].max() == 0.0
    assert lower.max() == pytest.approx(159.0763, rel=2e-3)  # at the output times of 1 ms
    assert abs(lower - lower[:, :1]).max() < 1e-6
    assert report.extremes["energyErrorMax"] < 1e-12


@pytest.mark.parametrize("restitution", [0.0, 0.7])
def test_a_capsule_that_meets_the_floor_at_an_angle(restitution):
    """L = (1 + e) v m/(1 + m c^2/J): c is the end's distance from the vertical through the mass
    centre."""
    model = deck("falling_capsule")
    assert [contact.child_point for contact in model.contacts] == [(-0.2, 0, 0), (0.2, 0, 0)]
    contacts = tuple(replace(contact, restitution=restitution) for contact in model.contacts)
    _, sink, events = run_events(replace(model, contacts=contacts), "gauss2", 0.005, 0.33)
    arm, J, speed = 0.2 * 0.75**0.5, 1.0 / 60.0, (2.0 * 9.81 * 0.45) ** 0.5
    assert events[0][0] == pytest.approx(speed / 9.81, abs=1e-12)
    assert events[0][2] == "Floor.1"
    assert events[0][3:5] == pytest.approx((-speed, restitution * speed), abs=1e-12)
    impulse = (1.0 + restitution) * speed / (1.0 + arm**2 / J)
    assert events[0][5] == pytest.approx(impulse, rel=1e-12)
    if restitution > 0.0:  # nothing rotates it on until it touches again
        assert sink.table("states")[-1, 11] == pytest.approx(impulse * arm / J, rel=1e-12)


FAULTS = {
    "both": (SIZE, f"{SIZE[:-3]}{CAPSULE}", "delete one of them"),
    "negative": (
        "<box><x>0.4</x><y>0.2</y><z>0.2</z></box>\n        <st",
        "<box><x>-1</x></box><st",
        "x is -1 m",
    ),
    "overlap": ("<z>0.6</z>", "<z>0.09</z>", "0.01 m below the plane"),
}


@pytest.mark.parametrize("case", ["both", "negative"])
def test_faults(tmp_path, case):
    old, new, words = FAULTS[case]
    assert words in faults_of(tmp_path, BOX, old, new)


def test_a_rigid_box_in_the_floor_is_a_fault(tmp_path):
    rigid = BOX.replace('<stiffness units="N/m">1e4</stiffness>', "")
    assert FAULTS["overlap"][2] in faults_of(tmp_path, rigid, *FAULTS["overlap"][:2])


def test_names_of_parts_are_those_of_no_other_contact(tmp_path):
    second = (
        "<contacts><planeContact><name>Floor.3</name>"
        "<parent><name>Earth</name><normal><z>1</z></normal></parent>"
        "<child><name>Box</name></child></planeContact>"
    )
    assert "'Floor.3' has the name" in faults_of(tmp_path, BOX, "<contacts>", second)
