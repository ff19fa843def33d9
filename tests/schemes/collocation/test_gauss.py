"""The scheme of higher order: its derivative, its orders, what it keeps, how it is asked for."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.algebra.rotation import matrix
from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.formulations.absolute import local_rotation
from msahl.linalg import block_lu
from msahl.model.scheme import COLLOCATION, choices, split
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.collocation import predictor
from msahl.schemes.collocation.tableau import new_tableau
from msahl.study.runs import with_step
from tests.support.closed_forms import recognise
from tests.support.collocation_step import Step
from tests.support.element_samples import ELEMENTS, SPRING, bushing, everything, spring
from tests.support.models import (
    DOWN,
    chain,
    deck,
    drag,
    free_bodies,
    pendulum,
    random_vector,
    simulate,
)

SINGLE = Path(__file__).parents[3] / "decks" / "thesis" / "single_pendulum_45.xml"
DEGREES = (1, 2, 3, 4, 5)
every_degree = pytest.mark.parametrize("degree", DEGREES)


def of_degree(model, degree):
    """``model`` by the gauss scheme."""
    return replace(model, simulation=replace(model.simulation, scheme="gauss", degree=degree))


@every_degree
def test_a_rule_integrates_what_it_should(degree):
    tableau, s = new_tableau("gauss", degree), degree
    t = np.append(0.0, tableau.constraint_time)
    for power in range(2 * s):
        integral = tableau.force_weight @ tableau.force_time**power
        assert integral == pytest.approx(1.0 / (power + 1), abs=1e-15)
    # Joint forces: all of Lobatto's rule but its last node, where every power is 1.
    last = 1.0 - tableau.multiplier_weight.sum()
    for power in range(2 * s):
        integral = tableau.multiplier_weight @ t[:s] ** power + last
        assert integral == pytest.approx(1.0 / (power + 1), abs=1e-15)
    # A momentum that is a rate of the unknowns gives the unknowns; numbers of the size of s^2.
    np.testing.assert_allclose(tableau.beta @ tableau.basis_rate, np.eye(s), atol=1e-13)
    # A constant force, of loads or of joints, displaces by t^2/2.
    np.testing.assert_allclose(tableau.alpha.sum(axis=1), -0.5 * t[1:] ** 2, atol=1e-13)
    # What it interpolates, it interpolates exactly: powers up to s - 1, and s where more is given.
    power = tableau.force_time ** (s - 1)
    np.testing.assert_allclose(tableau.integral @ power, t[1:] ** s / s, atol=1e-14)
    np.testing.assert_allclose(tableau.basis @ t[1:] ** s, tableau.force_time**s, atol=1e-14)
    np.testing.assert_allclose(tableau.basis_rate @ t[1:] ** s, s * power, atol=1e-13)


@pytest.mark.parametrize("scheme", COLLOCATION)
@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize(
    ("begin", "size"), [(-1.0, 1.0), (-0.8, 0.8), (-2.0, 2.0), (0.0, 2.0), (-1.0, 2.0)]
)
@pytest.mark.parametrize("near", [0.0, 1.0])
def test_a_guess_follows_the_known_polynomials(scheme, degree, begin, size, near):
    """Of the step before, also of another size, and of one that went through here."""
    step = Step(pendulum(), f"{scheme}{degree}", 0.1, np.random.default_rng(1))
    stages, tableau, s = step.stages, step.stages.tableau, degree
    t, h = 7.0, 0.1
    stages.last_step[:], stages.predicted_well[0] = (t + begin * h, size * h), near
    assert predictor.set_weights(stages, t, h)
    # Velocities where their step begins tell more, but where they jump there or the last guess was
    # far off. At the present place ours do, once, also where that is one of their nodes.
    follows = near > 0.0 and not tableau.decays
    at = np.append(begin + size * tableau.force_time, begin if follows else np.nan)
    power = np.count_nonzero(np.abs(np.nan_to_num(at)) > 1e-6)
    values = np.append(np.nan_to_num(at), 0.0) ** power
    # Times are known to round-off over the step; weights are up to 1e3 out of the nodes' range.
    np.testing.assert_allclose(stages.rate_weights @ values, tableau.force_time**power, atol=1e-9)
    pushes = (begin + size * tableau.multiplier_time) ** (s - 1)
    np.testing.assert_allclose(
        stages.multiplier_weights @ pushes * size**2, tableau.multiplier_time ** (s - 1), atol=1e-9
    )


def test_a_guess_follows_nothing_far_behind():
    step = Step(pendulum(), "gauss3", 0.1, np.random.default_rng(1))
    step.stages.last_step[:] = 0.0, 0.1
    assert not predictor.set_weights(step.stages, 0.1, 0.2)
    step.stages.last_step[1] = 0.0
    assert not predictor.set_weights(step.stages, 0.1, 0.1)


def test_the_local_parametrisation_rotates_as_it_says():
    """W = H c_dot against R of the parameters, and the derivatives against differences."""
    rng, step = np.random.default_rng(5), 1e-6
    c, a, z = rng.normal(size=(3, 3))

    def at(f, shift, *given):
        return np.array(f(tuple(c + shift), *map(tuple, given)))

    def slope(f, *given):
        return np.array(
            [(at(f, step * e, *given) - at(f, -step * e, *given)) / (2.0 * step) for e in np.eye(3)]
        ).T

    R_dot = (at(matrix, step * a) - at(matrix, -step * a)) / (2.0 * step)
    spin = R_dot @ at(matrix, 0.0).T
    W = (spin[2, 1], spin[0, 2], spin[1, 0])
    # Central differences: step^2, and round-off over the step.
    near = {"atol": 1e-9}
    np.testing.assert_allclose(at(local_rotation.tangent, 0.0) @ a, W, **near)
    np.testing.assert_allclose(at(local_rotation.parameter_rate, 0.0, W), a, **near)
    np.testing.assert_allclose(
        at(local_rotation.momentum, 0.0, at(local_rotation.parameter_rate, 0.0, a)), a
    )
    np.testing.assert_allclose(
        at(local_rotation.rate, 0.0, at(local_rotation.moment, 0.0, a)),
        np.array(at(local_rotation.tangent, 0.0).T @ at(local_rotation.moment, 0.0, a)),
    )
    np.testing.assert_allclose(
        at(local_rotation.momentum_slope, 0.0, z), slope(local_rotation.momentum, z), **near
    )
    np.testing.assert_allclose(
        at(local_rotation.rate_slope, 0.0, z), slope(local_rotation.rate, z), **near
    )
    np.testing.assert_allclose(
        at(local_rotation.curvature, 0.0, z, a),
        slope(lambda c, z, a: a @ np.array(local_rotation.momentum_slope(c, z)), z, a),
        **near,
    )


@pytest.mark.parametrize("make", ELEMENTS.values(), ids=ELEMENTS)
def test_the_derivative_of_every_element(make):
    rng = np.random.default_rng(8)
    # Differences: third derivatives times 1e-10, and round-off of numbers near 1 over 1e-5.
    assert Step(make(rng), "gauss2", 0.1, rng).differs(rng) <= 1e-7


def test_blocks_are_factored_as_the_complete_matrix():
    rng = np.random.default_rng(3)
    step = Step(chain(4), "gauss3", 0.05, rng)
    A, lu = step.derivative(), step.unknowns.elimination
    size = step.shape[0] * step.shape[1]
    right = rng.normal(size=step.shape)
    place = np.argsort(step.unknowns.free)
    order = place[np.searchsorted(step.unknowns.free[place], lu.order)]
    factor, stages = np.zeros((int(lu.base[-1]), 3, 3)), step.stages
    y = np.ascontiguousarray(right[:, order].T)
    block_lu.factor(lu, stages.source, stages.values, factor, np.zeros(3, dtype=np.int64))
    block_lu.solve(lu, factor, y)
    dense = A.reshape(size, size)
    exact = np.linalg.solve(dense, right.reshape(-1)).reshape(step.shape)
    error = np.abs(y.T - exact[:, order]).max()
    # No search among blocks: some digits less than the condition allows.
    assert error <= 1e-13 * np.linalg.cond(dense) * np.abs(exact).max()


CLOSED = {
    "single_pendulum_45": {1: 0.02, 2: 0.1, 3: 0.2, 4: 0.4, 5: 0.4},
    "top_1": {1: 0.002, 2: 0.02, 3: 0.04, 4: 0.05, 5: 0.16},
}
"""Largest of two steps [s] by degree, between too coarse and round-off."""


def errors(run, states, forces):
    """Position, orientation, velocity, spin, force: largest errors of a run's last row."""
    parts = np.abs(run.states[-1, 1:] - states).reshape(-1, 4, 3).max(axis=(0, 2))
    return np.append(parts, np.abs(run.reactions[-1, 1:] - forces).max())


