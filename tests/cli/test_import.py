"""The command ``msahl import``."""

import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.deck import read_deck
from tests.importers.test_urdf import tetrahedron
from tests.support.models import ROOT

ARM, LEG = ROOT / "examples" / "arm.urdf", ROOT / "examples" / "leg.xml"


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(main, ["import", *map(str, words)])


@pytest.mark.parametrize("file", [ARM, LEG], ids=lambda file: file.name)
def test_a_deck_is_written_and_the_rest_listed(call, tmp_path, file):
    result = call(file)
    assert result.exit_code == 0
    deck = tmp_path / f"{file.stem}_deck.xml"
    assert read_deck(deck).bodies
    assert f"next, msahl run {deck.name}" in result.stderr
    lines = result.stdout.splitlines()
    assert lines[0].startswith("not carried over: ")
    assert lines[1].startswith(f"    {file}:")
    again = call(file)
    assert again.exit_code == 2
    assert "exists; choose another file with -o, or --overwrite" in again.stderr
    assert call(file, "--overwrite", "-q").stdout == ""


def test_the_file_itself_is_never_overwritten(call, tmp_path):
    copy = tmp_path / "leg.xml"
    copy.write_bytes(LEG.read_bytes())
    assert call(copy, "-o", copy, "--overwrite").exit_code == 2
    assert copy.read_bytes() == LEG.read_bytes()


def test_a_file_may_have_a_name_that_xml_cannot_hold(call, tmp_path):
    copy = tmp_path / "arm\x01--\udcff.urdf"
    copy.write_bytes(ARM.read_bytes())
    assert call(copy, "-o", "deck.xml").exit_code == 0
    assert read_deck(tmp_path / "deck.xml").bodies


def test_the_deck_may_go_to_the_terminal(call, tmp_path):
    result = call(ARM, "-o", "-", "--at", "elbow=0.5", "--rate", "shoulder=2")
    (tmp_path / "deck.xml").write_text(result.stdout)
    model = read_deck(tmp_path / "deck.xml")
    assert model.bodies[0].angular_velocity == pytest.approx((0.0, 0.0, 2.0))
    assert "not carried over" in result.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((ARM, "--at", "elbow"), "--at elbow: expected JOINT=VALUE"),
        ((ARM, "--rate", "elbow=x"), "--rate elbow=x: expected JOINT=VALUE"),
        ((ARM, "--at", "knee=1"), "joint 'knee' does not rotate or slide; those that do: shoulder"),
        ((LEG, "--key", "up"), "there is no keyframe 'up'"),
        (("none.urdf",), "none.urdf: cannot be read"),
        ((ROOT / "decks" / "basics" / "stop.xml",), "<data> (that of a deck); expected <robot>"),
    ],
)
def test_faults_end_with_a_message(call, words, message):
    result = call(*words)
    assert result.exit_code == 2
    assert message in result.stderr


def test_meshes_are_copied_if_that_is_wanted(call, tmp_path):
    robots = tmp_path / "robots"
    robots.mkdir()
    tetrahedron(robots / "part.stl")
    mesh = '<visual><geometry><mesh filename="part.stl"/></geometry></visual>'
    text = ARM.read_text().replace("<visual>", f"{mesh}<visual>", 1)
    (robots / "arm.urdf").write_text(text)
    (tmp_path / "decks").mkdir()
    told = call(robots / "arm.urdf", "-o", "decks/arm.xml")
    assert "is not below the folder of the deck; --copy-meshes copies it" in told.stdout
    call(robots / "arm.urdf", "-o", "decks/arm.xml", "--overwrite", "--copy-meshes")
    assert (tmp_path / "decks" / "arm_meshes" / "part.stl").exists()
    check = CliRunner().invoke(main, ["check", "decks/arm.xml"])
    assert check.exit_code == 0
    (tmp_path / "decks" / "arm.xml").unlink()
    told = call(robots / "arm.urdf", "-o", "decks/arm.xml", "--copy-meshes")
    assert told.exit_code == 2
    assert "part.stl exists; choose another deck with -o, or --overwrite" in told.stderr
    assert not (tmp_path / "decks" / "arm.xml").exists()


def test_check_repairs_an_impossible_inertia_of_a_deck(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    deck = DECK.replace("<Izz>1</Izz>", "<Izz>5</Izz>")
    (tmp_path / "deck.xml").write_text(deck)
    first = CliRunner().invoke(main, ["check", "deck.xml", "--repair"])
    assert first.exit_code == 2
    assert "the nearest possible tensor about G has Ixx 2, Iyy 2, Izz 4" in first.stderr
    assert "deck_repaired.xml: the nearest possible inertias of Bob" in first.stderr
    assert CliRunner().invoke(main, ["check", "deck_repaired.xml"]).exit_code == 0
    (body,) = read_deck(tmp_path / "deck_repaired.xml").bodies
    # Second moments are at least 1e-6 of the largest entry.
    assert [body.inertia[i][i] for i in range(3)] == pytest.approx([2, 2, 4], abs=2e-5)
    assert CliRunner().invoke(main, ["check", "deck.xml", "--repair"]).exit_code == 2


def test_check_warns_of_an_inertia_that_does_not_fit_the_shapes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shape = "<shapes><sphere><radius>0.1</radius></sphere></shapes>"
    (tmp_path / "deck.xml").write_text(DECK.replace("</moi>", f"</moi>{shape}"))
    result = CliRunner().invoke(main, ["check", "deck.xml"])
    assert result.exit_code == 0
    assert "deck.xml: WARN: body 'Bob': radius of gyration 0.7071 m, more than the" in result.stderr


DECK = """<data>
  <system>
    <bodies>
      <rigidBody>
        <name>Bob</name>
        <mass>1</mass>
        <moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
      </rigidBody>
    </bodies>
  </system>
  <simulation><deltaT units="sec">0.01</deltaT><tFinal units="sec">1</tFinal></simulation>
</data>
"""
