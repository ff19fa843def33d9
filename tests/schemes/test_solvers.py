"""One trajectory whoever solves it; hard steps rescued, halved, or given up with a clear word."""

from dataclasses import replace

import numpy as np
import pytest

import msahl.run.loop
from msahl.algebra.vector import ZERO
from msahl.deck import read_deck
from msahl.model import ConcentratedLoad, resolve
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.fixed_stepper import MAX_SUBDIVISIONS, FixedStepper
from msahl.schemes.midpoint import stepper
from msahl.schemes.outcome import Outcome
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Chunk
from msahl.system.subsystems import split
from tests.support.models import DECKS, GROUND, body, build_model, deck, loaded, pendulum, simulate


@pytest.mark.sampled
@pytest.mark.parametrize("steps", [40, pytest.param(150, marks=pytest.mark.slow)])
@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_newton_root_and_auto_go_the_same_way(path, steps):
    """Steps of the deck's own size; no deck is wild enough in hundreds of them to need less."""
    model = replace(read_deck(path), stops=())  # whose search takes steps as well
    h = model.simulation.dt
    n = min(steps, round(model.simulation.t_final / h))
    solvers = ("newton", "root", "auto")
    runs = {s: simulate(model, dt=h, t_final=n * h, solver=s) for s in solvers}
    assert {runs[s].report.status for s in runs} == {"completed"}
    assert {runs[s].report.subdivisions for s in runs} == {0}
    known = next(iter(runs.values()))
    # Redundant joints are relaxed, by 1e-9 of their compliance.
    tolerance = 1e-8 if known.report.non_unique_reactions else 1e-10
    for run in runs.values():
        for b in range(len(model.bodies)):
            assert np.abs(run.of("position", b) - known.of("position", b)).max() < tolerance
        # Forces are the residual's round-off over h^2/(2 m): some 1e-8 N at 0.002 s and 2 kg.
        force = np.abs(known.reactions[:, 1:]).max(initial=1.0)
        # Which of many equally good reactions shared joints show is left to the relaxation against
        # the round-off of a solver's last iterations: some 2e-4 of the force, so 1e-3.
        allowed = 1e-3 if known.report.non_unique_reactions else 1e2 * tolerance
        assert np.abs(run.reactions - known.reactions).max() < allowed * force
    subsystems = known.report.subsystems
    # Collocation begins with the compiled loop.
    first = 0 if resolve(model.simulation).degree else subsystems
    by_scipy = {"newton": 0, "root": n * subsystems, "auto": first}
    # Events divide steps.
    if path.stem != "spring_table" and not model.contacts and not model.events:
        assert {s: runs[s].report.scipy_steps for s in runs} == by_scipy


def no_rows(steps):
    """A chunk of which no row is wanted."""
    return OutputSchedule.at_ends(np.zeros(steps, dtype=bool))


def test_auto_starts_with_root_and_goes_on_with_newton():
    run = simulate(pendulum(), dt=0.01, t_final=1.0)
    assert (run.report.scipy_steps, run.report.steps) == (1, 100)


def test_a_step_that_newton_refuses_is_solved_along_a_path(monkeypatch):
    """Every third step is refused; continuation takes it, and nothing of it shows in the answer."""
    march, refused = stepper._take_steps, []

    def reluctant(one, h, first, last, schedule):
        for k in range(first, last):
            if len(refused) < 33 and (k + 1) % 3 == 0 and k not in refused:
                refused.append(k)
                return k
            if march(one, h, k, k + 1, schedule) == k:
                return k
        return last

    known = simulate(pendulum(), dt=0.01, t_final=1.0, solver="newton")
    monkeypatch.setattr(msahl.run.loop, "PATIENCE", np.inf)  # steps are counted by chunk
    monkeypatch.setattr(stepper, "_take_steps", reluctant)
    run = simulate(pendulum(), dt=0.01, t_final=1.0)
    assert run.report.status == "completed"
    assert (run.report.scipy_steps, run.report.path_steps) == (1, len(refused))
    assert len(refused) >= 10
    assert run.of("position") == pytest.approx(known.of("position"), abs=1e-12)
    assert run.force() == pytest.approx(known.force(), abs=1e-9)


