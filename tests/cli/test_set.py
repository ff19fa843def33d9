"""Runs of decks with parameters and parts, and ``--set``: tables to the bit, files, resuming."""

import json
import shlex

import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.post.cli import main as post
from msahl.study.command import command_arguments
from msahl.study.plan import Plan
from msahl.study.runs import Case
from tests.run.test_resume import interrupted, tables
from tests.support.models import ROOT

ROD = ROOT / "decks" / "basics" / "parameters.xml"
CAR = ROOT / "decks" / "mechanisms" / "suspension.xml"


def call(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def run(folder, *words):
    result = call("run", *words, "-o", folder)
    assert result.exit_code == 0, result.output
    return json.loads((folder / "run.json").read_text())


def test_a_parameter_deck_gives_the_tables_of_the_deck_with_the_numbers_written_in(tmp_path):
    model = read_deck(ROD)
    body = model.bodies[0]
    text = ROD.read_text()
    start, end = text.index("  <parameters>"), text.index("  <system>")
    written = text[:start] + text[end:]
    for expression, value in {
        "{m}": repr(body.mass),
        "{across}": repr(body.inertia[0][0]),
        "{-L/2}": "-0.4",
        "{L/2}": "0.4",
        "{-start}": "-60",
        '<Izz units="kg-cm^2">{m*r^2/2}': f"<Izz>{body.inertia[2][2]!r}",
    }.items():
        assert expression in written
        written = written.replace(expression, value)
    assert "{" not in written
    (tmp_path / "written.xml").write_text(written)
    words = ("--t-final", 0.5)
    run(tmp_path / "a", ROD, *words)
    run(tmp_path / "b", tmp_path / "written.xml", *words)
    assert tables(tmp_path / "a") == tables(tmp_path / "b")
    assert tables(tmp_path / "a")


@pytest.mark.parametrize("path", [ROD, CAR], ids=lambda path: path.stem)
def test_the_deck_of_a_run_gives_its_tables_again(tmp_path, path):
    words = ("--t-final", 0.1, "--set", "deltaT=2 ms")
    first = run(tmp_path / "a", path, *words)
    second = run(tmp_path / "b", tmp_path / "a" / "deck.xml")
    assert tables(tmp_path / "a") == tables(tmp_path / "b")
    assert (tmp_path / "a" / "deck.xml").read_bytes() == (tmp_path / "b" / "deck.xml").read_bytes()
    assert first["set"] == ["deltaT=2 ms"]
    assert first["parameters"] == second["parameters"]
    assert first["steps"] == 50
    assert "set" not in second


def test_run_json_lists_parameters_and_changes(tmp_path):
    info = run(tmp_path, ROD, "--set", "L=1 m", "--set", "Rod.phi=-45", "--t-final", 0.01)
    assert info["set"] == ["L=1 m", "Rod.phi=-45"]
    assert info["parameters"]["L"] == {"value": 1.0, "units": "m"}
    assert info["parameters"]["m"]["units"] == "kg"
    plain = run(tmp_path / "plain", ROOT / "decks/joints/revolute.xml", "--t-final", 0.01)
    assert not {"set", "parameters"} & plain.keys()


def test_a_run_with_changes_is_resumed(tmp_path, monkeypatch):
    words = (ROD, "--set", "L=1 m", "--set", "Rod.phi=-45", "--t-final", 0.1)
    result = interrupted(monkeypatch, tmp_path / "out", *words)
    again = result.stderr.split("resume it with: ")[1].splitlines()[0]
    assert "--set 'L=1 m' --set Rod.phi=-45" in again
    assert call(*shlex.split(again)[1:]).exit_code == 0
    run(tmp_path / "complete", *words)
    assert tables(tmp_path / "out") == tables(tmp_path / "complete")
    assert json.loads((tmp_path / "out" / "run.json").read_text())["resumed"]


def test_a_part_that_changes_is_another_deck(tmp_path, monkeypatch):
    deck, part = tmp_path / "deck.xml", tmp_path / "parts" / "corner.xml"
    deck.write_text(CAR.read_text())
    part.parent.mkdir()
    part.write_text((CAR.parent / "parts" / "corner.xml").read_text())
    interrupted(monkeypatch, tmp_path / "out", deck, "--t-final", 0.1)
    part.write_text(part.read_text().replace(">40<", ">41<"))
    result = call("run", deck, "-o", tmp_path / "out", "--t-final", 0.1, "--resume")
    assert result.exit_code == 2
    assert "deck" in result.stderr


def test_results_of_parts_are_evaluated(tmp_path):
    run(tmp_path, CAR, "--t-final", 0.02)
    for command in ("energy", "constraints"):
        result = CliRunner().invoke(post, [command, str(tmp_path)])
        assert result.exit_code == 0, result.output


def test_check_and_explain_take_changes():
    assert call("check", ROD, "--set", "L=2").exit_code == 0
    assert "good" in call("check", ROD, "--set", "L=2").stdout
    assert call("explain", ROD, "--set", "L=2 m").exit_code == 0
    for command in ("check", "explain", "run", "study"):
        result = call(command, ROD, "--set", "len=2")
        assert result.exit_code == 2
        assert f"{ROD}: --set len=2: the deck has no element or parameter 'len'" in result.stderr


def test_the_name_of_a_body_alone_is_answered_with_its_numbers():
    result = call("check", ROD, "--set", "Rod=2")
    assert "--set Rod=2: the deck has no such number; known here: Rod.mass" in result.stderr


def test_the_commands_of_a_study_contain_its_changes():
    model = read_deck(ROD)
    plan = Plan(model, (), (), "auto", None, 1e-6, "position", 10.0)
    words = command_arguments(Case("preserving", 0.01), plan, "d.xml", settings=("L=1 m", "r=3"))
    assert words[:6] == ["run", "d.xml", "--set", "L=1 m", "--set", "r=3"]


def test_the_schema_is_printed_and_copied(tmp_path):
    path = call("schema").stdout.strip()
    assert path.endswith("msaHLData.xsd")
    copied = call("schema", "--copy", tmp_path / "new").stdout.strip()
    assert copied == str(tmp_path / "new" / "msaHLData.xsd")
    schema = (ROOT / "schemas" / "msaHLData.xsd").read_bytes()
    assert (tmp_path / "new" / "msaHLData.xsd").read_bytes() == schema
    (tmp_path / "file").touch()
    assert call("schema", "--copy", tmp_path / "file").exit_code == 4
