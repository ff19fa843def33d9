"""Errors of states, signals, loads of actuators and reactions: estimated, written and judged."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.vector import ZERO
from msahl.expressions.syntax import parse
from msahl.model import Joint, JointActuator, Limits, Signal, SignalState
from msahl.run.tables import error_columns
from msahl.run.verdict import PASS, WARN, judge
from tests.physics.test_actuators import motor, motor_exactly
from tests.run.test_verdict import GOOD
from tests.support.loops import bennett
from tests.support.models import GROUND, body, build_model, simulate


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
    sizes = {"largest": {"force": 50.0}, "force": share * 50.0}
    verdict = judge(replace(GOOD, error=GOOD.error | sizes), Limits()).as_json()
    assert verdict["checks"].get("forceError", {}).get("word") == word
