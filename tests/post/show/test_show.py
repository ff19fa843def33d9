"""The page of a deck: what it contains, of good decks and of faulty ones, and in a browser."""

import json
import re
from pathlib import Path
from xml.sax.saxutils import escape

import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.post.show.deck_page import FAULTY, show_deck
from msahl.post.show.lines import element_lines, files_of
from tests.post.web.test_web import PAYLOADS
from tests.support.browser import next_picture, wait_until
from tests.support.models import DECKS, ROOT

ENGINE = ROOT / "decks" / "machines" / "engine.xml"
CAR = ROOT / "decks" / "mechanisms" / "suspension.xml"

FAULTY_DECK = """<data>
  <system>
    <bodies>
      <ground><name>Base</name></ground>
      <rigidBody>
        <name>Crank</name>
        <mass>-1</mass>
        <rGB><x>0.2</x></rGB>
        <moi><Ixx>0.01</Ixx><Iyy>0.1</Iyy><Izz>0.1</Izz></moi>
      </rigidBody>
      <rigidBody>
        <name>Rod</name>
        <masss>1</masss>
        <moi><Ixx>0.01</Ixx><Iyy>0.1</Iyy><Izz>0.1</Izz></moi>
      </rigidBody>
    </bodies>
    <joints>
      <revolute>
        <name>Pin</name>
        <parent><name>Base</name><axis><z>1</z></axis></parent>
        <child><name>Crank</name></child>
      </revolute>
      <revolute>
        <name>Elbow</name>
        <parent><name>Crank</name><position><x>0.4</x></position><axis><z>1</z></axis></parent>
        <child><name>Rod</name></child>
      </revolute>
    </joints>
    <loads>
      <torsionalSpringDamper><name>Spring</name><joint>Elbow</joint><stiffness>1</stiffness>
      </torsionalSpringDamper>
    </loads>
  </system>
  <simulation><deltaT>0.01</deltaT><tFinal>1</tFinal></simulation>
</data>
"""


def data_of(html, key):
    """The data that a page holds under a key."""
    pattern = rf'<script type="application/json" id="{key}">(.*?)</script>'
    return json.loads(re.search(pattern, html, re.DOTALL)[1])


def scene_of(html):
    return data_of(html, "viewer")["runs"][0]["scene"]


@pytest.mark.parametrize("deck", DECKS[3::14], ids=lambda path: path.stem)
def test_elements_are_found_in_the_text(deck):
    page = show_deck(deck)
    assert page.faults == ()
    data = data_of(page.html, "deck")
    texts = [file["text"].split("\n") for file in data["files"]]
    model = read_deck(deck)
    named = {e["name"].rpartition(".")[2]: e for e in data["elements"]}
    bodies = [e["name"] for e in data["elements"] if e["kind"] == "rigidBody"]
    nodes = {name for beam in model.beams for name in beam.nodes}
    assert bodies == [body.name for body in model.bodies if body.name not in nodes]
    for name, element in named.items():
        lines = texts[element["file"]][element["from"] - 1 : element["to"]]
        assert f"<{element['kind']}" in lines[0]
        # Of an element without children the start tag is the end.
        assert f"</{element['kind']}>" in lines[-1] or "/>" in lines[-1]
        assert name in "\n".join(lines)


def test_a_deck_with_parts():
    page = show_deck(CAR)
    data = data_of(page.html, "deck")
    assert [file["name"] for file in data["files"]] == ["suspension.xml", "parts/corner.xml"]
    wheels = [e for e in data["elements"] if e["kind"] == "rigidBody" and e["file"] == 1]
    assert [wheel["name"] for wheel in wheels] == ["FL.Wheel", "FR.Wheel", "RL.Wheel", "RR.Wheel"]
    assert page.files == (CAR, CAR.parent / "parts" / "corner.xml")


def test_degrees_of_freedom_and_scene():
    html = show_deck(ENGINE).html
    facts = data_of(html, "deck")["facts"]
    assert "degrees of freedom: by count 18 - 20 = -2, by rank 18 - 17 = 1" in facts
    assert any(fact.startswith("Main bearing at t = 0: angle -30 deg") for fact in facts)
    assert [body["name"] for body in scene_of(html)["bodies"]] == ["Crank", "Rod", "Piston"]