@pytest.mark.parametrize(("solver", "dt"), [("auto", 0.3), ("newton", 0.15), ("root", 0.15)])
def test_violent_steps_are_solved_or_halved_and_lose_nothing(solver, dt):
    """The triple pendulum from 135 degrees: bobs rotate more than a step can follow."""
    run = simulate(deck("triple_pendulum_135"), dt=dt, t_final=100 * dt, solver=solver)
    report = run.report
    assert (report.status, report.steps, len(run.states)) == ("completed", 100, 101)
    assert report.extremes["energyErrorMaxRelative"] < 1e-11
    assert report.extremes["constraintViolationMax"] < 1e-11
    if solver == "auto":
        # Measured: 5 steps of which Newton's method finds no solution, and the first by scipy.
        assert (report.scipy_steps, report.subdivisions) == (1, 0)
        assert 1 <= report.path_steps <= 30
    if solver == "newton":
        # The last step's motion is near enough where that by accelerations is not.
        assert (report.scipy_steps, report.subdivisions) == (0, 0)
    if solver == "root":
        assert 5 <= report.subdivisions <= 100


def test_the_force_of_a_halved_step_is_the_mean_over_the_complete(monkeypatch):
    """Impulse and momentum say the same, whatever pieces the step was taken in."""
    once = FixedStepper._solve_once

    def only_quarters(self, h, share, tried):
        return once(self, h, share, tried) if share <= 0.25 else Outcome(1.0, 0)

    monkeypatch.setattr(FixedStepper, "_solve_once", only_quarters)
    run = simulate(pendulum(), dt=0.1, t_final=2.0, solver="root")
    assert run.report.subdivisions == 3 * run.report.steps
    R = run.matrices()
    v = np.einsum("tij,tj->ti", R, run.of("velocity"))
    impulse = 2.0 * np.diff(v, axis=0) - 0.1 * 2.0 * np.array([0.0, 0.0, 9.80665])
    assert 0.1 * run.force()[1:] == pytest.approx(impulse, abs=1e-11)


def blasted():
    """A pendulum under a force of 1e100 N that rotates with it: round and round in any step."""
    force = (1e100, 0.0, 1e100)
    blast = ConcentratedLoad("Blast", "Bob", (0.0, 0.0, 1.0), force, "Bob", ZERO, GROUND.name)
    return replace(pendulum(), loads=(blast,))


@pytest.mark.parametrize("solver", ["auto", "newton", "root"])
def test_a_step_that_cannot_be_taken_ends_the_run_and_says_why(solver):
    run = simulate(blasted(), dt=0.01, t_final=0.1, solver=solver)
    report = run.report
    assert (report.status, report.steps, report.time) == ("not converged", 0, 0.0)
    # One piece of each size, from the complete step to the 2^-10 of it.
    assert report.subdivisions == MAX_SUBDIVISIONS
    assert len(run.states) == 1
    assert "step 1 from t = 0 s did not converge" in report.message
    assert f"down to {0.01 / 2**MAX_SUBDIVISIONS:.3g} s" in report.message
    assert "largest in body 'Bob', " in report.message
    assert "Try a smaller --dt" in report.message
    assert np.isfinite(run.states).all()


@pytest.mark.parametrize("solver", ["auto", "newton"])
def test_a_run_that_ends_early_keeps_all_it_had(monkeypatch, solver):
    """From step 41 on nothing converges; state, rows and extremes are those of step 40."""
    march, steps = stepper._take_steps, 40

    def until(one, h, first, last, schedule):
        end = min(last, first + max(0, steps - until.taken))
        until.taken += end - first
        return march(one, h, first, end, schedule)

    def never(self, h, share, tried):
        may_compile = self.may_compile or self.solver == "newton"
        return Outcome(0.125, 3) if may_compile else once(self, h, share, tried)

    once = FixedStepper._solve_once
    until.taken = 1 if solver == "auto" else 0
    model = pendulum()
    known = simulate(model, dt=0.01, t_final=0.4, solver=solver)
    monkeypatch.setattr(stepper, "_take_steps", until)
    monkeypatch.setattr(FixedStepper, "_solve_once", never)
    run = simulate(model, dt=0.01, t_final=1.0, solver=solver)
    report = run.report
    assert (report.status, report.steps, report.time) == ("not converged", 40, 0.4)
    assert "step 41 from t = 0.4 s" in report.message
    assert "relative residual stayed at 1.2e-01" in report.message
    assert "largest in body 'Bob', moment about x" in report.message
    assert run.of("position") == pytest.approx(known.of("position"), abs=0)
    assert report.extremes == pytest.approx(known.report.extremes)


