"""Explicit Runge-Kutta schemes: order, drift of the energy, motion of gauss, what they refuse."""

import math
from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
import pytest

from msahl.model.scheme import EXPLICIT
from msahl.run.explain import explain
from msahl.run.verdict import PASS
from msahl.schemes.explicit.stepper import MOST_DIVISIONS
from msahl.schemes.explicit.tableau import butcher
from msahl.start.velocities import StartError
from tests.support.closed_forms import recognise
from tests.support.models import deck, pendulum, simulate, simulate_and_estimate
from tests.support.trees import loaded_tree, random_tree


def rooted_trees(order):
    """All rooted trees with so many nodes: tuples of the trees at the root."""
    if order == 1:
        return [()]
    found = set()
    for sizes in partitions(order - 1):
        families = [()]
        for size in sorted(set(sizes)):
            groups = combinations_with_replacement(rooted_trees(size), sizes.count(size))
            families = [one + group for group in groups for one in families]
        found.update(families)
    return sorted(found, key=repr)


def partitions(total, most=None):
    """All ways to write ``total`` as a sum, largest numbers first."""
    if total == 0:
        return [[]]
    most = total if most is None else most
    return [
        [first, *rest]
        for first in range(min(total, most), 0, -1)
        for rest in partitions(total - first, first)
    ]


def nodes(tree):
    return 1 + sum(nodes(one) for one in tree)


def density(tree):
    return nodes(tree) * math.prod(density(one) for one in tree)


def weights(tree, a):
    """(s,) product over the tree's branches of the sums that they stand for, at each stage."""
    found = np.ones(len(a))
    for one in tree:
        found = found * (a @ weights(one, a))
    return found


@pytest.mark.parametrize("scheme", EXPLICIT)
def test_coefficients_satisfy_the_conditions_of_their_order_and_of_no_higher_one(scheme):
    a, b = butcher(scheme).a[:-1], butcher(scheme).a[-1]
    defects = {}
    for order in range(1, EXPLICIT[scheme] + 2):
        trees = rooted_trees(order)
        defects[order] = max(abs(b @ weights(tree, a) - 1.0 / density(tree)) for tree in trees)
    # 200 conditions for order 8; 1e-14: round-off of some hundred products of numbers up to 13.
    assert max(defect for order, defect in defects.items() if order <= EXPLICIT[scheme]) < 1e-14
    assert defects[EXPLICIT[scheme] + 1] > 1e-5
    assert np.all(np.triu(a) == 0.0)


STEPS = {
    "robot": {"rk4": (0.04, 3), "rk8": (0.08, 3)},
    "double_pendulum_89": {"rk4": (0.08, 3), "rk8": (0.16, 2)},
}
"""Largest step [s], and how often it is divided by two. The robot's motion begins fast, where the
output times fall into other parts of each step, so the slope from one step to its half is up to
5.8, by gauss2 as well."""


@pytest.mark.parametrize("scheme", EXPLICIT)
@pytest.mark.parametrize("name", STEPS)
def test_rows_have_the_order_of_the_scheme(name, scheme):
    """At the ends of steps and between them, where positions and reactions are interpolated."""
    model = deck(name)
    between = replace(model.simulation, output_interval=0.8 / 29.0, t_final=0.8)
    model = replace(model, simulation=between)
    exact = simulate(model, scheme="gauss5", dt=0.01)
    dt, times = STEPS[name][scheme]
    errors = []
    for size in (dt, dt / 2**times):
        found = simulate(model, scheme=scheme, dt=size)
        pairs = (found.states, exact.states), (found.reactions, exact.reactions)
        errors.append([np.abs(mine - its).max() for mine, its in pairs])
    slopes = np.log2(np.array(errors[0]) / errors[1]) / times
    # Half an order: the next term of the error.
    np.testing.assert_allclose(slopes, EXPLICIT[scheme], atol=0.5)


@pytest.mark.parametrize("scheme", EXPLICIT)
@pytest.mark.parametrize("seed", range(4))
def test_trees_of_all_joints_and_loads_move_as_by_gauss(seed, scheme):
    model = loaded_tree(np.random.default_rng(seed))
    dt = {"rk4": 5e-5, "rk8": 2e-3}[scheme]
    model = replace(model, simulation=replace(model.simulation, output_interval=2e-3))
    wanted = simulate(model, scheme="gauss4", dt=2e-3, t_final=0.02)
    found = simulate(model, scheme=scheme, dt=dt, t_final=0.02)
    assert found.report.tree_subsystems == found.report.subsystems
    for name in ("states", "reactions", "work"):
        mine, its = getattr(found, name), getattr(wanted, name)
        # 1e-10: the error of rk4 at a step of 5e-5 s; that of rk8 and gauss4 is round-off.
        assert np.abs(mine - its).max() < 1e-10 * max(1.0, np.abs(its).max())


LOOPS = {
    "four_bar_by_angle": 2e-3,
    "andrews_squeezer": 2e-5,
    "bricard": 0.01,
    "suspension": 2e-3,
    "stewart": 0.01,
    "cam_valve": 1e-3,
}


