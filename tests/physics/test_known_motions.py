"""Motions that are known, the rate at which they are approached, and what must stay constant."""

import re
from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.rotation import from_axis_angle
from msahl.algebra.vector import ZERO
from msahl.deck import read_deck
from msahl.model import ConcentratedLoad
from msahl.system.names import work_columns
from tests.support.models import (
    DECKS,
    GROUND,
    body,
    build_model,
    deck,
    frame,
    loaded,
    pendulum,
    simulate,
)
from tests.support.reference_motions import PendulumChain, euler_motion, pendulum_path, top_path

TOPS = {1: (0.0, 0.9888, 7.5167), 2: (0.0, 0.20905, 6.2964), 3: (0.0, 0.0, 6.3794)}


def slopes(steps, errors):
    """Measured orders between neighbouring steps."""
    return np.diff(np.log(errors)) / np.diff(np.log(steps))


def at_rest_of(model, t_final, steps, known, body=-1):
    """Position errors at ``t_final`` for each step."""
    runs = (simulate(model, dt=h, t_final=t_final) for h in steps)
    return [np.linalg.norm(run.of("position", body)[-1] - known) for run in runs]


# Order -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [45, 89, 135])
def test_the_single_pendulum_is_approached_with_order_two(degrees):
    steps = [0.04, 0.02, 0.01, 0.005, 0.0025]
    known = pendulum_path(10.0, np.radians(degrees))
    errors = at_rest_of(pendulum(degrees), 10.0, steps, known)
    assert slopes(steps, errors) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(("degrees", "t_final"), [(45, 10.0), (89, 10.0), (135, 5.0)])
def test_the_double_pendulum_is_approached_with_order_two(degrees, t_final):
    # At 135 degrees the bobs fly through a sharp rotation before 10 s; coarse steps miss it.
    steps = [0.008, 0.004, 0.002, 0.001]
    known = PendulumChain(2).path(np.radians(degrees), [0.0, t_final])[-1, 1]
    errors = at_rest_of(deck(f"double_pendulum_{degrees}"), t_final, steps, known)
    assert slopes(steps, errors) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("case", TOPS)
def test_the_top_is_approached_with_order_two(case):
    steps = [0.02, 0.01, 0.005, 0.0025]
    known = top_path(10.0, np.radians(10.0), TOPS[case])
    errors = at_rest_of(deck(f"top_{case}"), 10.0, steps, known)
    assert slopes(steps, errors) == pytest.approx(2.0, abs=0.1)


def test_reactions_are_approached_with_order_two():
    """Row k is the mean over its step, so the exact force at mid-step is the measure."""
    steps, errors = [0.04, 0.02, 0.01, 0.005], []
    m, L, inertia, g, e = 2.0, 5.0, 0.008, 9.80665, 1e-3
    for h in steps:
        run = simulate(pendulum(45.0), dt=h, t_final=4.0)
        middle = run.time[1:] - h / 2
        # Fourth-order difference of the closed form: its error, e^4 and eps/e^2, is below 1e-8.
        weights = {-2: -1, -1: 16, 0: -30, 1: 16, 2: -1}
        a = sum(
            w * pendulum_path(middle + k * e, np.radians(45.0), m=m, L=L, inertia=inertia, g=g)
            for k, w in weights.items()
        ) / (12 * e * e)
        errors.append(np.abs(run.force()[1:] - m * (a - [0.0, 0.0, g])).max())
    assert slopes(steps, errors) == pytest.approx(2.0, abs=0.1)


# Known motions -----------------------------------------------------------------------------------