@every_degree
@pytest.mark.parametrize("name", CLOSED)
def test_orders_against_closed_forms(name, degree):
    model, coarse = of_degree(deck(name), degree), CLOSED[name][degree]
    exact, found = recognise(model), []
    for h in (coarse, 0.5 * coarse):
        run = simulate(model, dt=h, t_final=2.0 if coarse > 0.2 else 1.0)
        end = run.time[-1:]
        found.append(errors(run, exact.states(end)[0], exact.forces(end).reshape(-1)))
        assert run.report.extremes["constraintViolationMax"] <= 1e-13
        assert run.report.extremes["constraintViolationRateMax"] <= 1e-13
    assert np.log2(found[0] / found[1]) == pytest.approx(2.0 * degree, abs=0.15)


@pytest.mark.parametrize("name", ["double_pendulum_89", "four_bar_sketched", "andrews_squeezer"])
def test_mechanisms_stay_closed(name):
    model = of_degree(deck(name), 2)
    run = simulate(model, t_final=100 * model.simulation.dt, solver="newton")
    assert run.report.extremes["constraintViolationMax"] <= 1e-13
    assert run.report.extremes["constraintViolationRateMax"] <= 1e-13


def with_smooth_friction(contact):
    """A contact whose friction is smooth at all slips of the test: no step is divided for it."""
    law = contact.compliance
    if law is None or law.friction_width is None:
        return contact
    return replace(contact, compliance=replace(law, friction_width=50.0))


