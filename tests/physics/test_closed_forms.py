"""Joints, couplings, motions and forces in motions that are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from msahl.algebra.rotation import from_axis_angle
from msahl.algebra.vector import ZERO
from msahl.model import (
    ConcentratedLoad,
    Coupling,
    Joint,
    JointMotion,
    JointSpring,
    Law,
    PointMotion,
    SpringDamper,
)
from tests.support.element_samples import Frame, Sample, joint_between, vector
from tests.support.models import GROUND, body, build_model, deck, drag, friction, simulate

X, Y, Z = np.eye(3)
EARTH = GROUND.name
G = 9.80665
SIZES = (0.02, 0.03, 0.04)
"""Principal moments of inertia of bodies whose rotating about z is the point [kg m^2]."""


def across(axis):
    """A matrix with ``axis`` for its z."""
    z = np.asarray(axis) / np.linalg.norm(axis)
    x = np.cross(Y if abs(z[1]) < 0.9 else X, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def join(bodies, kind, name, parent, child, point, axis=Z, **parameters):
    """A joint at ``point`` of the model as it stands, the same axis on both sides."""
    frame = Frame(np.asarray(point, dtype=float), across(axis))
    sample = Sample([], parameters=tuple(parameters.items()))
    return joint_between(bodies, kind, name, parent, child, frame, sample)


def extrapolated(model, t, h, of):
    """What ``of`` finds in a run at its end, from two step sizes: their h^4 is left."""
    ends = [of(simulate(model, dt=e, t_final=t)) for e in (h, h / 2)]
    return (4 * ends[1] - ends[0]) / 3


def rotated(run, body=-1):
    """Angle about z, counted over all revolutions."""
    R = run.matrices(body)
    return np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0]))


def wheel(**loads):
    """A wheel on an axle along z."""
    own = body("Wheel", inertia=SIZES)
    return build_model([own], [join([own], "revolute", "Axle", EARTH, "Wheel", ZERO)], **loads)


def sledge(axis=X, **others):
    """2 kg that slide along an axis."""
    own = body("Sledge", inertia=SIZES)
    return build_model(
        [own], [join([own], "prismatic", "Rail", EARTH, "Sledge", ZERO, axis)], **others
    )


# Springs, drag, friction -------------------------------------------------------------------------


def test_a_torsion_pendulum_swings_harmonically():
    model = wheel(loads=[JointSpring("S", "Axle", "angle", 0.9, 0.0, free=2.5)])
    omega = np.sqrt(0.9 / 0.04)
    run = simulate(model, dt=0.001, t_final=4.0)
    # A rotation of 0.012 rad a step is taken for 2 tan of its half: 1.2e-5 of 30 rad.
    assert rotated(run) == pytest.approx(2.5 * (1 - np.cos(omega * run.time)), abs=5e-4)
    end = extrapolated(model, 4.0, 0.001, lambda r: rotated(r)[-1])
    assert end == pytest.approx(2.5 * (1 - np.cos(omega * 4.0)), abs=1e-6)
    stored = 0.5 * 0.9 * (rotated(run) - 2.5) ** 2
    assert run.column("S.energy") == pytest.approx(stored, abs=1e-12)


@pytest.mark.parametrize("two_points", [True, False])
def test_a_damped_oscillator(two_points):
    m, k, c, x0 = 2.0, 50.0, 3.0, 0.4
    if two_points:
        load = SpringDamper("S", EARTH, "Sledge", (-2.0, 0.0, 0.0), ZERO, k, c, 2.0 - x0)
    else:
        load = JointSpring("S", "Rail", "slide", k, c, free=-x0)
    delta, omega = c / (2 * m), np.sqrt(k / m - (c / (2 * m)) ** 2)

    def known(t):
        swing = np.cos(omega * t) + delta / omega * np.sin(omega * t)
        return x0 * (np.exp(-delta * t) * swing - 1)

    end = extrapolated(sledge(loads=[load]), 2.0, 0.004, lambda r: r.of("position")[-1, 0])
    assert end == pytest.approx(known(2.0), abs=1e-8)
    run = simulate(sledge(loads=[load]), dt=0.002, t_final=2.0)
    x, v = run.of("position")[:, 0], run.of("velocity")[:, 0]
    lost = 0.5 * k * x0**2 - 0.5 * k * (x + x0) ** 2 - 0.5 * m * v**2
    assert run.column("S.work") == pytest.approx(-lost, abs=1e-12)


def test_drag_lets_a_body_fall_at_its_limit():
    m, c = 2.0, 0.3
    limit = np.sqrt(m * G / c)
    ball = body("Ball")
    model = build_model([ball], loads=[drag("D", "Ball", ZERO, c)], gravity=(0.0, 0.0, G))

    def ends(run):
        return np.array([run.of("position")[-1, 2], run.of("velocity")[-1, 2]])

    t = 1.5
    known = limit**2 / G * np.log(np.cosh(G * t / limit)), limit * np.tanh(G * t / limit)
    assert extrapolated(model, t, 0.01, ends) == pytest.approx(known, rel=1e-7)
    falling = simulate(model, dt=0.05, t_final=20.0)
    assert falling.of("velocity")[-1, 2] == pytest.approx(limit, rel=1e-12)


def test_friction_slows_a_sledge_by_its_coefficient_times_weight():
    mu, v0 = 0.3, 3.0
    rub = friction("F", "Rail", "slide", mu, 1.0, 1e-3)
    model = sledge(loads=[rub], gravity=(0.0, 0.0, -G), t_final=1.5)
    model = replace(model, bodies=(replace(model.bodies[0], velocity=(v0, 0.0, 0.0)),))
    run = simulate(model, dt=0.002)
    t, stop = run.time, v0 / (mu * G)
    sliding = t < stop - 0.02
    v, x = run.of("velocity")[:, 0], run.of("position")[:, 0]
    assert v[sliding] == pytest.approx(v0 - mu * G * t[sliding], abs=1e-9)
    assert x[sliding] == pytest.approx((v0 * t - 0.5 * mu * G * t**2)[sliding], abs=1e-9)
    # Then it creeps to rest at the regularisation's width.
    assert np.abs(v[t > stop + 0.05]).max() < 1e-3
    assert x[-1] == pytest.approx(v0**2 / (2 * mu * G), abs=2e-3)
    assert run.column("F.work")[-1] == pytest.approx(-0.5 * 2.0 * v0**2, rel=1e-6)


def test_friction_in_a_hinge_slows_a_wheel():
    """An axle of radius r under the weight m g: moment mu r m g."""
    mu, r, w0 = 0.2, 0.05, 8.0
    model = wheel(loads=[friction("F", "Axle", "angle", mu, r, 0.01)], gravity=(0.0, -G, 0.0))
    model = replace(model, bodies=(replace(model.bodies[0], angular_velocity=(0.0, 0.0, w0)),))
    run = simulate(model, dt=0.002, t_final=1.0)
    known = w0 - mu * r * 2.0 * G / 0.04 * run.time
    # The rotation of a step, 0.016 rad, is taken for 2 tan of its half: 2e-5.
    assert run.of("spin")[:, 2] == pytest.approx(known, abs=1e-4)


# Couplings ---------------------------------------------------------------------------------------


def test_a_nut_rotates_as_it_sinks():
    pitch, m = 0.1, 2.0
    own = body("Nut", mass=m, inertia=SIZES)
    nut = join([own], "screw", "Thread", EARTH, "Nut", ZERO, pitch=pitch)
    model = build_model([own], [nut], gravity=(0.0, 0.0, -G))
    a = G / (1 + 0.04 * (2 * np.pi / pitch) ** 2 / m)
    run = simulate(model, dt=0.005, t_final=3.0)
    assert run.of("position")[:, 2] == pytest.approx(rotated(run) * pitch / (2 * np.pi), abs=1e-12)
    end = extrapolated(model, 3.0, 0.004, lambda r: r.of("position")[-1, 2])
    assert end == pytest.approx(-0.5 * a * 9.0, rel=1e-6)


@pytest.mark.parametrize("ratio", [-0.4, 2.5])
def test_a_gear_pair_under_a_moment(ratio):
    first = body("First", inertia=(0.02, 0.03, 0.04))
    second = body("Second", inertia=(0.1, 0.12, 0.15), position=(1.0, 0.0, 0.0))
    pair = [first, second]
    joints = [
        join(pair, "revolute", f"Axle{k}", EARTH, own.name, own.position)
        for k, own in enumerate(pair)
    ]
    push = ConcentratedLoad("M", "First", ZERO, ZERO, EARTH, (0.0, 0.0, 0.5), EARTH)
    gear = Coupling("Gear", "gear", "Axle0", "Axle1", ratio)
    model = build_model(pair, joints, [push], couplings=(gear,))
    alpha = 0.5 / (0.04 + ratio**2 * 0.15)
    run = simulate(model, dt=0.005, t_final=2.0)
    assert rotated(run, 1) == pytest.approx(ratio * rotated(run, 0), abs=1e-11)
    end = extrapolated(model, 2.0, 0.01, lambda r: rotated(r, 0)[-1])
    assert end == pytest.approx(0.5 * alpha * 4.0, rel=1e-6)
    # The teeth rotate the second wheel.
    load = run.column("Gear.load")[1:]
    assert load == pytest.approx(np.full_like(load, ratio * alpha * 0.15), rel=1e-3)


def test_a_pinion_rolls_down_its_rack():
    """A cylinder that rolls: its rotating is mass as well."""
    radius, tilt = 0.2, np.radians(20.0)
    cylinder = body("Cylinder", mass=2.0, inertia=SIZES)
    carriage = body("Carriage", mass=0.5, inertia=SIZES)
    pair = [carriage, cylinder]
    joints = [
        join(pair, "prismatic", "Way", EARTH, "Carriage", ZERO, X),
        join(pair, "revolute", "Axle", "Carriage", "Cylinder", ZERO),
    ]
    rack = Coupling("Rack", "rackAndPinion", "Axle", "Way", radius)
    g = (G * np.sin(tilt), -G * np.cos(tilt), 0.0)
    model = build_model(pair, joints, gravity=g, couplings=(rack,))
    a = 2.5 * G * np.sin(tilt) / (2.5 + 0.04 / radius**2)
    run = simulate(model, dt=0.005, t_final=1.0)
    assert run.of("position")[:, 0] == pytest.approx(radius * rotated(run), abs=1e-12)
    end = extrapolated(model, 1.0, 0.01, lambda r: r.of("position")[-1, 0])
    assert end == pytest.approx(0.5 * a, rel=1e-6)


def test_a_cam_lifts_along_its_spline():
    angles = np.linspace(0.0, 2 * np.pi, 9)
    heights = 0.1 * np.array([0.0, 0.2, 0.9, 1.0, 0.7, 0.4, 0.3, 0.1, 0.0])
    cam, follower = body("Cam", inertia=SIZES), body("Follower", inertia=SIZES)
    pair = [cam, follower]
    joints = [
        join(pair, "revolute", "Shaft", EARTH, "Cam", ZERO),
        join(pair, "prismatic", "Guide", EARTH, "Follower", ZERO, Y),
    ]
    lift = Law("periodic", (*angles.tolist(), *heights.tolist()))
    model = build_model(
        pair,
        joints,
        gravity=(0.0, -G, 0.0),
        couplings=(Coupling("Lift", "camFollower", "Shaft", "Guide", lift=lift),),
        motions=(JointMotion("Motor", "Shaft", "angle", Law("polynomial", (0.0, 5.0, 1.0))),),
    )
    run = simulate(model, dt=0.01, t_final=3.0)
    spline = CubicSpline(angles, heights, bc_type="periodic")
    angle = 5.0 * run.time + run.time**2
    assert angle[-1] > 3 * 2 * np.pi
    assert rotated(run, 0) == pytest.approx(angle, abs=1e-10)
    assert run.of("position")[:, 1] == pytest.approx(spline(angle), abs=1e-11)
    assert run.column("Motor.work")[-1] == pytest.approx(
        0.5 * 0.04 * (run.of("spin", 0)[-1, 2] ** 2 - 25.0)
        + 0.5 * 2.0 * (run.of("velocity")[-1, 1] ** 2 - run.of("velocity")[0, 1] ** 2)
        + 2.0 * G * run.of("position")[-1, 1],
        abs=1e-9,
    )


# Mechanisms by formula ---------------------------------------------------------------------------


def test_an_eccentric_lifts_a_flat_face_as_a_sine():
    run = simulate(deck("cam_follower_flat"), dt=0.005, t_final=1.0)
    a = 4 * np.pi * run.time
    height = 0.04 + 0.01 * np.cos(a)
    # The deck's 36 points are printed to 1e-9 m; a cubic spline through them keeps 1e-7 m.
    assert run.of("position")[:, 2] == pytest.approx(height, abs=2e-7)
    # The cam lifts weight and inertia: mean over the step, exact by momentum.
    v = run.of("velocity")[:, 2]
    assert run.column("Cam lift.load")[1:] == pytest.approx(
        0.2 * (9.81 + np.diff(v) / 0.005), abs=1e-10
    )


@pytest.mark.parametrize("h", [0.05, 0.01])
def test_a_driven_slider_crank_follows_its_formula(h):
    r, length, w = 0.1, 0.35, 4.0
    crank = body("Crank", mass=0.5, inertia=SIZES, position=(r / 2, 0.0, 0.0))
    rod = body("Rod", mass=0.7, inertia=SIZES, position=(r + length / 2, 0.0, 0.0))
    slider = body("Slider", mass=1.0, inertia=SIZES, position=(r + length, 0.0, 0.0))
    all3 = [crank, rod, slider]
    joints = [
        join(all3, "revolute", "Main", EARTH, "Crank", ZERO),
        join(all3, "revolute", "Pin", "Crank", "Rod", (r, 0.0, 0.0)),
        join(all3, "revolute", "Wrist", "Rod", "Slider", (r + length, 0.0, 0.0)),
        join(all3, "prismatic", "Way", EARTH, "Slider", (r + length, 0.0, 0.0), X),
    ]
    motor = JointMotion("Motor", "Main", "angle", Law("polynomial", (0.0, w)))
    model = build_model(all3, joints, gravity=(0.0, -G, 0.0), motions=(motor,))
    run = simulate(model, dt=h, t_final=4.0)
    phi = w * run.time
    known = r * np.cos(phi) + np.sqrt(length**2 - (r * np.sin(phi)) ** 2)
    # Closed at every step whatever its size.
    assert run.of("position")[:, 0] == pytest.approx(known, abs=1e-11)
    assert run.report.degrees_of_freedom == {"byCount": -3, "byRank": 0}
    # In space the hinges' reactions are not unique; the motor's moment is.
    assert "Motor" not in run.report.non_unique_reactions


@pytest.mark.parametrize("scheme", ["preserving", "gauss3", "radau2"])
@pytest.mark.parametrize("h", [0.01, 0.1 / 7.0])
@pytest.mark.parametrize("kind", ["cubic", "linear"])
def test_the_last_row_has_the_slope_of_a_law_that_ends_with_the_run(kind, scheme, h):
    """Times of steps round, to either side of the end of a table."""
    wheel = body("Wheel", inertia=SIZES)
    t = np.array([0.0, 0.1, 0.2, 0.3])
    table = Law(kind, (*t, *(5.0 * t if kind == "linear" else 0.5 * t + 20.0 * t**3)))
    axle = Joint("Axle", "revolute", EARTH, "Wheel", ZERO, ZERO)
    motor = JointMotion("Motor", "Axle", "angle", table)
    model = build_model([wheel], [axle], motions=(motor,))
    run = simulate(model, dt=h, t_final=0.3, scheme=scheme)
    slope = 5.0 if kind == "linear" else 0.5 + 60.0 * 0.3**2
    # The preserving scheme has order 2: h^2 times the third derivative, 120 rad/s^3, is 0.024.
    error = 0.03 if scheme == "preserving" else 1e-9
    assert run.of("spin")[-1, 2] == pytest.approx(slope, abs=error)
    # The velocity of the start becomes that of the law in a step; that of the end is it.
    assert run.report.extremes["constraintViolationRateMax"] < 1.0


@pytest.mark.parametrize("degrees", [20.0, 45.0])
def test_a_universal_joint_does_not_rotation_evenly(degrees):
    beta, w = np.radians(degrees), 3.0
    b = np.cos(beta) * Z + np.sin(beta) * X
    rotation = from_axis_angle((0.0, 1.0, 0.0), beta)
    first = body("First", inertia=SIZES, position=(0.0, 0.0, -1.0))
    second = body("Second", inertia=SIZES, position=vector(b), orientation=rotation)
    pair = [first, second]
    middle = Frame(np.zeros(3), np.column_stack([Z, X, Y]))
    # The first yoke holds the cross along y, the second along y x b.
    second_frame = np.column_stack([Y, b, np.cross(Y, b)])
    cross = Sample([], axes=tuple((middle.R.T @ second_frame).T))
    joints = [
        join(pair, "revolute", "In", EARTH, "First", first.position),
        join(pair, "revolute", "Out", EARTH, "Second", second.position, b),
        joint_between(pair, "universal", "Cross", "First", "Second", middle, cross),
    ]
    motor = JointMotion("Motor", "In", "angle", Law("polynomial", (0.0, w)))
    run = simulate(build_model(pair, joints, motions=(motor,)), dt=0.01, t_final=4.0)
    theta = w * run.time
    R = np.einsum("ji,tjk->tik", np.array(across(b)), run.matrices(1) @ run.matrices(1)[0].T)
    R = R @ across(b)
    out = np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0]))
    known = np.unwrap(np.arctan2(np.cos(beta) * np.sin(theta), np.cos(theta)))
    assert out == pytest.approx(known, abs=1e-10)
    assert np.ptp(out - theta) > 0.02  # it does fluctuate


def test_a_driven_pendulum_takes_the_torque_that_inverse_dynamics_gives():
    m, L, J = 2.0, 0.5, 0.04
    bob = body("Bob", mass=m, inertia=SIZES, position=(0.0, -L, 0.0))
    pivot = join([bob], "revolute", "Pivot", EARTH, "Bob", ZERO)
    amplitude, omega = 0.8, 3.0
    motor = JointMotion("Motor", "Pivot", "angle", Law("sine", (amplitude, omega, 0.0, 0.0)))
    model = build_model([bob], [pivot], gravity=(0.0, -G, 0.0), motions=(motor,))
    errors = []
    for h in (0.02, 0.01, 0.005):
        run = simulate(model, dt=h, t_final=2.0)
        load, power = (run.column(f"Motor.{what}")[1:] for what in ("load", "power"))
        # Power is load times speed in the middle of the step, as the load is its mean.
        speed = amplitude * omega * np.cos(omega * (run.time[1:] - h / 2))
        assert power == pytest.approx(load * speed, rel=1e-9)
        # A law of time is met at the ends of steps; the load alternates about its course by O(h),
        # and the mean of two steps is the measure.
        t = run.time[1:-1]
        theta = amplitude * np.sin(omega * t)
        torque = -(J + m * L**2) * omega**2 * theta + m * G * L * np.sin(theta)
        errors.append(np.abs(0.5 * (load[1:] + load[:-1]) - torque).max())
        # The work is the sum of load times way, exactly.
        way = np.diff(amplitude * np.sin(omega * run.time))
        assert np.diff(run.column("Motor.work")) == pytest.approx(load * way, abs=1e-12)
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2.0, abs=0.1)


def test_a_point_follows_its_law_and_is_free_across_it():
    ball = body("Ball", velocity=(0.0, 1.0, 0.0))
    law = Law("sine", (0.3, 5.0, 0.0, 0.0))
    motion = PointMotion("P", "Ball", ZERO, (0.0, 0.0, 1.0), law)
    run = simulate(build_model([ball], motions=(motion,)), dt=0.01, t_final=2.0)
    assert run.of("position")[:, 2] == pytest.approx(0.3 * np.sin(5 * run.time), abs=1e-12)
    assert run.of("position")[:, 1] == pytest.approx(run.time, abs=1e-11)


@pytest.mark.parametrize(("beta", "precession"), [(1.2, 1.5), (0.9, -2.5)])
def test_a_rolling_disk_goes_in_a_circle(beta, precession):
    """Axis e at ``beta`` from the vertical, precessing at W; w3 the spin about e. With d in the
    disk, uphill, and tau = e x d:

        W sin(beta) (A W cos(beta) - C w3) = m a (a W w3 sin(beta) + g cos(beta))
    """
    m, a = 15.0, 1.0
    A, C, W = m / 4, m / 2, precession
    s, c = np.sin(beta), np.cos(beta)
    w3 = (A * W**2 * s * c - m * G * a * c) / ((C + m * a**2) * W * s)
    e, d = s * X + c * Z, -c * X + s * Z
    tau = np.cross(e, d)
    spin = w3 * e + W * s * d
    rotation = from_axis_angle((0.0, 1.0, 0.0), beta)
    own = body("Disk", mass=m, inertia=(A, A, C), position=(0.0, 0.0, a * s), orientation=rotation)
    R = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    v = a * w3 * tau
    own = replace(own, velocity=vector(R.T @ v), angular_velocity=vector(R.T @ spin))
    frame = Frame(np.zeros(3), np.eye(3))
    sample = Sample([], a * s * Z, tuple(R.T), (("radius", a),))
    joint = joint_between([own], "rollingDisk", "Roll", EARTH, "Disk", frame, sample)
    model = replace(build_model([own], [joint], gravity=(0.0, 0.0, -G)), velocity="refuse")
    run = simulate(model, dt=0.002, t_final=3.0)
    # Steady to the order of the step.
    assert run.of("position")[:, 2] == pytest.approx(a * s, abs=2e-4)
    # v = W z x (place - middle of the circle).
    middle = np.array([0.0, 0.0, a * s]) + np.cross(Z, v) / W

    def at_end(run):
        return run.of("position")[-1]

    arm = np.array([0.0, 0.0, a * s]) - middle
    t = 3.0
    known = middle + np.cos(W * t) * arm + np.sin(W * t) * np.cross(Z, arm)
    assert extrapolated(model, t, 0.004, at_end) == pytest.approx(known, abs=2e-5)
