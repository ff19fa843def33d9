"""Actuators and auxiliary states against closed forms: orders, energy, solvers, resuming."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from msahl.expressions.syntax import parse
from msahl.joints.coordinates import Motion, columns, is_angle, relative, values_and_rates
from msahl.model import (
    Joint,
    JointActuator,
    Marker,
    MarkerActuator,
    Options,
    RigidBody,
    Signal,
    SignalState,
)
from msahl.system.subsystems import split
from tests.run.test_resume import same_run
from tests.support.element_samples import joint_model
from tests.support.models import build_model, deck
from tests.support.models import simulate_and_estimate as simulate

HERE = (0.0, 0.0, 0.0)
X_AXES = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
"""Axes of a joint whose own axis is x."""


def body(name, mass=2.0, inertia=(0.03, 0.04, 0.02), **motion):
    tensor = tuple(tuple(inertia[i] if i == j else 0.0 for j in range(3)) for i in range(3))
    given = {"position": HERE, "velocity": HERE, "angular_velocity": HERE} | motion
    return RigidBody(name, mass, HERE, tensor, orientation=HERE, **given)


# A motor with inductance on a wheel: J w' = k i - c w, L i' = U - R i - k w.
J, L, R, K, C, U = 0.02, 0.05, 1.3, 0.4, 0.01, 12.0
# A mass of 2 kg on a slide, with a controller: m x'' = P (1 - x) + Q e - D x', e' = 1 - x.
M, P, Q, D = 2.0, 80.0, 60.0, 14.0


def motor():
    load = JointActuator("Motor", "Axle", "angle", parse(f"{K}*i - {C}*Axle.angleRate"))
    current = SignalState("i", parse(f"({U} - {R}*i - {K}*Axle.angleRate)/{L}"), 0.5)
    axle = Joint("Axle", "revolute", "Earth", "Wheel", HERE, HERE)
    wheel = body("Wheel", inertia=(0.03, 0.03, J))
    return build_model([wheel], [axle], [load], signals=(current, Signal("P", parse(f"{U}*i"))))


def slider():
    law = f"{P}*error + {Q}*sum - {D}*Rail.slideRate"
    load = JointActuator("Ram", "Rail", "slide", parse(law))
    signals = (Signal("error", parse("1 - Rail.slide")), SignalState("sum", parse("error")))
    rail = Joint("Rail", "prismatic", "Earth", "Mass", HERE, HERE)
    return build_model([body("Mass", M)], [rail], [load], signals=signals)


def linear(A, b, first, t):
    """Solution of y' = A y + b at ``t``."""
    rest = np.linalg.solve(A, b)
    return expm(np.array(A) * t) @ (np.array(first) + rest) - rest


def motor_exactly(t):
    """Rate of the wheel and current."""
    return linear([[-C / J, K / J], [-K / L, -R / L]], [0.0, U / L], [0.0, 0.5], t)


def slider_exactly(t):
    """Velocity and sum, of place, velocity and sum."""
    A = [[0.0, 1.0, 0.0], [-P / M, -D / M, Q / M], [-1.0, 0.0, 0.0]]
    return linear(A, [0.0, P / M, 1.0], [0.0, 0.0, 0.0], t)[1:]


MACHINES = {"motor": (motor, motor_exactly, 12), "slider": (slider, slider_exactly, 9)}
T = 0.6
STEPS = {
    "preserving": (2.0, 0.01),
    "decaying": (2.0, 0.01),
    "gauss1": (2.0, 0.01),
    "gauss2": (4.0, 0.01),
    "gauss3": (6.0, 0.04),
    "radau1": (1.0, 0.002),
    "radau2": (3.0, 0.02),
    "radau3": (5.0, 0.03),
}
"""Order of every scheme, and a step [s] between too coarse and round-off."""


@pytest.mark.parametrize("scheme", STEPS)
@pytest.mark.parametrize("machine", MACHINES)
def test_orders_with_auxiliary_states(machine, scheme):
    make, exactly, column = MACHINES[machine]
    order, coarse = STEPS[scheme]
    found = []
    for h in (coarse, 0.5 * coarse):
        run = simulate(make(), h, T, scheme, solver="newton")
        state = run.signals[-1, 1 if machine == "motor" else 2]
        found.append(np.linalg.norm(np.array([run.states[-1, column], state]) - exactly(T)))
    # The next term of the error is smaller by the step times a rate of some 20 1/s.
    assert np.log2(found[0] / found[1]) == pytest.approx(order, abs=0.35)


