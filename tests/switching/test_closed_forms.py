"""Release, engagement and break against closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from tests.contact.models import run_events
from tests.switching.models import catch, docking, door, event, flywheels, pendulum

G, J = 9.81, 1.01
"""Gravity [m/s^2], and the pendulum's moment of inertia about its pivot [kg m^2]."""
EXACT = 1e-12
SCHEMES = [("gauss4", 0.02, None), ("auto", None, 1e-9)]
BREAKS = "sqrt(Pivot.Fx^2 + Pivot.Fy^2 + Pivot.Fz^2) > 20"


def time_to(angle):
    """Time [s] in which the pendulum falls by an angle: the integral of 1/w, w^2 = 2 g sin/J, with
    the angle as a square, by which the integrand is smooth."""
    factor = 2.0 * np.sqrt(J / (2.0 * G))
    smooth = quad(lambda u: u / np.sqrt(np.sin(u * u)), 0.0, np.sqrt(angle), epsabs=1e-15)
    return factor * smooth[0]


def flight(angle, t):
    """Where the bob is at ``t``, released at an angle below the horizontal."""
    w, since = np.sqrt(2.0 * G * np.sin(angle) / J), t - time_to(angle)
    x = np.cos(angle) - w * np.sin(angle) * since
    return x, -np.sin(angle) - w * np.cos(angle) * since - 0.5 * G * since**2


def load(angle):
    """Size of the pivot's force [N]."""
    along, across = np.sin(angle) * (1.0 + 2.0 / J), np.cos(angle) * (1.0 - 1.0 / J)
    return G * np.hypot(along, across)


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
@pytest.mark.parametrize("kind", ["spherical", "revolute"])
def test_a_pendulum_is_released_at_an_angle(kind, scheme, dt, tolerance):
    report, sink, events = run_events(pendulum("Tip.x <= 0.5", kind), scheme, dt, None, tolerance)
    near = EXACT if tolerance is None else tolerance
    (row,) = events
    assert list(row[1:3]) == ["releases", "Pivot"]
    assert row[0] == pytest.approx(time_to(np.pi / 3.0), abs=near)
    x, z = flight(np.pi / 3.0, 1.0)
    assert sink.table("states")[-1, [1, 3]] == pytest.approx([x, z], abs=5.0 * near)
    assert sink.table("reactions")[-1, 1:] == pytest.approx(0.0, abs=0.0)
    assert report.extremes["energyErrorMax"] < 1e-9


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
def test_a_joint_breaks_at_its_strength(scheme, dt, tolerance):
    """By the reaction at the time, not that of the step before."""
    _, sink, events = run_events(pendulum(BREAKS), scheme, dt, None, tolerance)
    near = EXACT if tolerance is None else tolerance
    angle = brentq(lambda a: load(a) - 20.0, 0.1, 1.5, xtol=1e-15)
    assert events[0][0] == pytest.approx(time_to(angle), abs=5.0 * near)
    assert sink.table("states")[-1, [1, 3]] == pytest.approx(flight(angle, 1.0), abs=10.0 * near)


@pytest.mark.parametrize(
    ("scheme", "steps", "least"),
    [("gauss2", (0.04, 0.02, 0.01), 3.9), ("gauss3", (0.05, 0.025, 0.0125), 5.8)],
)
def test_the_order_holds_through_a_release(scheme, steps, least):
    exact = flight(np.pi / 3.0, 1.0)
    off = []
    for dt in steps:
        _, sink, _ = run_events(pendulum("Tip.x <= 0.5"), scheme, dt)
        off.append(np.hypot(*np.subtract(sink.table("states")[-1, [1, 3]], exact)))
    order = np.log2(np.divide(off[:-1], off[1:]))
    assert (order > least).all(), (order, off)


