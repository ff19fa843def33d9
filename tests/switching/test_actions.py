"""What events set and push, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.expressions.syntax import parse
from msahl.model import JointActuator, JointSpring, Marker, SignalState
from msahl.model.events import Impulse, ParameterChange, StateChange
from tests.contact.models import ball, run_events
from tests.support.models import GROUND, body, build_model
from tests.switching.models import (
    DOWN,
    ORIGIN,
    Z_AXIS,
    Joint,
    event,
    flywheels,
    pendulum,
    revolute,
)

EXACT, SOON = 1e-12, 1e-9
"""Round-off; time [s] after an event within which nothing moves by more than 1e-8."""
SCHEMES = [
    ("gauss2", 0.01, None),
    ("radau2", 0.01, None),
    ("preserving", 0.01, None),
    ("decaying", 0.01, None),
    ("auto", None, 1e-9),
]
K, M, X = 100.0, 1.0, 0.2
"""Stiffness [N/m], mass [kg] and first elongation [m] of the oscillator."""


def set_state(state, text):
    return StateChange(state, parse(text))


def along(joint, text, coordinate="angle", **others):
    return Impulse(parse(text), joint=joint, coordinate=coordinate, **others)


def at(marker, text, direction, basis=GROUND.name, **others):
    return Impulse(parse(text), marker=marker, direction=direction, basis=basis, **others)


def wheel(*events, **others):
    """A flywheel of 0.02 kg m2 at rest, with a motor whose torque is a state T [N m]."""
    bodies = [body("Wheel", 1.0, 0.02)]
    motor = JointActuator("Motor", "Axle", "angle", parse("T"))
    given = {"signals": (SignalState("T", parse("0")),), "events": events, "t_final": 1.0}
    return build_model(
        bodies, [revolute("Axle", GROUND.name, "Wheel")], [motor], **(given | others)
    )


def oscillator(*events, damping=0.0, compliance=False, **others):
    """A mass on a spring along z, X from where it is unloaded."""
    guide = Joint("Guide", "prismatic", GROUND.name, "Mass", ORIGIN, ORIGIN, Z_AXIS, Z_AXIS)
    spring = JointSpring("Spring", "Guide", "slide", K, damping, free=-X, compliance=compliance)
    given = {"events": events, "t_final": 1.0, "gravity": (0.0, 0.0, 0.0)}
    return build_model([body("Mass", M, 0.01)], [guide], [spring], **(given | others))


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
def test_a_state_is_set_to_a_value_of_the_motion(scheme, dt, tolerance):
    """The torque is 0.2 N m from 0.3 s to 0.6 s, and then minus twice the wheel's rate in SI."""
    model = wheel(
        event("On", "t >= 0.3", states=(set_state("T", "0.2"),)),
        event("Brake", "t >= 0.6", states=(set_state("T", "-0.1*Axle.angleRate"),)),
    )
    report, sink, rows = run_events(model, scheme, dt, None, tolerance)
    assert [tuple(row[1:3]) for row in rows] == [("sets", "T")] * 2
    w = 0.2 / 0.02 * 0.3
    end = w - 0.1 * w / 0.02 * 0.4
    # The angle's moment over a step of order 2 is wrong by a share (w dt)^2/12 of it.
    near = {"preserving": 1e-3, "decaying": 1e-2, "auto": 1e-9}.get(scheme, EXACT)
    assert sink.table("states")[-1, 12] == pytest.approx(end, abs=near)
    assert report.extremes["energyErrorMax"] < 1e-9


@pytest.mark.parametrize("compliance", [False, True])
@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
def test_a_stiffness_is_set_and_its_energy_booked(compliance, scheme, dt, tolerance):
    """At 0.1 s the spring has x = X cos(w t): from then on four times the stiffness, w doubled."""
    double = event(
        "Stiffen", "t >= 0.1", parameters=(ParameterChange("Spring", "stiffness", 4 * K),)
    )
    report, sink, (row,) = run_events(
        oscillator(double, compliance=compliance), scheme, dt, None, tolerance
    )
    w = np.sqrt(K / M)
    x, v = X * np.cos(0.1 * w), -w * X * np.sin(0.1 * w)
    since = 2.0 * w * 0.9
    end = x * np.cos(since) + v / (2.0 * w) * np.sin(since) - X
    order = {"gauss2": 2e-6, "radau2": 1e-3, "preserving": 4e-3, "decaying": 2e-2, "auto": 1e-8}
    near = order[scheme]
    assert sink.table("states")[-1, 3] == pytest.approx(end, abs=near)
    assert list(row[1:3]) == ["sets", "Spring.stiffness"]
    assert row[6] == pytest.approx(-1.5 * K * x**2, abs=50.0 * near)
    assert report.events["energyLost"] == pytest.approx(row[6], rel=1e-12)
    assert report.extremes["energyErrorMax"] < (1e-12 if scheme == "preserving" else 1e-4)


