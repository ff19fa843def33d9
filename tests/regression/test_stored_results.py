"""Runs of stored cases give the numbers that tests/regression keeps; see tools/regress.py."""

import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.post.cli import main as post
from tests.support.models import ROOT
from tools.regress import STORED, TOLERANCES, cases


@pytest.mark.parametrize("case", cases(), ids=lambda case: case.name)
def test_a_stored_run_gives_the_same_numbers(case, tmp_path):
    deck = ROOT / "decks" / case.deck
    words = ["--dt", case.dt, "--t-final", case.t_final, "--every", case.every, "-q"]
    run = CliRunner().invoke(main, ["run", str(deck), *words, "-o", str(tmp_path)])
    assert run.exit_code == 0, run.output
    told = CliRunner().invoke(
        post, ["compare", str(tmp_path), str(STORED / case.name), *TOLERANCES]
    )
    assert told.exit_code == 0, told.output