@pytest.mark.slow
def test_a_deck_with_faults_shows_what_can_be_read(tmp_path):
    deck = tmp_path / "deck.xml"
    deck.write_text(FAULTY_DECK)
    page = show_deck(deck)
    data, scene = data_of(page.html, "deck"), scene_of(page.html)
    assert [(f["line"], f["file"]) for f in data["faults"]] == [(7, 0), (11, 0), (13, 0)]
    assert data["facts"] == []
    assert [body["name"] for body in scene["bodies"]] == ["Crank"]
    assert scene["bodies"][0]["colour"] == FAULTY
    assert [joint["name"] for joint in scene["joints"]] == ["Pin"]  # the other has lost its child
    assert scene["springs"] == []
    assert {e["name"] for e in data["elements"]} == {
        "Base",
        "Crank",
        "Rod",
        "Pin",
        "Elbow",
        "Spring",
    }


@pytest.mark.parametrize(
    "text",
    ["", "<data", "<part/>", "<data/>", "\0", "<!DOCTYPE data><data/>"],
    ids=["empty", "cut", "part", "bare", "byte", "doctype"],
)
def test_nothing_to_draw(tmp_path, text):
    deck = tmp_path / "deck.xml"
    deck.write_text(text)
    page = show_deck(deck)
    assert page.faults
    assert "Nothing of this deck can be drawn yet." in page.html
    assert data_of(page.html, "deck")["files"][0]["text"] == text


def test_a_start_without_solution_is_a_fault(tmp_path):
    deck = tmp_path / "deck.xml"
    text = (ROOT / "decks" / "extreme" / "open_joint.xml").read_text()
    assert "<assembly" in text
    deck.write_text(text.replace("<tFinal", "<tFinal").replace('position="project"', ""))
    page = show_deck(deck)
    assert page.faults
    assert scene_of(page.html)["bodies"]


def test_a_missing_mesh_is_a_fault(tmp_path):
    deck = tmp_path / "shapes.xml"
    deck.write_text((ROOT / "decks" / "basics" / "shapes.xml").read_text())
    page = show_deck(deck)
    assert "meshes/dish.obj: body 'Probe', mesh: not found in" in str(page.faults[0])
    assert tmp_path / "meshes" / "dish.obj" in page.files  # so a server sees when it comes
    assert scene_of(page.html)["bodies"]


def test_of_a_large_file_the_beginning_is_shown(tmp_path, monkeypatch):
    monkeypatch.setattr("msahl.post.show.lines.LARGEST", 1000)
    data = data_of(show_deck(ENGINE).html, "deck")
    assert data["files"][0]["text"].endswith("(the rest is not shown)")
    assert data["elements"]


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    good = CliRunner().invoke(main, ["show", str(ENGINE)])
    assert good.exit_code == 0
    assert good.stdout.strip() == str(Path("results") / "engine.html")
    assert "engine.xml: good" in good.stderr
    (tmp_path / "deck.xml").write_text(FAULTY_DECK)
    bad = CliRunner().invoke(main, ["show", "deck.xml", "-o", "page.html"])
    assert bad.exit_code == 2
    assert "deck.xml:7: body 'Crank', mass: the mass is -1 kg" in bad.stderr
    assert (tmp_path / "page.html").is_file()
    both = CliRunner().invoke(main, ["show", "deck.xml", "-o", "page.html", "--watch"])
    assert both.exit_code == 2
    assert "--watch serves the page and writes no file" in both.stderr
    missing = CliRunner().invoke(main, ["show", "none.xml", "-o", "none.html"])
    assert not Path("none.html").exists()
    assert missing.exit_code == 2
    assert "none.xml: cannot be read" in missing.stderr


def test_changed_numbers_are_shown(tmp_path):
    html = show_deck(ENGINE, ("r=60 mm",)).html
    pin = next(j for j in scene_of(html)["joints"] if j["name"] == "Crank pin")
    assert pin["parentPoint"] == [0, 0, 0.06]


def test_lines_of_a_deck_that_has_gone(tmp_path):
    from msahl.deck.source import Source

    deck = tmp_path / "deck.xml"
    deck.write_text(FAULTY_DECK)
    readable = Source.of_file(deck).readable()
    files = files_of(deck, readable)
    deck.unlink()
    assert element_lines(files, readable) == []


# in a browser ------------------------------------------------------------------------------------


