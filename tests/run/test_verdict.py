"""The verdict on a run: every check at its limits, against true errors, in the commands."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import msahl
from msahl.algebra.rotation_arrays import angles
from msahl.algebra.vector import ZERO
from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.model import Joint, Limits, SpringDamper
from msahl.model.scheme import ORDER_TWO
from msahl.model.settings import EQUILIBRIUM
from msahl.post.cli import main as post
from msahl.run.companion import SAFETY
from msahl.run.verdict import DONE, FAIL, PASS, WARN, WARN_FACTOR, WORDS, Figures, judge
from tests.schemes.midpoint.test_decaying import oscillator
from tests.support.closed_forms import recognise
from tests.support.models import (
    DECKS,
    DOWN,
    ELASTIC,
    GROUND,
    ROOT,
    body,
    build_model,
    chain,
    deck,
    pendulum,
)
from tests.support.models import (
    simulate_and_estimate as simulate,
)

GOOD = Figures(
    status="completed",
    time=10.0,
    steps=1000,
    iterations=2000,
    subdivisions=0,
    scipy_steps=1,
    path_steps=0,
    joints=2,
    dt=0.01,
    order=2,
    conserves=True,
    works=False,
    by_cayley=True,
    tolerance=None,
    local_tolerance=None,
    length=5.0,
    energy_size=100.0,
    extremes={
        "largestKineticEnergy": 50.0,
        "energyErrorMax": 1e-12,
        "energyErrorMaxRelative": 2e-14,
        "constraintViolationMax": 1e-15,
        "constraintViolationRateMax": 1e-4,
        "constraintWorkMax": 1e-13,
        "speedMax": 7.0,
        "rotationPerStepMax": 0.01,
        "distanceMax": 5.0,
        "displacementMax": 4.0,
        "localErrorMax": 1e-6,
        "localErrorSum": 1e-3,
    },
    momentum=(1e-15, 1e-14),
    pivot_ratio=1e4,
    velocity_change=0.0,
    non_unique_reactions={},
    error={"position": 4e-4, "orientation": 5e-4, "companion": "half the step", "complete": True},
    horizon=lambda accuracy: 4.0,
)


def erring(**changes):
    """An estimated error; the accuracy asked is 1 mm unless given."""
    return {"error": GOOD.error | {"accuracy": 1e-3} | changes}


def with_extremes(**changes):
    return {"extremes": GOOD.extremes | changes}


def higher(**changes):
    return {"error": None, **with_extremes(localErrorMax=None, localErrorSum=None, **changes)}


def at_rest(between=None):
    """The extremes of a run in which nothing moves, with an error between steps [J]."""
    return with_extremes(
        largestKineticEnergy=0.0,
        energyErrorMax=0.0,
        energyErrorMaxRelative=None,
        energyErrorBetweenSteps=between,
    )


def energy_off_by(error):
    return with_extremes(energyErrorMax=50.0 * error, energyErrorMaxRelative=error)


# Each case: what differs from the good run, limits of the deck, the check it is for, its word.
CASES = {
    "interrupted": ({"status": "interrupted"}, {}, "completion", WARN),
    "not converged": ({"status": "not converged"}, {}, "completion", FAIL),
    "energy just kept": (energy_off_by(0.9e-8), {}, "energy", PASS),
    "energy hardly kept": (energy_off_by(1.1e-8), {}, "energy", WARN),
    "energy not kept": (energy_off_by(0.9e-3), {}, "energy", WARN),
    "energy lost": (energy_off_by(1.1e-3), {}, "energy", FAIL),
    "energy as the deck asks": (energy_off_by(1e-4), {"energy": 1e-3}, "energy", PASS),
    "energy not as the deck asks": (energy_off_by(1e-4), {"energy": 1e-6}, "energy", FAIL),
    # Ten times the accuracy asked for over the length, 2e-3.
    "energy of gauss as accurate as asked": (
        {"conserves": False, **energy_off_by(1.9e-3), **erring()},
        {},
        "energy",
        PASS,
    ),
    "energy of gauss less accurate than asked": (
        {"conserves": False, **energy_off_by(2.1e-3), **erring()},
        {},
        "energy",
        WARN,
    ),
    "energy of gauss without an estimate": (
        {"conserves": False, "error": None, **energy_off_by(1.1e-3)},
        {},
        "energy",
        WARN,
    ),
    "energy of gauss lost": ({"conserves": False, **energy_off_by(0.2)}, {}, "energy", FAIL),
    "energy unknown": (energy_off_by(float("nan")), {}, "energy", FAIL),
    # Both potential and kinetic energy are known to 2e-16 of the larger one only.
    "energy below the round-off of its terms": (
        {"energy_size": 1e10, **energy_off_by(1e-7)},
        {},
        "energy",
        PASS,
    ),
    "at rest": (at_rest(), {}, "energy", PASS),
    # Of energies of 100 J.
    # Of a motion that is smaller than the tolerance nothing was asked for, its energy neither.
    "energy between steps of a motion within the tolerance": (
        {
            "tolerance": 1e-3,
            "conserves": False,
            **with_extremes(
                displacementMax=1e-7, rotationPerStepMax=1e-9, energyErrorBetweenSteps=1e4
            ),
        },
        {},
        "energy",
        PASS,
    ),
    "energy between steps of a motion above the tolerance": (
        {
            "tolerance": 1e-3,
            "conserves": False,
            **with_extremes(
                displacementMax=1e-2, rotationPerStepMax=1e-9, energyErrorBetweenSteps=1e4
            ),
        },
        {},
        "energy",
        FAIL,
    ),
    "at rest, with round-off between long steps": (at_rest(0.9e-7), {}, "energy", PASS),
    "at rest, with other energies between steps": (at_rest(1.1e-7), {}, "energy", FAIL),
    "momentum lost": ({"momentum": (1e-3, None)}, {}, "linearMomentum", FAIL),
    "angular momentum hardly kept": ({"momentum": (None, 5e-9)}, {}, "angularMomentum", WARN),
    "a joint open": (with_extremes(constraintViolationMax=1e-6), {}, "constraintViolation", WARN),
    "a joint wide open": (
        with_extremes(constraintViolationMax=1e-3),
        {},
        "constraintViolation",
        FAIL,
    ),
    "a joint as open as the deck lets it": (
        with_extremes(constraintViolationMax=1e-6),
        {"violation": 1e-6},
        "constraintViolation",
        PASS,
    ),
    "far from the origin": (
        with_extremes(constraintViolationMax=1e-6, distanceMax=1e9),
        {},
        "constraintViolation",
        PASS,
    ),
    "fast constraint violation at velocity level": (
        with_extremes(constraintViolationRateMax=1.0),
        {},
        "constraintViolationRate",
        WARN,
    ),
    "joints work": (with_extremes(constraintWorkMax=1e-3), {}, "constraintWork", WARN),
    "halved": ({"subdivisions": 3}, {}, "solver", WARN),
    "near singular": ({"pivot_ratio": 1e14}, {}, "pivotRatio", WARN),
    "not unique": ({"non_unique_reactions": {"A": ["Fz", "Mx"]}}, {}, "reactions", PASS),
    "velocities changed": ({"velocity_change": 0.1}, {}, "initialVelocities", WARN),
    "accurate": (erring(), {}, "accuracy", PASS),
    # Limits are parts of the model's size, here the longest body, 5 m.
    "accurate, where nothing is asked": (
        erring(position=0.049, accuracy=None),
        {},
        "accuracy",
        PASS,
    ),
    "a hundredth of the size": (erring(position=0.051, accuracy=None), {}, "accuracy", WARN),
    "nearly a third of the size": (erring(position=1.49, accuracy=None), {}, "accuracy", WARN),
    "a third of the size": (erring(position=1.51, accuracy=None), {}, "accuracy", FAIL),
    "a little inaccurate": (erring(orientation=5e-3), {}, "accuracy", WARN),
    "inaccurate": (erring(position=2e-2), {}, "accuracy", FAIL),
    "not as accurate as a generous deck asks": (
        erring(position=1.6, accuracy=1.0),
        {},
        "accuracy",
        FAIL,
    ),
    "an unknown error": (erring(position=float("nan")), {}, "accuracy", FAIL),
    "beyond the tolerance": ({"tolerance": 1e-6, **erring(accuracy=None)}, {}, "accuracy", WARN),
    "within the tolerance": ({"tolerance": 1e-3, **erring(accuracy=None)}, {}, "accuracy", PASS),
    "not estimated": ({"error": None}, {}, "accuracy", DONE),
    "coarse": ({"error": None, **with_extremes(localErrorSum=0.06)}, {}, "accuracy", WARN),
    "local errors beyond their tolerance": (
        {"error": None, "local_tolerance": 1e-4},
        {},
        "accuracy",
        WARN,
    ),
    "a scheme that took a little": (higher(energyTaken=0.4), {}, "accuracy", DONE),
    "a scheme that took much": (higher(energyTaken=0.6), {}, "accuracy", WARN),
    "a scheme that took it before anything moved": (
        higher(energyTaken=0.1, largestKineticEnergy=0.0, energyErrorMaxRelative=None),
        {},
        "accuracy",
        DONE,
    ),
    # The displacement of a step is 0.07 m, less 0.05 m that may be the rotation.
    "to and fro within a step": (higher(displacementMax=0.009), {}, "accuracy", WARN),
    "to and fro in some steps": (higher(displacementMax=0.011), {}, "accuracy", DONE),
    # The run at half the step came to no end: what it was beside agrees, but not to the end.
    "half the step stopped": (
        erring(complete=False, until=4.0),
        {},
        "accuracy",
        WARN,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_each_check_covers_its_limits(case):
    changes, limits, check, word = CASES[case]
    verdict = judge(replace(GOOD, **changes), Limits(**limits))
    found = {finding.check: finding for finding in verdict.findings}
    assert found[check].word == word
    # Nothing else is wrong with this run.
    assert verdict.word == word
    assert verdict.reasons == ([found[check].text] if word in (WARN, FAIL) else [])


def test_the_worst_comes_first():
    changes = {"velocity_change": 0.1, **energy_off_by(1.0), "subdivisions": 1}
    verdict = judge(replace(GOOD, **changes), Limits())
    assert verdict.word == FAIL
    assert "energy" in verdict.reasons[0]
    assert len(verdict.reasons) == 3


def test_a_remedy_is_reported_where_the_step_is_coarse():
    verdict = judge(replace(GOOD, error=None, **with_extremes(localErrorSum=0.2)), Limits())
    # Four times too much: the error falls with the square of the step.
    assert "try --dt 0.005, or" in verdict.reasons[0]
    verdict = judge(replace(GOOD, **erring(position=0.1, accuracy=None)), Limits())
    # Twice too much, and half of what is left aimed at.
    assert "within 5.0e-02 m up to t = 4 s; try --dt 0.005 or" in verdict.reasons[0]
    # Of order 10 the step is 13 % shorter: in one digit it would be the same.
    coarse = replace(GOOD, **erring(position=0.1, accuracy=None), dt=0.02, order=10)
    assert "try --dt 0.017 or" in judge(coarse, Limits()).reasons[0]


@pytest.mark.parametrize(
    ("error", "tolerance", "word"),
    [(0.1, 0.2, PASS), (0.1, None, WARN), (1.6, 2.0, WARN), (float("nan"), 2.0, FAIL)],
)
def test_a_tolerance_that_is_met_is_not_too_loose_to_pass(error, tolerance, word):
    """A model of 5 m: a tolerance of more than 1 % of it is what the user asked for."""
    erred = erring(position=error, accuracy=None)
    assert judge(replace(GOOD, **erred, tolerance=tolerance), Limits()).word == word


@pytest.mark.parametrize("name", ["single_pendulum_45", "single_pendulum_135", "top_3"])
@pytest.mark.parametrize("dt", [0.02, 0.005])
def test_local_errors_add_up_to_about_the_true_one(name, dt):
    model = deck(name)
    run = simulate(model, dt=dt, t_final=10.0)
    exact = recognise(run.model).states(run.time).reshape(len(run.time), 12)
    error = np.linalg.norm(run.of("position") - exact[:, :3], axis=1).max()
    rotation = angles(run.of("orientation"), exact[:, 3:6]).max()
    length = np.linalg.norm(model.joints[0].child_point)
    # Local errors of one sign add up, those of changing sign partly cancel: estimated from above.
    ratio = run.report.extremes["localErrorSum"] / max(error, rotation * length)
    assert 0.8 < ratio < 5.0


def test_two_runs_know_the_error():
    model = pendulum()
    run = simulate(model, dt=0.01, t_final=10.0, accuracy=1e-2)
    exact = recognise(run.model).states(run.time).reshape(len(run.time), 12)
    error = np.linalg.norm(run.of("position") - exact[:, :3], axis=1).max()
    # Terms of order 4 are 2 % at this step.
    assert run.report.error["position"] == pytest.approx(SAFETY * error, rel=0.02)
    assert run.report.error["trustHorizon"] == 10.0
    assert np.array_equal(run.errors[:, 0], run.time)
    assert run.errors[:, 1].max() == run.report.error["position"]
    assert run.report.verdict["checks"]["accuracy"]["word"] == PASS


@pytest.mark.parametrize("every", [1, 7])
def test_the_companion_is_the_run_at_half_the_step(every):
    """The last step is shorter, and rows are thinned: still the same times are compared."""
    model = chain(3)
    model = replace(model, gravity=DOWN)
    run = simulate(model, dt=0.01, t_final=1.997, every=every, accuracy=1.0)
    half = simulate(model, dt=0.005, t_final=1.997)
    rows = np.searchsorted(half.time, run.time - 1e-9)
    assert np.allclose(half.time[rows], run.time)
    apart = max(
        np.linalg.norm(run.of("position", b) - half.of("position", b)[rows], axis=1).max()
        for b in range(3)
    )
    # The last of the half steps differs: 0.007 s in two, and in 0.005 and 0.002.
    estimate = SAFETY / (1.0 - 0.5**2) * apart
    assert run.report.error["position"] == pytest.approx(estimate, rel=1e-2)


@pytest.mark.parametrize("scheme", ["gauss", "radau"])
def test_a_scheme_of_higher_order_is_judged_by_two_runs(scheme):
    model = pendulum()
    simulation = replace(model.simulation, dt=0.05, t_final=10.0, scheme=scheme, degree=3)
    model = replace(model, simulation=simulation)
    alone = simulate(model, error="off").report.verdict
    assert alone["word"] == DONE
    assert alone["checks"]["accuracy"]["text"] == "error not estimated (use --error estimate)"
    run = simulate(model, accuracy=1e-6)
    exact = recognise(run.model).states(run.time).reshape(len(run.time), 12)
    error = np.linalg.norm(run.of("position") - exact[:, :3], axis=1).max()
    assert run.report.error["position"] == pytest.approx(SAFETY * error, rel=0.1)
    assert run.report.verdict["checks"]["energy"]["word"] == PASS
    assert run.report.verdict["checks"]["accuracy"]["word"] == PASS


def test_a_chaotic_run_is_trusted_to_a_horizon():
    run = simulate(deck("chaos_90"), accuracy=1e-3)
    error, verdict = run.report.error, run.report.verdict
    assert verdict["word"] == FAIL
    # 89.99 and 90 degrees part at about that time as well (docs/validation/thesis.md).
    assert 15.0 < error["trustHorizon"] < 30.0
    assert f"within 1.0e-03 m up to t = {error['trustHorizon']:g} s" in verdict["reasons"][0]
    assert run.report.status == "completed"


def test_the_companion_changes_nothing():
    with_it, without = (simulate(pendulum(), t_final=1.0, accuracy=s) for s in (1e-3, None))
    assert np.array_equal(with_it.states, without.states)
    assert np.array_equal(with_it.reactions, without.reactions)
    assert with_it.report.iterations == without.report.iterations


@pytest.mark.parametrize("scheme", ORDER_TWO)
def test_a_spring_faster_than_the_step_is_not_passed(scheme):
    """At 1 m/s a period of 3 ms is an amplitude of 0.5 mm, one of 10 ns of 1.6 nm; what the step
    takes it for is not known to the run."""
    for period in (3e-3, 1e-8):
        run = simulate(oscillator(period), dt=0.01, t_final=1.0, scheme=scheme, accuracy=1e-5)
        assert run.report.verdict["checks"]["accuracy"]["word"] != PASS
        assert run.report.error["position"] >= period / (2.0 * np.pi)


@pytest.mark.parametrize("scheme", ["gauss2", "gauss3", "radau1", "radau3"])
def test_nor_by_a_scheme_of_higher_order(scheme):
    """Gauss swings it as it likes, radau takes it at once: both are the same at half the step."""
    for period in (3e-3, 1e-8):
        model = oscillator(period)
        run = simulate(model, dt=0.01, t_final=1.0, scheme=scheme, accuracy=1e-5)
        assert run.report.verdict["checks"]["accuracy"]["word"] != PASS
        assert run.report.error["position"] >= period / (2.0 * np.pi)
        if period < 1e-3:
            alone = simulate(model, dt=0.01, t_final=1.0, scheme=scheme, error="off")
            assert alone.report.verdict["word"] == WARN


def test_a_pendulum_that_is_slowed_by_its_scheme_is_not_passed():
    """By radau1, of order 1: at 0.01 s the swing of 5 m is 0.45 m off within 10 s."""
    words = {s: simulate(pendulum(), dt=0.01, t_final=10.0, scheme=s) for s in ("radau1", "radau3")}
    reasons = words["radau1"].report.verdict["reasons"]
    assert len(reasons) == 1
    assert "position error at most" in reasons[0]
    assert words["radau3"].report.verdict["word"] == PASS


def linked(**others):
    """Two bodies thrown off with a spring between them."""
    bodies = [
        body("A", 1.0, (0.1, 0.2, 0.25), angular_velocity=(0.3, 2.0, 0.1)),
        body("B", 2.0, 0.3, (1.0, 0.2, 0.0), velocity=(0.0, 3.0, 1.0)),
    ]
    link = SpringDamper("Link", "A", "B", (0.1, 0.0, 0.0), (0.0, 0.1, 0.0), 50.0, 1.0)
    return build_model(bodies, loads=[link], gravity=DOWN, t_final=2.0, **others)


def test_momentum_is_looked_at_where_it_is_kept():
    checks = simulate(linked()).report.verdict["checks"]
    assert checks["linearMomentum"]["word"] == PASS
    assert checks["angularMomentum"]["word"] == PASS
    assert "linearMomentum" not in simulate(pendulum(), t_final=0.1).report.verdict["checks"]
    # The decaying scheme keeps the angular one to its order only.
    checks = simulate(linked(), scheme="decaying").report.verdict["checks"]
    assert checks["linearMomentum"]["word"] == PASS
    assert "angularMomentum" not in checks


def test_momentum_has_the_size_that_speeds_may_give_it():
    """Two balls vibrate along the line through both, without angular momentum but for round-off;
    half a period after their start they rest again, without any.
    """
    balls = [body("A", 1.0), body("B", 1.0, position=(1.2, 0.4, 0.0))]
    link = SpringDamper("Link", "A", "B", ZERO, ZERO, 50.0, 0.0, free_length=1.0)
    half = math.pi / 10.0  # omega^2 = 2 k/m
    for t_final in (half, 1.5 * half):
        run = simulate(build_model(balls, loads=[link]), half / 50.0, t_final, "gauss4")
        assert run.report.verdict["word"] == PASS
        assert {"linearMomentum", "angularMomentum"} <= set(run.report.verdict["checks"])


TEMPLATES = sorted((ROOT / "msahl" / "deck" / "templates").glob("*.xml"))


@pytest.mark.sampled
@pytest.mark.parametrize("path", [*DECKS, *ELASTIC, *TEMPLATES], ids=lambda path: path.stem)
def test_a_deck_passes_or_says_why_not(path):
    """In its header, as in "Verdict: WARN: ..."."""
    said = re.search("Verdict: (WARN|FAIL): ", path.read_text().split("-->")[0])
    model = read_deck(path)
    begins = model.simulation.start == EQUILIBRIUM
    word = msahl.load(path).run().verdict if begins else simulate(model).report.verdict["word"]
    assert word == (said.group(1) if said else PASS)


# commands ----------------------------------------------------------------------------------------


def call(command, *words):
    return CliRunner().invoke(command, [str(word) for word in words])


def path_of(name):
    (path,) = [path for path in DECKS if path.stem == name]
    return path


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Folders of a run of each word."""
    folder = tmp_path_factory.mktemp("runs")
    options = {
        PASS: (path_of("single_pendulum_45"), "--t-final", 1),
        DONE: (path_of("single_pendulum_45"), "--t-final", 1, "--error", "local"),
        WARN: (path_of("top_2"), "--t-final", 1),
        FAIL: (path_of("single_pendulum_45"), "--dt", 0.1, "--accuracy", 1e-6),
    }
    for word, words in options.items():
        result = call(main, "run", *words, "-o", folder / word)
        assert result.exit_code == (word == FAIL)
        assert result.stderr.splitlines()[-1].startswith(f"{words[0]}: {word}: ")
    return folder


