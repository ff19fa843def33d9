"""Joint coordinates of open trees: symplectic steps, the motion of the absolute form, fallback."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.formulations.tree import recursion
from msahl.jit.compiled import compiled
from msahl.model.loads import JointSpring
from msahl.model.settings import OFF
from msahl.run.explain import explain
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.collocation.tableau import lagrange, new_tableau
from msahl.schemes.collocation.tree import loads, slopes
from msahl.schemes.collocation.tree import step as tree_step
from msahl.schemes.collocation.tree.predictor import predict
from msahl.schemes.collocation.tree.stages import SLOPES, STIFF
from tests.support.element_samples import SPRING, bushing, spring
from tests.support.models import deck, drag, random_vector, simulate
from tests.support.trees import TreeSteps, loaded_tree, random_tree, symplectic_form

SWINGING = ("revolute", "spherical", "prismatic", "universal", "spherical")


@pytest.mark.parametrize(
    ("kinds", "degree"),
    [
        (SWINGING, 1),
        (("spherical", "planar", "spherical"), 1),
        (("cylindrical", "rigid", "universal"), 1),
        (("spherical", "universal"), 2),
        (("spherical", "spherical"), 3),
        (("spherical", "spherical"), 4),
        (("free", "spherical", "revolute"), 1),
        (("free", "universal"), 2),
    ],
)
def test_a_step_is_symplectic(kinds, degree):
    steps = TreeSteps(random_tree(np.random.default_rng(7), kinds), degree)
    take_step = compiled(tree_step.take_step)
    start = steps.configuration()

    def begin(change):
        steps.set_configuration(start)
        return steps.moved(change)

    def end(change):
        steps.set_configuration(begin(change))
        assert take_step(*steps.arguments(0.02))
        return steps.configuration()

    before, after = (symplectic_form(*steps.variations(at)) for at in (begin, end))
    # 1e-11: ten times the error of the differences. With the momenta of a ball's hinges as they are
    # at the start, without the variation of their axes, the defect is 1.5e-6 at degree 1.
    np.testing.assert_allclose(after, before, atol=1e-11 * np.abs(before).max())


@pytest.mark.parametrize("seed", range(10))
def test_both_formulations_have_the_same_motion(seed, monkeypatch):
    """Of all kinds of joints and loads; the error of the steps themselves is below 1e-13 here."""
    model = loaded_tree(np.random.default_rng(seed))
    given = {"scheme": "gauss4", "dt": 2e-3, "t_final": 0.02}
    trees = simulate(model, **given)
    # Not by the option for full runs, which solves all subsystems, and the start, together.
    monkeypatch.setattr(SubsystemIntegrator, "joint_coordinates", False)
    absolute = simulate(model, **given)
    assert trees.report.tree_subsystems == trees.report.subsystems
    assert absolute.report.tree_subsystems == 0
    for name in ("states", "reactions", "work"):
        found, wanted = getattr(trees, name), getattr(absolute, name)
        # For reactions, too: constraints that are followed by increments leave their round-off in
        # the velocities, and velocities of 10 m/s that of the start.
        assert np.abs(found - wanted).max() < 1e-11 * max(1.0, np.abs(wanted).max())


@pytest.mark.parametrize("seed", range(3))
def test_free_bodies_carry_joints(seed, monkeypatch):
    """As above; a spring and drag act on bodies that no joint connects to the ground."""
    rng = np.random.default_rng(seed)
    model = random_tree(rng, ("free", "revolute", "universal", "free", "prismatic"))
    held = spring(rng, model, **SPRING, free_length=0.8)
    loads = (held, drag("D", "B1", random_vector(rng), 0.2))
    both = []
    for form in (True, False):
        monkeypatch.setattr(SubsystemIntegrator, "joint_coordinates", form)
        run = simulate(replace(model, loads=loads), scheme="gauss4", dt=2e-3, t_final=0.02)
        assert run.report.tree_subsystems == form * run.report.subsystems
        both.append(run)
    for name in ("states", "reactions", "work"):
        found, wanted = (getattr(run, name) for run in both)
        # Round-off of velocities of 10 m/s over ten steps.
        assert np.abs(found - wanted).max() < 1e-12 * max(1.0, np.abs(wanted).max())


@pytest.mark.parametrize("name", ["actuator_motor", "motor_four_bar", "cart_pole", "satellite"])
def test_auxiliary_states_are_the_same_in_both_formulations(name, monkeypatch):
    """Of motors, filters and controllers, whose states loads depend on."""
    runs = []
    for form in (False, True):
        monkeypatch.setattr(SubsystemIntegrator, "joint_coordinates", form)
        runs.append(simulate(deck(name), scheme="gauss4", dt=2.5e-3, t_final=0.1))
    assert runs[1].report.tree_subsystems == 1
    for name in ("states", "signals", "work"):
        absolute, tree = (getattr(run, name) for run in runs)
        # Steps of 1e-13; round-off of forty of them.
        assert np.abs(tree - absolute).max() < 1e-12 * max(1.0, np.abs(absolute).max())


def test_free_bodies_keep_their_momentum():
    """A free tree without gravity, 1000 steps: no load changes the momenta of all bodies together,
    about any point.
    """
    rng = np.random.default_rng(3)
    model = random_tree(rng, ("free", "spherical", "revolute", "universal"), gravity=False)
    run = simulate(model, scheme="gauss2", dt=0.01, t_final=10.0)
    assert run.report.tree_subsystems == 1
    linear, angular = np.zeros((2, len(run.time), 3))
    for b, body in enumerate(model.bodies):
        R, w = run.matrices(b), run.of("spin", b)
        own = run.of("velocity", b) + np.cross(w, body.r_BG)
        v = body.mass * np.einsum("tij,tj->ti", R, own)
        linear += v
        angular += np.cross(run.of("position", b) + R @ body.r_BG, v)
        angular += np.einsum("tij,jk,tk->ti", R, np.array(body.inertia), w)
    for momentum in (linear, angular):
        # Round-off of places of up to 50 m and of orientations over 1000 steps.
        assert np.abs(momentum - momentum[0]).max() < 1e-12 * 50.0 * np.abs(momentum[0]).max()


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_motion_and_reactions_have_the_order_of_the_scheme(degree):
    model = random_tree(np.random.default_rng(3), SWINGING)
    exact = simulate(model, scheme="gauss4", dt=0.0025, t_final=0.4)
    errors = []
    for dt in (0.04, 0.02):
        found = simulate(model, scheme=f"gauss{degree}", dt=dt, t_final=0.4)
        assert found.report.tree_subsystems == found.report.subsystems
        pairs = ((found.states, exact.states), (found.reactions, exact.reactions))
        errors.append([np.abs(a[-1] - b[-1]).max() for a, b in pairs])
    orders = np.log2(np.array(errors[0]) / errors[1])
    # Half an order: the next term of the error, at two steps of which the larger one is not small.
    np.testing.assert_allclose(orders, 2 * degree, atol=0.5)


def test_the_energy_of_many_periods_does_not_drift():
    """Of bodies on a ball and a universal joint, over some 200 periods of 100 steps: the last tenth
    is as good as the first.
    """
    model = random_tree(np.random.default_rng(1), ("spherical", "universal"))
    run = simulate(model, scheme="gauss2", dt=0.02, t_final=400.0)
    assert run.report.tree_subsystems == run.report.subsystems
    kinetic, total = np.zeros((2, len(run.time)))
    for b, body in enumerate(model.bodies):
        w, R = run.of("spin", b), run.matrices(b)
        v = run.of("velocity", b) + np.cross(w, body.r_BG)
        kinetic += 0.5 * body.mass * (v**2).sum(axis=1)
        kinetic += 0.5 * np.einsum("ij,ti,tj->t", np.array(body.inertia), w, w)
        total -= body.mass * (run.of("position", b) + R @ body.r_BG) @ model.gravity
    total += kinetic
    error, tenth = np.abs(total - total[0]), len(total) // 10
    # A chaotic motion visits other places later, which changes the largest error of a tenth.
    assert error[-tenth:].max() < 2.0 * error[:tenth].max()
    assert error.max() < 1e-3 * kinetic.max()


@pytest.mark.parametrize("degree", [1, 4])
def test_compiled_lanes_give_the_digits_of_plain_python(degree):
    model = loaded_tree(np.random.default_rng(5))
    plain, fast = TreeSteps(model, degree), TreeSteps(model, degree)
    take_step = compiled(tree_step.take_step)
    for _ in range(3):
        assert tree_step.take_step(*plain.arguments(0.02))
        assert take_step(*fast.arguments(0.02))
    for a, b in zip(plain.configuration(), fast.configuration(), strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-14 * max(1.0, np.abs(b).max()))


def stiff_chain(stiffness, damping):
    """Three bodies on revolute joints with springs and dampers, which begin to move at rest."""
    model = random_tree(np.random.default_rng(5), ("revolute", "revolute", "revolute"))
    loads = tuple(
        JointSpring(f"S{k}", joint.name, "angle", stiffness, damping)
        for k, joint in enumerate(model.joints)
    )
    return replace(model, loads=loads)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_slopes_change_no_step(degree):
    """Where both iterations converge they find the same rates, to round-off of ten steps."""
    model = stiff_chain(20.0, 0.5)
    plain, with_slopes = TreeSteps(model, degree), TreeSteps(model, degree)
    for _ in range(10):
        with_slopes.tree.figures[STIFF] = 0.0
        assert tree_step.take_step(*plain.arguments(0.005))
        assert tree_step.take_step(*with_slopes.arguments(0.005))
    assert plain.tree.figures[SLOPES] == 0.0 < with_slopes.tree.figures[SLOPES]
    for a, b in zip(plain.configuration(), with_slopes.configuration(), strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-13 * max(1.0, np.abs(b).max()))


@pytest.mark.parametrize(("stiffness", "damping"), [(1e6, 0.0), (2e4, 1e3)])
@pytest.mark.parametrize("degree", [2, 3, 4])
def test_stiff_steps_are_solved_in_joint_coordinates(degree, stiffness, damping):
    """Springs whose phase goes on by up to 10 rad in a step, and dampers by which rates fade in a
    hundredth of one: all converge, to steps as good as those of absolute coordinates.
    """
    model = stiff_chain(stiffness, damping)
    exact = simulate(model, scheme="gauss4", dt=2.5e-4, t_final=0.2).states[-1]
    given = {"scheme": f"gauss{degree}", "dt": 0.01, "t_final": 0.2, "error": OFF}
    tree, absolute = (simulate(model, full=full, **given) for full in (False, True))
    assert tree.report.tree_subsystems == tree.report.subsystems
    # Six a step with slopes, and one try without of up to ten.
    assert tree.report.iterations <= tree.report.subsystems * (20 * 6 + 10)
    errors = [np.abs(run.states[-1] - exact).max() for run in (tree, absolute)]
    assert errors[0] <= 1.05 * errors[1] + 1e-12


def test_slopes_are_derivatives_of_the_generalised_forces():
    """Of bodies on several kinds of joints, by central differences, whose error is that of a third
    derivative times 1e-10 and round-off over 1e-5: 1e-9 of the largest slope. By places loads are
    taken along the joints as they are; their directions do not count as slopes.
    """
    steps = loaded_steps(2)
    h, size, lane = 0.02, 1e-5, 1
    tree, motion, found = steps.tree.tree, steps.tree.motion, steps.tree.slopes
    given, rates = motion.q.copy(), motion.u.copy()

    def loads_at(places, rates):
        motion.q[:], motion.u[:] = places, rates
        recursion.set_places(tree, motion)
        recursion.set_twists(tree, motion)
        loads.set_loads(steps.tree, steps.workspace, steps.stages, h)
        return motion.load[6:, lane].copy()

    def differences(of):
        ends = ((of(-c), of(c)) for c in size * np.eye(tree.body.size)[:, :, None])
        return np.array([motions @ (a - b) / (2.0 * size) for a, b in ends]).T

    loads_at(given, rates)
    motions = unit_motions(tree, motion, lane)
    loads.set_slopes(found, steps.tree, steps.stages)
    by_rate = found.by_rate.copy(), differences(lambda c: loads_at(given, rates + c))
    # At rest, as places change velocities, too.
    loads_at(given, np.zeros_like(rates))
    loads.set_slopes(found, steps.tree, steps.stages)
    by_place = found.by_place.copy(), differences(lambda c: loads_at(given + c, 0.0 * rates))
    for slope, exact in (by_rate, by_place):
        assert np.count_nonzero(slope) > tree.body.size
        np.testing.assert_allclose(slope, exact, rtol=0.0, atol=1e-9 * np.max(np.abs(exact)))


def loaded_steps(degree):
    """Steps of bodies on several kinds of joints with springs and drag, at the motion predicted."""
    rng = np.random.default_rng(7)
    model = random_tree(rng, ("spherical", "universal", "cylindrical"))
    given = (spring(rng, model, **SPRING, free_length=0.8), bushing(rng, model))
    given = (*given, drag("D", "B1", random_vector(rng), 0.2))
    steps = TreeSteps(replace(model, loads=given), degree)
    h, motion = 0.02, steps.tree.motion
    recursion.begin(steps.tree.tree, motion, steps.state.x, steps.workspace.start.frames)
    predict(steps.tree, steps.stages, steps.workspace.start.frames.R, 0.0, h)
    loads.begin_loads(steps.workspace, steps.stages, h)
    assert tree_step.set_coordinates(steps.tree, h)
    recursion.set_places(steps.tree.tree, motion)
    return steps


def unit_motions(tree, motion, lane):
    """(n, 6 b) angular velocities and velocities of the mass centres by unit rates."""
    found = np.zeros((tree.body.size, tree.frame.size, 6))
    place = motion.place[:, lane].reshape(-1, 3)
    for k, b in np.argwhere(tree.precedes):
        a, s = motion.screw[6 * k : 6 * k + 6, lane].reshape(2, 3)
        found[k, b] = [*a, *(s + np.cross(a, place[b]))]
    return found[:, 1:].reshape(tree.body.size, -1)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_solutions_with_slopes_are_those_of_all_nodes_together(degree):
    """Of a tree with branches that stiff loads connect, to round-off."""
    steps, h, rng = loaded_steps(degree), 0.02, np.random.default_rng(degree)
    tree, motion, found = steps.tree.tree, steps.tree.motion, steps.tree.slopes
    recursion.set_twists(tree, motion)
    loads.set_loads(steps.tree, steps.workspace, steps.stages, h)
    n, found.used[0] = tree.body.size, 1.0
    tree_step.set_factors(steps.tree, steps.stages, h)
    mass = np.zeros((n, n))
    for k in range(n):
        j = k
        for entry in range(tree.row[k], tree.row[k + 1]):
            mass[k, j] = mass[j, k] = motion.mass[entry, :degree].mean()
            j = tree.before[j]
    c = new_tableau("gauss", degree).force_time
    A = lagrange(c, c, -1)
    together = np.kron(np.eye(degree), mass) + h * np.kron(A, found.by_rate)
    together += h * h * np.kron(A @ A, found.by_place)
    motion.y[:] = rng.normal(size=motion.y.shape)
    wanted = np.linalg.solve(together, motion.y[:, :degree].T.reshape(-1)).reshape(degree, n).T
    slopes.solve(found, tree, motion)
    np.testing.assert_allclose(
        motion.y[:, :degree], wanted, rtol=0.0, atol=1e-12 * np.abs(wanted).max()
    )


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("double_pendulum_89", "2 joint coordinates"),
        ("torque_free", "6 joint coordinates"),
        ("bricard", "those of what is not in the tree"),
        ("gear", "those of what is not in the tree"),
        ("friction_hinge", "friction depends on reactions"),
    ],
)
def test_explain_names_the_coordinates_and_why(name, words):
    model = deck(name)
    changed = replace(model, simulation=replace(model.simulation, scheme="gauss", degree=3))
    assert any(words in line for line in explain(changed))


def test_other_schemes_and_full_runs_are_in_absolute_coordinates():
    model = deck("double_pendulum_89")
    for given in ({"scheme": "radau2"}, {"scheme": "preserving"}, {"scheme": "gauss5"}):
        assert simulate(model, t_final=0.05, **given).report.tree_subsystems == 0
    for given in ({"full": True}, {"solver": "root"}):
        assert simulate(model, t_final=0.05, scheme="gauss2", **given).report.tree_subsystems == 0