@pytest.mark.parametrize("name", LOOPS)
def test_loops_move_as_by_gauss_and_stay_closed(name):
    """Of hinges, balls, cams and prescribed motions, redundant ones among them."""
    model, dt = deck(name), LOOPS[name]
    wanted, found = (
        simulate(model, scheme=scheme, dt=dt, t_final=40 * dt) for scheme in ("gauss4", "rk8")
    )
    assert found.report.tree_subsystems == 1
    for table in ("states", "work"):
        mine, its = getattr(found, table), getattr(wanted, table)
        # 1e-11: round-off where a work is a small difference of large ones.
        assert np.abs(mine - its).max() < 1e-11 * max(1.0, np.abs(its).max())
    # Reactions that are not unique are equal, too: they are the least ones.
    apart = np.abs(found.reactions - wanted.reactions).max()
    assert apart < 1e-9 * np.abs(wanted.reactions).max()
    assert found.report.extremes["constraintViolationMax"] < 1e-12
    assert found.report.extremes["constraintViolationRateMax"] < 1e-11


@pytest.mark.parametrize(("scheme", "drifts"), [("rk4", True), ("rk8", True), ("gauss2", False)])
def test_energy_drifts_where_gauss_keeps_it(scheme, drifts):
    """Over some 200 periods: in the last quarter the error of rk is more than twice that of the
    first one, and grows on; that of gauss is as large as it was.
    """
    model = random_tree(np.random.default_rng(1), ("spherical", "universal"))
    run = simulate(model, scheme=scheme, dt={"rk8": 0.05}.get(scheme, 0.02), t_final=400.0)
    total = energy(run)
    error = np.abs(total - total[0])
    quarter = len(error) // 4
    assert bool(error[-quarter:].mean() > 2.0 * error[:quarter].mean()) == drifts


def energy(run):
    """(m,) total energy [J] of the bodies under gravity."""
    total = np.zeros(len(run.time))
    for b, body in enumerate(run.model.bodies):
        w, R = run.of("spin", b), run.matrices(b)
        v = run.of("velocity", b) + np.cross(w, body.r_BG)
        total += 0.5 * body.mass * (v**2).sum(axis=1)
        total += 0.5 * np.einsum("ij,ti,tj->t", np.array(body.inertia), w, w)
        total -= body.mass * (run.of("position", b) + R @ body.r_BG) @ run.model.gravity
    return total


@pytest.mark.parametrize("scheme", EXPLICIT)
def test_the_estimated_error_of_a_pendulum_is_about_the_true_one(scheme):
    """By elliptic functions, over four periods."""
    dt = {"rk4": 0.1, "rk8": 0.4}[scheme]
    run = simulate_and_estimate(deck("single_pendulum_45"), dt=dt, t_final=20.0, scheme=scheme)
    exact = recognise(run.model).states(run.time).reshape(len(run.time), 12)
    error = np.linalg.norm(run.of("position") - exact[:, :3], axis=1).max()
    assert error > 1e-9  # more than round-off
    assert error < run.report.error["position"] < 3.0 * error


@pytest.mark.parametrize("scheme", EXPLICIT)
def test_the_verdict_says_that_the_energy_drifts(scheme):
    dt = {"rk4": 0.2, "rk8": 0.8}[scheme]
    run = simulate_and_estimate(pendulum(), dt=dt, t_final=40.0, scheme=scheme, accuracy=1e-9)
    finding = run.report.verdict["checks"]["energy"]
    assert finding["word"] != PASS
    assert "explicit steps do not conserve it" in finding["text"]


@pytest.mark.parametrize("scheme", EXPLICIT)
def test_a_condition_ends_the_run_when_it_does_by_gauss(scheme):
    model = deck("stop")
    dt = {"rk4": 0.005, "rk8": 0.02}[scheme]
    wanted, found = simulate(model, scheme="gauss5", dt=0.01), simulate(model, scheme=scheme, dt=dt)
    assert found.report.status == wanted.report.status
    assert found.time[-1] < model.simulation.t_final
    # 1e-8 s: the error of the steps of rk4.
    assert found.time[-1] == pytest.approx(wanted.time[-1], abs=1e-8)
    assert np.abs(found.states[-1] - wanted.states[-1]).max() < 1e-6


def test_explain_names_the_scheme_and_the_coordinates():
    model = deck("robot")
    said = "\n".join(explain(replace(model, simulation=replace(model.simulation, scheme="rk8"))))
    assert "rk8, of order 8; explicit: does not conserve the energy, which drifts" in said
    assert "joint coordinates" in said


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("bouncing_ball", "contacts open and close"),
        ("bicycle", "constraints between rates have no joint coordinates"),
        ("right_angle", "beams have no joint coordinates"),
    ],
)
def test_models_without_joint_coordinates_are_refused(name, reason):
    with pytest.raises(StartError, match=f"rk4 takes steps in joint coordinates only.*{reason}"):
        simulate(deck(name), scheme="rk4", t_final=0.1)


@pytest.mark.parametrize("given", [{"full": True}, {"solver": "root"}])
def test_options_for_absolute_coordinates_are_refused(given):
    with pytest.raises(StartError, match="omit --full and --solver root"):
        simulate(pendulum(), scheme="rk4", dt=0.02, t_final=0.04, **given)


def test_a_stiff_model_is_named_where_steps_are_unstable():
    run = simulate(deck("flyball_governor"), scheme="rk4", dt=0.01, t_final=0.1)
    assert run.report.status == "not converged"
    assert "unstable where springs or dampers are stiff" in run.report.message
    assert "take a smaller --dt, or an implicit scheme" in run.report.message


def test_an_unstable_run_ends_after_few_divisions():
    """It took 630,000 of them, a thousand in each of its last steps."""
    run = simulate(deck("flyball_governor"), scheme="rk4", dt=0.002, t_final=1.0)
    assert run.report.status == "not converged"
    # Those of the steps before the last one are less than it may have, too, and these are few.
    assert run.report.subdivisions <= 3 * MOST_DIVISIONS