def test_run_json_holds_the_verdict(runs):
    for word in WORDS:
        verdict = json.loads((runs / word / "run.json").read_text())["verdict"]
        assert verdict["word"] == word
        assert bool(verdict["reasons"]) == (word in (WARN, FAIL))


def test_verdicts_are_tabulated_and_filtered(runs):
    folders = [runs / word for word in WORDS]
    result = call(post, "verdict", *folders)
    assert result.exit_code == 1
    assert [line.split()[1] for line in result.stdout.splitlines()[1:]] == list(WORDS)
    result = call(post, "verdict", *folders, "--only", PASS, "--only", WARN, "--names")
    assert result.stdout.splitlines() == [str(runs / PASS), str(runs / WARN)]
    assert result.exit_code == 1
    assert call(post, "verdict", runs / PASS, runs / WARN).exit_code == 0
    (row,) = json.loads(call(post, "verdict", runs / FAIL, "--json").stdout)
    assert row["trusted"] < 10.0
    assert "within 1.0e-06 m up to" in row["reasons"]


def test_a_run_cut_off_by_force_has_failed(runs, tmp_path):
    (tmp_path / "states.csv.part").write_text("time\n")
    result = call(post, "verdict", tmp_path)
    assert result.exit_code == 1
    assert "the run was killed" in result.stdout
    result = call(post, "verdict", tmp_path / "nothing")
    assert result.exit_code == 2
    assert "no verdict" in result.stderr


