"""The command ``msahl linearize``: what it prints and writes."""

import json

import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from tests.support.models import ROOT

CART = ROOT / "decks" / "machines" / "cart_pole.xml"
FREE = [f"--set={name}=0" for name in ("kPosition", "kVelocity", "kAngle", "kRate")]


def call(*words):
    return CliRunner().invoke(main, ["linearize", *(str(word) for word in words)])


def test_report_and_file(tmp_path):
    file = tmp_path / "new" / "cart.json"
    names = ["--input", "Motor", "--input", "Pole.Fx", "--output", "Hinge.angle"]
    result = call(CART, *FREE, "--at", "equilibrium", *names, "-o", file)
    assert result.exit_code == 0, result.output
    assert "WARN" not in result.output
    assert ": equilibrium, residual" in result.output
    # Half a revolution, of either sign.
    assert "3.14159265 rad" in result.output
    assert "input  Motor = 0 N" in result.output
    # The pole hangs: omega^2 = m g l (M + m)/det, damped by the rail's friction.
    assert "pole  -0.0392343068 +- 5.39340534 i 1/s" in result.output
    assert "no steady gains: a pole is zero" in result.output
    assert json.loads(file.read_text())["inputNames"] == ["Motor", "Pole.Fx"]


def test_quiet_and_states():
    result = call(CART, "--states", "nullspace", "-q")
    assert result.exit_code == 0
    # The deck begins 20 degrees off, with forces that are not balanced.
    (line,) = result.output.splitlines()
    assert line.startswith("WARN: this is no equilibrium and no steady motion: ")
    assert "not balanced (body '" in line


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--input", "Moter"], "'Moter' is no input"),
        (["--output", "Hinge.angel"], "did you mean Hinge.angle"),
        (["-o", "cart.csv"], "ends in none of .npz, .mat, .json"),
        (["--at", "never"], "'never' is not a valid time"),
    ],
)
def test_wrong_use(words, message):
    result = call(CART, *words)
    assert result.exit_code == 2
    assert message in result.output
    assert "Traceback" not in result.output


def test_wrong_inputs_and_outputs_are_reported_together():
    result = call(CART, "--input", "Moter", "--output", "Hinge.angel")
    assert "'Moter' is no input" in result.output
    assert "'Hinge.angel' is no output" in result.output


def test_a_file_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    result = call(CART, "-q", "-o", tmp_path / "file" / "cart.npz")
    assert result.exit_code == 4