@pytest.mark.slow
def test_every_element_together_has_the_order_of_the_scheme():
    model = everything(np.random.default_rng(4))
    model = replace(model, contacts=tuple(map(with_smooth_friction, model.contacts)))
    best = simulate(model, dt=0.0025, t_final=0.1, scheme="gauss3", solver="newton")
    for scheme, order, h in (("gauss2", 4.0, 0.02), ("radau2", 3.0, 0.005)):
        found = []
        for dt in (h, 0.5 * h):
            run = simulate(model, dt=dt, t_final=0.1, scheme=scheme, solver="newton")
            assert run.report.status == "completed"
            found.append(np.abs(run.states[-1] - best.states[-1]).max())
        assert np.log2(found[0] / found[1]) == pytest.approx(order, abs=0.5)


@pytest.mark.parametrize(("degree", "steps"), [(4, (4, 5, 6)), (5, (2, 3, 4))])
def test_smooth_loads_of_all_kinds_leave_the_order(degree, steps):
    """Two bodies on a spring and a damper, a bushing, drag: no table, and nothing comes to rest."""
    rng = np.random.default_rng(8)
    model = free_bodies(rng, 2)
    held = replace(bushing(rng, model), name="Bushing")
    loads = (spring(rng, model, **SPRING), held, drag("Drag", "B0", random_vector(rng), 0.4))
    model, T = replace(model, loads=loads), 0.3
    best = simulate(model, T / 16, T, "gauss5").states[-1]
    # Errors of 1e-6 to 1e-12, well above round-off.
    found = [
        np.abs(simulate(model, T / n, T, f"gauss{degree}").states[-1] - best).max() for n in steps
    ]
    order = -np.polyfit(np.log(steps), np.log(found), 1)[0]
    # A load with a jump in its derivative would show an order of 4 or less; at such steps it may be
    # more than 2s.
    assert order >= 2.0 * degree - 0.5


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_the_energy_error_does_not_grow(degree):
    """Over 2000 periods of a pendulum, 20 steps each: the last are as good as the first."""
    model = of_degree(pendulum(60.0), degree)
    period, steps = 4.0, 40_000
    run = simulate(model, dt=0.05 * period, t_final=0.05 * period * steps, solver="newton")
    v, w, z = run.of("velocity"), run.of("spin"), run.of("position")[:, 2]
    (bob,) = model.bodies
    kinetic = 0.5 * bob.mass * (v**2).sum(axis=1) + 0.5 * bob.inertia[0][0] * (w**2).sum(axis=1)
    error = np.abs(kinetic - bob.mass * model.gravity[2] * z + bob.mass * model.gravity[2] * z[0])
    tenth = steps // 10
    first, last = error[:tenth].max(), error[-tenth:].max()
    # A step whose parametrisation is not varied with its beginning is not symplectic: the error of
    # s = 1 then grows by 2 parts in 1000 in this time, that of s = 2 by 2 in 100. Round-off has its
    # own share.
    assert last <= 1.0005 * first + 1e-11 * kinetic.max()
    assert first <= 0.05 * kinetic.max()