@pytest.mark.parametrize(("scheme", "least"), [("gauss2", 3.9), ("gauss3", 5.8)])
def test_the_order_holds_where_a_stiffness_is_set(scheme, least):
    w = np.sqrt(K / M)
    x, v, since = X * np.cos(0.1 * w), -w * X * np.sin(0.1 * w), 2.0 * w * 0.9
    end = x * np.cos(since) + v / (2.0 * w) * np.sin(since) - X
    change = (ParameterChange("Spring", "stiffness", 4.0 * K),)
    off = []
    for dt in (0.04, 0.02, 0.01):
        model = oscillator(event("Stiffen", "t >= 0.1", parameters=change))
        _, sink, _ = run_events(model, scheme, dt)
        off.append(abs(sink.table("states")[-1, 3] - end))
    order = np.log2(np.divide(off[:-1], off[1:]))
    assert (order > least).all(), (order, off)


def test_numbers_are_set_and_set_back():
    """Damping for a while: then the motion is that of the undamped spring, with what is left."""
    model = oscillator(
        event("On", "t >= 0.2", parameters=(ParameterChange("Spring", "damping", 2.0),)),
        event("Off", "t >= 0.4", parameters=(ParameterChange("Spring", "damping", 0.0),)),
    )
    report, sink, rows = run_events(model, "gauss4", 0.01)
    assert [row[6] for row in rows] == [0.0, 0.0]
    work = sink.table("work")
    lost = -work[:, 1]
    before, after = work[:, 0] < 0.2, work[:, 0] > 0.4
    assert np.abs(lost[before]).max() == 0.0
    assert np.ptp(lost[after]) == 0.0
    assert lost[-1] > 0.1
    assert report.extremes["energyErrorMax"] < 1e-11


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
@pytest.mark.parametrize("changes_velocity", [False, True])
def test_an_impulse_along_a_joint(changes_velocity, scheme, dt, tolerance):
    """By 0.1 N m s, or by what changes the rate by 5 rad/s, the wheel has 5 rad/s."""
    text = "5" if changes_velocity else "0.1"
    push = along("Axle", text, changes_velocity=changes_velocity)
    report, sink, (row,) = run_events(
        wheel(event("Kick", "t >= 0.5", impulses=(push,))), scheme, dt, None, tolerance
    )
    assert list(row[1:3]) == ["pushes", "Axle"]
    assert row[3:6] == pytest.approx([0.0, 5.0, 0.1], abs=EXACT)
    assert row[6] == pytest.approx(-0.5 * 0.02 * 25.0, abs=EXACT)
    assert sink.table("states")[-1, 12] == pytest.approx(5.0, abs=EXACT)
    assert report.extremes["energyErrorMax"] < EXACT


@pytest.mark.parametrize("scheme", ["gauss2", "preserving"])
@pytest.mark.parametrize("basis", [GROUND.name, "Rod"])
@pytest.mark.parametrize("direction", [(1.0, 2.0, 0.5), (0.0, 3.0, 0.0)])
def test_an_impulse_at_a_marker_of_a_free_body(direction, basis, scheme):
    """dv = L/m and J dw = r x L, in the axes of the body where they are its own."""
    L, r, J = 0.7, np.array([0.3, 0.0, 0.1]), np.array([0.02, 0.03, 0.04])
    push = at("Tip", "0.7", direction, basis)
    rod = body("Rod", 2.0, tuple(J), velocity=(1.0, 0.0, 0.0), angular_velocity=(0.0, 0.0, 2.0))
    model = build_model(
        [rod],
        markers=(Marker("Tip", "Rod", tuple(r)),),
        events=(event("Kick", "t >= 0.25", impulses=(push,)),),
    )
    report, sink, (row,) = run_events(model, scheme, 0.01, 0.25 + SOON)
    angle = 0.5  # the rod rotates about z evenly until then
    R = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]]
    )
    size = L * np.array(direction) / np.linalg.norm(direction)
    inertial = R @ size if basis == "Rod" else size
    w = np.array([0.0, 0.0, 2.0]) + np.cross(r, R.T @ inertial) / J
    v = np.array([1.0, 0.0, 0.0]) + inertial / 2.0
    states = sink.table("states")[-1]
    near = 1e-7 if scheme == "gauss2" else 1e-4  # of the angle, by the step
    assert states[7:10] == pytest.approx(R.T @ v, abs=near)
    assert states[10:13] == pytest.approx(w, abs=near)
    before = np.array([1.0, 0.0, 0.0]) + np.cross([0.0, 0.0, 2.0], R @ r)
    after = v + R @ np.cross(w, r)
    unit = inertial / L
    assert row[3:6] == pytest.approx([before @ unit, after @ unit, L], abs=near)
    assert row[6] == pytest.approx(-0.5 * L * (before + after) @ unit, abs=near)
    assert report.extremes["energyErrorMax"] < EXACT


