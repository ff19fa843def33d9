"""Campbell diagrams: pictures and page of a folder of ``msahl modes --over``."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main as msahl
from msahl.post.campbell import figures, read_diagram
from msahl.post.cli import main as msahl_post
from tests.support.models import ROOT


def post(*words):
    return CliRunner().invoke(msahl_post, ["modes", *map(str, words)])


@pytest.fixture(scope="module")
def rotor(tmp_path_factory):
    """Five speeds of the rotor."""
    folder = tmp_path_factory.mktemp("modes")
    deck = ROOT / "decks/mechanisms/rotor.xml"
    words = ["modes", str(deck), "--over", "speed=0:400:5", "-q", "-o", str(folder)]
    assert CliRunner().invoke(msahl, words).exit_code == 0
    return folder


@pytest.mark.slow
def test_pictures_show_the_modes_and_the_critical_speeds(rotor):
    diagram = read_diagram(rotor)
    assert (diagram.parameter, diagram.orders, diagram.speed) == ("speed [rad/sec]", (1.0,), 1.0)
    (_, _, campbell), (_, _, locus) = figures(diagram)
    top, bottom = campbell.axes
    drawn = [line.get_xydata() for line in top.lines if len(line.get_xdata()) == 5]
    assert len(drawn) == 4
    for number, line in zip(diagram.numbers, drawn, strict=True):
        own = diagram.mode(number)
        assert line == pytest.approx(np.column_stack([own[:, 0], own[:, 3] / (2.0 * np.pi)]))
    # Circles mark the critical speeds on the line of 1x.
    circles = [line for line in top.lines if line.get_marker() == "o"]
    assert len(circles) == len(diagram.critical) == 3
    for circle in circles:
        (speed,), (hertz,) = circle.get_data()
        assert hertz == pytest.approx(speed / (2.0 * np.pi))
    assert bottom.get_xlabel() == "speed [rad/sec]"
    assert len(locus.axes[0].collections) == 4


def test_files_and_page(rotor, tmp_path, open_page):
    result = post(rotor, "-o", tmp_path / "out", "--format", "svg")
    assert result.exit_code == 0, result.output
    names = [line.rpartition("/")[2] for line in result.output.split()]
    assert names == ["campbell.html", "campbell.svg", "root-locus.svg"]
    page = open_page(tmp_path / "out/campbell.html", color_scheme="dark")
    assert page.locator("figure.drawn").count() == 2
    assert "251.42" in page.locator("table").first.inner_text()
    assert "forward whirl" in page.locator("table").first.inner_text()


@pytest.mark.slow
def test_folders_that_are_none(rotor, tmp_path):
    assert "no campbell.json" in post(tmp_path).output
    for name in ("campbell.csv", "critical.csv"):
        (tmp_path / name).write_bytes((rotor / name).read_bytes())
    (tmp_path / "campbell.json").write_text("{}")
    assert "cannot be read" in post(tmp_path).output
    info = json.loads((rotor / "campbell.json").read_text())
    (tmp_path / "campbell.json").write_text(json.dumps(info))
    assert post(tmp_path).exit_code == 0
    (tmp_path / "critical.csv").write_text("value\n1.0\n")
    result = post(tmp_path)
    assert result.exit_code == 2
    assert "other columns" in result.output