@pytest.mark.parametrize("scheme", ["gauss3", "radau2"])
def test_states_between_steps_have_the_order_of_the_dense_output(scheme):
    order, coarse = STEPS[scheme]
    found = []
    for h in (coarse, 0.5 * coarse):
        model = motor()
        model = replace(model, simulation=replace(model.simulation, output_interval=0.0123))
        run = simulate(model, h, T, scheme, solver="newton")
        exact = np.array([motor_exactly(t) for t in run.time])
        errors = (run.states[:, 12] - exact[:, 0], run.signals[:, 1] - exact[:, 1])
        found.append([np.abs(error).max() for error in errors])
        assert run.signals[:, 2] == pytest.approx(U * run.signals[:, 1], rel=1e-15)
        load = K * run.signals[:, 1] - C * run.states[:, 12]
        assert run.signals[:, 3] == pytest.approx(load, rel=1e-13)
        power = load * run.states[:, 12]
        assert run.signals[:, 4] == pytest.approx(power, rel=1e-12)  # of a rate by products
    assert (np.log2(np.divide(*found)) >= order - 0.6).all()


@pytest.mark.parametrize("scheme", ["preserving", "decaying"])
@pytest.mark.parametrize("machine", MACHINES)
def test_the_work_of_an_actuator_is_the_change_of_energy(machine, scheme):
    run = simulate(MACHINES[machine][0](), 0.02, T, scheme, solver="newton")
    # Thirty steps, each solved to 1e-14 of its motion.
    assert run.report.extremes["energyErrorMaxRelative"] <= 1e-12
    if scheme == "preserving":
        inertia = (J, 12) if machine == "motor" else (M, 9)
        energy = 0.5 * inertia[0] * run.states[:, inertia[1]] ** 2
        assert run.work[:, 1] == pytest.approx(energy, abs=1e-12)


@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
def test_all_solvers_agree(scheme):
    # In absolute coordinates all: steps in joint coordinates have another truncation error.
    solvers = ("newton", "root", "auto")
    runs = [simulate(motor(), 0.02, T, scheme, solver=s, full=True) for s in solvers]
    for run in runs[1:]:
        # Each step is solved to 1e-12 of its motion or better.
        assert run.states == pytest.approx(runs[0].states, abs=1e-9)
        assert run.signals == pytest.approx(runs[0].signals, abs=1e-9)


def test_step_control_keeps_its_tolerance():
    model = motor()
    model = replace(model, simulation=replace(model.simulation, local_tolerance=1e-9))
    run = simulate(model, 0.01, T, "auto", solver="newton")
    # 1e-9 m at the length of the wheel, 0.2 m, that is 5e-9 rad; rates change by 10 1/s.
    assert run.states[-1, 12] == pytest.approx(motor_exactly(T)[0], abs=1e-6)


@pytest.mark.parametrize("scheme", ["preserving", "decaying", "gauss2", "radau2"])
def test_a_run_goes_on_to_the_bit(monkeypatch, scheme):
    model = motor()
    name, degree = scheme.rstrip("0123456789"), int(scheme[-1]) if scheme[-1].isdigit() else None
    simulation = replace(model.simulation, scheme=name, degree=degree, dt=0.02, t_final=T)
    model, options = replace(model, simulation=simulation), Options(solver="newton")
    same_run(monkeypatch, model, options, 7)


def two_motors(shared):
    """Two wheels with motors, of which the second depends on the first, or does not."""
    wheels = [body("A", position=HERE), body("B", position=(1.0, 0.0, 0.0))]
    axles = [
        Joint("X", "revolute", "Earth", "A", HERE, HERE),
        Joint("Y", "revolute", "Earth", "B", (1.0, 0.0, 0.0), HERE),
    ]
    other = "X" if shared else "Y"
    loads = [
        JointActuator("M", "X", "angle", parse("2 - X.angleRate")),
        JointActuator("N", "Y", "angle", parse(f"4*({other}.angle - 1) - Y.angleRate")),
    ]
    return build_model(wheels, axles, loads)


def test_signals_couple_subsystems():
    assert len(split(two_motors(False))) == 2
    assert len(split(two_motors(True))) == 1
    for shared in (False, True):
        model = two_motors(shared)
        runs = [simulate(model, 0.02, T, solver="newton", full=full) for full in (False, True)]
        # The same equations in another order, at most thirty steps to 1e-14 of their motion.
        assert runs[1].states == pytest.approx(runs[0].states, abs=1e-11)
        assert runs[1].signals == pytest.approx(runs[0].signals, abs=1e-11)


def test_signals_of_the_time_alone_are_published_once():
    model = replace(two_motors(False), signals=(Signal("wave", parse("sin(3*t)")),))
    run = simulate(model, 0.02, T, solver="newton")
    assert run.signals[:, 1] == pytest.approx(np.sin(3 * run.time), abs=1e-15)