@pytest.mark.parametrize("solver", ["auto", "newton", "root"])
def test_a_failed_step_leaves_the_state_as_it_was(monkeypatch, solver):
    """Its first half is taken, and undone when the second half fails in all its pieces."""
    model = deck("double_pendulum_89")
    integrator = SubsystemIntegrator(model, solver, False, 20)
    assert integrator.advance(Chunk(20, h=0.01, schedule=no_rows(20))).steps == 20
    before = [
        np.array(array)
        for array in (*integrator.workspace.state, *_flat(integrator.workspace.start))
    ]
    once, halves = FixedStepper._solve_once, []

    def first_half_only(self, h, share, tried):
        if share == 0.5 and not halves:
            halves.append(once(self, h, share, tried))
            return halves[0]
        return Outcome(0.125, 3)

    monkeypatch.setattr(FixedStepper, "_solve_once", first_half_only)
    monkeypatch.setattr(stepper, "_take_steps", lambda one, h, first, last, schedule: first)
    done, outcome, *_ = integrator.advance(Chunk(20, h=0.01, schedule=no_rows(20)))
    assert (done, outcome) == (0, Outcome(0.125, 3))
    assert halves[0].converged
    after = (*integrator.workspace.state, *_flat(integrator.workspace.start))
    for array, value in zip(after, before, strict=True):
        assert np.array_equal(array, value)


def _flat(group):
    """The arrays of nested groups."""
    if isinstance(group, tuple):
        return [array for part in group for array in _flat(part)]
    return [group] if isinstance(group, np.ndarray) else []


# Work counts -------------------------------------------------------------------------------------


def test_one_factorisation_a_step_is_enough():
    """What a step costs, in iterations and factorisations, for models of the thesis."""
    for name, iterations in {
        "single_pendulum_45": 1.2,
        "double_pendulum_89": 1.3,
        "triple_pendulum_89": 2.5,
        "top_2": 1.3,
    }.items():
        report = simulate(deck(name), t_final=2.0, solver="newton").report
        assert report.iterations <= iterations * report.steps, name
        assert report.factorisations <= 1.05 * report.steps, name


def test_unrelated_elements_elsewhere_cost_a_model_nothing():
    """A pendulum is solved by the same counts alone and beside bodies under loads."""
    alone = pendulum()
    push = ConcentratedLoad("P", "Other", ZERO, (1.0, 2.0, 0.0), GROUND.name, ZERO, GROUND.name)
    other = body("Other", position=(9.0, 0.0, 0.0), inertia=(0.1, 0.2, 0.25))
    beside = build_model([*alone.bodies, other], alone.joints, [push], gravity=alone.gravity)
    counts = [_counts(model) for model in (alone, beside)]
    assert counts[0] == counts[1]
    # And its motion is the same to the last bit.
    runs = [simulate(model, t_final=1.0, solver="newton") for model in (alone, beside)]
    assert np.array_equal(runs[0].of("position", 0), runs[1].of("position", 0))


def _counts(model):
    """Unknowns, blocks, operations, iterations and factorisations of the first subsystem."""
    integrator = SubsystemIntegrator(split(model)[0], "newton", False, 100)
    integrator.advance(Chunk(100, h=0.01, schedule=no_rows(100)))
    system, unknowns = integrator.workspace.system, integrator.workspace.unknowns
    return (
        unknowns.free.size,
        len(system.blocks),
        unknowns.elimination.target.size,
        *integrator.workspace.counts.tolist(),
    )


def test_loads_that_are_there_do_count():
    """The counts above would tell: the same tree without its loads has fewer blocks."""
    rng = np.random.default_rng(0)
    with_loads = loaded(rng)
    without = build_model(with_loads.bodies, with_loads.joints, gravity=with_loads.gravity)
    assert _counts(with_loads)[1] > _counts(without)[1]


@pytest.mark.parametrize("solver", ["auto", "root"])
def test_a_chunk_that_is_broken_off_changes_nothing(solver, monkeypatch):
    """Two subsystems: where the first stops to check for interruptions, so does the other."""
    for model in (deck("two_pendulums"), deck("triple_pendulum_135")):
        complete = simulate(model, dt=0.1, t_final=3.0, solver=solver)
        with monkeypatch.context() as patch:
            patch.setattr(msahl.run.loop, "PATIENCE", 0.0)
            parts = simulate(model, dt=0.1, t_final=3.0, solver=solver)
        assert np.array_equal(complete.states, parts.states)
        assert np.array_equal(complete.reactions, parts.reactions)
        assert parts.report.steps == 30