@pytest.mark.parametrize(
    ("scheme", "dt", "tolerance"), [*SCHEMES, ("preserving", 0.01, None), ("radau2", 0.01, None)]
)
@pytest.mark.parametrize("ratio", [1.0, -0.5])
def test_a_clutch_joins_two_flywheels(ratio, scheme, dt, tolerance):
    """w2 = ratio w1; the momentum J1 w1 + ratio J2 w2 stays."""
    report, sink, events = run_events(flywheels(ratio=ratio), scheme, dt, None, tolerance)
    inertia = 0.02 + ratio**2 * 0.03
    w = 0.02 * 10.0 / inertia
    states = sink.table("states")
    assert states[-1, [12, 24]] == pytest.approx([w, ratio * w], abs=EXACT)
    (row,) = events
    assert list(row[:3]) == [pytest.approx(0.5, abs=1e-14), "engages", "Clutch"]
    impulse = 0.03 * ratio * w
    assert row[3:6] == pytest.approx([-10.0 * ratio, 0.0, impulse], abs=EXACT)
    lost = 0.5 * 0.02 * 100.0 - 0.5 * inertia * w**2
    assert row[6] == pytest.approx(lost, abs=EXACT)
    assert -0.5 * row[5] * (row[3] + row[4]) == pytest.approx(lost, abs=EXACT)
    assert report.events["energyLost"] == pytest.approx(lost, abs=EXACT)
    assert report.events["engaged"] == ["Clutch"]
    assert report.extremes["energyErrorMax"] < EXACT


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
def test_a_latch_catches_a_falling_mass(scheme, dt, tolerance):
    """It sticks with v = m1 v1/(m1 + m2); then both oscillate about where the spring bears both."""
    report, sink, events = run_events(catch(), scheme, dt, None, tolerance)
    near = EXACT if tolerance is None else tolerance
    t = np.sqrt(2.0 * 0.5 / G)
    assert events[0][0] == pytest.approx(t, abs=EXACT)
    assert events[0][6] == pytest.approx(0.5 * (2.0 / 3.0) * 2.0 * G * 0.5, abs=EXACT)
    w, sag, v = np.sqrt(400.0 / 3.0), G / 400.0, G * t / 3.0
    since = 1.0 - t
    z = -sag + sag * np.cos(w * since) - v / w * np.sin(w * since)
    assert sink.table("states")[-1, [3, 15]] == pytest.approx([z, z], abs=10.0 * near)
    assert report.extremes["energyErrorMax"] < max(near, 1e-9)


@pytest.mark.parametrize("scheme", ["gauss3", "preserving"])
def test_free_bodies_dock(scheme):
    """The impulse of a joint changes neither the momentum nor the moment of momentum."""
    report, sink, events = run_events(docking(), scheme, 0.01)
    assert [row[2] for row in events] == ["Dock"]
    assert events[0][3] > 1.0
    assert events[0][6] > 0.0
    rows = sink.table("system")[:, 7:13]  # momentum, moment of momentum
    assert np.abs(rows - rows[0]).max() < 1e-11
    assert report.extremes["energyErrorMax"] < 1e-7


def test_pendulum_flies_at_a_known_time():
    _, _, events = run_events(pendulum("t > 0.3"), "gauss2", 0.007)
    assert events[0][0] == pytest.approx(0.3, abs=1e-15)


def test_a_door_on_two_hinges_loses_one_of_them():
    """Redundant hinges: the motion is that on both, and a brake takes what its impulse says."""
    _, steady, _ = run_events(door(), "gauss3", 0.02)
    loses = event("Off", "t > 0.2", ("Low",)), event("On", "t > 0.3", (), ("Low",))
    _, sink, rows = run_events(door(*loses), "gauss3", 0.02)
    assert [row[1] for row in rows] == ["releases", "engages"]
    off = sink.table("states")[-1] - steady.table("states")[-1]
    assert np.abs(off).max() < 1e-10  # the hinges are relaxed by 1e-9 of their compliance
    brake = event("Stop", "t > 0.4", (), ("Brake",))
    report, sink, (row,) = run_events(door(brake), "gauss3", 0.02)
    assert row[6] == pytest.approx(-0.5 * row[5] * row[3], rel=1e-12)
    assert row[5] == pytest.approx(-(0.7 + 5.0 * 0.25) * row[3], rel=1e-12)  # J of the door
    assert np.abs(sink.table("states")[-1, 7:13]).max() < 1e-12
    assert report.extremes["energyErrorMax"] < 1e-9
