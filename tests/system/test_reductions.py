"""What is omitted of the equations is omitted exactly, and only where it may be."""

import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import msahl
from msahl.algebra.rotation import from_axis_angle
from msahl.algebra.rotation_arrays import rotations
from msahl.algebra.vector import ZERO
from msahl.deck import read_deck
from msahl.model import ConcentratedLoad, Ground, Joint, Law, PointMotion
from msahl.system.subsystems import split
from tests.support.models import (
    DECKS,
    GROUND,
    body,
    build_model,
    chain,
    deck,
    free_bodies,
    jointed,
    pendulum,
    random_body,
    ring,
    simulate,
)

# At dead points, which that deck runs through, reactions are determined to few digits.
REGULAR = [path for path in DECKS if path.stem != "dead_points"]


@pytest.mark.sampled
@pytest.mark.parametrize("path", REGULAR, ids=lambda path: path.stem)
@pytest.mark.parametrize(
    ("solver", "steps"),
    [("newton", 300), pytest.param("root", 20, marks=pytest.mark.slow)],
)
def test_the_reduced_equations_give_the_full_ones_answer(path, solver, steps):
    model = read_deck(path)
    h = model.simulation.dt
    t_final = min(steps * h, model.simulation.t_final)
    runs = [simulate(model, t_final=t_final, solver=solver, full=full) for full in (False, True)]
    # Newton omits what is exactly zero or exact: the same to the last bits. Root's norms take
    # in all unknowns, so it stops elsewhere within its 1e-12 of a step.
    points = path.parent.name in ("thesis", "basics")
    # Rows along directions round a little more than points that coincide.
    tolerance = {"newton": 1e-13 if points else 1e-12, "root": 1e-10}[solver]
    if runs[1].report.non_unique_reactions:
        tolerance = 1e-10  # redundant joints are relaxed, and full models have more of them
    for what in ("position", "orientation", "velocity", "spin"):
        for b in range(len(model.bodies)):
            known = runs[1].of(what, b)
            assert runs[0].of(what, b) == pytest.approx(known, abs=tolerance * _size(known))
    # A residual of round-off is a force of round-off times 2 m/h^2.
    force = runs[1].reactions
    assert runs[0].reactions == pytest.approx(force, abs=1e3 * tolerance * _size(force))
    assert runs[0].work == pytest.approx(runs[1].work, abs=1e-12 * _size(runs[1].work))


def _size(values):
    return max(1.0, np.abs(values).max(initial=0.0))


def reduction(model):
    """Subsystems, planar subsystems, unknowns."""
    report = simulate(model, dt=0.01, t_final=0.01).report
    return report.subsystems, report.planar_subsystems, report.unknowns


UNKNOWNS = {
    # 6 a body and 3 a joint; in a plane 3 and 2; thrown freely 3 for the rotation, or 1.
    "single_pendulum_45": (5, 9),
    "double_pendulum_89": (10, 18),
    "triple_pendulum_5": (15, 27),
    "top_1": (9, 9),
    "conical_pendulum": (9, 9),
    "torque_free": (3, 6),
    "ballistic_point": (1, 6),
    "ballistic_cylinder": (3, 6),
    "loads": (6, 6),
    "us_units": (5, 9),
}


@pytest.mark.parametrize("name", UNKNOWNS)
def test_how_many_unknowns_are_left(name):
    counts = [
        simulate(deck(name), t_final=deck(name).simulation.dt, full=full).report.unknowns
        for full in (False, True)
    ]
    assert tuple(counts) == UNKNOWNS[name]


