"""Contacts of decks: what is read, written and refused, and what a run leaves."""

import csv
import json
from dataclasses import replace

import pytest
from click.testing import CliRunner

import msahl
from msahl.check import check
from msahl.cli.main import main
from msahl.deck import DeckError, read_deck
from msahl.deck.write_model import write_deck
from msahl.model import DistanceLimit, JointLimit, PlaneContact
from tests.support.models import ROOT, deck

DECKS = ROOT / "decks" / "contact"
RODS = (DECKS / "crossed_rods.xml").read_text()
BALL = (DECKS / "bouncing_ball.xml").read_text()
ROPE = (DECKS / "slack_rope.xml").read_text()
BILLIARD = (DECKS / "billiard.xml").read_text()
TROUGH = (DECKS / "trough.xml").read_text()
WALL = (DECKS / "pendulum_at_a_wall.xml").read_text()
SPHERE = (DECKS / "sliding_sphere.xml").read_text()


def faults_of(tmp_path, text, old, new):
    """Messages about a deck in which ``old`` is replaced by ``new``."""
    assert old in text
    path = tmp_path / "deck.xml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(DeckError) as error:
        read_deck(path)
    return str(error.value)


def test_records_are_those_of_the_deck():
    ground, zero = "Earth", (0.0, 0.0, 0.0)
    assert deck("bouncing_ball").contacts == (
        PlaneContact("Floor", ground, "Ball", zero, zero, (0.0, 0.0, 1.0), 0.1, 0.8),
    )
    assert deck("slack_rope").contacts == (
        DistanceLimit("Rope", ground, "Bob", zero, zero, None, 1.0),
    )
    (wall,) = deck("pendulum_at_a_wall").contacts
    assert isinstance(wall, JointLimit)
    assert wall.lower == pytest.approx(-0.5235987755982988, abs=1e-16)


@pytest.mark.parametrize(
    "name",
    [
        "bouncing_ball",
        "slack_rope",
        "pendulum_at_a_wall",
        "buffers",
        "billiard",
        "trough",
        "sliding_sphere",
        "box_on_slope",
        "golf_hole",
        "turntable",
        "spinning_ball",
        "ball_on_a_plank",
        "crossed_rods",
        "bump_stop",
    ],
)
def test_a_written_deck_is_read_to_equal_records(tmp_path, name):
    model = deck(name)
    model = replace(model, simulation=replace(model.simulation, impact_law="newton"))
    path = tmp_path / "written.xml"
    path.write_bytes(write_deck(model))
    read = read_deck(path)
    assert read.contacts == model.contacts
    assert read.simulation == model.simulation
    assert check(model) == []


