"""The decaying scheme of higher order: derivative, orders, what it takes and what it keeps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.algebra.vector import ZERO
from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.expressions.syntax import parse
from msahl.model import Joint, JointActuator
from msahl.model.scheme import choices
from msahl.ports import forces
from msahl.results.read import read_run
from msahl.run.verdict import FAIL, PASS
from msahl.schemes.collocation import newton
from msahl.schemes.collocation import stepper as collocation_stepper
from msahl.schemes.collocation.tableau import new_tableau
from msahl.study.plan import Plan
from msahl.study.runs import with_step
from msahl.study.study import study
from tests.schemes.midpoint.test_decaying import energies, oscillator
from tests.support.closed_forms import recognise
from tests.support.collocation_step import Step
from tests.support.element_samples import ELEMENTS
from tests.support.models import (
    GROUND,
    body,
    build_model,
    deck,
    jointed,
    pendulum,
)
from tests.support.models import (
    simulate_and_estimate as simulate,
)

ROOT = Path(__file__).parents[3]
H = 0.01
DEGREES = (1, 2, 3)
every_degree = pytest.mark.parametrize("degree", DEGREES)
PADE = {
    1: lambda z: 1.0 / (1.0 - z),
    2: lambda z: (1.0 + z / 3.0) / (1.0 - 2.0 * z / 3.0 + z**2 / 6.0),
    3: lambda z: (1.0 + 0.4 * z + 0.05 * z**2) / (1.0 - 0.6 * z + 0.15 * z**2 - z**3 / 60.0),
}
"""What one step makes of y' = z/h y, by degree: Hairer and Wanner, Solving ODEs II, IV.3."""


@every_degree
def test_a_rule_integrates_what_it_should(degree):
    tableau, s = new_tableau("radau", degree), degree
    t = tableau.force_time
    assert (tableau.constraint_time == t).all()
    assert t[-1] == 1.0
    for power in range(2 * s - 1):
        assert tableau.force_weight @ t**power == pytest.approx(1.0 / (power + 1), abs=1e-15)
    # Rates of polynomials through 0 at the start are summed to what they are rates of.
    np.testing.assert_allclose(tableau.beta @ tableau.basis_rate, np.eye(s), atol=1e-14)
    # A constant force displaces by t^2/2; with one node, which is the end, by all of its last rate.
    moved = 0.5 * t**2 if s > 1 else t
    np.testing.assert_allclose(tableau.alpha.sum(axis=1), -moved, atol=1e-15)


@pytest.mark.parametrize("make", ELEMENTS.values(), ids=ELEMENTS)
def test_the_derivative_of_every_element(make):
    rng = np.random.default_rng(8)
    # Differences: third derivatives times 1e-10, and round-off of numbers near 1 over 1e-5.
    assert Step(make(rng), "radau2", 0.1, rng).differs(rng) <= 1e-7


CLOSED = {
    "single_pendulum_45": {1: 0.004, 2: 0.05, 3: 0.1},
    "top_1": {1: 0.0005, 2: 0.01, 3: 0.02},
}
"""Largest of two steps [s] by degree, between too coarse and round-off."""


@every_degree
@pytest.mark.parametrize("name", CLOSED)
def test_orders_against_closed_forms(name, degree):
    coarse, exact, found = CLOSED[name][degree], recognise(deck(name)), []
    for h in (coarse, 0.5 * coarse):
        run = simulate(deck(name), dt=h, t_final=0.4, scheme=f"radau{degree}")
        end = run.time[-1:]
        parts = np.abs(run.states[-1, 1:] - exact.states(end)[0]).reshape(-1, 4, 3)
        force = np.abs(run.reactions[-1, 1:] - exact.forces(end).reshape(-1)).max()
        found.append(np.append(parts.max(axis=(0, 2)), force))
        assert run.report.extremes["constraintViolationMax"] <= 1e-13
        assert run.report.extremes["constraintViolationRateMax"] <= 1e-13
    assert np.log2(found[0] / found[1]) == pytest.approx(2.0 * degree - 1.0, abs=0.15)


@pytest.mark.parametrize("period", [100.0 * H, 3.0 * H, 0.1 * H])
@every_degree
def test_a_linear_oscillator_is_stepped_by_the_closed_form(period, degree):
    w = 2.0 * np.pi / period
    run = simulate(oscillator(period), dt=H, t_final=20 * H, scheme=f"radau{degree}")
    y = run.of("velocity")[:, 2] + 1j * w * run.of("position")[:, 2]
    # Steps are solved to 1e-14 of the largest load in them, the one that a step begins with.
    np.testing.assert_allclose(y[1:], PADE[degree](1j * w * H) * y[:-1], atol=1e-12 * abs(y[0]))


