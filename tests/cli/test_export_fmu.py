"""The command msahl export fmu."""

import json
import zipfile

import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from tests.support.models import ROOT

DECK = ROOT / "decks" / "forces" / "actuator_input.xml"


def export(*words):
    return CliRunner().invoke(main, ["export", "fmu", *map(str, words)])


@pytest.mark.parametrize(("version", "platform"), [("2", "linux64"), ("3", "x86_64-linux")])
def test_an_fmu_is_written(version, platform, tmp_path):
    path = tmp_path / "cart.fmu"
    done = export(DECK, "--fmi", version, "-o", path, "--set", "m=3 kg", "--dt", "0.002")
    assert (done.exit_code, done.stdout) == (0, "")
    assert f"cart.fmu: FMI {version}.0 for co-simulation" in done.stderr
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
        run = json.loads(archive.read("resources/run.json"))
        assert archive.read("resources/deck/actuator_input.xml") == DECK.read_bytes()
    assert f"binaries/{platform}/fmu_actuator_input.so" in names
    assert run["changes"] == {"m": "3 kg"}
    assert run["options"]["dt"] == 0.002


def test_the_file_is_named_after_the_deck(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert export(DECK, "-q").output == ""
    assert (tmp_path / "actuator_input.fmu").stat().st_size > 100_000


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "k=3"), "k=3: the deck has no element or parameter 'k'"),
        (
            ("--set", "m=-1"),
            "actuator_input.xml:23: body 'Cart', mass: the mass is -1 kg; it must be",
        ),
        (("--scheme", "auto"), "a tolerance of the global error needs complete runs"),
        (("--dt", "-1"), "deltaT: it is -1 s; it must be greater than zero"),
        (("--fmi", "1"), "--fmi"),
    ],
)
def test_faults_are_messages(words, message, tmp_path):
    done = export(DECK, *words, "-o", tmp_path / "cart.fmu")
    assert done.exit_code == 2
    assert message in done.stderr
    assert not list(tmp_path.iterdir())
