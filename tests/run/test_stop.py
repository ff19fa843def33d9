"""Runs that end where a condition of the motion begins to hold."""

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.deck import DeckError, read_deck
from msahl.expressions.conditions import margin
from msahl.expressions.evaluate import evaluate
from msahl.expressions.syntax import ExpressionError, parse
from msahl.model import Stop
from msahl.run import loop
from msahl.run.time_grid import SHORTEST, TimeGrid
from msahl.start.velocities import StartError
from tests.support.models import ROOT
from tests.support.models import simulate_and_estimate as simulate

DECKS = ROOT / "decks"
PENDULUM = DECKS / "basics/pendulum_by_angle.xml"
SCHEMES = ("preserving", "decaying", "gauss3", "radau2", "auto")


def stopped(condition, path=PENDULUM):
    """A model that stops where the ``condition`` begins to hold."""
    return replace(read_deck(path), stops=(Stop(condition, margin(parse(condition))),))


def last_angle(result):
    return result.others["joints"][-1, 1]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_run_ends_where_the_condition_begins_to_hold(scheme):
    result = simulate(stopped("Hinge.angle < 0"), dt=0.02, scheme=scheme, solver="newton")
    assert result.report.status == "completed"
    assert abs(last_angle(result)) < 1e-14  # round-off of an angle of 0.5 rad
    assert result.states[-1, 0] == pytest.approx(result.report.stop["time"], rel=1e-15)
    assert (result.others["joints"][:-1, 1] > 0.0).all()


@pytest.mark.parametrize(("scheme", "order"), [("preserving", 2), ("gauss2", 4)])
def test_the_time_has_the_order_of_the_scheme(scheme, order):
    model = stopped("Hinge.angle < 0")
    exact = simulate(model, dt=0.01, scheme="gauss5", solver="newton").report.stop["time"]
    errors = [
        abs(simulate(model, dt=dt, scheme=scheme, solver="newton").report.stop["time"] - exact)
        for dt in (0.08, 0.04)
    ]
    # 0.25: a step that is cut has another error than a complete one.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_neither_the_clock_nor_the_output_decides_on_the_end(scheme, monkeypatch):
    model = stopped("Hinge.angleRate > 0 and t > 0.5")
    given = {"dt": 0.02, "scheme": scheme, "solver": "newton"}
    result = simulate(model, **given)
    seldom = simulate(model, **given, every=7)
    monkeypatch.setattr(loop, "CHUNK_SECONDS", 0.0)  # a step or a pair in every chunk
    slowly = simulate(model, **given)
    assert result.report.stop == seldom.report.stop == slowly.report.stop
    assert np.array_equal(result.states, slowly.states)
    assert np.array_equal(result.states[-1], seldom.states[-1])


def test_a_run_to_the_same_time_has_the_same_rows():
    given = {"dt": 0.02, "solver": "newton"}
    result = simulate(stopped("Hinge.angle < 0"), **given)
    plain = simulate(read_deck(PENDULUM), t_final=result.report.stop["time"], **given)
    # Times of steps, and so the states, differ by their last digits.
    assert result.states == pytest.approx(plain.states, abs=1e-13)


def test_the_error_of_the_last_row_is_estimated():
    model = stopped("Hinge.angle < 0")
    exact = simulate(model, dt=0.01, scheme="gauss5", solver="newton")
    result = simulate(model, dt=0.02, solver="newton", error="estimate")
    assert result.report.error["complete"]
    # At equal times: the exact motion is later by the difference of the times, at its own speed.
    speed = np.linalg.norm(exact.states[-1, 7:10])
    late = abs(result.report.stop["time"] - exact.report.stop["time"])
    assert speed * late < result.report.error["position"]


def test_subsystems_end_together():
    """One of two pendulums decides, and both end there."""
    model = stopped("abs(Right.angle) < 0.1", DECKS / "mechanisms/two_pendulums.xml")
    result = simulate(model, dt=0.01, solver="newton")
    assert result.report.subsystems == 2
    time = result.report.stop["time"]
    rest = simulate(replace(model, stops=()), dt=0.01, t_final=time, solver="newton")
    assert result.states[-1] == pytest.approx(rest.states[-1], abs=1e-12)  # round-off


