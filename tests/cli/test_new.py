"""``msahl new`` writes decks to start from, and overwrites nothing."""

from pathlib import Path
from urllib.parse import urlparse
from urllib.request import url2pathname

import pytest
from click.testing import CliRunner
from lxml import etree

from msahl.cli.new import names, new, new_deck, template
from msahl.deck import read_deck
from msahl.deck.schema import schema_bytes


@pytest.mark.parametrize("name", names())
def test_a_template_is_a_good_deck_with_comments(tmp_path, name):
    path = tmp_path / "my.xml"
    result = CliRunner().invoke(new, [name, "-o", str(path)])
    assert result.exit_code == 0
    assert f"msahl run {path}" in result.stderr
    assert read_deck(path, thorough=True).bodies
    assert "Expect: " in path.read_text()


@pytest.mark.parametrize("name", ["pendulum", "revolute"])  # without and with a schema of its own
def test_a_new_deck_names_the_installed_schema(name):
    root = etree.fromstring(new_deck(name).encode())
    place = root.get("{http://www.w3.org/2001/XMLSchema-instance}noNamespaceSchemaLocation")
    assert place.startswith("file:///")
    assert Path(url2pathname(urlparse(place).path)).read_bytes() == schema_bytes()
    rest = [text.split("<system>")[1] for text in (new_deck(name), template(name))]
    assert rest[0] == rest[1]


def test_every_template_is_listed_with_its_purpose():
    listed = CliRunner().invoke(new, ["--list"])
    assert listed.exit_code == 0
    assert [line.split()[0] for line in listed.stdout.splitlines()] == names()
    assert "pendulum" in names()
    assert "--list" in CliRunner().invoke(new, ["--help"]).stdout


def test_every_element_has_a_template():
    schema = etree.fromstring(schema_bytes())
    kinds = {
        element.get("name")
        for group in ("joints", "motions", "loads")
        for element in schema.iterfind(f"xs:complexType[@name='{group}']//xs:element", schema.nsmap)
    }
    assert kinds > {"universal", "camFollower", "jointMotion", "bushing"}
    shown = {
        element.tag
        for name in names()
        for element in etree.fromstring(template(name).encode()).iter(*kinds)
    }
    assert shown == kinds


def test_the_terminal_gets_the_deck_itself():
    assert CliRunner().invoke(new, ["joint-motion", "-o", "-"]).stdout == new_deck("joint-motion")


def test_without_a_file_it_is_named_after_the_template(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(new, ["gears"]).exit_code == 0
    assert (tmp_path / "gears.xml").read_text() == new_deck("gears")


def test_nothing_is_overwritten(tmp_path):
    path = tmp_path / "deck.xml"
    path.write_text("mine")
    result = CliRunner().invoke(new, ["joint-motion", "-o", str(path)])
    assert (result.exit_code, path.read_text()) == (2, "mine")
    assert result.stderr == f"{path} exists; choose another file with -o\n"


def test_a_folder_that_is_not_there(tmp_path):
    result = CliRunner().invoke(new, ["joint-motion", "-o", str(tmp_path / "no/deck.xml")])
    assert result.exit_code == 4
    assert "No such file or directory; choose another file with -o" in result.stderr


def test_an_unknown_template_names_the_known_ones():
    result = CliRunner().invoke(new, ["pendulm"])
    assert result.exit_code == 2
    assert "did you mean pendulum" in result.stderr