@pytest.mark.parametrize("scheme", ["preserving", "gauss2", "rk4"])
def test_bodies_that_fall_freely_have_the_acceleration_of_gravity(scheme):
    """It was written as zero: the displacement of a ballistic body is no unknown."""
    model = free_bodies(np.random.default_rng(5), n=2)
    model = replace(model, bodies=tuple(replace(b, r_BG=ZERO) for b in model.bodies))
    options = {"scheme": scheme, "dt": 0.01, "t_final": 0.02, "error": "off"}
    run = msahl.Model(model).run(accelerations="yes", **options)
    for one in model.bodies:
        for row in range(3):
            P = [run[f"{one.name}.P{i}"][row] for i in (1, 2, 3)]
            found = [run[f"{one.name}.a{x}"][row] for x in "xyz"]
            # Round-off of one rotation.
            assert found == pytest.approx(rotations(np.array(P)).T @ model.gravity, abs=1e-13)


# Planar ------------------------------------------------------------------------------------------


def changed(model, place=0, **fields):
    bodies = list(model.bodies)
    bodies[place] = replace(bodies[place], **fields)
    return replace(model, bodies=tuple(bodies))


def with_load(model, **fields):
    given = {"point": ZERO, "force": ZERO, "moment": ZERO} | fields
    name = model.bodies[0].name
    load = ConcentratedLoad(
        name="L", body=name, force_basis=name, moment_basis=GROUND.name, **given
    )
    return replace(model, loads=(load,))


BOB = pendulum()
IN_PLANE = {
    "as it is": BOB,
    "moving in the plane": changed(BOB, angular_velocity=(0.0, 1.0, 0.0)),
    "pushed in the plane": with_load(BOB, force=(1.0, 0.0, 2.0), point=(0.5, 0.0, 0.1)),
    "rotated by a moment": with_load(BOB, moment=(0.0, 3.0, 0.0)),
    "a moment's arm does not matter": with_load(BOB, moment=(0.0, 3.0, 0.0), point=(0.0, 9.0, 0.0)),
    "unequal inertia": changed(BOB, inertia=((0.1, 0.0, 0.02), (0.0, 0.15, 0.0), (0.02, 0.0, 0.2))),
    "gravity across the pendulum": replace(BOB, gravity=(9.0, 0.0, -2.0)),
    "in the plane x = 0": pendulum(axis=(1.0, 0.0, 0.0)),
    "in the plane z = 0": replace(
        pendulum(axis=(0.0, 0.0, 1.0), arm=(5.0, 0.0, 0.0)), gravity=(3.0, 9.0, 0.0)
    ),
    "a chain": chain(4),
    # Every third wave has no height at six corners, but for 1e-16 of round-off.
    "but for round-off": ring(6, (0,)),
    "off the origin": replace(
        changed(BOB, position=tuple(np.add(BOB.bodies[0].position, (7.0, 3.0, -2.0)).tolist())),
        joints=(replace(BOB.joints[0], parent_point=(7.0, 3.0, -2.0)),),
    ),
}

OUT_OF_PLANE = {
    "velocity": build_model([body(velocity=(1.0, 1e-12, 0.0))], gravity=(0.0, 0.0, -9.8)),
    "spin": changed(BOB, angular_velocity=(0.0, 0.0, 1e-12)),
    "gravity": replace(BOB, gravity=(0.0, 1e-12, 9.8)),
    "arm": pendulum(arm=(0.0, 1e-9, 5.0)),
    "inertia": changed(BOB, inertia=((0.1, 1e-9, 0.0), (1e-9, 0.1, 0.0), (0.0, 0.0, 0.1))),
    "rotation": pendulum(axis=(0.0, 1.0, 1e-9)),
    "force": with_load(BOB, force=(1.0, 1e-12, 2.0)),
    "force beside the plane": with_load(BOB, force=(1.0, 0.0, 2.0), point=(0.0, 1e-9, 0.0)),
    "moment": with_load(BOB, moment=(1e-12, 3.0, 0.0)),
    "another body": ring(7),
    "a motion along the normal": build_model(
        [body(velocity=(1.0, 0.0, 0.0))],
        gravity=(0.0, 0.0, -9.8),
        motions=(
            PointMotion("P", "Bob", ZERO, (0.0, 1.0, 0.0), Law("sine", (0.3, 5.0, 0.0, 0.0))),
        ),
    ),
    "a force that is zero at the start": with_load(
        BOB, force=(0.0, 1.0, 0.0), law=Law("sine", (1.0, 5.0, 0.0, 0.0))
    ),
}


