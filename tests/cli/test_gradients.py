"""Derivatives by ``msahl run --gradient``: what is printed and written, and what stays the same."""

import csv
import json

import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from tests.support.models import ROOT

ROD = ROOT / "decks/basics/parameters.xml"
SHORT = ("--t-final", 0.2, "--error", "off")


def call(*words):
    return CliRunner().invoke(main, ["run", *(str(word) for word in words)])


def test_files_of_a_run_with_derivatives(tmp_path):
    asked = ("--gradient", "Hinge.angle final", "--gradient", "Rod.z max", "--wrt", "L,start")
    result = call(ROD, *SHORT, *asked, "-o", tmp_path / "with")
    assert result.exit_code == 0, result.output
    plain = call(ROD, *SHORT, "-o", tmp_path / "without")
    assert plain.exit_code == 0, plain.output
    for name in ("states.csv", "joints.csv", "reactions.csv"):
        assert (tmp_path / "with" / name).read_bytes() == (tmp_path / "without" / name).read_bytes()
    with (tmp_path / "with/gradients.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["measure"], row["parameter"], row["unit"]) for row in rows] == [
        ("Hinge.angle final", "L", "rad/cm"),
        ("Hinge.angle final", "start", "rad/deg"),
        ("Rod.z max", "L", "m/cm"),
        ("Rod.z max", "start", "m/deg"),
    ]
    told = json.loads((tmp_path / "with/run.json").read_text())
    assert [of["derivative"] for of in told["gradients"]] == [float(r["derivative"]) for r in rows]
    assert "gradients.csv" in told["tables"]
    assert all(row["measure"] in result.output for row in rows)
    # A run without derivatives in the same folder leaves none of the earlier run.
    assert call(ROD, *SHORT, "-o", tmp_path / "with").exit_code == 0
    assert not (tmp_path / "with/gradients.csv").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--gradient", "Hinge.angle final"), "--gradient and --wrt belong together"),
        (("--gradient", "Hinge.angle finale", "--wrt", "L"), "write a column and one of"),
        (("--gradient", "Hinge.angle final", "--wrt", "LL"), "did you mean L"),
        (("--gradient", "Hinge.angle final", "--wrt", "L", "--resume"), "omit --resume"),
    ],
)
def test_wrong_use(words, said, tmp_path):
    result = call(ROD, *words, "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert said in result.output
    assert not (tmp_path / "out").exists()


def test_a_run_whose_derivatives_cannot_be_computed_is_kept(tmp_path):
    words = ("--gradient", "Hinge.angle final", "--wrt", "Rod.position.z")
    result = call(ROD, *SHORT, *words, "-o", tmp_path / "out")
    quiet = call(ROD, *SHORT, *words, "-q", "-o", tmp_path / "quiet")
    assert quiet.exit_code == result.exit_code
    assert quiet.output.strip() in result.output
    assert quiet.output.strip()
    assert result.exit_code == 3
    assert "the deck allows no values near" in result.output
    assert (tmp_path / "out/states.csv").exists()