# The printed digits of the library of benchmarks, to half a unit of the last.
PRINTED = {
    "single_pendulum_45": (10.0, pendulum_path(10.0, np.pi / 4), (2.365540054, 0.0, 4.405022162)),
    "single_pendulum_45 at 100 s": (
        100.0,
        pendulum_path(100.0, np.pi / 4),
        (-3.274317336, 0.0, 3.778736029),
    ),
    "single_pendulum_135": (
        10.0,
        pendulum_path(10.0, 3 * np.pi / 4),
        (-3.728607586, 0.0, -3.331288860),
    ),
    "top_1": (
        10.0,
        top_path(10.0, np.pi / 18, TOPS[1]),
        (0.0183548159, 0.0416309222, 0.1947561733),
    ),
    "top_2": (
        10.0,
        top_path(10.0, np.pi / 18, TOPS[2]),
        (0.0031555762, 0.0321397318, 0.1973754797),
    ),
    "top_3": (
        10.0,
        top_path(10.0, np.pi / 18, TOPS[3]),
        (0.0101412533, 0.0332846139, 0.1969499669),
    ),
}


@pytest.mark.parametrize(("t", "known", "printed"), PRINTED.values(), ids=PRINTED)
def test_the_closed_forms_give_the_printed_digits(t, known, printed):
    assert known == pytest.approx(printed, abs=6e-10)


def test_the_double_pendulum_gives_the_printed_digits():
    for degrees, (x, z) in {
        45: (-4.909787856, 8.493395258),
        89: (-9.680271575, -0.597982252),
    }.items():
        found = PendulumChain(2).path(np.radians(degrees), [0.0, 10.0])[-1, 1]
        # The last digit printed came from another integration of the same tolerance.
        assert found == pytest.approx((x, 0.0, z), abs=3e-9)


EXPECTED = re.compile(
    r"t = ([\d.]+) s \(x, z\) = \(([^)]*)\)|t = ([\d.]+) s \(([^)=]*,[^)=]*,[^)=]*)\) m"
)


def expected(path):
    """Time and position that the comment of a deck announces, or None."""
    comment = " ".join(path.read_text().split("-->")[0].split())
    found = EXPECTED.search(comment)
    if found is None:
        return None
    t, numbers = (found[1], found[2]) if found[1] else (found[3], found[4])
    values = [float(x) for x in numbers.split(",")]
    return float(t), np.array(values if len(values) == 3 else (values[0], 0.0, values[1]))


PINNED = [path for path in DECKS if expected(path)]


def test_the_decks_that_announce_a_position_are_found():
    assert {path.stem for path in DECKS if path.parent.name == "thesis"} <= {p.stem for p in PINNED}


@pytest.mark.parametrize("path", PINNED, ids=lambda path: path.stem)
def test_a_deck_goes_where_its_comment_says(path):
    t, place = expected(path)
    h = 0.001
    coarse, fine = (simulate(read_deck(path), dt=e, t_final=t, every=1000) for e in (h, h / 2))
    ends = [run.of("position")[-1] for run in (coarse, fine)]
    # Extrapolated, the error falls with h^4: 1.4 hundredths of the difference for the wildest, the
    # triple pendulum from 135 degrees. The comments print nine decimals.
    best = (4 * ends[1] - ends[0]) / 3
    tolerance = 2e-9 + np.abs(ends[1] - ends[0]).max() / 50
    assert tolerance < 1e-3, "the step is too coarse to judge the comment"
    assert best == pytest.approx(place, abs=tolerance)


@pytest.mark.parametrize("h", [0.5, 0.1, 0.013])
def test_a_thrown_body_follows_the_parabola_exactly(h):
    for name in ("ballistic_point", "ballistic_sphere", "ballistic_cylinder"):
        run = simulate(deck(name), dt=h)
        t = run.time
        known = np.stack([10 * t, 0 * t, 10 * t - 9.80665 * t**2 / 2], axis=1)
        assert run.of("position") == pytest.approx(known, abs=1e-13 * len(t))
    spin = simulate(deck("ballistic_sphere"), dt=h).of("spin")
    assert spin == pytest.approx(np.broadcast_to((0.0, 20.0, 0.0), spin.shape), abs=1e-11)


def test_a_wobbling_cylinder_rotates_as_it_should():
    run = simulate(deck("ballistic_cylinder"), dt=0.0005)
    angle = 30 * (0.02 - 0.19 / 3) / (0.19 / 3) * run.time
    known = np.stack([2 * np.cos(angle), 2 * np.sin(angle), np.full_like(angle, 30.0)], axis=1)
    # k^3 h^2 t / 12 = 4e-4 rad of phase at 2 s, on 2 rad/s.
    assert run.of("spin") == pytest.approx(known, abs=1e-3)


