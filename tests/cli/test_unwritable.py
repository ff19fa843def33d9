"""Results that cannot be written, or printed: exit status 4 and one line, whatever the command."""

import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from msahl.cli.main import COMMANDS, main
from msahl.post.cli import COMMANDS as POST_COMMANDS
from msahl.post.cli import main as post
from tests.support.elastic_files import write_beam
from tests.support.models import ROOT
from tests.support.run_folders import write as write_run
from tests.support.sweep_folders import write_sweep

DECK = ROOT / "decks" / "basics" / "pendulum_by_angle.xml"
CRANK = ROOT / "decks" / "mechanisms" / "slider_crank.xml"
ROBOT = ROOT / "examples" / "arm.urdf"
BRIEF = ("--t-final", "0.01", "--dt", "0.01")
RUN, SWEEP, BODY = "run", "sweep", "beam.npz"
"""Stand for folders with results, and the file of an elastic body."""
WRITING = [
    (main, "run", DECK, *BRIEF),
    (main, "study", DECK, *BRIEF),
    (main, "sweep", DECK, "--set", "Rod.mass=1,2", *BRIEF),
    (main, "kinematics", CRANK, "--t-final", "0.01"),
    (main, "equilibrium", DECK),
    (main, "modes", DECK),
    (main, "linearize", DECK),
    (main, "show", DECK),
    (main, "new", "pendulum"),
    (main, "schema"),
    (main, "import", ROBOT),
    (main, "reduce", BODY, "--interface", 1),
    (main, "export", "loads", RUN),
    (main, "export", "fmu", DECK),
    (post, "report", RUN),
    (post, "plot", RUN, "path"),
    (post, "view", RUN),
    (post, "export", RUN, "--glb"),
    (post, "sweep", SWEEP),
]
PRINTING = [
    (main, "check", DECK),
    (main, "explain", DECK),
    (main, "schema"),
    (main, "new", "--list"),
    (main, "show", DECK),
    (main, "equilibrium", DECK),
    (main, "linearize", DECK),
    (main, "--help"),
    (main, "sweep", DECK, "--set", "Rod.mass=1,2", "--dry-run"),
    (post, "energy", RUN),
    (post, "verdict", RUN),
    (post, "compare", RUN, RUN),
    (post, "sweep", SWEEP, "--csv"),
    (post, "--help"),
]
ELSEWHERE = {"check", "explain", "compile", "inverse", "serve"}
"""Commands that write no results, or whose tests have this case."""


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A folder with a run, a sweep and an elastic body."""
    folder = tmp_path_factory.mktemp("results")
    write_run(folder / RUN)
    write_beam(folder / BODY)
    write_sweep(folder / SWEEP, {"a": [1.0, 2.0, 3.0]}, {"Tip.z max": [1.0, 2.0, 4.0]})
    return folder


def words_of(words, results):
    return [str(results / word) if word in (RUN, SWEEP, BODY) else str(word) for word in words]


@pytest.mark.parametrize(("program", "name", "words"), [(p, n, w) for p, n, *w in WRITING])
def test_results_that_cannot_be_written_are_status_4(program, name, words, results, tmp_path):
    """A file is in the place of a folder: that is true for root as well."""
    (tmp_path / "file").write_text("mine")
    place = tmp_path / "file" / ("x.json" if name == "linearize" else "x")
    given = [name, *words_of(words, results), "--copy" if name == "schema" else "-o", place]
    ran = CliRunner().invoke(program, [str(word) for word in given])
    assert ran.exit_code == 4, ran.output
    assert str(tmp_path / "file") in ran.stderr
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize(("program", "words"), [(p, w) for p, *w in PRINTING])
def test_what_cannot_be_printed_is_status_4(program, words, results, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    with Path("/dev/full").open("w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        with pytest.raises(SystemExit) as ended:
            program.main([words[0], *words_of(words[1:], results)])
    assert ended.value.code == 4
    said = capfd.readouterr().err.splitlines()
    assert said[-1] == f"{program.name}: standard output: No space left on device"


def test_every_command_that_writes_is_in_the_table():
    assert {n for p, n, *_ in WRITING if p is main} >= {*COMMANDS} - ELSEWHERE
    writers = {c.name for c in POST_COMMANDS if any("-o" in p.opts for p in c.params)}
    assert {n for p, n, *_ in WRITING if p is post} >= writers - {"modes"}