@pytest.mark.parametrize("model", IN_PLANE.values(), ids=IN_PLANE)
def test_a_model_in_a_plane_is_seen_as_one_and_moves_the_same(model):
    assert reduction(model)[1] == 1
    runs = [
        simulate(model, dt=0.01, t_final=2.0, solver="newton", full=full) for full in (False, True)
    ]
    for b in range(len(model.bodies)):
        # What is omitted is exactly zero in the full equations, too.
        assert runs[0].of("position", b) == pytest.approx(runs[1].of("position", b), abs=1e-12)
        assert runs[0].of("spin", b) == pytest.approx(runs[1].of("spin", b), abs=1e-11)


@pytest.mark.parametrize("model", OUT_OF_PLANE.values(), ids=OUT_OF_PLANE)
def test_whatever_leaves_the_plane_is_not_planar(model):
    assert reduction(model)[1] == 0


# Subsystems and free bodies
# -------------------------------------------------------------------------


def test_bodies_on_one_ground_are_subsystems_of_their_own():
    assert reduction(jointed(np.random.default_rng(0), 4))[0] == 2
    assert reduction(chain(4))[0] == 1
    assert reduction(free_bodies(np.random.default_rng(0), 5)) == (5, 0, 15)


def test_a_load_in_another_bodys_axes_couples_the_two():
    rng = np.random.default_rng(1)
    model = free_bodies(rng, 3)
    load = ConcentratedLoad("L", "B0", ZERO, (1.0, 0.0, 0.0), "B2", ZERO, GROUND.name)
    assert [[body.name for body in i.bodies] for i in split(replace(model, loads=(load,)))] == [
        ["B0", "B2"],
        ["B1"],
    ]
    assert reduction(replace(model, loads=(load,))) == (2, 0, 6 + 3 + 3)


def test_subsystems_come_back_to_the_places_of_the_deck():
    """Bodies, joints and loads of three subsystems, shuffled, have the columns of the deck."""
    rng = np.random.default_rng(2)
    model = jointed(rng, 5)
    extra = random_body(rng, "Free")
    push = ConcentratedLoad("P", "Free", ZERO, (1.0, 2.0, 3.0), GROUND.name, ZERO, GROUND.name)
    twist = ConcentratedLoad("T", "B1", ZERO, ZERO, GROUND.name, (0.0, 1.0, 0.0), "B1")
    order = [3, 0, 5, 4, 1, 2]
    everybody = (*model.bodies, extra)
    shuffled = replace(
        model,
        bodies=tuple(everybody[i] for i in order),
        joints=model.joints[::-1],
        loads=(push, twist),
    )
    assert len(split(shuffled)) == 3
    runs = [
        simulate(shuffled, dt=0.01, t_final=0.5, solver="newton", full=f) for f in (False, True)
    ]
    assert runs[0].states == pytest.approx(runs[1].states, abs=1e-11)
    assert runs[0].reactions == pytest.approx(runs[1].reactions, abs=1e-8)
    assert runs[0].work == pytest.approx(runs[1].work, abs=1e-11)


def test_a_hard_subsystem_does_not_disturb_an_easy_one():
    """The triple pendulum needs continuation for its steps, the single one beside it none."""
    wild, calm = deck("triple_pendulum_135"), pendulum(30.0)
    away = (100.0, 0.0, 0.0)
    bob = replace(calm.bodies[0], position=tuple(np.add(calm.bodies[0].position, away).tolist()))
    joint = replace(calm.joints[0], name="Calm", parent=wild.grounds[0].name, parent_point=away)
    both = replace(wild, bodies=(bob, *wild.bodies), joints=(*wild.joints, joint))
    runs = [simulate(m, dt=0.3, t_final=30.0) for m in (both, calm, wild)]
    together, alone, rest = runs
    assert together.report.path_steps == rest.report.path_steps > 0
    assert alone.report.path_steps == 0
    assert together.report.iterations == rest.report.iterations + alone.report.iterations
    assert together.of("position", 0) - away == pytest.approx(alone.of("position"), abs=1e-11)
    assert np.array_equal(together.of("position", 3), rest.of("position", 2))