@every_degree
def test_what_the_step_cannot_see_is_gone_at_once(degree):
    """A vibration of a millionth of the step: each step leaves less than 1e-5 of its amplitude."""
    run = simulate(oscillator(1e-6 * H), dt=H, t_final=1.0, scheme=f"radau{degree}")
    energy = energies(run)
    assert energy[3] <= 1e-25 * energy[0]
    assert run.column("scheme.work")[-1] == pytest.approx(-energy[0], rel=1e-12)
    # Linear: one solution a step, and one more where the motion falls beside its own round-off.
    assert run.report.iterations <= 2 * run.report.steps
    assert run.report.subdivisions == run.report.scipy_steps == 0


@pytest.mark.parametrize("period", [100.0 * H, H, 1e-2 * H, 1e-6 * H])
@every_degree
def test_energy_is_never_gained_and_the_balance_holds(period, degree):
    run = simulate(oscillator(period), dt=H, t_final=10.0, scheme=f"radau{degree}")
    energy, taken = energies(run), run.column("scheme.work")
    # Round-off of a thousand steps, each solved to 1e-14 of its own motion.
    assert np.abs(energy - energy[0] - taken).max() <= 1e-11 * energy[0]
    assert (np.diff(taken) <= 0.0).all()
    assert energy.max() <= energy[0]
    assert run.report.verdict["checks"]["energy"]["word"] == PASS


@pytest.mark.parametrize("scheme", ["gauss3", "radau3"])
def test_a_step_of_a_thousand_revolutions_is_not_taken_for_solved(scheme):
    """A guess of parameters past a revolution is no measure of what a residual is beside
    it: the joint of a pendulum under a million times its weight stood open by metres, at once.
    """
    model = replace(pendulum(), gravity=(0.0, 0.0, 1e7))
    run = simulate(model, dt=1.0, t_final=2.0, scheme=scheme)
    assert run.report.extremes["constraintViolationMax"] <= 1e-12
    assert run.report.status == "not converged" or run.report.iterations > 0


def test_what_the_scheme_gives_is_an_error_of_the_balance():
    """A needle thrown so that it tumbles: radau3 may give as well as take, and says so."""
    rod = body("Rod", 1.0, (0.01, 0.02, 0.025), angular_velocity=(4.0, 3.0, 2.0))
    run = simulate(build_model([rod]), dt=0.05, t_final=10.0, scheme="radau3")
    w = run.of("spin")
    energy = 0.5 * (w**2) @ np.array([0.01, 0.02, 0.025])
    balance = energy - energy[0] - run.column("scheme.work")
    figures = run.report.extremes
    assert balance.min() >= -1e-15
    assert figures["energyErrorMax"] == pytest.approx(balance.max(), abs=1e-15)
    assert figures["energyTaken"] == -run.column("scheme.work")[-1]
    assert 1e-9 < figures["energyErrorMaxRelative"] < 1e-8


ANGULAR = {1: (0.002, 0.001), 2: (0.01, 0.005), 3: (0.04, 0.02)}
"""Steps [s] by degree, between too coarse and round-off."""


@every_degree
def test_spins_and_momenta(degree):
    """Of a free body all is kept; of jointed ones the linear part, the angular to the order."""
    spin = body("Spin", 1.0, 0.3, velocity=(1.0, 2.0, 3.0), angular_velocity=(3.0, 4.0, 5.0))
    run = simulate(build_model([spin]), dt=0.1, t_final=20.0, scheme=f"radau{degree}")
    # Each of 200 steps rounds.
    np.testing.assert_allclose(run.of("spin") / (3.0, 4.0, 5.0), 1.0, atol=1e-13)
    model = jointed(np.random.default_rng(1), 3, gravity=False, grounded=False)
    lost = []
    for h in ANGULAR[degree]:
        run = simulate(model, dt=h, t_final=0.4, scheme=f"radau{degree}", solver="newton")
        assert run.report.verdict["checks"]["linearMomentum"]["word"] == PASS
        assert "angularMomentum" not in run.report.verdict["checks"]
        angular = 0.0
        for b, given in enumerate(model.bodies):
            R, w = run.matrices(b), run.of("spin", b)
            x = run.of("position", b) + R @ np.array(given.r_BG)
            v = np.einsum("tij,tj->ti", R, run.of("velocity", b) + np.cross(w, given.r_BG))
            rotating = np.einsum("tij,jk,tk->ti", R, np.array(given.inertia), w)
            angular = angular + given.mass * np.cross(x, v) + rotating
        lost.append(np.abs(angular[-1] - angular[0]).max())
    assert np.log2(lost[0] / lost[1]) == pytest.approx(2.0 * degree - 1.0, abs=0.4)


