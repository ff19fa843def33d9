"""Events between rows: their times against closed forms, and what they are known to."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scenes import THESIS

from msahl.cli import main as msahl
from msahl.deck import read_deck
from msahl.post.cli import main as post
from msahl.post.events import passages, turns
from msahl.results.read import ResultError, read_run
from msahl.study.exact import recognise

SINGLE = THESIS[0].parent / "single_pendulum_45.xml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("events") / "run"
    words = ["run", SINGLE, "--scheme", "gauss4", "--dt", "0.1", "--output-interval", "0.02"]
    result = CliRunner().invoke(msahl, [*map(str, words), "--t-final", "10", "-o", str(out)])
    assert result.exit_code == 0, result.output
    return out


def exact(time):
    """(rows, 12) states of the pendulum."""
    return recognise(read_deck(SINGLE)).states(np.atleast_1d(time))


def test_passages_are_where_the_closed_form_passes(folder):
    run = read_run(folder)
    bob = run.model.bodies[0].name
    found = passages(run, f"{bob}.x", 0.0)
    assert len(found) == 4
    for event in found:
        # Degree 5 at 0.02 s of a motion of 4.7 s: 0.02^6 of its sixth derivative, over its speed.
        assert abs(exact(event.time)[0, 0]) <= 1e-10
        assert event.apart is not None
        assert 0.0 < event.apart <= 1e-6
    assert [np.sign(e.slope) for e in found] == [-1, 1, -1, 1]
    # Half a period apart, all of them.
    assert np.ptp(np.diff([e.time for e in found])) <= 1e-9


def test_turns_are_where_the_pendulum_stands(folder):
    run = read_run(folder)
    bob = run.model.bodies[0].name
    for event in turns(run, f"{bob}.x"):
        # Where it is known to 1e-8 s the speed is that times the acceleration, 7 m/s^2.
        assert np.abs(exact(event.time)[0, 6:9]).max() <= 1e-6


def test_the_command_and_what_it_refuses(folder):
    bob = read_run(folder).model.bodies[0].name
    result = CliRunner().invoke(post, ["events", str(folder), f"{bob}.x", "--at", "0", "--json"])
    assert result.exit_code == 0
    assert len(json.loads(result.stdout)) == 4
    for column, word in (("Nobody.x", "no column"), (f"{bob}.P1", "jump at half a turn")):
        with pytest.raises(ResultError, match=word):
            passages(read_run(folder), column, 0.0)
        assert CliRunner().invoke(post, ["events", str(folder), column]).exit_code == 2
