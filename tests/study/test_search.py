"""Studies that choose their steps: the curves, the recommendation, the reference, the report."""

import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from msahl.algebra.functions import Law
from msahl.algebra.vector import ZERO
from msahl.cli.main import main
from msahl.cli.study import study as command
from msahl.jit.compiled import working_clock
from msahl.model import ConcentratedLoad, JointMotion, Model, Options, RigidBody, Simulation
from msahl.model.settings import OFF
from msahl.post.draw import style
from msahl.results.read import ResultError
from msahl.study import independent as independent_solutions
from msahl.study import reference_cache, refined_runs
from msahl.study import runs as study_runs
from msahl.study.breakpoints import breakpoints, longest_step
from msahl.study.dynamics import Dynamics
from msahl.study.errors import compute_errors
from msahl.study.independent import Solution, TooSlowError, independent
from msahl.study.page import recommendation
from msahl.study.pictures import pictures
from msahl.study.plan import Plan
from msahl.study.refined_runs import refined_reference
from msahl.study.rounding import MANTISSAS, next_round, round_down, series_index, series_value
from msahl.study.runs import Case, run_in_memory, with_step
from msahl.study.search import Observer, Search
from msahl.study.study import find_reference, study
from tests.events.test_expressions import SCENES, TIMED
from tests.support.models import GROUND, deck

DECK = Path(__file__).parents[2] / "decks" / "thesis" / "double_pendulum_89.xml"
AMPLE = 600.0
"""Budget [s] that no test uses up: its curves end by their errors, on a slow machine as well."""
SOME = ("preserving", "gauss4", "gauss5")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """References are made, not found."""
    monkeypatch.setattr(
        reference_cache.platformdirs, "user_cache_dir", lambda *a, **k: str(tmp_path / "cache")
    )


