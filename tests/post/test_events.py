"""Events between output times: their times against closed forms, and what they are known to."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from msahl.cli.main import main as msahl
from msahl.deck import read_deck
from msahl.post.cli import main as post
from msahl.post.events import crossings, extrema, first_crossing
from msahl.results.read import ResultError, Run, read_run
from tests.support.closed_forms import recognise
from tests.support.models import THESIS

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
    found = crossings(run, f"{bob}.x", 0.0)
    assert len(found) == 4
    for event in found:
        # Degree 5 at 0.02 s of a motion of 4.7 s: 0.02^6 of its sixth derivative, over its speed.
        assert abs(exact(event.time)[0, 0]) <= 1e-10
        assert event.uncertainty is not None
        assert 0.0 < event.uncertainty <= 1e-6
    assert [np.sign(e.slope) for e in found] == [-1, 1, -1, 1]
    # Half a period apart, all of them.
    assert np.ptp(np.diff([e.time for e in found])) <= 1e-9


def test_extrema_are_where_the_pendulum_stands(folder):
    run = read_run(folder)
    bob = run.model.bodies[0].name
    for event in extrema(run, f"{bob}.x"):
        # Where it is known to 1e-8 s the speed is that times the acceleration, 7 m/s^2.
        assert np.abs(exact(event.time)[0, 6:9]).max() <= 1e-6


def rows_of(values, end, rows=101):
    """A run of one column over time."""
    time = np.linspace(0.0, end, rows)
    states = pd.DataFrame({"time": time, "Bob.x": values(time)})
    return Run(Path("run"), None, {}, states, None, None, False)


@pytest.mark.parametrize("noise", [0.0, 1e-12])
@pytest.mark.parametrize("factor", [1.0, 1e-9, -5.0])
def test_where_a_run_starts_or_ends_at_rest_there_is_no_extremum(factor, noise):
    # The motion of one who begins at rest, and is at rest again at the end of the second period.
    grain = np.random.default_rng(7).normal(size=101)
    run = rows_of(lambda t: factor * (np.cos(t) + noise * grain), 4.0 * np.pi)
    found = [event.time for event in extrema(run, "Bob.x")]
    # 50 rows a period: degree 5 places a rotation to 1e-6 of a row's spacing; noise moves it by
    # itself over the spacing and the acceleration.
    assert found == pytest.approx([np.pi, 2.0 * np.pi, 3.0 * np.pi], abs=1e-6)


def test_the_pendulum_does_not_rotation_where_it_starts(folder):
    run = read_run(folder)
    bob = run.model.bodies[0].name
    first = extrema(run, f"{bob}.x")[0].time
    # It starts at rest, and stands again half a period later: no period of a pendulum is shorter
    # than that of small swings.
    assert first > np.pi * np.sqrt(5.0 / 9.80665)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_rests_for_an_instant_and_goes_on_does_not_rotation(sign):
    assert extrema(rows_of(lambda t: sign * (t - 0.513) ** 3, 1.0), "Bob.x") == []


def test_what_rests_all_along_has_no_events():
    assert extrema(rows_of(np.ones_like, 1.0), "Bob.x") == []
    assert crossings(rows_of(np.ones_like, 1.0), "Bob.x", 1.0) == []


def test_to_begin_at_a_level_is_not_to_pass_it():
    run = rows_of(np.sin, 7.0)
    assert [e.time for e in crossings(run, "Bob.x", 0.0)] == pytest.approx([np.pi, 2.0 * np.pi])


def test_a_passage_is_found_wherever_the_column_changes_its_sign():
    time = np.arange(0.0, 4.0, 0.2)  # 4 output times a period: the first passage is uncertain
    event = first_crossing(time, np.sin(8.0 * (time - 0.02)), 0.0)
    assert event.time == pytest.approx(0.02, abs=0.02)
    assert event.uncertainty > 0.01
    # From the end, the same passage is the last one.
    events = crossings(rows_of(lambda t: np.sin(8.0 * (3.78 - t)), 3.8, 20), "Bob.x", 0.0)
    assert events[-1].time == pytest.approx(3.78, abs=0.02)


def test_the_command_and_what_it_refuses(folder):
    bob = read_run(folder).model.bodies[0].name
    result = CliRunner().invoke(post, ["events", str(folder), f"{bob}.x", "--at", "0", "--json"])
    assert result.exit_code == 0
    assert len(json.loads(result.stdout)) == 4
    for column, word in (
        ("Nobody.x", "no column"),
        (f"{bob}.P1", "discontinuous at rotations by 180 degrees"),
    ):
        with pytest.raises(ResultError, match=word):
            crossings(read_run(folder), column, 0.0)
        assert CliRunner().invoke(post, ["events", str(folder), column]).exit_code == 2


def test_angles_of_joints_have_events(tmp_path):
    """A crank of one revolution a second is back at -60 degrees after every second."""
    out, crank = tmp_path / "run", THESIS[0].parents[1] / "mechanisms" / "four_bar.xml"
    assert CliRunner().invoke(msahl, ["run", str(crank), "-o", str(out)]).exit_code == 0
    (event,) = crossings(read_run(out), "Crank pivot.angle", -np.pi / 3 - 3.0 * np.pi)
    assert event.time == pytest.approx(1.5, abs=1e-9)
    assert event.slope == pytest.approx(-2.0 * np.pi, rel=1e-9)
    words = ["events", str(out), "Crank pivot.angle", "--at", "-4.19", "--json"]
    assert CliRunner().invoke(post, words).exit_code == 0
