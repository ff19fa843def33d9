"""The estimate of the global error, held against closed forms and far more accurate runs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

from msahl.algebra.rotation_arrays import angles
from msahl.algebra.vector import ZERO
from msahl.cli.main import main
from msahl.model import Joint, JointSpring, Law
from msahl.model.contacts import Compliance, PlaneContact
from msahl.model.loads import JointLoad
from msahl.run import companion
from msahl.run.companion import SAFETY
from msahl.run.verdict import DONE, FAIL, PASS, WARN
from tests.support.closed_forms import recognise
from tests.support.models import (
    DECKS,
    GROUND,
    body,
    build_model,
    deck,
    pendulum,
)
from tests.support.models import (
    simulate_and_estimate as simulate,
)

UP = (0.0, 0.0, 1.0)
NEAR = (0.3, 10.0)
"""Estimated over true error, at worst."""


def true_errors(run):
    """(rows,) true error of positions, from the closed form of a deck of one body."""
    exact = recognise(run.model).states(run.time).reshape(len(run.time), 12)
    distance = np.linalg.norm(run.of("position") - exact[:, :3], axis=1)
    rotation = angles(run.of("orientation"), exact[:, 3:6])
    return distance, rotation


@pytest.mark.parametrize(
    "scheme", ["preserving", "decaying", "gauss2", "gauss4", "radau1", "radau3"]
)
@pytest.mark.parametrize("name", ["single_pendulum_89", "top_2"])
def test_the_estimate_is_near_the_error_at_every_time(name, scheme):
    dt = 0.2 if scheme == "gauss4" else 0.02
    run = simulate(deck(name), dt=dt, t_final=2.0, scheme=scheme, error="estimate")
    distance, _ = true_errors(run)
    # Where the error has a zero in time, or is round-off, the quotient says nothing.
    told = distance > np.maximum(0.1 * distance.max(), 1e-11)
    ratio = run.errors[told, 1] / distance[told]
    assert told.any()
    assert (ratio > NEAR[0]).all()
    assert (ratio < NEAR[1]).all()


def test_run_and_companion_solve_a_step_in_the_same_coordinates():
    """A top by steps so large that they are left to absolute coordinates, as their halves would not
    be. Each form has an error of its own: their difference was a twentieth of the error.
    """
    model = deck("top_1")
    run = simulate(model, dt=1.0 / 30.0, t_final=2.0, scheme="gauss1", error="estimate")
    exact = simulate(model, dt=1.0 / 240.0, t_final=2.0, scheme="gauss4", every=8)
    error = np.linalg.norm(run.of("position") - exact.of("position"), axis=1).max()
    assert NEAR[0] < run.report.error["position"] / error < NEAR[1]


@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
def test_a_companion_of_higher_order_serves_as_well(monkeypatch, scheme):
    monkeypatch.setattr(companion, "CHEAP", 0.0)
    run = simulate(deck("single_pendulum_89"), dt=0.01, t_final=2.0, scheme=scheme, every=3)
    assert "times the step size" in run.report.error["companion"]
    distance, _ = true_errors(run)
    assert run.report.error["position"] == pytest.approx(SAFETY * distance.max(), rel=0.05)
    assert np.array_equal(run.errors[:, 0], run.time)
    # Means over steps have no counterpart in a scheme of higher order.
    assert ("force" in run.report.error) == (scheme != "preserving")


def test_an_expensive_companion_must_be_asked_for(monkeypatch):
    monkeypatch.setattr(companion, "CHEAP", 0.0)
    model = deck("single_pendulum_89")
    run = simulate(model, dt=0.05, t_final=0.5, scheme="gauss5")
    assert run.report.error is None
    assert run.report.verdict["word"] == DONE
    run = simulate(model, dt=0.05, t_final=0.5, scheme="gauss5", error="estimate")
    assert run.report.error["companion"] == "half the step"
    assert run.report.verdict["word"] == PASS


def by_tolerance(model, tolerance, **others):
    given = {"scheme": "auto", "tolerance": tolerance, **others}
    return replace(model, simulation=replace(model.simulation, **given))


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_the_tolerance_bounds_the_global_error(tolerance):
    run = simulate(by_tolerance(deck("single_pendulum_135"), tolerance), dt=0.1, t_final=10.0)
    distance, _ = true_errors(run)
    error = run.report.error
    assert max(error["position"], error["orientation"]) <= tolerance
    assert distance.max() <= error["position"]
    assert run.report.verdict["word"] == PASS


def test_a_motion_that_magnifies_errors_is_run_again():
    """The triple pendulum: within 4 s errors grow a thousandfold; the truth is a run at 1e-11 m."""
    model = deck("triple_pendulum_135")
    run = simulate(by_tolerance(model, 1e-6), dt=0.05, t_final=8.0)
    truth = simulate(by_tolerance(model, None, local_tolerance=1e-11), dt=0.05, t_final=8.0)
    made = run.report.step_control["runs"]
    assert len(made) > 1
    assert made[0]["error"] > 1e-6 >= made[-1]["error"]
    error = max(
        np.linalg.norm(run.of("position", b) - truth.of("position", b), axis=1).max()
        for b in range(3)
    )
    assert error <= run.report.error["position"] <= 1e-6
    assert len(run.time) == 161


def test_beyond_double_precision_the_time_is_reported():
    """90 degrees: chaotic after 20 s or so; round-off is a metre before 60 s."""
    run = simulate(by_tolerance(deck("chaos_90"), 1e-9), dt=0.5, t_final=80.0)
    assert run.report.status == "completed"
    assert len(run.time) == 161
    verdict = run.report.verdict
    assert verdict["word"] == WARN
    assert "the tolerance of 1e-09 m is met up to t = " in verdict["reasons"][0]


@pytest.mark.parametrize("part", [1.0, 0.5, 0.25])
def test_a_joint_motion_that_moves_between_the_steps_is_not_passed(part):
    """A sine whose period is the step, or a part of it: both runs see it at rest."""
    model = deck("joint_motion_sine")
    (joint_motion,) = model.motions
    law = Law("sine", (0.1, 2.0 * np.pi / (part * model.simulation.dt), 0.0, 0.0))
    run = simulate(replace(model, motions=(replace(joint_motion, law=law),)), t_final=0.5)
    assert run.report.error["position"] >= 0.1
    assert run.report.verdict["word"] != PASS
    # No row shows it, so there is no time up to which the run is good.
    assert "up to t = 0 s" in run.report.verdict["reasons"][0]


def test_what_rotates_fast_fails_with_a_remedy():
    """The top of the thesis at 0.76 rad a step: its phase is lost, and nothing else is wrong."""
    run = simulate(deck("top_1"))
    _, rotation = true_errors(run)
    length = np.linalg.norm(run.model.joints[0].child_point)
    assert run.report.error["orientation"] >= length * rotation.max()
    assert run.report.verdict["word"] == FAIL
    assert "--rotation-update exponential" in run.report.verdict["reasons"][0]


def path_of(name):
    (path,) = [path for path in DECKS if path.stem == name]
    return str(path)


def call(folder, *words):
    return CliRunner().invoke(main, ["run", *words, "-o", str(folder)])


def test_the_exit_status_follows_the_verdict(tmp_path):
    single, top = path_of("single_pendulum_45"), path_of("top_2")
    assert call(tmp_path / "a", single, "--t-final", "1").exit_code == 0
    failed = call(tmp_path / "b", single, "--dt", "0.1", "--accuracy", "1e-6")
    assert failed.exit_code == 1
    assert (tmp_path / "b" / "states.csv").exists()
    assert call(tmp_path / "c", top, "--t-final", "1").exit_code == 0
    assert call(tmp_path / "d", top, "--t-final", "1", "--strict").exit_code == 1
    done = call(tmp_path / "e", single, "--t-final", "1", "--error", "off", "--strict")
    assert done.exit_code == 0
    assert "DONE" in done.stderr
    assert not (tmp_path / "e" / "error.csv").exists()


def test_errors_stand_beside_the_rows(tmp_path):
    assert call(tmp_path, path_of("single_pendulum_45"), "--t-final", "0.1").exit_code == 0
    errors = np.genfromtxt(tmp_path / "error.csv", delimiter=",", names=True)
    states = np.genfromtxt(tmp_path / "states.csv", delimiter=",", names=True)
    assert errors.dtype.names == ("time", "position", "orientation")
    assert np.array_equal(errors["time"], states["time"])
    assert (np.diff(errors["time"]) > 0).all()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--accuracy", "nan"), "nan is not a finite number"),
        (("--accuracy", "inf"), "inf is not a finite number"),
        (("--scheme", "auto", "--tolerance", "1e-6", "--error", "off"), "needs its estimate"),
        (("--tolerance", "1e-6"), "takes the steps it is given"),
        (("--scheme", "auto", "--tolerance", "1e300"), "it is 1e+300 m"),
        (
            ("--scheme", "auto", "--tolerance", "1e-6", "--local-tolerance", "1e-6"),
            "give one of them",
        ),
    ],
)
def test_wrong_options_are_named(tmp_path, words, told):
    result = call(tmp_path / "out", path_of("single_pendulum_45"), *words)
    assert result.exit_code == 2
    assert told in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_pendulum_without_an_estimate_keeps_its_rows():
    estimated, off = (simulate(pendulum(), t_final=1.0, error=e) for e in (None, "off"))
    assert np.array_equal(estimated.states, off.states)
    assert np.array_equal(estimated.reactions, off.reactions)


def test_friction_that_is_not_resolved_is_an_error(tmp_path):
    """From rest the width of 1 mm/s is passed in 0.3 ms: by steps of 25 ms nobody sees it."""
    run = simulate(deck("friction_slide"), dt=0.025, t_final=1.5)
    # 0.29 mm/s at the end of the width, as integrated by itself: 0.43 mm after 1.5 s.
    assert 4.3e-4 <= run.report.error["position"] <= 10.0 * 4.3e-4
    assert call(tmp_path, path_of("friction_slide"), "--dt", "0.025").exit_code == 0
    fine = simulate(deck("friction_slide"), dt=1e-4, t_final=0.2)
    assert fine.report.error["position"] < 4.3e-4


def slide_with_friction(t, width=1e-3):
    """Way [m] of the block of ``friction_slide`` after ``t``, as integrated by itself."""
    along, press = 0.5 * 9.81, 0.2 * math.sqrt(0.75) * 9.81
    return solve_ivp(
        lambda t, y: (y[1], along - press * math.tanh(y[1] / width)),
        (0.0, t),
        (0.0, 0.0),
        method="LSODA",
        rtol=1e-13,
        atol=1e-16,
    ).y[0, -1]


@pytest.mark.parametrize("width", [1e-3, 1e-5])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_auto_sees_the_friction_beyond_its_width(tolerance, width):
    """A step that begins where the rate passes the width resolves what friction lacks there: the
    block was 9.5e-5 m too far at 1e-6.
    """
    model = deck("friction_slide")
    given = dict(model.loads[0].parameters) | {"width": width}
    rub = replace(model.loads[0], parameters=tuple(given.items()))
    settings = replace(model.simulation, tolerance=tolerance)
    run = simulate(replace(model, loads=(rub,), simulation=settings), t_final=1.5, scheme="auto")
    true = abs(np.linalg.norm(run.states[-1, 1:4]) - slide_with_friction(1.5, width))
    assert run.report.verdict["word"] == PASS
    # 1e-13 of the displacement of 3.6 m is what the reference is worth.
    assert true <= min(tolerance, run.report.error["position"] + 1e-12)


@pytest.mark.parametrize(("scheme", "dt"), [("gauss2", 0.01), ("gauss3", 0.002), ("radau2", 0.01)])
def test_friction_that_steps_end_at_is_not_unseen(scheme, dt):
    """Schemes of higher order end steps at widths of friction, and resolve what is between them, so
    that nothing remains unseen. A companion does not take the same part up to there.
    """
    run = simulate(deck("friction_slide"), dt, 0.05, scheme, solver="newton")
    true = abs(np.linalg.norm(run.states[-1, 1:4]) - slide_with_friction(0.05))
    assert NEAR[0] <= run.report.error["position"] / true <= NEAR[1]


def slides_to_rest(width):
    """A block that slides along x at 0.606 m/s, against friction of 0.2 in its rail."""
    along_x = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    rail = Joint("Rail", "prismatic", GROUND.name, "Block", ZERO, ZERO, along_x, along_x)
    given = (("coefficient", 0.2), ("radius", 1.0), ("width", width))
    rub = JointLoad("Rub", "friction", "Rail", "slide", given)
    block = body("Block", velocity=(0.606, 0.0, 0.0))
    return build_model([block], [rail], [rub], gravity=(0.0, 0.0, -9.81))


def rolls_to_no_slip(width):
    """A sphere of 1 kg that slides at 0.606 m/s on a soft floor until it rolls."""
    soft = Compliance(1e5, friction_width=width)
    law = {"restitution": 1.0, "friction": 0.2, "compliance": soft}
    floor = {"parent_point": ZERO, "child_point": ZERO, "normal": UP, "radius": 0.1}
    contact = PlaneContact("Floor", GROUND.name, "Ball", **floor, **law)
    place = (0.0, 0.0, 0.1 - 9.81 / 1e5)
    ball = body("Ball", 1.0, 0.004, place, velocity=(0.606, 0.0, 0.0))
    return build_model([ball], gravity=(0.0, 0.0, -9.81), contacts=(contact,))


def way_to_rest(speed, deceleration, width):
    """Way [m] of a speed v until friction has brought it to rest: of (v/a) coth(v/w)."""
    return (0.5 * speed**2 + (math.pi * width) ** 2 / 12.0) / deceleration


@pytest.mark.parametrize(
    ("scheme", "dt"), [("gauss2", 0.01), ("gauss3", 0.005), ("gauss3", 0.01), ("radau2", 0.005)]
)
@pytest.mark.parametrize("width", [1e-3, 1e-5])
@pytest.mark.parametrize("rolls", [False, True])
def test_steps_are_divided_where_friction_changes_fast(rolls, width, scheme, dt):
    """As a rate falls to zero within a step. The error was 1e-5 m, and the estimate often missed
    it by factors of a hundred.
    """
    model = rolls_to_no_slip(width) if rolls else slides_to_rest(width)
    run = simulate(model, dt, 0.4, scheme, solver="newton")
    if rolls:
        # Of the slip 2/7 is speed of the centre, which rolls on with 5/7 of what it had.
        exact = 5.0 / 7.0 * 0.606 * 0.4 + 2.0 / 7.0 * way_to_rest(0.606, 3.5 * 0.2 * 9.81, width)
    else:
        exact = way_to_rest(0.606, 0.2 * 9.81, width)
    true = abs(float(run.states[-1, 1]) - exact)
    # Where errors are 1e-10 of the displacement, those of run and companion may be alike by chance.
    assert true <= run.report.error["position"] / NEAR[0] + 2e-11
    # Parts of steps resolve the width: of radau2, which has the largest error, 3e-8 m is left.
    assert run.report.error["position"] <= 1e-7


@pytest.mark.parametrize("scheme", ["preserving", "radau1"])
def test_with_small_steps_the_estimate_is_the_safety_factor_times_the_error(scheme):
    """Richardson: a companion at half the step has 2^-p of the error, so the difference of both
    runs is 1 - 2^-p of it.
    """
    run = simulate(deck("single_pendulum_89"), dt=0.002, t_final=0.5, scheme=scheme)
    assert run.report.error["companion"] == "half the step"
    distance, _ = true_errors(run)
    # Terms of higher order: the error at half the step is 2^-p of the error but for 1 %.
    assert run.report.error["position"] == pytest.approx(SAFETY * distance.max(), rel=0.02)


def oscillators(*given, **others):
    """Blocks on springs in rails along x, by angular frequency [rad/s], speed [m/s] and mass
    [kg]."""
    along_x = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    bodies, joints, springs = [], [], []
    for k, (omega, speed, mass) in enumerate(given):
        name, place = f"B{k}", (0.0, float(k), 0.0)
        bodies.append(body(name, mass=mass, position=place, velocity=(speed, 0.0, 0.0)))
        joints.append(Joint(f"J{k}", "prismatic", GROUND.name, name, place, ZERO, along_x, along_x))
        springs.append(JointSpring(f"S{k}", f"J{k}", "slide", mass * omega**2, 0.0))
    return build_model(bodies, joints, springs, **others)


def test_a_hidden_vibration_is_estimated_by_the_error_of_its_velocity():
    """The midpoint rule advances the phase of an oscillator by 2 atan(omega h/2) a step, whatever
    its frequency is. Where it reverses the velocity, the position error is h/pi times that of the
    velocity, as if half a period were as long as the step.
    """
    omega, speed, h = 50.0, 0.3, 0.2
    run = simulate(oscillators((omega, speed, 1.0)), dt=h, t_final=2.0)
    n = np.arange(11)
    phase, of_companion = (parts * 2.0 * np.arctan(omega * h / parts / 2.0) for parts in (1, 2))
    factor = SAFETY / (1.0 - 0.25)
    velocity = factor * speed * np.abs(np.cos(n * phase) - np.cos(n * of_companion))
    position = factor * speed / omega * np.abs(np.sin(n * phase) - np.sin(n * of_companion))
    hidden = np.where(velocity > 0.02 * speed, h / np.pi * velocity, 0.0)
    assert hidden.max() > 3.0 * position.max()
    # Newton's method stops at a residual of 1e-12 or so.
    assert run.errors[:, 1] == pytest.approx(np.maximum(position, hidden), abs=1e-10)
    assert run.report.error["velocity"] == pytest.approx(velocity.max(), abs=1e-10)


def test_a_wheel_about_its_centre_does_not_vibrate():
    """It rotates by less in a step than at its highest speed; its centre stays where it is."""
    wheel = body("Wheel", inertia=0.1, angular_velocity=(0.0, 0.0, 7.0))
    axle = Joint("Axle", "revolute", GROUND.name, "Wheel", ZERO, ZERO)
    spring = JointSpring("Spring", "Axle", "angle", 0.9, 0.0)
    run = simulate(build_model([wheel], [axle], [spring]), dt=0.1, t_final=1.0)
    assert run.report.error["orientation"] > 1e-3
    # Rounding errors of a body of 0.2 m.
    assert run.report.error["position"] < 1e-14


def test_what_is_driven_in_all_directions_does_not_vibrate():
    """The midpoint rule misses the velocities of a motion by a table, and none of its positions."""
    run = simulate(deck("joint_motion_table"), dt=0.2)
    assert run.report.error["velocity"] > 0.05
    # Rounding errors of coordinates of 1 m.
    assert run.errors[:, 1:3].max() < 1e-14


def test_what_gauss_of_even_degree_keeps_is_estimated_by_the_displacement_of_a_step():
    """As omega h grows, gauss2 leaves position and velocity as they are, and so does its companion:
    the body would move by h v in a step, h v/pi is the amplitude of half a period in a step.
    """
    speed, h = 0.3, 0.1
    run = simulate(oscillators((1e6, speed, 1.0)), dt=h, t_final=1.0, scheme="gauss2")
    # A step changes the phase by 12/(omega h) = 1e-4.
    assert run.report.error["position"] == pytest.approx(h * speed / np.pi, rel=1e-4)


def test_a_damped_vibration_is_estimated_by_the_energy_that_both_runs_take():
    """A fast vibration is removed by the first steps, so it is in no difference of the runs. Of the
    slow one the companion takes about a quarter of what the run takes; 2 E_c - E_r leaves the
    energy of the fast one, but for half of what the run takes of the slow one.
    """
    h, fast, slow = 0.05, (2e4, 10.0, 0.01), (8.0, 1.0, 1.0)
    options = {"t_final": 1.0, "scheme": "decaying", "damping": 1.0, "error": "off"}
    taken = [
        simulate(oscillators(fast, slow), dt=h / parts, **options).report.extremes["energyTaken"]
        for parts in (1, 2)
    ]
    run = simulate(oscillators(fast, slow), dt=h, **{**options, "error": "estimate"})
    # K_max, at t = 0, is 0.5 J of each, and the larger speed 10 m/s.
    amplitude = 0.5 * 10.0 * h * np.sqrt((2.0 * taken[1] - taken[0]) / 1.0)
    assert 1.1 * taken[1] < taken[0] < taken[1] / 0.75
    assert run.errors[:, 1].max() < amplitude
    assert run.report.error["position"] == pytest.approx(amplitude, rel=1e-6)


def test_a_third_of_a_cycle_in_a_step_is_resolved_by_a_high_degree():
    """An oscillation through 2.5 rad in a step of order 8: right, though it moves farther by its
    velocity in a step than it ever is from its start; by order 4 it is not, and says so.
    """
    omega, found = 2.5, []
    for scheme in ("gauss4", "gauss2"):
        run = simulate(oscillators((omega, 1.0, 1.0)), dt=1.0, t_final=20.0, scheme=scheme)
        true = np.abs(run.states[:, 1] - np.sin(omega * run.time) / omega).max()
        assert 1.0 < run.report.error["position"] / true < 3.0
        found.append(run.report.verdict["word"])
    assert found == [PASS, FAIL]