def test_a_thrown_stick_ends_on_the_ground():
    """Expect: in the header of the deck."""
    result = simulate(read_deck(DECKS / "basics/stop.xml"), solver="newton")
    # The header has ten digits; gauss3 is exact for the flight and to 1e-12 for the rotation.
    assert result.states[-1, :2] == pytest.approx((1.507138511, 7.535692555), rel=1e-9)


def test_a_condition_fulfilled_from_the_start_is_refused():
    with pytest.raises(StartError, match="fulfilled at t = 0"):
        simulate(stopped("Hinge.angle > 0"), solver="newton")


def test_steps_after_the_end_may_fail():
    """The chunk of the end contains steps after it, here with a margin that is not a number."""
    result = simulate(stopped("sqrt(0.5 - t) < 0.1"), dt=0.005, solver="newton")
    assert result.report.status == "completed", result.report.message
    assert result.report.stop["time"] == pytest.approx(0.49, rel=1e-15)


def test_a_condition_that_never_holds_is_mentioned():
    result = simulate(stopped("Hinge.angle > 4"), t_final=0.1, solver="newton")
    assert result.report.stop is None
    (warning,) = result.report.warnings
    assert "did not begin to hold" in warning


def test_margins_have_the_sign_of_their_conditions():
    values = {"a": 1.0, "b": 2.0}
    conditions = {
        "a < b": True,
        "a >= b": False,
        "a > b or b > a": True,
        "a < b and a > b": False,
        "not a > b": True,
        "not (a < b and b < 3)": False,
    }
    for text, holds in conditions.items():
        assert (evaluate(margin(parse(text)), values) > 0.0) == holds, text


@pytest.mark.parametrize(("text", "word"), [("a == b", ">= or <="), ("a + b", "no condition")])
def test_what_is_no_condition_is_said(text, word):
    with pytest.raises(ExpressionError, match=word):
        margin(parse(text))


def test_a_cut_grid_has_no_very_short_interval():
    grid = TimeGrid.with_interval(0.1, 1.0)
    for t in (0.25, 0.3, 0.3 + 0.5e-4, 0.3 + 2e-4):
        cut = grid.until(t)
        assert cut.time(cut.n) == t
        assert SHORTEST * 0.1 * (1.0 - 1e-9) < cut.step(cut.n) <= (1.0 + SHORTEST) * 0.1 + 1e-12
        assert [cut.time(k) for k in range(cut.n)] == [grid.time(k) for k in range(cut.n)]


def call(*words):
    return CliRunner().invoke(main, list(map(str, words)))


def test_the_option_replaces_the_condition_of_the_deck(tmp_path):
    deck = tmp_path / "deck.xml"
    text = PENDULUM.read_text().replace("</tFinal>", '</tFinal><stop when="{Hinge.angle &lt; 0}"/>')
    deck.write_text(text)
    (given,) = read_deck(deck).stops
    assert given.condition == "Hinge.angle < 0"
    result = call("run", deck, "--solver", "newton", "-o", tmp_path / "a", "--stop-when", "t > 0.3")
    assert result.exit_code == 0, result.stderr
    assert "ended at t = 0.3 s, where t > 0.3" in result.stderr
    again = call("run", tmp_path / "a/deck.xml", "--solver", "newton", "-o", tmp_path / "b")
    assert again.exit_code == 0, again.stderr
    tables = [(tmp_path / name / "states.csv").read_bytes() for name in "ab"]
    assert tables[0] == tables[1]


@pytest.mark.parametrize(
    ("condition", "word"),
    [("Hing.angle > 1", "Hinge.angle"), ("Hinge.angle", "no condition"), ("1 >", "column")],
)
def test_faults_of_a_condition_name_the_line(condition, word, tmp_path):
    deck = tmp_path / "deck.xml"
    stop = f'<stop when="{condition.replace(">", "&gt;")}"/>'
    deck.write_text(PENDULUM.read_text().replace("</tFinal>", f"</tFinal>\n{stop}"))
    with pytest.raises(DeckError) as caught:
        read_deck(deck)
    (fault,) = caught.value.faults
    assert word in str(fault)
    assert deck.read_text().splitlines()[fault.line - 1] == stop
    result = call("run", PENDULUM, "--stop-when", condition, "-o", tmp_path / "results")
    assert (result.exit_code, word in result.stderr) == (2, True)
    result = call("check", deck, "--set", f"simulation.stop.when={condition}")
    assert result.stdout + result.stderr == result.stderr
    assert result.stderr.startswith(f"{deck}: --stop-when {condition}: simulation/stop: ")