@pytest.fixture
def opened(open_page, tmp_path):
    """A function that opens the page of a deck."""

    def open_deck(deck, **settings):
        path = tmp_path / "show.html"
        path.write_text(show_deck(deck).html, encoding="utf-8")
        settings.setdefault("viewport", {"width": 1300, "height": 800})
        page = open_page(path, **settings)
        page.wait_for_selector("[data-state=ready]")
        return page

    return open_deck


CHOSEN = "[...document.querySelectorAll('.line.chosen')].map((line) => Number(line.dataset.line))"


def chosen_row(name):
    """Selector of a selected element in the list, which is marked with the next frame."""
    return f".tree li.selected .what[title='{name}']"


def test_a_selected_element_is_marked_in_text_list_and_view(opened):
    page = opened(ENGINE)
    data = data_of(show_deck(ENGINE).html, "deck")
    rod = next(e for e in data["elements"] if e["name"] == "Rod")
    lines = list(range(rod["from"], rod["to"] + 1))
    before = page.locator(".view3d").screenshot()
    page.click(".tree .what[title=Rod]")
    assert page.evaluate(CHOSEN) == lines
    assert page.locator(".line.chosen").first.is_visible()  # it was scrolled to
    page.wait_for_selector(chosen_row("Rod"))
    next_picture(page)
    assert page.locator(".view3d").screenshot() != before
    # From the text: the list follows.
    pin = next(e for e in data["elements"] if e["name"] == "Piston pin")
    page.click(f".line[data-line='{pin['from'] + 1}'] code")
    assert page.evaluate(CHOSEN) == list(range(pin["from"], pin["to"] + 1))
    page.wait_for_selector(chosen_row("Piston pin"))
    # From the view: what is in the middle of the picture.
    box = page.locator(".view3d").bounding_box()
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.6 * box["height"])
    page.wait_for_selector(chosen_row("Crank"))
    page.mouse.click(box["x"] + 0.97 * box["width"], box["y"] + 0.03 * box["height"])
    assert page.evaluate(CHOSEN) == []


@pytest.mark.slow
def test_files_and_faults(opened, tmp_path):
    page = opened(CAR)
    page.click(".tree .what[title='RL.Wheel']")
    assert page.locator(".tabs button[aria-pressed=true]").inner_text() == "parts/corner.xml"
    deck = tmp_path / "deck.xml"
    deck.write_text(FAULTY_DECK)
    page = opened(deck)
    assert page.locator(".deck-head .word").inner_text() == "3 faults"
    page.locator(".faults button").first.click()
    assert page.evaluate(CHOSEN) == [7]
    faulty = "[...document.querySelectorAll('.line.faulty')].map((l) => Number(l.dataset.line))"
    assert page.evaluate(faulty) == [7, 11, 13]


@pytest.mark.slow
def test_hostile_names_run_no_script(opened, tmp_path):
    body = FAULTY_DECK[FAULTY_DECK.index("<rigidBody>") :].partition("</rigidBody>")[0]
    bodies = "".join(
        body.replace("Crank", escape(f"{index} {payload}")).replace("-1", "1") + "</rigidBody>"
        for index, payload in enumerate(PAYLOADS)
    )
    text = FAULTY_DECK.replace("</bodies>", f"{bodies}</bodies>")
    title = f"<title>{escape(' '.join(PAYLOADS))}</title>"
    deck = tmp_path / "deck.xml"
    deck.write_text(text.replace("<tFinal", f"{title}<tFinal"))
    page = opened(deck)
    for row in page.locator(".tree li .what").all():
        row.click()
    page.wait_for_timeout(100)
    assert page.evaluate("window.hit === undefined")
    foreign = "document.querySelectorAll('.show img, .show script, .deck svg').length"
    assert page.evaluate(foreign) == 0
    assert page.locator(".tree").inner_text().count("window.hit=1") >= len(PAYLOADS) - 2


def test_dark_and_on_a_phone(opened):
    page = opened(ENGINE, color_scheme="dark", viewport={"width": 390, "height": 780})
    width = page.evaluate("document.documentElement.scrollWidth")
    assert width <= 390
    assert page.locator(".view3d").is_visible()
    assert page.locator(".code").is_visible()
    wait_until(page, "getComputedStyle(document.body).backgroundColor !== 'rgb(255, 255, 255)'")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="a device of Unix")
def test_a_file_without_end_is_not_read_to_its_end():
    page = show_deck(Path("/dev/zero"))
    assert "larger than 256 MiB" in str(page.faults[0])
    assert len(page.html) < 2**25
