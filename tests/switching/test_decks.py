"""Events of decks: what is read, written and refused, and what a run leaves."""

import csv
import json

import numpy as np
import pytest
from click.testing import CliRunner

import msahl
from msahl.check import check
from msahl.cli.main import main
from msahl.deck import DeckError, read_deck
from msahl.deck.write_model import write_deck
from tests.support.models import ROOT, deck

PATH = ROOT / "decks" / "contact" / "trebuchet.xml"
TEXT = PATH.read_text()
G = 9.80665


def message_of(tmp_path, old, new):
    """Messages about the deck in which ``old`` is replaced by ``new``."""
    assert old in TEXT
    path = tmp_path / "deck.xml"
    path.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(DeckError) as error:
        read_deck(path)
    return str(error.value)


def test_records_are_those_of_the_deck():
    fire, let_go = deck("trebuchet").events
    assert (fire.condition, fire.releases) == ("t >= 0.2", ("Trigger",))
    assert (let_go.releases, let_go.engages) == (("Sling", "Trough"), ())
    assert let_go.message == "the stone flies"
    assert not let_go.repeats
    assert check(deck("trebuchet")) == []


def test_a_written_deck_is_read_to_equal_records(tmp_path):
    text = TEXT.replace("</events>", "<released>Trough</released></events>")
    text = text.replace('<event name="Fire"', '<event repeats="true" name="Fire"')
    (tmp_path / "given.xml").write_text(text)
    model = read_deck(tmp_path / "given.xml")
    assert model.released == ("Trough",)
    assert model.events[0].repeats
    (tmp_path / "written.xml").write_bytes(write_deck(model))
    read = read_deck(tmp_path / "written.xml")
    assert (read.events, read.released) == (model.events, model.released)


FAULTS = {
    "unknown element": (
        "<release>Trigger</release>",
        "<release>Triger</release>",
        "event 'Fire'",
        "'Triger' is no joint, coupling, motion or rigid contact of this model; did you mean",
    ),
    "unknown name": ("t &gt;= 0.2", "x &gt;= 0.2", "event 'Fire'", "unknown name 'x'"),
    "no condition": ("t &gt;= 0.2", "t", "event 'Fire'", "this is no condition"),
    "an equation": ("t &gt;= 0.2", "t == 0.2", "event 'Fire'", "true at single times only"),
    "both": (
        "<release>Trigger</release>",
        "<release>Trigger</release><engage>Trigger</engage>",
        "event 'Fire'",
        "it releases and engages 'Trigger'",
    ),
    "nothing": ("<release>Trigger</release>", "<message/>", "event 'Fire'", "nothing happens"),
    "a comma": (">the stone flies<", ">it flies, far<", "event 'LetGo'", "must not contain ,"),
    "name taken": ('name="Fire"', 'name="Sling"', "event 'Sling'", "the name is taken by"),
    "released": (
        "<events>",
        "<events><released>Slink</released>",
        "released 'Slink'",
        "'Slink' is no joint, coupling, motion or rigid contact",
    ),
}


@pytest.mark.parametrize("case", FAULTS)
def test_faults_have_line_and_remedy(tmp_path, case):
    old, new, where, words = FAULTS[case]
    message = message_of(tmp_path, old, new)
    assert message.startswith(str(tmp_path / "deck.xml:"))
    assert where in message
    assert words in message


def test_a_model_has_the_same_faults():
    from dataclasses import replace

    model = deck("trebuchet")
    event = replace(model.events[0], releases=("Triger",))
    (fault,) = check(replace(model, events=(event,), stops=()))
    assert str(fault).startswith("event 'Fire', release: release 'Triger' is no joint")


def test_a_released_joint_need_not_fit(tmp_path):
    """Nor is it assembled."""
    away = ('<position basis="Earth"><x>{stone}</x>', '<position basis="Earth"><x>1</x>')
    length = "<child><name>Stone</name></child>\n      </distance>"
    with_length = length.replace("</distance>", "<length>{sling}</length></distance>")
    text = TEXT.replace(*away).replace(length, with_length)
    path = tmp_path / "deck.xml"
    path.write_text(text)
    with pytest.raises(DeckError, match="Sling"):
        read_deck(path)
    path.write_text(text.replace("<events>", "<events><released>Sling</released>"))
    assert read_deck(path).released == ("Sling",)


