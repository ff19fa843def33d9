"""The command ``msahl reduce``."""

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.cli.reduce import UNITS
from msahl.reduction import read_body
from msahl.reduction.units import UNITS as KNOWN_UNITS
from tests.support.elastic_files import write_beam
from tests.support.models import ROOT


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_beam(tmp_path / "beam.npz")
    return lambda *words: CliRunner().invoke(main, ["reduce", *map(str, words)])


def test_a_body_is_written_and_reported(call, tmp_path):
    result = call("beam.npz", "--interface", "Root=1", "--interface", "7", "--modes", 6)
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0] == "7 nodes, 42 degrees of freedom, 1.57 kg"
    assert "interface: Root (6), 7 (6)" in lines
    assert "12 modes of the free body (mean axes), without rigid-body modes" in lines
    assert result.stderr == "beam_body.npz: the reduced body\n"
    body = read_body(tmp_path / "beam_body.npz")
    assert body.interface_names.tolist() == ["Root", "7"]
    table = lines[lines.index("mode  frequency [Hz]  too high by") + 1 :]
    shown = [float(line.split()[1]) for line in table]
    assert shown == pytest.approx(body.frequencies, rel=1e-8)  # nine digits
    again = call("beam.npz", "--interface", 1)
    assert again.exit_code == 2
    assert "beam_body.npz exists; choose another file with -o, or --overwrite" in again.stderr
    words = ("beam.npz", "--interface", 1, "--frame", 1, "--up-to", 300, "-o", "beam_body.npz")
    result = call(*words, "--overwrite", "-q")
    assert (result.exit_code, result.stdout) == (0, "")
    assert read_body(tmp_path / "beam_body.npz").frame == "1"


def test_a_mesh_is_reduced_with_its_volume_and_the_error_of_the_mesh(call, tmp_path):
    pytest.importorskip("skfem")
    pytest.importorskip("meshio")
    words = (ROOT / "examples" / "link.inp", "--interface", "Root=ROOT", "--interface", "Tip=TIP")
    result = call(*words, "--material", "E=210e9, nu=0.3, rho=7850", "--modes", 6)
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    # 0.3 m x 0.02 m x 0.03 m
    assert lines[0] == "127 nodes, 381 degrees of freedom, 1.413 kg"
    assert lines[1] == "elements: 12 hexahedron20; volume 0.00018 m^3"
    page = (ROOT / "docs" / "reduce.md").read_text()
    first = next(line for line in lines if line.startswith("   1 "))
    assert first[:22] in page  # eight digits: the last is round-off's
    assert read_body(tmp_path / "link_body.npz").interface_names.tolist() == ["Root", "Tip"]
    result = call(*words, "-o", "other.npz")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "link.inp: it is a mesh; give its material: --material 'E=" in result.stderr


def test_the_file_itself_is_never_overwritten(call, tmp_path):
    before = (tmp_path / "beam.npz").read_bytes()
    result = call("beam.npz", "--interface", 1, "-o", "beam.npz", "--overwrite")
    assert result.exit_code == 2
    assert (tmp_path / "beam.npz").read_bytes() == before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--interface", "1", "--modes", "3", "--up-to", "9"), "give --modes or --up-to, not both"),
        (("--interface", "9x\n"), "--interface 9x: expected a node such as 12"),
        (("--interface", "99"), "beam.npz: there is no node 99"),
        ((), "no interface is chosen; name the nodes"),
        (("--interface", "1", "--frame", "Tip"), "--frame Tip: expected mean or an interface: 1"),
        (("--interface", "1", "--units", "mm-t"), None),
        (("--interface", "1", "--units", "furlong"), "'furlong'"),
        (("--interface", "1", "--up-to", "nan"), "--up-to"),
    ],
)
def test_faults_end_with_a_message(call, words, message):
    result = call("beam.npz", *words)
    assert result.exit_code == (0 if message is None else 2)
    assert (message or "") in result.stderr


def test_units_of_the_option_are_those_of_the_package():
    assert tuple(KNOWN_UNITS) == UNITS


def test_a_table_that_is_no_model(call, tmp_path):
    (tmp_path / "table.csv").write_text("time,angle\n0,1\n")
    result = call("table.csv", "--interface", 1)
    assert result.exit_code == 2
    assert "table.csv:1: 'time,angle': no line of an elastic model" in result.stderr
    np.savez(tmp_path / "other.npz", a=np.ones(3))
    assert "array 'a' is none of an elastic model" in call("other.npz", "--interface", 1).stderr
