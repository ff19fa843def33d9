"""Shapes change no result: tables, digest, resuming; msahl check reads files of meshes."""

import json
import shutil

from click.testing import CliRunner

from msahl.cli.main import main
from tests.support.models import ROOT

DECK = ROOT / "decks" / "basics" / "shapes.xml"


def call(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def without(text):
    """The deck's text without the shapes of the probe and of the ground."""
    for indent in ("\n        <shapes>", "\n        <shapes>"):
        start, end = text.index(indent), text.index("</shapes>") + len("</shapes>")
        text = text[:start] + text[end:]
    return text


def run(tmp_path, name, text):
    (tmp_path / f"{name}.xml").write_text(text)
    folder = tmp_path / name
    result = call("run", tmp_path / f"{name}.xml", "-o", folder, "--t-final", 1)
    assert result.exit_code == 0, result.output
    return folder


def test_shapes_leave_tables_and_digest_alone(tmp_path):
    text = DECK.read_text()
    assert without(text).count("shapes>") == 0
    drawn, plain = run(tmp_path, "drawn", text), run(tmp_path, "plain", without(text))
    for table in ("states.csv", "error.csv"):
        assert (drawn / table).read_bytes() == (plain / table).read_bytes()
    digests = [json.loads((f / "run.json").read_text())["deck"]["digest"] for f in (drawn, plain)]
    assert digests[0] == digests[1]
    assert "<mesh href=" in (drawn / "deck.xml").read_text()
    # A run may be resumed with other shapes: it is complete, and nothing is to be done.
    (tmp_path / "drawn.xml").write_text(without(text))
    result = call("run", tmp_path / "drawn.xml", "-o", drawn, "--t-final", 1, "--resume")
    assert result.exit_code == 0
    assert "is complete" in result.output


def test_check_reads_meshes(tmp_path):
    assert call("check", DECK).exit_code == 0
    shutil.copy(DECK, tmp_path)
    result = call("check", tmp_path / "shapes.xml")
    assert result.exit_code == 2
    assert (
        f"meshes/dish.obj: body 'Probe', mesh: not found in {tmp_path}; put it there"
        in result.output
    )
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "dish.obj").write_text("v 0 0 0\nf 1 2 3\n")
    result = call("check", tmp_path / "shapes.xml")
    assert result.exit_code == 2
    assert "dish.obj:2: body 'Probe', mesh: there is no vertex 2 before this line" in result.output