def test_a_planar_machine_stays_planar_and_is_the_same():
    """An actuator in the plane by signals out of it: none of these moves anything out of it."""
    model = deck("double_pendulum_89")
    markers = (Marker("Tip", model.bodies[1].name, (0.1, 0.2, 0.3)), Marker("Hook", "Earth", HERE))
    ground = model.grounds[0].name
    markers = (markers[0], replace(markers[1], body=ground, point=(0.5, 0.0, 0.0)))
    law = parse("2*Tip.z - 0.3*Tip.vy + Tip.q1 + 0.2*Tip.wy - Tip.x")
    model = replace(model, markers=markers, loads=(MarkerActuator("P", "Tip", "Hook", law),))
    model = replace(model, markers=(replace(markers[0], point=(0.1, 0.0, 0.3)), markers[1]))
    runs = [simulate(model, 0.01, 0.5, solver="newton", full=full) for full in (False, True)]
    assert runs[0].report.planar_subsystems in (0, 1)
    assert runs[1].states == pytest.approx(runs[0].states, abs=1e-9)


def test_markers_push_each_other_apart():
    """Two bodies of 2 kg on a line, 1 m apart, pushed by 3 N: a = 1.5 m/s^2 each way."""
    bodies = [body("A"), body("B", position=(1.0, 0.0, 0.0))]
    markers = (Marker("M", "A", HERE), Marker("N", "B", HERE))
    push = MarkerActuator("P", "M", "N", parse("3"))
    model = build_model(bodies, loads=[push], markers=markers)
    run = simulate(model, 0.01, 1.0, solver="newton")
    assert run.of("position", 1)[-1] == pytest.approx((1.75, 0.0, 0.0), abs=1e-13)
    assert run.work[-1, 1] == pytest.approx(3.0 * 1.5, abs=1e-12)


@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
def test_signals_see_an_angle_that_is_not_zero_at_the_start(scheme):
    """Frames of the joint that are not parallel at t = 0, as after a correction of positions."""
    axle = Joint("Axle", "revolute", "Earth", "Wheel", HERE, HERE)
    wheel = replace(body("Wheel"), orientation=(0.0, 0.0, 4.0 * np.tan(0.1)))
    model = build_model([wheel], [axle], signals=(Signal("a", parse("Axle.angle")),))
    for full in (False, True):
        run = simulate(model, 0.01, 0.1, scheme, solver="newton", full=full, checked=True)
        assert run.signals[:, 1] == pytest.approx(0.4, abs=1e-14)


def test_signals_see_the_angle_over_revolutions_from_its_zero():
    """A wheel that rotates at 10 rad/s from an angle of 0.4 rad, by its reference directions."""
    axle = Joint(
        *("Axle", "revolute", "Earth", "Wheel", HERE, HERE),
        parent_reference=(1.0, 0.0, 0.0),
        child_reference=(np.cos(0.4), np.sin(0.4), 0.0),
    )
    wheel = body("Wheel", angular_velocity=(0.0, 0.0, 10.0))
    signals = (Signal("a", parse("Axle.angle")), Signal("w", parse("Axle.angleRate")))
    for scheme in ("preserving", "gauss2"):
        run = simulate(
            build_model([wheel], [axle], signals=signals), 0.01, 2.0, scheme, solver="newton"
        )
        # A rotation of 0.1 rad per step is 2 atan(0.05) of it; of order four 1e-8 of it.
        near = 2e-2 if scheme == "preserving" else 1e-6
        assert run.signals[:, 1] == pytest.approx(0.4 + 10.0 * run.time, abs=near)
        assert run.signals[:, 2] == pytest.approx(10.0, abs=1e-9)


@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
@pytest.mark.parametrize("kind", ["universal", "planar", "cylindrical"])
def test_signals_of_coordinates_are_those_of_the_joints_table(kind, scheme):
    """Random bodies on a joint: as computed from the states, for values and rates."""
    model = joint_model(kind, np.random.default_rng(3))
    (joint,) = model.joints
    names = [name for level in (0, 1) for name in columns(joint, level)]
    signals = tuple(Signal(name, parse(f"J.{name}")) for name in names)
    run = simulate(replace(model, signals=signals), 0.005, 0.5, scheme, solver="newton")
    motions = [motion_of(run, body) for body in range(2)]
    known = np.concatenate(values_and_rates(joint, relative(joint, *motions)), axis=1)
    angles = [i for i, name in enumerate(names) if is_angle(name)]
    known[:, angles] = np.unwrap(known[:, angles], axis=0)
    # Places some metres out, 100 steps; a table of round-off alone.
    assert run.signals[:, 1:] == pytest.approx(known, abs=1e-10)


