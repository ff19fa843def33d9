"""Short runs of every scheme against independent solutions, in seconds even as plain Python."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from msahl.algebra.functions import Law
from msahl.algebra.vector import ZERO
from msahl.model import Joint, JointMotion, SpringDamper
from msahl.model.scheme import EXPLICIT, choices, split
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Chunk
from tests.support.closed_forms import recognise
from tests.support.models import (
    GROUND,
    body,
    build_model,
    deck,
    friction,
    pendulum,
)
from tests.support.models import (
    simulate_and_estimate as simulate,
)

G, ARM = 9.80665, 5.0
ROUNDED = 1e-12
"""Size of rounding errors of positions of some metres over some steps [m]."""
FIXED = [scheme for scheme in choices() if scheme != "auto"]


def angle_of_pendulum(times):
    """(m,) angle [rad] of the pendulum of 5 m from 45 degrees, by DOP853."""
    inertia = 0.008 + 2.0 * ARM**2

    def slope(t, y):
        return [y[1], -2.0 * G * ARM / inertia * np.sin(y[0])]

    given = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13, "t_eval": times}
    return solve_ivp(slope, (0.0, times[-1]), [np.pi / 4.0, 0.0], **given).y[0]


def errors(run):
    """(m,) distance [m] of the bob from where it should be, at each output time."""
    theta = angle_of_pendulum(run.time)
    place = ARM * np.stack([np.sin(theta), 0.0 * theta, np.cos(theta)], axis=1)
    return np.linalg.norm(run.of("position") - place, axis=1)


def by_tolerance(model, tolerance, interval, **changes):
    """The model with steps chosen by a tolerance of the global error."""
    given = {"tolerance": tolerance, "output_interval": interval, "dt": interval, **changes}
    return replace(model, simulation=replace(model.simulation, **given))


@pytest.mark.parametrize(
    ("scheme", "full"),
    [(word, full) for word in FIXED for full in (False, True) if not (full and word in EXPLICIT)],
)
def test_the_estimated_error_of_a_pendulum_is_about_the_true_one(scheme, full):
    run = simulate(pendulum(), dt=0.02, t_final=0.08, scheme=scheme, full=full)
    assert run.report.status == "completed"
    error, estimate = errors(run).max(), run.report.error["position"]
    assert error < 3.0 * estimate + ROUNDED
    assert estimate < 3.0 * error + ROUNDED


@pytest.mark.parametrize("scheme", ["preserving", "gauss3"])
def test_scipy_solves_the_steps_as_newton_does(scheme):
    runs = [
        simulate(pendulum(), dt=0.02, t_final=0.06, scheme=scheme, solver=solver, error="off")
        for solver in ("newton", "root", "auto")
    ]
    for other in runs[1:]:
        assert other.states == pytest.approx(runs[0].states, abs=ROUNDED)


@pytest.mark.parametrize("scheme", ["preserving", "gauss3"])
def test_scipy_solves_redundant_equations_as_newton_does(scheme):
    """Also for the reactions, of which the ones of least norm are published."""
    given = {"t_final": 0.002, "scheme": scheme, "full": True, "error": "off"}
    newton, root = (simulate(deck("four_bar"), solver=s, **given) for s in ("newton", "root"))
    assert newton.report.status == root.report.status == "completed"
    assert root.states == pytest.approx(newton.states, abs=ROUNDED)
    largest = np.abs(newton.reactions).max()
    assert root.reactions == pytest.approx(newton.reactions, abs=1e-10 * largest)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_a_run_by_tolerance_is_as_accurate_at_every_output_time(tolerance):
    run = simulate(by_tolerance(pendulum(), tolerance, 0.05), t_final=0.3, scheme="auto")
    assert run.report.status == "completed"
    assert run.time == pytest.approx(np.linspace(0.0, 0.3, 7), abs=1e-15)
    assert errors(run).max() < tolerance
    assert run.report.error["position"] < tolerance


def test_output_between_the_ends_of_steps_is_as_accurate_as_there():
    model = pendulum()
    model = replace(model, simulation=replace(model.simulation, output_interval=0.025))
    run = simulate(model, dt=0.1, t_final=0.2, scheme="gauss3")
    assert run.time == pytest.approx(np.linspace(0.0, 0.2, 9), abs=1e-15)
    found = errors(run)
    assert found.max() < 1e-8
    assert found[1:4].max() < 100.0 * found[4]


def test_a_top_between_the_ends_of_steps_is_as_its_closed_form():
    """Its rotations do not commute, so their order shows."""
    model = deck("top_1")
    model = replace(model, simulation=replace(model.simulation, output_interval=0.001))
    run = simulate(model, dt=0.004, t_final=0.016, scheme="gauss3", error="off")
    exact = recognise(deck("top_1")).states(run.time)
    scale = np.abs(exact).max(axis=0) + 1.0
    found = np.abs(run.states[:, 1:] - exact) / scale
    assert len(found) == 17
    assert found[::4].max() < 1e-9  # at the ends of steps
    assert found.max() < 1e-7


def test_a_ball_leaves_a_one_sided_spring_when_its_law_does():
    """Free fall, half an oscillation about the sag, and rise; both knees of the law are met."""
    mass, k, height = 2.0, 4000.0, 0.05
    law = Law("linear", (0.0, 0.5, 1.0, 2.0, -0.5 * k, 0.0, 0.0, 0.0))
    spring = SpringDamper("Pad", GROUND.name, "Bob", ZERO, ZERO, 0.0, 0.0, 0.5, table=law)
    ball = body(mass=mass, position=(0.0, 0.0, 0.5 + height))
    model = build_model([ball], loads=[spring], gravity=(0.0, 0.0, -G))
    touch, speed, omega = np.sqrt(2.0 * height / G), np.sqrt(2.0 * G * height), np.sqrt(k / mass)
    sag = G / omega**2
    amplitude, phase = np.hypot(speed / omega, sag), np.arctan2(sag, speed / omega)
    leave = touch + (np.pi + 2.0 * phase) / omega
    run = simulate(by_tolerance(model, 1e-6, 0.02), t_final=0.24, scheme="auto")
    t = run.time
    z = height - 0.5 * G * t**2
    contact, rise = (t > touch) & (t <= leave), t > leave
    z[contact] = -sag - amplitude * np.sin(omega * (t[contact] - touch) - phase)
    z[rise] = speed * (t[rise] - leave) - 0.5 * G * (t[rise] - leave) ** 2
    assert leave < t[-1]
    assert run.of("position")[:, 2] - 0.5 == pytest.approx(z, abs=1e-6)


@pytest.mark.parametrize("scheme", ["auto", "gauss3"])
def test_the_motor_of_a_ramp_does_the_work_of_the_kinetic_energy(scheme):
    ramp = Law("ramp", (0.0, 2.0, 0.05, 0.15))
    hinge = Joint("Hinge", "revolute", GROUND.name, "Bob", ZERO, ZERO)
    motor = JointMotion("Motor", "Hinge", "angle", ramp)
    model = build_model([body()], [hinge], motions=(motor,), dt=0.0125, t_final=0.2)
    if scheme == "auto":
        model = by_tolerance(model, 1e-5, 0.02)
    run = simulate(model, scheme=scheme)
    assert run.report.status == "completed"
    angle = 4.0 * np.arctan(run.of("orientation")[:, 2] / 4.0)
    assert angle[-1] == pytest.approx(2.0, abs=1e-9)
    energy = 0.5 * 0.008 * run.of("spin")[:, 2] ** 2
    # The work is a sum of the scheme's own weights: of order 6, or within the tolerance.
    assert run.column("Motor.work") == pytest.approx(energy, abs=1e-3 * energy.max())


@pytest.mark.parametrize("scheme", ["auto", "preserving"])
def test_a_sledge_is_slowed_by_its_friction(scheme):
    """By mu g where the regularised friction is fully developed."""
    rail = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    slide = Joint("Rail", "prismatic", GROUND.name, "Bob", ZERO, ZERO, rail, rail)
    rub = friction("Rub", "Rail", "slide", 0.3, 1.0, 1e-3)
    sledge = body(velocity=(1.0, 0.0, 0.0))
    model = build_model([sledge], [slide], [rub], gravity=(0.0, 0.0, -G), dt=0.01, t_final=0.1)
    if scheme == "auto":
        model = by_tolerance(model, 1e-5, 0.05)
    run = simulate(model, scheme=scheme)
    t, x = run.time[-1], run.of("position")[-1, 0]
    assert x == pytest.approx(t - 0.5 * 0.3 * G * t**2, abs=1e-5)
    assert run.column("Rub.work")[-1] == pytest.approx(-0.3 * 2.0 * G * x, rel=1e-5)


@pytest.mark.parametrize("scheme", ["preserving", "gauss3"])
def test_a_step_that_is_too_large_is_solved_by_other_means(scheme):
    """The triple pendulum from 135 degrees rotates by revolutions in 1.2 s."""
    run = simulate(deck("triple_pendulum_135"), dt=1.2, t_final=2.4, scheme=scheme, error="off")
    assert (run.report.status, run.report.steps) == ("completed", 2)
    assert run.report.subdivisions + run.report.path_steps > 0
    assert run.report.verdict["checks"]["solver"]["word"] == "WARN"
    assert run.report.extremes["constraintViolationMax"] < 1e-11
    drift = run.report.extremes["energyErrorMaxRelative"]
    assert drift < (1e-11 if scheme == "preserving" else 0.1)


@pytest.mark.parametrize("scheme", ["radau2", "radau3"])
def test_joint_forces_at_the_end_of_a_step_are_those_of_the_motion(scheme):
    """The last node of a radau step is its end; the bob's circle needs the force m (a - g)."""
    model = pendulum()
    name, degree = split(scheme)
    model = replace(model, simulation=replace(model.simulation, scheme=name, degree=degree))
    integrator = SubsystemIntegrator(model, "newton", False, 10)
    integrator.show_start()
    schedule = OutputSchedule.at_ends(np.ones(5, dtype=bool))
    assert integrator.advance(Chunk(5, h=0.01, schedule=schedule)).steps == 5
    theta = angle_of_pendulum(np.array([0.0, 0.05]))[-1]
    inertia = 0.008 + 2.0 * ARM**2
    across = -2.0 * G * ARM**2 / inertia * np.sin(theta) + G * np.sin(theta)
    along = 2.0 * 2.0 * G * ARM**2 / inertia * (np.cos(theta) - np.cos(np.pi / 4.0))
    wanted = 2.0 * np.hypot(across, along + G * np.cos(theta))
    force = np.linalg.norm(integrator.workspace.state.force[0])
    # Multipliers of a stage are of a lower order than the motion: 9e-4 and 5e-5 at this step.
    assert force == pytest.approx(wanted, rel=2e-3 if scheme == "radau2" else 1e-4)