def test_quiet_runs_tell_failures_alone(tmp_path):
    deck_path = path_of("single_pendulum_45")
    for accuracy, told in ((1e-6, True), (1.0, False)):
        words = ("--dt", 0.1, "--accuracy", accuracy, "-q", "-o", tmp_path)
        assert ("FAIL" in call(main, "run", deck_path, *words).stderr) == told


def test_a_deck_asks_for_its_accuracy(tmp_path):
    text = path_of("single_pendulum_45").read_text()
    wish = '<verdict><accuracy units="mm">2</accuracy><energy>1e-9</energy></verdict></simulation>'
    path = tmp_path / "deck.xml"
    path.write_text(text.replace("</simulation>", wish))
    limits = read_deck(path).simulation.limits
    assert limits == Limits(accuracy=2e-3, energy=1e-9)
    for dt, word in ((0.01, PASS), (0.1, FAIL)):
        result = call(main, "run", path, "--dt", dt, "-o", tmp_path / "run")
        told = json.loads((tmp_path / "run" / "run.json").read_text())
        assert (result.exit_code, told["verdict"]["word"]) == (word == FAIL, word)
        assert told["error"]["accuracy"] == 2e-3


@pytest.mark.slow
def test_the_report_gives_the_verdict(runs):
    assert call(post, "report", runs / WARN).exit_code == 0
    text = (runs / WARN / "report" / "report.md").read_text()
    assert "**WARN**: Use the results with" in text
    assert "| Initial velocities | WARN |" in text