def motion_of(run, b):
    """Motion of body ``b``, whose table has velocities in its own axes."""
    R = run.matrices(b)
    v, w = (np.einsum("tij,tj->ti", R, run.of(what, b)) for what in ("velocity", "spin"))
    return Motion(run.of("position", b), R, v, w)


@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
def test_reactions_are_those_of_the_step_before(scheme):
    """A weight on a rail under it: the force on the rail is that of the last step, -m g at rest."""
    law = parse("0.5*(Rail.Fz - 2)")
    rail = Joint("Rail", "prismatic", "Earth", "Mass", HERE, HERE, X_AXES, X_AXES)
    load = JointActuator("Pull", "Rail", "slide", law)
    shown = (Signal("held", parse("Rail.Fz")),)
    model = build_model([body("Mass", M)], [rail], [load], signals=shown, gravity=(0.0, 0.0, -9.81))
    run = simulate(model, 0.01, 1.0, scheme, solver="newton")
    assert run.signals[:, 1] == pytest.approx(M * 9.81, abs=1e-11)
    pull = 0.5 * (M * 9.81 - 2.0)
    assert run.signals[:, 2] == pytest.approx(pull, abs=1e-11)
    assert run.states[-1, 1] == pytest.approx(0.5 * pull / M, abs=1e-11)


DECKS = {
    "actuator_motor": (("states", 12, 29.47773737), ("signals", 1, 0.25609937)),
    "actuator_pid": (("states", 1, 1.01925346), ("signals", 2, 0.10263351)),
    "actuator_markers": (("states", 1, -0.31993941), ("signals", 1, 1.00634857)),
    "concentrated_expression": (("states", 1, 1.199047245), ("states", 3, -8.586670789)),
}
"""Table, column and value at the end by the closed form of the deck's header, and the force of the
strut there."""


@pytest.mark.parametrize("name", DECKS)
def test_decks_are_as_they_say(name):
    run = simulate(deck(name), solver="newton")
    assert run.report.extremes["energyErrorMaxRelative"] <= 1e-12
    for table, column, value in DECKS[name]:
        # Of order two: steps of 1 or 2 ms, rates of 16 1/s and less, 1e-4 of the value.
        assert getattr(run, table)[-1, column] == pytest.approx(value, rel=1.5e-3)


NO_VALUE = {
    "load 'M'": ("max(0, sqrt(0.3 - Axle.angle))", "0", 0.3),
    "state 's'": ("s", "sqrt(0.3 - Axle.angle)", 0.3),
    "signal 'shown'": ("0", "0", 0.5),
}
"""Law of a torque, rate of a state, and the angle beyond which one has no value."""


@pytest.mark.parametrize("scheme", ["preserving", "gauss2", "auto"])
@pytest.mark.parametrize("name", NO_VALUE)
def test_an_expression_without_a_value_ends_the_run_by_its_name(name, scheme):
    law, rate, last = NO_VALUE[name]
    axle = Joint("Axle", "revolute", "Earth", "Wheel", HERE, HERE)
    signals = (SignalState("s", parse(rate)), Signal("shown", parse("sqrt(0.5 - Axle.angle)")))
    wheel = body("Wheel", inertia=(0.03, 0.03, J), angular_velocity=(0.0, 0.0, 1.0))
    load = JointActuator("M", "Axle", "angle", parse(law))
    model = build_model([wheel], [axle], [load], signals=signals)
    report = simulate(model, 0.01, 1.0, scheme).report
    assert report.verdict["word"] == "FAIL"
    assert f"the expression of {name} has no finite value" in report.message
    # The wheel rotates at 1 rad/s and faster, and the last step or pair begins before the end.
    assert report.time <= last + 1e-12


@pytest.mark.parametrize("scheme", ["preserving", "gauss2", "auto"])
def test_states_on_which_no_force_depends_are_solved_as_well(scheme):
    """s' = s^2 from 3/2 is infinite at t = 2/3: steps become shorter, and end there."""
    axle = Joint("Axle", "revolute", "Earth", "Wheel", HERE, HERE)
    state = SignalState("s", parse("s^2"), 1.5)
    load = JointActuator("M", "Axle", "angle", parse("0.1"))
    report = simulate(
        build_model([body("Wheel")], [axle], [load], signals=(state,)), 0.01, 1.0, scheme
    ).report
    assert report.verdict["word"] == "FAIL"
    if scheme == "auto":
        # The largest value that the tolerance can follow is some 1e9 and more: 1/s before the end.
        assert report.time == pytest.approx(2 / 3, abs=1e-6)
    else:
        assert report.subdivisions > 0
        assert report.time == pytest.approx(0.66, abs=1e-12)