@pytest.mark.parametrize(
    "name",
    # Friction by scipy is a kernel of its own, which takes a minute to compile.
    [
        "double_pendulum_89",
        "revolute",
        pytest.param("bricard", marks=pytest.mark.slow),
        pytest.param("friction_hinge", marks=pytest.mark.slow),
    ],
)
def test_both_solvers_find_the_same_motion(name):
    newton, root = (
        simulate(deck(name), dt=0.02, t_final=0.2, scheme="radau2", solver=solver)
        for solver in ("newton", "root")
    )
    assert (root.report.scipy_steps, newton.report.scipy_steps) == (10, 0)
    scale = np.abs(newton.states).max()
    # Both to residuals of 1e-12 of a step.
    np.testing.assert_allclose(newton.states, root.states, atol=1e-10 * scale)
    assert max(run.report.extremes["constraintViolationMax"] for run in (newton, root)) <= 1e-13


@pytest.mark.parametrize("name", ["double_pendulum_89", "two_pendulums", "four_bar"])
def test_what_is_omitted_changes_nothing(name):
    given = {"dt": 0.01, "t_final": 0.3, "scheme": "radau3", "solver": "newton"}
    reduced, full = (simulate(deck(name), full=full, **given) for full in (False, True))
    scale = np.abs(full.states).max()
    np.testing.assert_allclose(reduced.states, full.states, atol=1e-11 * scale)
    # What the scheme took is of all subsystems.
    taken = [run.column("scheme.work")[-1] for run in (reduced, full)]
    assert taken[0] == pytest.approx(taken[1], rel=1e-6)


def test_a_rolling_disk_rolls():
    model = read_deck(ROOT / "decks" / "joints" / "rolling_disk.xml")
    best = simulate(model, dt=0.005, t_final=0.4, scheme="gauss3", solver="newton")
    found = []
    for h in (0.04, 0.02):
        run = simulate(model, dt=h, t_final=0.4, scheme="radau2", solver="newton")
        found.append(np.abs(run.states[-1] - best.states[-1]).max())
        assert run.report.extremes["constraintViolationRateMax"] <= 1e-13
    assert np.log2(found[0] / found[1]) == pytest.approx(3.0, abs=0.25)


def test_the_command_and_the_deck_ask_for_it(tmp_path):
    source = ROOT / "decks" / "extreme" / "stiff_spring.xml"
    assert choices()[-6:] == ("radau1", "radau2", "radau3", "rk4", "rk8", "auto")
    words = ["run", str(source), "--t-final", "0.1", "-o", str(tmp_path / "a")]
    result = CliRunner().invoke(main, [*words, "--scheme", "radau2"])
    assert result.exit_code in (0, 1), result.output
    run = read_run(tmp_path / "a")
    options = [run.info["options"][word] for word in ("scheme", "degree", "damping")]
    assert options == ["radau", 2, 0.0]
    assert (run.model.simulation.scheme, run.model.simulation.degree) == ("radau", 2)
    assert run.work["scheme.work"].iloc[-1] == pytest.approx(-0.5, rel=1e-9)
    given = source.read_text().replace("<simulation>", '<simulation scheme="radau" degree="4">')
    bad = tmp_path / "bad.xml"
    bad.write_text(given)
    result = CliRunner().invoke(main, ["check", str(bad)])
    assert result.exit_code == 2
    line = given[: given.index("<simulation ")].count("\n") + 1
    expected = f"{bad}:{line}: simulation: the degree is 4; the radau scheme has the degrees 1 to 3"
    assert expected in result.output
    result = CliRunner().invoke(main, ["run", str(source), "--scheme", "radau4"])
    assert result.exit_code == 2


def test_a_study_finds_its_order():
    plan = Plan(with_step(deck("single_pendulum_45"), 0.1, 0.8), (0.08, 0.04, 0.02, 0.01))
    found = study(replace(plan, schemes=("radau2", "gauss1"), repeats=1))
    assert found.fits["radau2", "position"].order == pytest.approx(3.0, abs=0.15)
    assert found.fits["gauss1", "position"].order == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize(("factor", "word"), [(1.0, PASS), (1.3, FAIL)])
def test_works_that_are_not_those_of_the_motion_fail(monkeypatch, factor, word):
    """A motor drives a wheel against a drag; it is said to do 1.3 times its work. Radau's own work
    takes up what is missing, at any size of its steps: that is no damping of vibrations.
    """
    add_power = forces.add_power

    def falsified(group, *arguments):
        *others, dt, work = arguments
        add_power(group, *others, factor * dt, work)

    monkeypatch.setattr(collocation_stepper, "_take_steps", newton.take_steps)
    monkeypatch.setattr(forces, "add_power", falsified)
    wheel = body("Wheel", inertia=(1.0, 1.0, 1.0))
    axle = Joint("Axle", "revolute", GROUND.name, wheel.name, ZERO, ZERO)
    motor = JointActuator("Motor", "Axle", "angle", parse("2 - 0.1*Axle.angleRate"))
    run = simulate(build_model([wheel], [axle], [motor]), 0.1, 1.0, "radau2", solver="newton")
    check = run.report.verdict["checks"]["energy"]
    assert check["word"] == word, check
    assert ("not those of the motion" in check["text"]) == (word == FAIL)