def test_momentum_of_free_bodies_is_kept():
    """Bodies held to each other, not to the ground: both momenta, to round-off."""
    model = of_degree(ELEMENTS["chain"](np.random.default_rng(2), gravity=False), 3)
    run = simulate(model, dt=0.02, t_final=2.0, solver="newton")
    linear, angular = np.zeros((2, len(run.time), 3))
    for b, body in enumerate(model.bodies):
        R, w = run.matrices(b), run.of("spin", b)
        x = run.of("position", b) + R @ body.r_BG
        v = np.einsum("tij,tj->ti", R, run.of("velocity", b) + np.cross(w, body.r_BG))
        linear += body.mass * v
        angular += body.mass * np.cross(x, v) + np.einsum(
            "tij,tj->ti", R, w @ np.array(body.inertia)
        )
    for momentum in (linear, angular):
        # A hundred steps of round-off each.
        assert np.abs(momentum - momentum[0]).max() <= 1e-12 * np.abs(momentum).max()


@pytest.mark.parametrize(
    "name",
    [
        "double_pendulum_89",
        "revolute",
        pytest.param("bricard", marks=pytest.mark.slow),
        "rolling_disk_coin",
    ],
)
def test_both_solvers_find_the_same_motion(name):
    path = {"rolling_disk_coin": SINGLE.parents[1] / "joints" / "rolling_disk.xml"}.get(name)
    model = of_degree(read_deck(path) if path else deck(name), 2)
    # In absolute coordinates both: trees have another truncation error in joint coordinates.
    newton = simulate(model, dt=0.02, t_final=0.2, solver="newton", full=True)
    root = simulate(model, dt=0.02, t_final=0.2, solver="root")
    assert (root.report.scipy_steps, newton.report.scipy_steps) == (10, 0)
    scale = np.abs(newton.states).max()
    # Both to residuals of 1e-12 of a step.
    np.testing.assert_allclose(newton.states, root.states, atol=1e-10 * scale)
    if not newton.report.non_unique_reactions:
        # Those of redundant joints are not unique.
        near = 1e-8 * np.abs(newton.reactions).max()
        np.testing.assert_allclose(newton.reactions, root.reactions, atol=near)
    assert max(run.report.extremes["constraintViolationMax"] for run in (newton, root)) <= 1e-13