def test_the_trebuchet_throws_its_stone(tmp_path):
    """By the parabola from where the sling lets go; the trough bears the stone at first."""
    folder = tmp_path / "run"
    done = CliRunner().invoke(main, ["run", str(PATH), "-o", str(folder)])
    assert done.exit_code == 0, done.output
    assert "s: the stone flies" in done.output
    rows = [*csv.reader((folder / "events.csv").read_text().splitlines())]
    kinds = ["closes", "releases", "opens", "releases", "releases"]
    assert [row[1] for row in rows[1:]] == kinds
    assert [row[-2] for row in rows[1:]] == ["", "Fire", "", "LetGo", "LetGo"]
    info = json.loads((folder / "run.json").read_text())
    assert info["verdict"]["word"] == "PASS"
    assert info["events"]["happened"] == {"Fire": 1, "LetGo": 1}
    run = msahl.read(folder)
    assert list(run.events["event"]) == ["", "Fire", "", "LetGo", "LetGo"]
    states, t = run.states, float(rows[-1][0])
    assert run.reactions["Trough.load"].iloc[0] == pytest.approx(10.0 * G, abs=1e-9)
    after = states[states["time"] > t].iloc[0]
    x, z, v, w = (after[f"Stone.{name}"] for name in ("x", "z", "vx", "vz"))
    since = after["time"] - t
    assert v == pytest.approx(w + G * since, abs=1e-5)  # 45 degrees when it was let go
    landing = x + v * (w + np.sqrt(w * w + 2.0 * G * z)) / G
    assert states["Stone.x"].iloc[-1] == pytest.approx(landing, abs=1e-8)
    assert landing == pytest.approx(149.419, abs=1e-2)


@pytest.mark.parametrize("command", ["linearize", "kinematics"])
def test_analyses_refuse_events(tmp_path, command):
    text = TEXT[: TEXT.index("    <contacts>")] + TEXT[TEXT.index("    <markers>") :]
    (tmp_path / "deck.xml").write_text(text.replace("<release>Trough</release>", ""))
    done = CliRunner().invoke(main, [command, str(tmp_path / "deck.xml")])
    assert done.exit_code != 0
    assert "has events (Fire, LetGo)" in done.output


def test_explain_says_why_steps_are_in_absolute_coordinates(tmp_path):
    text = TEXT[: TEXT.index("    <contacts>")] + TEXT[TEXT.index("    <markers>") :]
    (tmp_path / "deck.xml").write_text(text.replace("<release>Trough</release>", ""))
    done = CliRunner().invoke(main, ["explain", str(tmp_path / "deck.xml")])
    assert "events release or engage its constraints" in done.output
    assert "event Fire: releases Trigger when t >= 0.2" in done.output


def test_elements_of_parts_have_their_prefix(tmp_path):
    system = TEXT[TEXT.index("  <system>") : TEXT.index("  <simulation")]
    system = system.replace(TEXT[TEXT.index("    <gravity>") : TEXT.index("    <bodies>")], "")
    parameters = TEXT[TEXT.index("  <parameters>") : TEXT.index("  <system>")]
    unit = "<unitSystem>SI</unitSystem>"
    (tmp_path / "part.xml").write_text(f"<part>{unit}{parameters}{system}</part>")
    include = '<includes><include href="part.xml" prefix="Old."/></includes>'
    run = TEXT[TEXT.index("  <simulation") :].replace("Pouch", "Old.Pouch")
    (tmp_path / "deck.xml").write_text(f"<data>{unit}{include}<system/>{run}")
    fire, let_go = read_deck(tmp_path / "deck.xml").events
    assert (fire.name, fire.releases) == ("Old.Fire", ("Old.Trigger",))
    assert "Old.Pouch.vx" in let_go.condition


def test_the_clutch_joins_its_flywheels(tmp_path):
    done = CliRunner().invoke(
        main, ["run", str(PATH.with_name("clutch.xml")), "-o", str(tmp_path / "run")]
    )
    assert done.exit_code == 0, done.output
    run = msahl.read(tmp_path / "run")
    (row,) = run.events.to_dict("records")
    assert (row["kind"], row["element"], row["event"]) == ("engages", "Clutch", "Shift")
    assert row["impulse"] == pytest.approx(0.12, abs=1e-12)
    assert row["energyLost"] == pytest.approx(0.6, abs=1e-12)
    assert run.work["Shift.work"].iloc[-1] == pytest.approx(-0.6, abs=1e-12)
    for body in ("Driver", "Driven"):
        assert run.states[f"{body}.wz"].iloc[-1] == pytest.approx(4.0, abs=1e-12)
