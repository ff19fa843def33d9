"""Sets of spheres and planes: a contact for each pair of different bodies."""

import numpy as np
import pytest

from msahl.algebra.rotation import matrix
from msahl.deck import DeckError, read_deck
from msahl.model import BoxContact, CapsuleContact, PlaneContact, SphereContact
from tests.contact.models import run_events
from tests.support.models import ROOT, deck

BREAK = (ROOT / "decks" / "contact" / "billiard_break.xml").read_text()
BALL = '        <sphere><name>Ball1</name><radius units="mm">28.6</radius></sphere>\n'
FLOOR = "        <plane><name>Table</name><normal><z>1</z></normal></plane>\n"


def read(tmp_path, text):
    path = tmp_path / "deck.xml"
    path.write_text(text)
    return read_deck(path)


def test_every_pair_has_a_contact_and_its_own_name():
    contacts = deck("billiard_break").contacts
    assert len(contacts) == 120
    assert len({contact.name for contact in contacts}) == 120
    assert contacts[0].name == "Balls.Cue.Ball1"
    assert {type(contact) for contact in contacts} == {SphereContact}
    assert {contact.restitution for contact in contacts} == {0.95}


def test_planes_and_second_spheres_of_a_body(tmp_path):
    second = BALL.replace("<radius", "<position><z>0.1</z></position><radius")
    low = FLOOR.replace("<normal", "<position><z>-1</z></position><normal")
    contacts = read(tmp_path, BREAK.replace(BALL, BALL + second + low, 1)).contacts
    names = [contact.name for contact in contacts]
    assert "Balls.Ball1.1.Ball2" in names
    assert "Balls.Ball1.2.Ball2" in names
    assert "Balls.Ball1.1.Ball1.2" not in names
    planes = [contact for contact in contacts if isinstance(contact, PlaneContact)]
    assert len(planes) == 17
    assert {plane.parent for plane in planes} == {"Table"}
    assert len(contacts) == 120 + 15 + 17


def test_capsules_touch_spheres_planes_and_each_other(tmp_path):
    rods = "".join(
        f"        <capsule><name>Ball{k}</name><position><z>{2 * k}</z></position>"
        "<axis><x>2</x></axis>"
        '<radius units="m">0.1</radius><length units="m">0.8</length></capsule>\n'
        for k in (1, 2)
    )
    low = FLOOR.replace("<normal", "<position><z>-1</z></position><normal")
    start, end = BREAK.index(BALL), BREAK.index("        <restitution>")
    text = BREAK[:start] + BALL.replace("Ball1", "Ball3") + rods + low + BREAK[end:]
    found = {one.name: one for one in read(tmp_path, text).contacts}
    kinds = {name: type(one) for name, one in found.items()}
    assert kinds == {
        "Balls.Cue.Ball3": SphereContact,
        "Balls.Ball1.Cue": BoxContact,
        "Balls.Ball2.Cue": BoxContact,
        "Balls.Ball1.Ball3": BoxContact,
        "Balls.Ball2.Ball3": BoxContact,
        "Balls.Ball1.Ball2": CapsuleContact,
        "Balls.Table.Cue": PlaneContact,
        "Balls.Table.Ball3": PlaneContact,
        **{f"Balls.Table.Ball{k}.{end}": PlaneContact for k in (1, 2) for end in (1, 2)},
    }
    ends = [found[f"Balls.Table.Ball2.{k}"].child_point for k in (1, 2)]
    assert ends == [(-0.4, 0.0, 4.0), (0.4, 0.0, 4.0)]
    pair = found["Balls.Ball1.Ball2"]
    assert (pair.parent_half, pair.radius, pair.axis) == (0.4, 0.1, (1.0, 0.0, 0.0))


FAULTS = {
    "no radius": ("28.6</radius></sphere>\n        <sphere><name>Ball2", "radius: it is 0 m"),
    "nothing": (None, "no <sphere> in it has a radius"),
    "capsule": (
        BALL,
        "length: it is 0 m; it must be greater than zero",
    ),
    "overlap": ("<x>-0.600000</x>", "Balls.Cue.Ball1: it overlaps by"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_name_the_place(tmp_path, name):
    old, message = FAULTS[name]
    if old is None:
        start, end = BREAK.index("        <sphere><name>Cue"), BREAK.index("        <restitution>")
        text = BREAK[:start] + BREAK[end:]
    else:
        new = "<x>-0.050000</x>" if old.startswith("<x>") else old.replace("28.6", "0")
        if name == "capsule":
            new = old.replace("sphere>", "capsule>").replace(
                "<radius", "<axis><x>1</x></axis><radius"
            )
            new = new.replace("</capsule>", "<length>0</length></capsule>")
        assert old in BREAK
        text = BREAK.replace(old, new, 1)
    with pytest.raises(DeckError, match=message):
        read(tmp_path, text)


def test_a_break_keeps_momentum_and_angular_momentum():
    model = deck("billiard_break")
    report, sink, events = run_events(model, "gauss2")
    assert sum(event[1] == "impact" for event in events) > 15
    states = sink.table("states")[-1, 1:].reshape(16, 12)
    v = np.array([matrix(tuple(row[3:6])) @ np.array(row[6:9]) for row in states])
    assert 0.17 * v.sum(axis=0) == pytest.approx([0.85, 0.0, 0.0], abs=1e-14)
    moment = 0.17 * np.cross(states[:, :3], v).sum(axis=0)
    assert moment == pytest.approx([0.0, 0.0, -0.0034], abs=1e-14)
    assert report.extremes["energyErrorMax"] < 1e-13


def test_a_ball_bounces_down_a_step():
    report, sink, events = run_events(deck("steps"), "gauss2")
    impacts = [(event[0], event[2]) for event in events if event[1] == "impact"]
    assert [name for _, name in impacts] == ["Block", "Set.Floor.Ball"]
    # Parabolas are exact, and so are their ends but for round-off of the positions.
    wanted = [0.319275428407051, 0.957826285221151]
    assert [t for t, _ in impacts] == pytest.approx(wanted, abs=1e-13)
    states = sink.table("states")[-1]
    assert states[[1, 2, 3]] == pytest.approx([1.2, 0.0, 0.267437235548073], abs=1e-12)
    assert states[[13, 14, 15]] == pytest.approx([2.0, 0.0, 0.1], abs=1e-14)
    assert report.contacts["closed"] == ["Set.Floor.Other"]