@pytest.mark.parametrize("scheme", ["preserving", "gauss3"])
def test_a_cantilever_bears_its_weight_and_the_moment_of_it(scheme):
    """The moment is about the joint's point, not about the mass centre."""
    clamp = Joint("Clamp", "rigid", GROUND.name, "Bob", ZERO, (-0.5, 0.0, 0.0))
    beam = body(position=(0.5, 0.0, 0.0))
    model = build_model([beam], [clamp], gravity=(0.0, 0.0, -G))
    run = simulate(model, dt=0.01, t_final=0.02, scheme=scheme, error="off")
    assert run.force() == pytest.approx(np.tile([0.0, 0.0, 2.0 * G], (3, 1)), abs=1e-12)
    assert run.moment() == pytest.approx(np.tile([0.0, -0.5 * 2.0 * G, 0.0], (3, 1)), abs=1e-12)


@pytest.mark.parametrize(
    ("scheme", "full"), [("preserving", False), ("gauss1", False), ("gauss1", True)]
)
def test_rounding_errors_of_positions_do_not_add_up(scheme, full):
    """Far from the origin each sum of position and displacement is rounded by half of its
    last digit at most, and by the same in each step; 300 of these add up to 5e-11 m.
    """
    place, speed, h = 4000.0, 1.0 / 3.0, 0.001
    model = build_model([body(position=(place, 0.0, 0.0), velocity=(speed, 0.0, 0.0))])
    run = simulate(model, dt=h, t_final=0.3, scheme=scheme, full=full, error="off")
    exact = place + speed * run.time
    # The last digit is 4.5e-13 m; what is left is the rounding of one sum, and of ``exact``.
    assert np.abs(run.of("position")[:, 0] - exact).max() <= 1e-12