def test_the_limit_to_fail_is_well_above_the_limit_to_warn():
    """Two runs that both err by the tolerance may differ by twice as much, not by ten times."""
    assert WARN_FACTOR > 2.0


ALONG_Y = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@pytest.mark.parametrize("scheme", ["preserving", "gauss2", "radau2"])
def test_a_body_at_rest_in_the_origin_passes(scheme):
    """Nothing is large there: distances are zero, and all speeds are the round-off of gravity."""
    bob = body("Bob", 1.9245, (0.078, 0.0677, 0.0551))
    guide = Joint("Guide", "prismatic", GROUND.name, "Bob", ZERO, ZERO, ALONG_Y, ALONG_Y)
    run = simulate(build_model([bob], [guide], gravity=DOWN), scheme=scheme)
    assert run.report.verdict["word"] == PASS, run.report.verdict["reasons"]


def test_the_line_says_which_energy_and_which_size_it_means():
    """A throw over 79 m, 0.62 m wrong; a model in which something does work."""
    far = with_extremes(displacementMax=79.0)
    given = {"error": GOOD.error | {"position": 0.62, "orientation": 0.0}, **far}
    checks = judge(replace(GOOD, **given), Limits()).as_json()["checks"]
    assert checks["accuracy"]["text"].endswith("6.2e-01 m, 0.008 of the largest displacement, 79 m")
    assert checks["energy"]["text"] == "energy conserved to 2.0e-14 of the largest kinetic energy"
    checks = judge(replace(GOOD, works=True), Limits()).as_json()["checks"]
    assert checks["accuracy"]["text"].endswith("0.0001 of the longest body, 5 m")
    assert checks["energy"]["text"].startswith("energy balance closed to 2.0e-14 of the largest")
