"""Output between steps: as accurate as the ends, on the joints, with reactions and work of their
own time; and how they are asked for.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.deck import check_simulation
from msahl.model.loads import SpringDamper
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.time_grid import TimeGrid
from msahl.run.verdict import PASS
from msahl.schemes.collocation import dense_output
from msahl.schemes.output_schedule import OutputSchedule
from tests.support.closed_forms import recognise
from tests.support.models import GROUND, THESIS, ZERO, body, build_model, deck
from tests.support.models import simulate_and_estimate as simulate

TABLES = ("states", "reactions", "work")
SINGLE = THESIS[0].parent / "single_pendulum_45.xml"


def between_rows(model, degree, dt, interval, t_final, **options):
    """A run by steps of ``dt`` with rows at the ``interval``."""
    given = replace(model.simulation, scheme="gauss", degree=degree, output_interval=interval)
    return simulate(replace(model, simulation=given), dt=dt, t_final=t_final, **options)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_output_between_steps_is_of_the_order_of_the_ends(degree):
    """0.07 s never divides the steps. At degree 4 errors come down to 1e-13 m: two are left."""
    model, order = deck("single_pendulum_45"), 2 * degree
    runs = [between_rows(model, degree, dt, 0.07, 2.1) for dt in (0.3, 0.15)]
    wrong = []
    for run in runs:
        assert np.allclose(run.time, 0.07 * np.arange(31))
        exact = recognise(run.model).states(run.time)
        wrong.append(np.abs(run.states[:, 1:] - exact).reshape(-1, 4, 3).max(axis=(0, 2)))
        # Rows are put back on the joint, places and velocities.
        bob, R = run.of("position"), run.matrices()
        assert np.abs(np.linalg.norm(bob, axis=1) - 5.0).max() <= 1e-13
        v = np.einsum("tij,tj->ti", R, run.of("velocity"))
        assert np.abs(np.einsum("ti,ti->t", bob, v)).max() <= 1e-12
    # A halved step of this size is within 0.3 of the order that still smaller ones come to.
    observed = np.log2(wrong[0] / wrong[1])
    assert (observed >= order - 0.3).all(), observed


@pytest.mark.parametrize(
    ("name", "dt", "degree", "t_final"),
    [
        ("spring_damper", 0.05, 3, 0.4),
        ("joint_motion_sine", 0.1, 3, 0.4),
        ("knife_edge", 0.05, 3, 0.4),
    ],
)
def test_reactions_and_work_between_are_as_good(name, dt, degree, t_final):
    """Of a damper, a joint motion and a joint between rates, against steps so small that none is
    between. The error of the output is of the steps' order, and at most a few times theirs.
    """
    model = deck(name)
    known = between_rows(model, 5, t_final / 40, None, t_final)
    errors = []
    for h in (dt, 0.5 * dt):
        run = between_rows(model, degree, h, t_final / 40, t_final)
        errors.append([np.abs(getattr(run, t) - getattr(known, t)).max() for t in TABLES])
    # Round-off: of velocities and forces put back by the index-1 problem.
    floors = [1e-13 * max(1.0, np.abs(getattr(known, t)).max()) for t in TABLES]
    for large, small, floor in zip(*errors, floors, strict=True):
        assert small <= max(large / 2 ** (2 * degree - 1), floor)


def test_polynomials_are_exact_up_to_their_degree():
    """Value and rate of t^k, from what is known at the ends and at the nodes within."""
    for nodes in ([], [1 / 3, 2 / 3], [0.2, 0.4, 0.6, 0.8]):
        basis = dense_output._basis(np.array(nodes))
        count, t = len(basis), 0.37
        for k in range(count):
            ends = [(0.0**k, float(k == 1), 2.0 * (k == 2)), (1.0, k, k * (k - 1))]
            within = [k * (k - 1) * node ** (k - 2) if k > 1 else 0.0 for node in nodes]
            known = np.array([*ends[0], *ends[1], *within])
            value = known @ basis @ (2.0 * t - 1.0) ** np.arange(count)
            assert value == pytest.approx(t**k, abs=1e-12)


def test_a_plan_says_where_rows_stand():
    schedule = OutputSchedule.passed(
        np.array([0.4, 1.0, 1.0 + 1e-12, 2.75]), 0.0, np.array([1.0, 2.0, 3.0])
    )
    np.testing.assert_array_equal(schedule.due, [0, 3, 3, 4])
    np.testing.assert_allclose(schedule.share, [0.4, 1.0, 1.0, 0.75])
    halves = schedule.halves()
    np.testing.assert_array_equal(halves.due, [0, 1, 3, 3, 3, 3, 4])
    np.testing.assert_allclose(halves.share, [0.8, 1.0, 1.0, 0.5])
    np.testing.assert_array_equal(schedule.ends(), [2, -1, -1])


def test_thinned_rows_and_a_last_row_of_its_own():
    run = between_rows(deck("single_pendulum_45"), 2, 0.1, 0.03, 0.5, every=4)
    assert np.allclose(run.time, [0.0, 0.12, 0.24, 0.36, 0.48, 0.5])
    assert run.report.steps == 5


def test_the_companion_follows_between_steps():
    run = between_rows(deck("double_pendulum_89"), 3, 0.05, 0.03, 1.0, accuracy=1e-4)
    assert run.report.error["trustHorizon"] == 1.0
    assert 0.0 < run.report.error["position"] < 1e-4


def test_the_energy_between_steps_is_a_figure():
    """By hand: a rod that swings, whose rows are interpolated by a polynomial of degree 5."""
    run = between_rows(deck("single_pendulum_45"), 1, 0.1, 0.03, 2.0)
    (bob,) = run.model.bodies
    v, w, x = (run.of(name) for name in ("velocity", "spin", "position"))
    spin = 0.5 * np.einsum("ti,ij,tj->t", w, np.array(bob.inertia), w)
    energy = 0.5 * bob.mass * (v**2).sum(axis=1) + spin - bob.mass * x @ run.model.gravity
    between = np.abs(np.mod(run.time / 0.1 + 0.5, 1.0) - 0.5) > 1e-6
    error = np.abs(energy - energy[0])[between].max()
    figures = run.report.extremes
    assert figures["energyErrorBetweenSteps"] == pytest.approx(error, rel=1e-9)
    at_ends = between_rows(deck("single_pendulum_45"), 1, 0.1, 0.2, 2.0)
    assert at_ends.report.extremes["energyErrorBetweenSteps"] is None


WRONG = {
    "nothing": ("states", 0, 1.0),
    "velocities": ("states", 6, 1.05),
    "works": ("work", 0, 1.3),
}
"""By what is falsified: its table, the first of three columns, and a factor."""


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("scheme", ["gauss3", "radau3", "auto"])
def test_wrong_output_between_steps_does_not_pass(monkeypatch, wrong, scheme):
    """Those of the companion are as wrong: nothing but their energy says so."""
    advance, (table, first, factor) = SubsystemIntegrator.advance, WRONG[wrong]

    def falsified(integrator, *chunk):
        done = advance(integrator, *chunk)
        rows = getattr(integrator.workspace.tables, table)
        rows[done.schedule.between, first : first + 3] *= factor
        return done

    monkeypatch.setattr(SubsystemIntegrator, "advance", falsified)
    model = deck("spring_damper")
    tolerance = 1e-5 if scheme == "auto" else None
    given = replace(model.simulation, output_interval=0.013, tolerance=tolerance)
    run = simulate(replace(model, simulation=given), 0.04, 0.5, scheme, solver="newton")
    check = run.report.verdict["checks"]["energy"]
    assert (check["word"] == PASS) == (wrong == "nothing"), check
    assert wrong == "nothing" or "at output times between steps" in check["text"]


def test_the_command_and_the_deck_ask_for_rows(tmp_path):
    words = ["run", str(SINGLE), "--t-final", "1", "-o", str(tmp_path / "a"), "--scheme", "gauss2"]
    more = ["--dt", "0.1", "--output-interval", "0.04"]
    assert CliRunner().invoke(main, [*words, *more]).exit_code == 0
    rows = (tmp_path / "a" / "states.csv").read_text().splitlines()
    assert len(rows) == 1 + 26
    again = ["run", str(tmp_path / "a" / "deck.xml"), "-o", str(tmp_path / "b")]
    assert CliRunner().invoke(main, again).exit_code == 0
    assert (tmp_path / "b" / "states.csv").read_text().splitlines() == rows
    options = json.loads((tmp_path / "b" / "run.json").read_text())["options"]
    assert options["outputInterval"] == 0.04


def test_the_lowest_order_has_rows_at_whole_number_steps():
    model = deck("single_pendulum_45")
    known = simulate(model, dt=0.02, t_final=1.0, every=3)
    thinned = replace(model, simulation=replace(model.simulation, output_interval=0.06))
    run = simulate(thinned, dt=0.02, t_final=1.0)
    np.testing.assert_array_equal(run.states[:, 1:], known.states[:, 1:])
    np.testing.assert_array_equal(run.reactions[:, 1:], known.reactions[:, 1:])
    np.testing.assert_allclose(run.time, known.time, rtol=1e-15)  # 33 times 0.02, 11 times 0.06
    odd = replace(model.simulation, dt=0.02, output_interval=0.05)
    (fault,) = check_simulation(odd)
    assert fault.startswith("outputInterval: 0.05 s are no whole number of steps of 0.02 s")
    (fault,) = check_simulation(replace(odd, scheme="gauss", output_interval=1e-6))
    assert "more than 1000 output times" in fault
    assert TimeGrid.of_output(replace(odd, t_final=1.0)).n == 20


def test_a_step_that_cannot_be_solved_leaves_nothing_in_the_dense_output():
    """Conditions of the levels above the present one have no weight, and may be nan: an oscillator
    of van der Pol ended where a longer step had been tried."""
    curve, weights = np.ones((3, 2, 3)), np.array([2.0, 0.0, 1.0])
    curve[1] = np.nan
    assert dense_output._sum(curve, weights, 1) == (3.0, 3.0, 3.0)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
@pytest.mark.parametrize("kind", ["tolerance", "local_tolerance"])
def test_energy_between_steps_is_compared_with_what_is_exchanged(tolerance, kind):
    """A spring of 200 J with a damper of ten times the critical constant: at most 0.5 J become
    kinetic energy, and steps are far longer than the shorter time constant. Compared with the
    kinetic energy the looser tolerance fails by 0.3 J.
    """
    leg = SpringDamper("Leg", GROUND.name, "Body", ZERO, ZERO, 1e4, 2e3, 1.0)
    start = body("Body", 1.0, np.diag((0.1, 0.1, 0.1)), position=(0.0, 0.0, 1.2))
    model = build_model([start], loads=[leg], dt=0.01, t_final=0.5)
    given = {"scheme": "auto", "output_interval": 0.01, kind: tolerance}
    model = replace(model, simulation=replace(model.simulation, **given))
    run = simulate(model)
    figures, checks = run.report.extremes, run.report.verdict["checks"]
    # After 2.5 of the longer time constants 0.7 % of the energy is left, exp(-5).
    assert figures["potentialEnergyChangeBetweenSteps"] == pytest.approx(200.0, rel=0.02)
    assert figures["largestKineticEnergy"] < 1.0
    assert checks["energy"]["word"] == PASS
    assert "of the largest change of the potential energy" in checks["energy"]["text"]