def test_several_grounds_are_one():
    model = pendulum()
    arm = (0.0, 0.0, -5.0)
    second = replace(model.bodies[0], name="Second")
    joints = (*model.joints, Joint("P2", "spherical", "Moon", "Second", ZERO, arm))
    two = replace(
        model, grounds=(GROUND, Ground("Moon")), bodies=(*model.bodies, second), joints=joints
    )
    run = simulate(two, dt=0.01, t_final=1.0)
    assert (run.report.subsystems, run.report.planar_subsystems) == (2, 2)
    assert np.array_equal(run.of("position", 0), run.of("position", 1))
    assert np.array_equal(run.force(0), run.force(1))


def test_a_body_between_two_grounds_is_one_subsystem():
    model = chain(3)
    end = (2.1, 0.0, 2.1)
    last = model.bodies[-1]
    hold = Joint(
        "Far", "spherical", last.name, "Moon", tuple(np.subtract(end, last.position).tolist()), end
    )
    both = replace(model, grounds=(GROUND, Ground("Moon")), joints=(*model.joints, hold))
    assert len(split(both)) == 1


def test_a_model_without_ground_joints_or_loads_drifts():
    rotation = from_axis_angle((1.0, 2.0, 3.0), 1.0)
    lone = body("A", inertia=(1.0, 2.0, 2.5), orientation=rotation, velocity=(1.0, 0.0, 0.0))
    run = simulate(build_model([lone], grounds=()), dt=0.25, t_final=2.0)
    assert run.report.status == "completed"
    assert run.reactions.shape == run.work.shape == (9, 1)
    drift = run.of("position") @ run.of("position")[-1]
    assert drift == pytest.approx(run.time * 2.0, abs=1e-13)
    assert run.report.extremes["constraintViolationMax"] == 0.0


def test_a_model_at_rest_stays_at_rest():
    run = simulate(build_model([body("A", inertia=(1.0, 2.0, 2.5))]), dt=0.1, t_final=1.0)
    assert not run.states[:, 1:].any()
    assert run.report.iterations <= 1
    assert run.report.extremes["energyErrorMaxRelative"] is None


# The compiler ------------------------------------------------------------------------------------

PLAIN = """
import json, sys
sys.path.insert(0, sys.argv[1])
from tests.support.models import deck, loaded, simulate
import numpy as np
runs = [simulate(deck("double_pendulum_89"), dt=0.01, t_final=0.1, solver="newton"),
        simulate(loaded(np.random.default_rng(4)), dt=0.01, t_final=0.05)]
told = [[r.states.tolist(), r.reactions.tolist(), r.report.iterations] for r in runs]
json.dump(told, sys.stdout)
"""


def test_without_the_compiler_the_numbers_are_the_same(tmp_path):
    checkout = os.fspath(DECKS[0].parents[2])
    told = {}
    for flag in ("0", "1"):
        environment = os.environ | {"NUMBA_DISABLE_JIT": flag}
        ran = subprocess.run(
            [sys.executable, "-c", PLAIN, checkout],
            env=environment,
            capture_output=True,
            check=True,
            cwd=tmp_path,
        )
        told[flag] = json.loads(ran.stdout)
    for fast, plain in zip(told["0"], told["1"], strict=True):
        assert np.array(fast[0]) == pytest.approx(np.array(plain[0]), abs=1e-13)
        assert np.array(fast[1]) == pytest.approx(np.array(plain[1]), abs=1e-9)
        assert fast[2] == plain[2]