@pytest.mark.parametrize(
    "name", ["double_pendulum_89", "two_pendulums", "four_bar", "ballistic_cylinder"]
)
def test_what_is_omitted_changes_nothing(name, monkeypatch):
    # Reductions that have no truncation error of their own.
    monkeypatch.setattr(SubsystemIntegrator, "joint_coordinates", False)
    model = of_degree(deck(name), 3)
    given = {"dt": 0.01, "t_final": 0.5, "solver": "newton"}
    reduced, full = simulate(model, **given), simulate(model, full=True, **given)
    scale = np.abs(full.states).max()
    np.testing.assert_allclose(reduced.states, full.states, atol=1e-11 * scale)


def test_a_hard_step_is_taken_in_parts_and_the_last_is_short():
    """The triple pendulum's violent moments at a step far too long, and an end between steps."""
    model = of_degree(deck("triple_pendulum_135"), 3)
    run = simulate(model, dt=0.4, t_final=9.5)
    assert run.report.status == "completed"
    assert run.report.subdivisions + run.report.scipy_steps > 0
    assert run.time[-1] == 9.5
    # Residuals of 1e-12 of steps of 20 m, the last of which is that of scipy's solver.
    assert run.report.extremes["constraintViolationMax"] <= 1e-12 * 20.0
    # A step of another size begins from the accelerations alone and ends on the same curve.
    short = simulate(of_degree(deck("single_pendulum_45"), 4), dt=0.3, t_final=1.0)
    exact = recognise(short.model).states(short.time)
    assert np.abs(short.states[:, 1:] - exact).max() <= 1e-8


@pytest.mark.parametrize(("full", "most"), [(True, 2.0), (False, 5.0)])
def test_one_derivative_and_few_iterations_a_step(full, most):
    """More of them in joint coordinates, by the mass matrix instead of the Jacobian."""
    model = of_degree(deck("double_pendulum_89"), 3)
    report = simulate(model, dt=0.02, t_final=10.0, full=full).report
    assert report.scipy_steps == report.subdivisions == 0
    assert report.factorisations <= 1.05 * report.steps
    assert report.iterations <= most * report.steps


def test_the_command_and_the_deck_ask_for_it(tmp_path):
    assert [split(word) for word in choices()[:3]] == [
        ("preserving", None),
        ("decaying", None),
        ("gauss", 1),
    ]
    words = ["run", str(SINGLE), "--dt", "0.1", "--t-final", "1", "-o", str(tmp_path / "a")]
    result = CliRunner().invoke(main, [*words, "--scheme", "gauss2"])
    assert result.exit_code == 0, result.output
    options = json.loads((tmp_path / "a" / "run.json").read_text())["options"]
    assert (options["scheme"], options["degree"], options["reactions"]) == (
        "gauss",
        2,
        "instantaneous",
    )
    again = read_deck(tmp_path / "a" / "deck.xml").simulation
    assert (again.scheme, again.degree) == ("gauss", 2)
    result = CliRunner().invoke(main, ["run", str(SINGLE), "--scheme", "gauss9"])
    assert result.exit_code == 2


def test_a_step_that_failed_leaves_nothing_to_follow():
    """Its unknowns stand where those of the step before were, and are no guess for the next one:
    halves of hard steps failed by what the complete step had left."""
    states = []
    for fails in (False, True):
        model = with_step(replace(chain(5), gravity=DOWN), 0.25, scheme="gauss3")
        integrator = SubsystemIntegrator(model, "newton", False, 1)
        assert integrator.stepper.method.take_step(0.25, 1.0).converged
        if fails:
            assert not integrator.stepper.method.take_step(8.0, 1.0).converged
        else:
            integrator.stepper.reset_prediction()
        assert integrator.stepper.method.take_step(0.05, 1.0).converged
        states.append(integrator.workspace.state.x.copy())
    assert np.array_equal(*states)
