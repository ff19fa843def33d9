"""Errors of states, signals, loads of actuators and reactions: estimated, written and judged."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.vector import ZERO
from msahl.elements.signals.group import MIDPOINT, new_stages
from msahl.expressions.syntax import parse
from msahl.jit.storage import arrays_in
from msahl.model import Joint, JointActuator, Limits, Signal, SignalState
from msahl.run.signal_errors import LISTED, SIGNAL, STATE, with_largest
from msahl.run.tables import error_columns
from msahl.run.verdict import PASS, WARN, judge
from msahl.system.build import build_system
from tests.physics.test_actuators import motor, motor_exactly
from tests.run.test_verdict import GOOD
from tests.support.loops import bennett
from tests.support.models import GROUND, body, build_model
from tests.support.models import simulate_and_estimate as simulate


def checks(run):
    return {name: check["word"] for name, check in run.report.verdict["checks"].items()}


@pytest.mark.parametrize(("scheme", "dt"), [("preserving", 0.02), ("gauss2", 0.1), ("radau2", 0.1)])
def test_the_error_of_a_state_and_of_a_load_is_estimated(scheme, dt):
    """The current of a motor against its closed form, at every output time."""
    run = simulate(motor(), dt, 0.6, scheme, solver="newton")
    names = error_columns(run.model)
    assert names[1:] == ["position", "orientation"] + [
        f"{name}.estimatedError" for name in ("i", "P", "Motor.load", "Motor.power")
    ]
    true = np.abs(run.signals[:, 1] - [motor_exactly(t)[1] for t in run.time])
    told = true > 0.1 * true.max()
    ratio = run.errors[told, names.index("i.estimatedError")] / true[told]
    assert (ratio > 0.3).all()
    assert (ratio < 10.0).all()
    of_run = run.report.error["signals"]["i"]
    assert of_run["error"] == run.errors[:, names.index("i.estimatedError")].max()
    assert of_run["largest"] == np.abs(run.signals[:, 1]).max()


def on_a_rail(states, load="0", shown=()):
    """A mass on a rail with these auxiliary states, on which a load depends."""
    rail = Joint("Rail", "prismatic", GROUND.name, "Bob", ZERO, ZERO)
    signals = (*states, *shown)
    loads = [JointActuator("Ram", "Rail", "slide", parse(load))]
    return build_model([body(velocity=(0.0, 0.0, 1.0))], [rail], loads, signals=signals)


@pytest.mark.parametrize("scheme", ["preserving", "gauss2", "radau2"])
def test_a_state_that_no_step_resolves_is_not_passed(scheme):
    """An oscillation of 100 rad/s by steps of 0.1 s, of which no position depends."""
    states = SignalState("a", parse("100*b"), 1.0), SignalState("b", parse("-100*a"))
    run = simulate(on_a_rail(states), 0.1, 2.0, scheme, solver="newton")
    assert checks(run)["accuracy"] == PASS
    assert checks(run)["signals"] != PASS
    assert "estimated error of state '" in str(run.report.verdict["reasons"])


@pytest.mark.parametrize(
    "scheme", ["preserving", "decaying", "gauss1", "gauss2", "gauss3", "radau2"]
)
def test_a_state_that_is_faster_than_the_steps_is_where_it_belongs(scheme):
    """A lag of 1 us behind a ramp by steps of 0.05 s: the load is that of the ramp from the first
    step on, x = v t + 5 t^3/(6 m) but for the ramp's delay.
    """
    lag = SignalState("z", parse("(5*t - z)/1e-6"), 3.0)
    model = on_a_rail((lag,), "z")
    run = simulate(model, 0.05, 1.0, scheme, solver="newton", error="estimate")
    # Of the jump at the start the first step leaves a few time constants over the step.
    assert run.signals[1:, 1] == pytest.approx(5.0 * run.time[1:], abs=5e-4)
    # Of order two, the force's line is not seen: h^2 t 5/(12 m) or so.
    order_two = 0.05**2 * 5.0 / (6.0 * 2.0)
    exact = run.time + 5.0 * run.time**3 / (6.0 * 2.0)
    assert run.states[:, 3] == pytest.approx(exact, abs=order_two)
    assert checks(run)["signals"] == PASS


def test_values_that_are_noise_or_jump_are_not_wrong():
    """A difference that is zero but for noise; a value that jumps between two output times."""
    shown = (
        Signal("zero", parse("(Rail.slide + 0.3) - 0.3 - Rail.slide")),
        Signal("passed", parse("Rail.slide > 0.5123")),
    )
    pull = "-40*Rail.slide"
    run = simulate(on_a_rail((), pull, shown), 0.02, 1.0, "preserving", solver="newton")
    assert 0.0 < np.abs(run.signals[:, 1]).max() < 1e-15
    assert checks(run)["signals"] == PASS


@pytest.mark.parametrize(("size", "word"), [(1e-75, PASS), (1e-9, WARN)])
def test_a_state_that_is_smaller_than_any_quantity_is_zero(size, word):
    model = on_a_rail((SignalState("s", parse("-500*s"), size),))
    run = simulate(model, 0.02, 0.1, "preserving", solver="newton")
    assert run.report.error["signals"]["s"]["error"] > STATE * size
    assert checks(run)["signals"] == word


@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
def test_reactions_of_an_overconstrained_loop_are_the_least(scheme):
    """Bennett's linkage: velocities that satisfy the joints to the square of the step only have a
    part of dG/dt v that no acceleration can give. Its reactions are mean ones but for the step.
    """
    model = bennett()
    given = replace(model.simulation, reactions="instantaneous")
    run = simulate(replace(model, simulation=given), 0.02, 0.6, scheme, solver="newton")
    mean = simulate(model, 0.02, 0.6, "preserving", solver="newton")
    sizes = [np.linalg.norm(r.reactions[:, 1:4], axis=1) for r in (run, mean)]
    # The weights are some 30 N, and steps are a fiftieth of a swing.
    assert sizes[0] == pytest.approx(sizes[1], abs=2.0)
    assert run.report.error["largest"]["force"] == pytest.approx(30.0, abs=10.0)


@pytest.mark.parametrize(("share", "word"), [(0.9, None), (1.1, WARN)])
def test_an_error_of_forces_is_judged_by_the_largest(share, word):
    errors = {"force": share * 50.0}
    sizes = {"largest": {"force": 50.0}, "lasting": errors, **errors}
    verdict = judge(replace(GOOD, error=GOOD.error | sizes), Limits()).as_json()
    assert verdict["checks"].get("forceError", {}).get("word") == word


def by_tolerance(model, tolerance, t_final, **options):
    simulation = replace(model.simulation, tolerance=tolerance)
    model = replace(model, simulation=simulation)
    return simulate(model, 0.01, t_final, "auto", solver="newton", **options)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-6])
@pytest.mark.parametrize("grows", [True, False])
def test_a_tolerance_is_that_of_states_as_well(tolerance, grows):
    """States alone: growth by e^9, and Lorenz' equations, which magnify errors by some e^11. Each
    may be wrong by the tolerance over the body's length of its largest value, and by no more than
    passes.
    """
    one = (SignalState("x", parse("3*x"), 1e-6),)
    lorenz = ("10*(y - x)", "x*(28 - z) - y", "x*y - 8/3*z")
    three = tuple(SignalState(n, parse(f), 1.0) for n, f in zip("xyz", lorenz, strict=True))
    given = (one, 3.0) if grows else (three, 12.0)
    run = by_tolerance(on_a_rail(given[0]), tolerance, given[1], full=True)
    length = float(np.sqrt(0.008 / 2.0))
    columns = run.report.error["signals"].values()
    allowed = min(STATE, tolerance / length)
    assert max(column["share"] for column in columns if column["state"]) <= allowed
    assert checks(run)["signals"] == PASS
    made = run.report.step_control["runs"]
    assert made[-1]["overTolerance"] <= 1.0
    # Positions are those of a body that moves uniformly: it is the states that ask for another run.
    assert all(one["error"] < 1e-12 for one in made)
    # Of Lorenz' equations the first run is wrong by ten times the largest tolerance.
    assert len(made) == 2 or tolerance < 1e-2 or grows
    if grows:
        true = 1e-6 * np.exp(3.0 * run.time)
        assert np.abs(run.signals[:, 1] - true).max() <= allowed * true.max()


def test_terms_that_cancel_are_zero_by_the_accuracy_asked_for():
    """A lag in its steady state behind a rate: their difference is the error of both."""
    lag = SignalState("z", parse("(Rail.slideRate - z)/0.1"), 1.0)
    run = by_tolerance(on_a_rail((lag,), "0.5*(z - Rail.slideRate)"), 1e-3, 3.0)
    assert checks(run)["signals"] == PASS


@pytest.mark.parametrize(("share", "word"), [(1.0, PASS), (1e-4, WARN)])
def test_a_small_value_is_wrong_if_the_motion_does_not_explain_its_error(share, word):
    """What is left of terms of 1 m that cancel is a ten thousandth of an oscillation by steps that
    do not resolve it: the motion is exact to round-off, so no error of it is that value. Or it is
    the oscillation's part in a lag, which is as small, and is right.
    """
    states = (SignalState("a", parse("100*b"), 1.0), SignalState("b", parse("-100*a")))
    lag = SignalState("z", parse("1e-4 - z"), 1e-4)
    left = Signal("left", parse("Rail.slide - t + 1e-4*a" if share < 1.0 else "Rail.slide - t + z"))
    run = simulate(on_a_rail(states if share < 1.0 else (lag,), shown=(left,)), 0.1, 2.0, "gauss1")
    column = run.report.error["signals"]["left"]
    assert column["largest"] == pytest.approx(1e-4, rel=0.2)
    assert (column["share"] > SIGNAL) == (word == WARN)
    assert checks(run)["signals"] == word


def test_a_state_that_misses_a_tolerance_says_relative_to_what():
    column = {"error": 2e-3, "largest": 1.0, "share": 2e-3, "state": True}
    figures = replace(GOOD, error=GOOD.error | {"signals": {"i": column}}, length=1.0)
    assert judge(replace(figures, tolerance=3e-3), Limits()).as_json()["word"] == PASS
    verdict = judge(replace(figures, tolerance=1e-3), Limits()).as_json()
    assert verdict["checks"]["signals"]["word"] == WARN
    assert "the tolerance of 0.001 m means 0.001 for states" in verdict["checks"]["signals"]["text"]


def test_the_largest_errors_are_listed_and_the_others_counted():
    columns = {
        f"s{i}": {"error": 1.0 + i % 7, "largest": 10.0, "share": (i % 7) / 10, "state": False}
        for i in range(50)
    }
    shown = with_largest(columns)
    assert (len(shown["signals"]), shown["otherSignals"]) == (LISTED, 50 - LISTED)
    shares = sorted((column["share"] for column in columns.values()), reverse=True)
    assert sorted((c["share"] for c in shown["signals"].values()), reverse=True) == shares[:LISTED]
    few = dict(list(columns.items())[:3])
    assert with_largest(few) == {"signals": few}
    assert with_largest({}) == {}


def test_a_run_lists_the_largest_errors_of_many_signals():
    """The table of errors has all columns."""
    shown = tuple(Signal(f"s{i}", parse(f"a*{i}")) for i in range(30))
    run = simulate(on_a_rail((SignalState("a", parse("-a"), 1.0),), shown=shown), 0.1, 0.3)
    assert len(run.report.error["signals"]) == LISTED
    assert run.report.error["otherSignals"] == len(run.errors[0]) - 3 - LISTED


def test_the_work_of_a_step_grows_with_the_states_and_not_with_their_square():
    """A hundred states that each depend on their neighbours, and one more hundred."""
    sizes = []
    for n in (100, 200):
        names = ["Rail.slide", *(f"x{k}" for k in range(n)), "0"]
        states = tuple(
            SignalState(f"x{k}", parse(f"9*({names[k]} - 2*x{k} + {names[k + 2]}) - x{k}^3"))
            for k in range(n)
        )
        system = build_system(on_a_rail(states, load=f"x{n - 1}"))
        stages = new_stages(system.forces.signals, MIDPOINT)
        operations = system.forces.signals.coupling.operations.items.size
        sizes.append(operations + sum(array.size for array in arrays_in(stages)))
    assert sizes[1] < 2.1 * sizes[0]