def test_a_conical_pendulum_stays_on_its_circle():
    run = simulate(deck("conical_pendulum"))
    x, rate = run.of("position"), 3.3566958455746914
    steady = 0.5, np.sqrt(0.75)
    # Steady to the order of the step: (W h)^2 / 12 = 2e-5.
    assert np.hypot(x[:, 0], x[:, 1]) == pytest.approx(steady[0], abs=2e-5)
    assert x[:, 2] == pytest.approx(steady[1], abs=2e-5)
    force = run.force()
    assert force[0] == pytest.approx((-2.0 * rate**2 * 0.5, 0.0, -2.0 * 9.80665), abs=1e-9)
    assert np.hypot(force[:, 0], force[:, 1]) == pytest.approx(2.0 * rate**2 * 0.5, rel=1e-4)
    angle = np.unwrap(np.arctan2(x[:, 1], x[:, 0]))
    assert abs(angle[-1]) / run.time[-1] == pytest.approx(rate, rel=5e-5)


def test_a_free_body_tumbles_as_eulers_equations_say():
    model = deck("torque_free")
    known = 1.35842847, 4.71509895, 1.21514704
    coarse, fine = (simulate(model, dt=h, t_final=10.0) for h in (0.001, 0.0005))
    ends = [run.of("spin")[-1] for run in (coarse, fine)]
    assert (4 * ends[1] - ends[0]) / 3 == pytest.approx(known, abs=1e-6)
    (own,) = model.bodies
    w, R = euler_motion(own.inertia, own.angular_velocity, np.eye(3), fine.time[::2000])
    # (w h)^2 a radian, of some 50 radians.
    assert fine.of("spin")[::2000] == pytest.approx(w, abs=3e-4)
    assert fine.matrices()[::2000] == pytest.approx(R, abs=3e-4)


@pytest.mark.parametrize("h", [0.1, 0.005])
def test_a_free_body_keeps_energy_and_angular_momentum(h):
    run = simulate(deck("torque_free"), dt=h)
    J, w = np.array(run.model.bodies[0].inertia), run.of("spin")
    momentum = np.einsum("tij,jk,tk->ti", run.matrices(), J, w)
    # Two thousand steps, each solved to 1e-14.
    assert np.abs(momentum - momentum[0]).max() < 2e-11 * np.abs(momentum[0]).max()
    energy = 0.5 * np.einsum("ti,ij,tj->t", w, J, w)
    assert np.abs(energy - energy[0]).max() < 2e-11 * energy[0]


def test_an_offset_body_swings_as_eulers_equations_say():
    """Everything at once: G is not B, a full inertia, oblique gravity, velocities in other axes."""
    model = deck("offset_body")
    (own,) = model.bodies
    (joint,) = model.joints
    pivot = joint.child_point if joint.child == own.name else joint.parent_point
    s = np.subtract(own.r_BG, pivot)
    J = np.array(own.inertia) + own.mass * ((s @ s) * np.eye(3) - np.outer(s, s))
    runs = [simulate(model, dt=h, t_final=4.0) for h in (0.002, 0.001)]
    fine = runs[1]
    w, R = euler_motion(
        J,
        own.angular_velocity,
        fine.matrices()[0],
        fine.time[[0, -1]],
        lambda R: own.mass * np.cross(s, R.T @ np.array(model.gravity)),
    )
    # The h^4 that extrapolation leaves is 1.4e-6 here, and falls by 16 when h is halved.
    spins = [run.of("spin")[-1] for run in runs]
    assert (4 * spins[1] - spins[0]) / 3 == pytest.approx(w[-1], abs=5e-6)
    rotations = [run.matrices()[-1] for run in runs]
    assert (4 * rotations[1] - rotations[0]) / 3 == pytest.approx(R[-1], abs=5e-6)
    places = [run.of("position")[-1] for run in runs]
    assert (4 * places[1] - places[0]) / 3 == pytest.approx(-R[-1] @ pivot, abs=5e-6)