def pendulum(t_final=2.0):
    return with_step(deck("double_pendulum_89"), 0.002, t_final)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A study of two schemes whose curves end by their errors."""
    with pytest.MonkeyPatch.context() as patch:
        cache = str(tmp_path_factory.mktemp("cache"))
        patch.setattr(reference_cache.platformdirs, "user_cache_dir", lambda *a, **k: cache)
        return study(Plan(pendulum(5.0), schemes=SOME[1:], budget=AMPLE))


# The search --------------------------------------------------------------------------------------


def test_round_numbers():
    for x in (1.0, 0.3, 0.1, 0.125, 7e-5, 1234.5):
        below = round_down(x)
        assert below <= x * (1.0 + 1e-9) < next_round(below) * (1.0 + 1e-9)
        assert float(f"{below:.3g}") == below
    assert [round_down(m) for m in MANTISSAS] == list(MANTISSAS)
    assert [series_value(k) for k in (-2, -1, 0, 1, 2, 3)] == [0.2, 0.5, 1.0, 2.0, 5.0, 10.0]
    assert all(series_index(series_value(k)) == k for k in range(-12, 5))


@pytest.mark.slow
def test_curves_span_the_errors(result):
    for scheme in SOME[1:]:
        _, errors = result.series(scheme, "position")
        assert errors[0] > 1e-2
        # To 1e-10 m, or what the reference itself is good for.
        assert errors[-1] <= max(1e-10, 3.0 * result.reference.error)
        # Steps 2 or 2.5 times smaller: order 8 gains a factor of 1500 at most in between.
        assert (errors[:-1] / errors[1:]).max() < 1e5


def test_the_recommended_step_is_round_and_as_large_as_may_be(result):
    best = result.fastest
    size = best.trial.case.size
    assert best.largest("position") <= result.plan.target
    assert round_down(size) == size
    # Of each scheme's runs the largest step that meets the target, or one that took no longer.
    meeting = [p for p in result.runs if p.meets("position", result.plan.target)]
    assert best.trial.seconds == min(p.trial.seconds for p in meeting)
    of_scheme = [p.trial.case.size for p in meeting if p.trial.scheme == best.trial.scheme]
    above = next_round(max(of_scheme))
    errors = {p.trial.case.size: p.largest("position") for p in result.runs
              if p.trial.scheme == best.trial.scheme}  # fmt: skip
    larger = [errors[s] for s in errors if s >= above]
    assert larger
    assert min(larger) > result.plan.target


def test_the_decks_own_run_is_among_them(result):
    assert result.deck_run.trial.case == Case("preserving", 0.002)
    assert result.deck_run.largest("position") > 0.0


def test_estimates_go_along_with_the_errors(result):
    judged = [
        (p.estimate, p.largest("position"))
        for p in result.runs
        if p.estimate and p.largest("position") > 30.0 * result.reference.error
    ]
    assert len(judged) >= 3
    # The range that estimates of the program keep (docs/validation/error.md).
    assert all(0.3 < estimate / error < 10.0 for estimate, error in judged)


def test_a_study_without_time_has_the_decks_own_run():
    plan = Plan(pendulum(), schemes=SOME)
    found = study(plan, reference=find_reference(plan), until=working_clock())
    assert [p.trial.case for p in found.runs] in ([], [Case("preserving", 0.002)])


@pytest.mark.slow
def test_a_run_that_chooses_its_steps_is_studied():
    told = []
    plan = Plan(pendulum(1.0), schemes=("auto",), budget=AMPLE)
    found = study(plan, report=told.append)
    sizes = {
        p.trial.case.size: p.largest("position") for p in found.runs if p.trial.case.chooses_steps
    }
    # A tolerance is a bound of the error, to twice of it (docs/validation/error.md).
    assert all(error <= 2.0 * size for size, error in sizes.items() if size >= 1e-9)
    assert len(sizes) >= 6
    assert any(line.startswith("auto:") for line in told)


# The reference -----------------------------------------------------------------------------------


def free_body(law, t_final=1.0):
    body = RigidBody("Ball", 1.0, ZERO, ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)), ZERO, ZERO, ZERO,
                     ZERO)  # fmt: skip
    load = ConcentratedLoad("Push", "Ball", ZERO, (1000.0, 0, 0), "Earth", ZERO, "Earth", law)
    return Model(ZERO, (GROUND,), (body,), (), (load,), Simulation("push", 0.01, t_final))


def test_the_reference_does_not_miss_a_pulse():
    # A triangle of 1000 N, 0.2 ms wide, about t = 0.5 s: 0.1 N s at 0.5 s by symmetry.
    table = Law("linear", (0.4999, 0.5, 0.5001, 0.0, 1.0, 0.0))
    model = free_body(table)
    times = np.linspace(0.0, 1.0, 101)
    reference = independent(model, times, 1e-6)
    assert reference.horizon == 1.0
    after = times > 0.501
    x = reference.states(times)[after, 0]
    # The pulse is a polynomial piece by piece, which DOP853 integrates to round-off.
    np.testing.assert_allclose(x, 0.1 * (times[after] - 0.5), atol=1e-14)


@pytest.mark.slow
def test_the_reference_does_not_alias_a_sine():
    omega = 2.0 * np.pi * 400.0
    model = free_body(Law("sine", (1.0, omega, np.pi / 2.0, 0.0)), 0.1)
    times = np.linspace(0.0, 0.1, 11)
    x = independent(model, times, 1e-6).states(times)[:, 0]
    # Amplitude 1.6e-4 m, at a relative tolerance of 1e-13 a step.
    np.testing.assert_allclose(x, 1000.0 * (1.0 - np.cos(omega * times)) / omega**2, atol=1e-12)


def test_breakpoints_of_laws():
    ramp, table = Law("ramp", (0.0, 1.0, 0.25, 0.5)), Law("periodic", (0, 0.1, 0.2, 0, 1, 0))
    np.testing.assert_allclose(breakpoints(free_body(ramp), 1.0), [0.25, 0.5], rtol=1e-12)
    np.testing.assert_allclose(breakpoints(free_body(table), 1.0), np.arange(1, 10) / 10, rtol=1e-9)
    assert breakpoints(free_body(Law("constant", (1.0,))), 1.0).size == 0
    assert longest_step(free_body(Law("sine", (1.0, 2.0 * np.pi, 0.0, 0.0)))) == pytest.approx(0.25)


@pytest.mark.parametrize(
    "scene", ["spike", "spikes", "square wave", "sampled", "two-point control"]
)
def test_changes_of_expressions_are_met(scene):
    """Known times end steps; jumps of the motion are met by short ones, to 1e-13 s each."""
    model, exact = {**TIMED, **SCENES}[scene]
    x = independent(model, np.linspace(0.0, 1.0, 11), 1e-6).states(np.array([1.0]))[0, 2]
    assert x == pytest.approx(exact(1.0), abs=5e-11)


def test_a_solution_is_known_at_any_time():
    # DOP853's polynomials are good to its tolerance of a step, 1e-13 of metres, times a few.
    times = np.linspace(0.0, 2.0, 21)
    reference = independent(pendulum(), times, 1e-6)
    odd = np.sort(np.random.default_rng(1).uniform(0.0, 2.0, 50))
    one = reference.states(odd)
    other = independent(replace(pendulum(2.5)), np.linspace(0.0, 2.5, 26), 1e-6).states(odd)
    np.testing.assert_allclose(one, other, atol=1e-10)


def test_forces_of_a_spring_that_rotates_fast_between_rows():
    # In the second between two rows the wheel makes up to a revolution. Its mass is off the axle,
    # so that the spring's moment, by the angle counted over all revolutions, is in the reaction.
    model = with_step(deck("torsional_spring"), 0.05, 5.0, "gauss5")
    (joint,), (wire,) = model.joints, model.loads
    off = replace(joint, child_point=(0.2, 0.0, 0.0), parent_point=(0.2, 0.0, 0.0))
    model = replace(model, joints=(off,), loads=(replace(wire, damping=0.0),))
    _, run = run_in_memory(model, Options(error=OFF, every=20))
    assert np.abs(run.states.iloc[:, 12]).max() * 1.0 > np.pi  # rad in a second
    errors = compute_errors(run, independent(model, np.linspace(0.0, 5.0, 501), 1e-6))
    # A revolution too few is a moment of 2 pi 0.05 N m, and 1 N at the axle; errors of the states
    # are 1e-9 m and less.
    assert errors.statistics["instantaneous_reaction"].max < 1e-6


def test_own_runs_as_the_reference():
    model = pendulum()
    nothing = Solution(np.zeros(1), np.zeros((0, 8, 26)))
    found = refined_reference(model, 1e-6, AMPLE, nothing)
    assert "msahl itself" in found.description
    times = found.times[found.times > 0.0]
    true = independent(model, times, 1e-6).states(times)
    apart = np.abs(found.states(times) - true).reshape(len(times), 2, 12)[:, :, :3].max()
    # The finer of two runs is better than what they differ by, but for the other's own error.
    assert apart <= found.error + 1e-11
    assert np.isnan(found.states(np.array([0.01234]))).all()


def test_what_takes_too_long_is_not_waited_for():
    times = np.linspace(0.0, 2.0, 11)
    with pytest.raises(TooSlowError):
        independent(pendulum(), times, 1e-6, seconds=0.0)
    nothing = Solution(np.zeros(1), np.zeros((0, 8, 26)))
    with pytest.raises(ResultError, match="--budget"):
        refined_reference(pendulum(), 1e-6, 0.0, nothing)


def test_a_reference_is_found_where_large_steps_take_long(monkeypatch):
    """Runs at large steps are given up, by a clock of their own iterations."""
    asked, clock = [], [0.0]

    def run(model, options, stopped):
        asked.append(model.simulation.dt)
        slow = model.simulation.dt > 0.011
        for _ in range(1000 if slow else 1):
            clock[0] += 0.1
            if stopped():
                return SimpleNamespace(status="interrupted"), None
        return run_in_memory(model, options)

    monkeypatch.setattr(refined_runs, "run_in_memory", run)
    monkeypatch.setattr(refined_runs, "working_clock", lambda: clock[0])
    nothing = Solution(np.zeros(1), np.zeros((0, 8, 26)))
    model = pendulum(1.0)
    found = refined_reference(model, 1e-6, 10.0, nothing)
    assert found.horizon == 1.0
    assert asked[:3] == [0.02, 0.01, 0.005]


def test_stiff_systems_do_not_use_up_the_time_of_a_reference(monkeypatch):
    """Of which the explicit method would solve a part only."""
    clock = [0.0]

    def rates(self, t, y):
        clock[0] += 1.0
        return found(self, t, y)

    found = Dynamics.rates
    monkeypatch.setattr(Dynamics, "rates", rates)
    monkeypatch.setattr(independent_solutions, "working_clock", lambda: clock[0])
    times = np.linspace(0.0, 2.0, 51)
    with pytest.raises(TooSlowError):
        independent(pendulum(), times, 1.1e-6, seconds=400.0)
    # A quarter of them, and the steps in which they were exceeded.
    assert clock[0] < 150.0


def test_the_time_of_other_programs_is_not_counted(monkeypatch):
    """Neither by the clock of a study nor in the seconds of its runs."""
    before = working_clock()
    time.sleep(0.4)
    assert working_clock() - before < 0.2
    for name, times in (("time", [0.0, 10.0]), ("working_clock", [0.0, 2.5])):
        clock = iter(times).__next__
        changed = SimpleNamespace(perf_counter=clock) if name == "time" else clock
        monkeypatch.setattr(study_runs, name, changed)
    report = SimpleNamespace(seconds={"loop": 8.0, "output": 1.0})
    monkeypatch.setattr(study_runs, "run", lambda *_, **__: report)
    study_runs._timed_run(None, None, None, bool)
    assert report.seconds == {"loop": 2.0, "output": 0.25}


def test_no_curve_begins_at_steps_that_were_too_large_for_another():
    plan = Plan(pendulum(1.0), schemes=(*SOME, "auto"))
    search = Search(plan, find_reference(plan), None, 1.0, Observer(bool, str, str))
    begun, *others = search.curves
    before = [curve.first for curve in others]
    search._give_up(begun, begun.first)
    assert begun.coarsest
    assert {curve.first for curve in others if curve.scheme != "auto"} == {begun.first}
    assert others[-1].first == before[-1]
    assert begun.first == before[0] - 1


def test_a_prescribed_motion_has_breaks():
    motion = JointMotion("Rotation", "Axle", "angle", Law("ramp", (0.0, 1.0, 0.5, 1.5)))
    model = replace(deck("torsional_spring"), motions=(motion,))
    np.testing.assert_allclose(breakpoints(model, 5.0), [0.5, 1.5], rtol=1e-12)


# The report --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_command_and_its_recommendation(tmp_path):
    out = tmp_path / "study"
    words = [str(DECK), "--t-final", "2", "--scheme", "gauss5", "--target", "1e-4"]
    found = CliRunner().invoke(command, [*words, "--budget", "60", "-o", str(out)])
    assert found.exit_code == 0, found.output
    assert f"{DECK}: gauss5: " in found.stderr  # a line of each curve
    html, text = (out / "study.html").read_text(), (out / "study.md").read_text()
    # The picture comes before the first table; all that is not the answer is folded.
    assert html.index("<figure") < html.index("<details>")
    assert html.index("<figure") < html.index("<table")
    assert text.index("error-time.png") < text.index("| run |")
    for name in ("error-time.png", "all-errors-time.png", "error-step.png"):
        assert (out / name).stat().st_size > 1000
    line = text.split("at every output time is:\n\n    msahl ")[1].splitlines()[0].split()
    run = CliRunner().invoke(main, [*line, "-q", "-o", str(tmp_path / "run")])
    assert run.exit_code == 0, run.output
    states = pd.read_csv(tmp_path / "run" / "states.csv").to_numpy()
    true = independent(pendulum(), states[:, 0], 1e-6).states(states[:, 0])
    error = (states[:, 1:] - true).reshape(-1, 2, 12)[:, :, :3]
    assert np.sqrt((error**2).sum(axis=2)).max() <= 1e-4
    assert "complete command" in text
    assert "than the run with the deck's own settings" in text


@pytest.mark.slow
def test_an_error_that_is_round_off_is_reported():
    # The wheel rotates about its own reference point, which rests: positions show nothing.
    model = with_step(deck("torsional_spring"), 0.05, 0.5)
    found = study(Plan(model, (0.05, 0.025), ("preserving",), repeats=1))
    assert "choose another --metric" in recommendation(found)
    with style():
        for _, _, figure in pictures(found):
            figure.canvas.draw()  # warnings, of axes without a range, are errors here
    other = study(Plan(model, (0.05, 0.025), ("preserving",), repeats=1, metric="orientation"))
    assert "choose another --metric" not in recommendation(other)


def test_steps_of_a_scheme_that_chooses_them_are_refused(tmp_path):
    words = [str(DECK), "--scheme", "auto", "--dt", "0.1", "-o", str(tmp_path)]
    found = CliRunner().invoke(command, words)
    assert found.exit_code == 2
    assert "chooses its step size" in found.stderr