STOP = (DECKS / "bump_stop.xml").read_text()
SOFT = "<stiffness>1e4</stiffness>"
FAULTS = {
    "spheres overlap": (BILLIARD, "<x>-0.4</x>", "<x>-0.04</x>", "overlaps by 0.01 m"),
    "no radius": (BILLIARD, '"mm">30</parentRadius>', '"mm">0</parentRadius>', "it is zero"),
    "too large for a hollow one": (
        TROUGH,
        '<parentRadius units="m">-1<',
        "<parentRadius>-0.1<",
        "give less",
    ),
    "outside of a hollow one": (TROUGH, "<z>-0.45</z>", "<z>-0.55</z>", "overlaps by 0.05"),
    "on the axis": (TROUGH, "<x>{0.9*sin(60*pi/180)}</x><z>-0.45</z>", "<y>3</y>", "coincide"),
    "no axis": (TROUGH, "<axis><y>1</y></axis>", "<axis><y>0</y></axis>", "axis is zero"),
    "angle of a slide": (
        STOP,
        '<length units="mm">0</length>',
        "<angle>0</angle>",
        "its entries have <length> and <force>",
    ),
    "stiffness beside a table": (STOP, "<table>", f"{SOFT}<table>", "already; delete <stiffness>"),
    "a table that pulls": (STOP, ">100</force>", ">-100</force>", "falls with the depth"),
    "capsule without a length": (
        RODS,
        '<length units="m">0.8</length>',
        "<length>0</length>",
        "a capsule without length is a sphere",
    ),
    "capsules that overlap": (RODS, "<z>0.6</z>", "<z>0.09</z>", "it overlaps by 0.01 m"),
    "no stiffness": (BALL, "<rest", "<exponent>1.5</exponent><rest", "add a <stiffness>"),
    "no speed of a rigid one": (BALL, "<rest", "<impactSpeed>1</impactSpeed><rest", "compliant"),
    "restitution without its speed": (BALL, "<rest", f"{SOFT}<rest", "add <impactSpeed>"),
    "no rebound": (
        BALL,
        "<restitution>0.8",
        f"{SOFT}<impactSpeed>1</impactSpeed><restitution>0.01",
        "delete <stiffness>",
    ),
    "no speed": (BALL, "<rest", f"{SOFT}<impactSpeed>0</impactSpeed><rest", "greater than zero"),
    "soft": (BALL, "<rest", "<stiffness>0</stiffness><rest", "greater than zero"),
    "exponent": (BALL, "<rest", f"{SOFT}<exponent>0.5</exponent><rest", "1.5 (Hertz)"),
    "unit by exponent": (
        BALL,
        "<rest",
        '<stiffness units="N/mm">9</stiffness><exponent>1.5</exponent><rest',
        "N/m^1.5; delete units",
    ),
    "exponent of another world": (
        BALL.replace("<unitSystem>SI<", "<unitSystem>US<"),
        "<rest",
        "<stiffness>9</stiffness><exponent>1e90</exponent><rest",
        "1.5 (Hertz)",
    ),
    "unit of an angle": (WALL, "<rest", '<stiffness units="N/mm">9</stiffness><rest', "N-m/rad"),
    "friction": (
        SPHERE,
        "<friction>0.2</friction>",
        "<friction>-0.2</friction>",
        "friction: it is -0.2; it must not be less than zero",
    ),
    "static friction": (
        SPHERE,
        "<friction>0.2</friction>",
        "<friction>0.2</friction><staticFriction>0.1</staticFriction>",
        "staticFriction: it is 0.1, and friction 0.2; it must not be less than friction",
    ),
    "friction of a compliant one": (
        SPHERE,
        "<friction>0.2</friction>",
        "<stiffness>1e5</stiffness><friction>0.2</friction>",
        "friction: a compliant contact creeps where a rigid one sticks; add <frictionWidth>",
    ),
    "width of the friction of a rigid one": (
        SPHERE,
        "<friction>0.2</friction>",
        "<friction>0.2</friction><frictionWidth>0.01</frictionWidth>",
        "<frictionWidth> is that of a compliant contact",
    ),
    "width without friction": (
        SPHERE,
        "<friction>0.2</friction>",
        "<stiffness>1e5</stiffness><frictionWidth>0.01</frictionWidth>",
        "frictionWidth: it is that of friction; add <friction>",
    ),
    "width of zero": (
        SPHERE,
        "<friction>0.2</friction>",
        "<stiffness>1e5</stiffness><friction>0.2</friction><frictionWidth>0</frictionWidth>",
        "frictionWidth: it is 0; it must be greater than zero",
    ),
    "static friction of a compliant one": (
        SPHERE,
        "<friction>0.2</friction>",
        "<stiffness>1e5</stiffness><friction>0.2</friction><frictionWidth>0.01</frictionWidth>"
        "<staticFriction>0.3</staticFriction>",
        "staticFriction: a compliant contact creeps instead of sticking",
    ),
    "friction of a ball that is less than nothing": (
        BILLIARD,
        "<restitution>1</restitution>",
        "<restitution>1</restitution><friction>-0.1</friction>",
        "friction: it is -0.1; it must not be less than zero",
    ),
    "overlap": (BALL, "<z>1.1</z>", "<z>0.05</z>", "0.05 m below the plane at t = 0"),
    "too long": (
        ROPE,
        '<upper units="m">1</upper>',
        "<upper>0.75</upper>",
        "0.25 m above its upper",
    ),
    "no range": (ROPE, '<upper units="m">1</upper>', "", "neither <lower> nor <upper>"),
    "no distance": (ROPE, '<upper units="m">1</upper>', "<upper>-1</upper>", "greater than zero"),
    "empty range": (
        ROPE,
        '<upper units="m">1</upper>',
        "<lower>2</lower><upper>1</upper>",
        "lower must be less than upper",
    ),
    "restitution": (BALL, "0.8</restitution>", "1.5</restitution>", "restitution"),
    "negative radius": (
        BALL,
        '<radius units="m">0.1</radius>\n        <res',
        "<radius>-1</radius><res",
        "less than zero",
    ),
    "no normal": (BALL, "<normal><z>1</z></normal>", "<normal><z>0</z></normal>", "normal is zero"),
    "no body": (
        BALL,
        "<child><name>Ball</name></child>",
        "<child><name>Boll</name></child>",
        "Boll",
    ),
    "one body": (
        BALL,
        "<child><name>Ball</name></child>",
        "<child><name>Earth</name></child>",
        "both",
    ),
    "no joint": (WALL, "<joint>Pivot</joint>", "<joint>Pin</joint>", "'Pin' is not a joint"),
    "no slide": (
        WALL,
        "<coordinate>angle</coordinate>",
        "<coordinate>slide</coordinate>",
        "no coordinate slide",
    ),
    "name taken": (WALL, "<name>Wall</name>", "<name>Pivot</name>", "name is taken"),
    "unit": (WALL, '<lower units="deg">', '<lower units="kg">', "unknown unit"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_faults_have_line_and_remedy(tmp_path, case):
    text, old, new, words = FAULTS[case]
    message = faults_of(tmp_path, text, old, new)
    assert words in message
    assert message.startswith(str(tmp_path / "deck.xml:"))


def test_a_stiffness_is_that_of_the_unit_system(tmp_path):
    """1 lbf/ft^1.5 and 1 lbf-ft/rad^1.5 in N and m."""
    path, given = tmp_path / "us.xml", "<stiffness>2</stiffness><exponent>1.5</exponent>"
    for text, wanted in (
        (BALL, 2.0 * 4.4482216152605 / 0.3048**1.5),
        (WALL, 2.0 * 4.4482216152605 * 0.3048),
    ):
        text = text.replace("<unitSystem>SI<", "<unitSystem>US<")
        path.write_text(text.replace("<restitution>0.8</restitution>", given))
        (contact,) = read_deck(path).contacts
        assert contact.compliance.stiffness == pytest.approx(wanted, rel=1e-15)
        assert (contact.compliance.exponent, contact.restitution) == (1.5, 1.0)


def test_a_run_leaves_its_events(tmp_path):
    folder = tmp_path / "run"
    done = CliRunner().invoke(main, ["run", str(DECKS / "bouncing_ball.xml"), "-o", str(folder)])
    assert done.exit_code == 0, done.output
    rows = [*csv.reader((folder / "events.csv").read_text().splitlines())]
    assert rows[0][:3] == ["time", "kind", "element"]
    assert rows[1][1:3] == ["impact", "Floor"]
    info = json.loads((folder / "run.json").read_text())
    assert info["contacts"]["impacts"] == sum(row[1] == "impact" for row in rows)
    assert info["verdict"]["word"] == "PASS"
    read = msahl.read(folder)
    assert list(read.events["kind"]) == [row[1] for row in rows[1:]]
    assert read.events["time"].tolist() == [float(row[0]) for row in rows[1:]]


def test_python_results_have_events(tmp_path):
    result = msahl.load(DECKS / "bouncing_ball.xml").run(t_final=1.0)
    assert list(result.events["kind"]) == ["impact"]
    assert result.write(tmp_path / "out").joinpath("events.csv").is_file()
    assert len(msahl.load(DECKS / "bouncing_ball.xml").run(t_final=0.1).events) == 0


@pytest.mark.parametrize("command", ["kinematics", "linearize"])
def test_analyses_refuse_contacts(tmp_path, command):
    done = CliRunner().invoke(main, [command, str(DECKS / "bouncing_ball.xml")])
    assert done.exit_code != 0
    assert "has rigid contacts (Floor)" in done.output


def test_explain_says_why_steps_are_in_absolute_coordinates():
    done = CliRunner().invoke(main, ["explain", str(DECKS / "pendulum_at_a_wall.xml")])
    assert "contacts open and close" in done.output