# Round-off ---------------------------------------------------------------------------------------


def test_positions_do_not_wear_out():
    """A kilometre out, a hundred thousand small steps; plain sums would lose 1e-9 m."""
    far = body("A", position=(1000.0, 0.0, 0.0), velocity=(1.0 / 3.0, 0.1, 0.0))
    run = simulate(build_model([far]), dt=1e-4, t_final=10.0, every=1000)
    known = np.array([1000.0, 0.0, 0.0]) + run.time[:, None] * np.array([1.0 / 3.0, 0.1, 0.0])
    # A rounding or two of a number of 1000.
    assert np.abs(run.of("position") - known).max() < 5e-13


@pytest.mark.parametrize("away", [0.0, 1000.0])
def test_forces_stay_quiet_at_tiny_steps_and_far_out(away):
    """The violation is followed by increments: its round-off is that of a step, not of a place.

    The force is the violation's rounding error times 2 m/h^2 = 4e12 N/m: 1e-3 N from a
    place at 1 m, 1 N from one at 1 km, 1e-5 N from the arm's change in a step at 0.1 m/s.
    """
    model = pendulum()
    place = (away, 0.0, 0.0)
    bob = replace(model.bodies[0], position=tuple(np.add(model.bodies[0].position, place).tolist()))
    joint = replace(model.joints[0], parent_point=place)
    model = replace(model, bodies=(bob,), joints=(joint,))
    run = simulate(model, dt=1e-6, t_final=5e-4, solver="newton")
    assert np.abs(run.force()[1:] - run.force()[0]).max() < 2e-5


# Starting values ---------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("degrees", [5, 45, 89, 135])
def test_initial_reactions_follow_from_the_accelerations(n, degrees):
    name = ["single", "double", "triple"][n - 1]
    path = deck("triple_pendulum_5" if n == 3 else f"{name}_pendulum_45")
    bodies = []
    rotation = from_axis_angle((0.0, 1.0, 0.0), np.radians(degrees))
    for k, old in enumerate(path.bodies):
        place = (
            5.0 * (k + 1) * np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])
        )
        bodies.append(body(old.name, position=tuple(map(float, place)), orientation=rotation))
    run = simulate(
        build_model(bodies, path.joints, gravity=path.gravity, grounds=path.grounds),
        dt=0.01,
        t_final=0.01,
    )
    known = PendulumChain(n).first_reactions(np.radians(degrees))
    # The forces of three bodies of 2 kg, by a linear system of condition some 1e4.
    assert run.reactions[0, 1:].reshape(n, 3) == pytest.approx(known, abs=1e-10)


@pytest.mark.parametrize(("case", "speed"), [(1, 0.19776), (2, 0.04181), (3, 0.0)])
def test_the_tops_velocity_is_made_to_fit_its_spin(case, speed):
    run = simulate(deck(f"top_{case}"), t_final=1.0)
    assert run.of("velocity")[0] == pytest.approx((speed, 0.0, 0.0), abs=1e-15)
    assert run.of("spin")[0] == pytest.approx(TOPS[case], abs=1e-15)
    told = [w for w in run.report.warnings if f"{speed:.3g} m/s" in w and "PendulumBob" in w]
    assert len(told) == len(run.report.warnings) == (1 if speed else 0)


def test_velocities_that_no_translation_mends_change_by_the_least_mass():
    """A rod with both ends on the ground can rotate about itself alone."""
    ends = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
    rod = frame([ends], [(None, 0, end) for end in ends])
    spun = replace(rod.bodies[0], angular_velocity=(3.0, 0.0, 0.0))
    run = simulate(replace(rod, bodies=(spun,)), dt=0.01, t_final=0.01)
    assert run.of("spin")[0] == pytest.approx((1.0, 1.0, 1.0), abs=1e-12)
    assert "smallest change, weighted by mass" in run.report.warnings[0]


# Energy ------------------------------------------------------------------------------------------