def test_a_marker_of_a_double_pendulum_gets_the_velocity_asked_for():
    """M dq = G^T L in two angles, with M of two uniform rods of 1 kg and 1 m that hang down."""
    bodies = [
        body("A", 1.0, 1.0 / 12.0, (0.0, 0.0, -0.5)),
        body("B", 1.0, 1.0 / 12.0, (0.0, 0.0, -1.5)),
    ]
    y = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    joints = [
        revolute("P", GROUND.name, "A", child_point=(0.0, 0.0, 0.5), axes=y),
        revolute("Q", "A", "B", (0.0, 0.0, -0.5), (0.0, 0.0, 0.5), axes=y),
    ]
    kick = at("Middle", "-2*t + 4", (1.0, 0.0, 0.0), changes_velocity=True)
    model = build_model(
        bodies,
        joints,
        gravity=DOWN,
        markers=(Marker("Middle", "B", ORIGIN),),
        events=(event("Kick", "t >= 1", impulses=(kick,)),),
    )
    report, sink, (row,) = run_events(model, "gauss3", 0.01, 1.0 + SOON)
    # Speeds to -x by absolute rates a, b: of the centres a/2 and a + b/2.
    mass = np.array([[1.0 / 12.0 + 0.25 + 1.0, 0.5], [0.5, 1.0 / 12.0 + 0.25]])
    gradient = -np.array([1.0, 0.5])
    W = gradient @ np.linalg.solve(mass, gradient)
    rates = np.linalg.solve(mass, gradient) * 2.0 / W
    assert row[3:6] == pytest.approx([0.0, 2.0, 2.0 / W], abs=1e-8)
    assert sink.table("states")[-1, [11, 23]] == pytest.approx(rates, abs=1e-7)
    assert row[6] == pytest.approx(-2.0 / W, abs=1e-11)
    assert report.extremes["energyErrorMax"] < 1e-10


def test_a_velocity_that_is_prescribed_cannot_be_changed():
    model = pendulum("t > 9")
    along_rod = at("Pin", "1", (1.0, 0.0, 0.0), changes_velocity=True)
    markers = (*model.markers, Marker("Pin", "Bob", (-1.0, 0.0, 0.0)))
    kick = event("Kick", "t >= 0.1", impulses=(along_rod,))
    report, sink, rows = run_events(replace(model, markers=markers, events=(kick,)), "gauss2", 0.01)
    assert not len(rows)
    assert "event 'Kick' cannot change the velocity of 'Pin'" in report.message
    assert sink.table("states")[-1, 0] == pytest.approx(0.1, abs=0.011)


@pytest.mark.parametrize(("e", "after"), [(0.0, 0.0), (0.5, 1.0)])
def test_contacts_answer_an_impulse(e, after):
    """A ball at rest on the floor is pushed down at 2 m/s: it leaves with e times that."""
    model = ball(e, 0.0)
    kick = event("Kick", "t >= 0.1", impulses=(at("Centre", "-2", (0.0, 0.0, 1.0)),))
    model = replace(model, markers=(Marker("Centre", "Ball", ORIGIN),), events=(kick,))
    report, sink, rows = run_events(model, "gauss2", 0.01, 0.1 + SOON)
    assert [row[1] for row in rows][:3] == ["closes", "pushes", "impact"]
    assert rows[2][3:6] == pytest.approx([-2.0, after, 2.0 + after], abs=EXACT)
    assert sink.table("states")[-1, 9] == pytest.approx(after, abs=1e-7)
    assert report.extremes["energyErrorMax"] < EXACT


def test_values_are_those_before_the_event():
    """Two flywheels: the impulse on the second is by the rate that the first had."""
    push = along("B", "0.01*A.angleRate")
    model = replace(
        flywheels(), events=(event("Shift", "t >= 0.5", engages=("Clutch",), impulses=(push,)),)
    )
    _, sink, rows = run_events(model, "gauss2", 0.01)
    assert [row[1] for row in rows] == ["engages", "pushes"]
    w = (0.02 * 10.0 + 0.1) / 0.05
    assert sink.table("states")[-1, [12, 24]] == pytest.approx([w, w], abs=EXACT)
    assert rows[1][4] == pytest.approx(w, abs=EXACT)


@pytest.mark.parametrize("text", ["1/Axle.angleRate", "sqrt(-1 - T)"])
def test_a_value_that_is_no_number_ends_the_run(text):
    model = wheel(event("Kick", "t >= 0.5", impulses=(along("Axle", text),)))
    report, sink, rows = run_events(model, "gauss2", 0.01)
    assert not len(rows)
    assert report.status == "not converged"
    assert "event 'Kick' has a value that is not a finite number" in report.message
    assert np.isfinite(sink.table("states")).all()