def energy_balance(run):
    """Energy minus work of the loads [J], and kinetic energy, from the published rows alone."""
    names = work_columns(run.model)[1:]
    stored = np.array([1.0 if name.endswith(".energy") else -1.0 for name in names])
    total, kinetic = run.work[:, 1:] @ stored, 0.0
    for b, own in enumerate(run.model.bodies):
        w, R = run.of("spin", b), run.matrices(b)
        v = run.of("velocity", b) + np.cross(w, own.r_BG)
        x = run.of("position", b) + R @ np.array(own.r_BG)
        kinetic += 0.5 * (
            own.mass * np.sum(v * v, axis=1) + np.einsum("ti,ij,tj->t", w, own.inertia, w)
        )
        total = total - own.mass * x @ np.array(run.model.gravity)
    return total + kinetic, kinetic


def steps_of(path):
    """Step sizes a deck is tried at: the thesis's coarse ones, or about its own."""
    own = read_deck(path).simulation.dt
    return (0.1, 0.01) if path.parent.name in ("thesis", "basics") else (own, own / 2)


@pytest.mark.sampled
@pytest.mark.parametrize("which", [0, 1], ids=["large steps", "small steps"])
@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_every_deck_keeps_its_energy_and_its_joints(path, which):
    model, h = read_deck(path), steps_of(path)[which]
    t_final = 10.0 if path.parent.name in ("thesis", "basics") else model.simulation.t_final
    run = simulate(model, dt=h, t_final=t_final)
    report, extremes = run.report, run.report.extremes
    assert report.status == "completed"
    # What is asked for; the figures are some 1e-13, round-off of a thousand steps.
    assert extremes["energyErrorMax"] < 1e-9 * max(extremes["largestKineticEnergy"], 1e-3)
    assert extremes["constraintViolationMax"] < 1e-9
    balance, kinetic = energy_balance(run)
    error = np.abs(balance - balance[0]).max()
    # run.json reports what the published rows show, to their round-off.
    size = np.abs(balance).max() + np.abs(run.work[:, 1:]).max(initial=0.0)
    slack = 1e-14 * size + 1e-13 * kinetic.max()
    assert extremes["energyErrorMax"] == pytest.approx(error, abs=4 * slack)
    assert extremes["largestKineticEnergy"] == pytest.approx(kinetic.max(), rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("h", [0.05, 0.005])
def test_the_work_of_loads_is_the_energy_gained(seed, h):
    run = simulate(loaded(np.random.default_rng(seed)), dt=h, t_final=2.0)
    balance, kinetic = energy_balance(run)
    assert np.abs(run.work[-1, 1:]).max() > 0.1 * kinetic.max()  # the loads do matter
    assert np.abs(balance - balance[0]).max() < 1e-11 * kinetic.max()


def test_a_constant_push_gives_a_parabola_and_its_work():
    thrown = body("A", mass=2.0, inertia=(0.1, 0.2, 0.25))
    push = ConcentratedLoad("P", "A", ZERO, (4.0, 0.0, -2.0), GROUND.name, ZERO, GROUND.name)
    run = simulate(build_model([thrown], loads=[push]), dt=0.1, t_final=2.0)
    t = run.time[:, None]
    assert run.of("position") == pytest.approx(t**2 * np.array([1.0, 0.0, -0.5]), abs=1e-12)
    assert run.work[:, 1] == pytest.approx(5.0 * run.time**2, abs=1e-12)


def test_loads_deck_ends_where_its_comment_says():
    run = simulate(deck("loads"))
    assert run.of("position")[-1] == pytest.approx((25.0, 0.0, 3.125), abs=1e-9)
    assert run.of("spin")[-1] == pytest.approx((0.0, 0.0, 10.0), abs=1e-9)


def test_us_units_are_the_same_pendulum():
    here, there = (simulate(deck(n), dt=0.01) for n in ("us_units", "single_pendulum_45"))
    # The deck's numbers are SI ones divided by the units: a rounding each, over 10 s of swinging.
    assert here.of("position") == pytest.approx(there.of("position"), abs=1e-11)
