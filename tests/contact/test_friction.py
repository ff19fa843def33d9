"""Contacts with Coulomb's friction that stick and slide, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.functions import Law
from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.model import ConcentratedLoad, Joint, PlaneContact, SpringDamper
from msahl.start.velocities import StartError
from tests.contact.models import DOWN, box, run_events, times_of
from tests.support.models import GROUND, body, build_model, deck

ZERO, UP = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
EXACT = 1e-9
"""Difference that gauss at small steps, and auto at the tolerance 1e-9, may leave."""


def slope(degrees):
    """Gravity seen from a slope that rises along x."""
    angle = np.radians(degrees)
    return (-9.81 * float(np.sin(angle)), 0.0, -9.81 * float(np.cos(angle)))


def block(mu, gravity, x=0.0, velocity=ZERO, loads=(), **friction):
    """A point of 1 kg on a plane."""
    floor = PlaneContact("Floor", GROUND.name, "Block", ZERO, ZERO, UP, friction=mu, **friction)
    bodies = [body("Block", 1.0, 0.01, (x, 0.0, 0.0), velocity=velocity)]
    return build_model(bodies, loads=loads, gravity=gravity, contacts=(floor,))


def oscillator(stiffness=100.0, loads=(), **others):
    """A block on a spring that is not stretched at x = 0, for small x."""
    spring = SpringDamper(
        "Spring",
        GROUND.name,
        "Block",
        (-1.0, 0.0, 0.0),
        ZERO,
        stiffness=stiffness,
        damping=0.0,
        free_length=1.0,
    )
    return block(others.pop("mu", 0.25), DOWN, loads=(spring, *loads), **others)


def kinds(events):
    """Kinds of events, without those at t = 0."""
    return [event[1] for event in events if event[0] > 0.0]


ROLLS = 0.291247997670016
ALL = [
    ("preserving", 0.05, None),
    ("decaying", 0.05, None),
    ("gauss2", 0.05, None),
    ("gauss3", 0.05, None),
    ("radau2", 0.05, None),
    ("auto", None, 1e-9),
]


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), ALL)
def test_sphere_slides_then_rolls(scheme, dt, tolerance):
    report, sink, events = run_events(deck("sliding_sphere"), scheme, dt, 0.5, tolerance)
    assert times_of(events, "sticks") == pytest.approx([ROLLS], abs=1e-13)  # slips are lines in t
    if scheme != "decaying":  # which takes a part of the energy itself
        # Rotations about an axis at a given torque have the error of the scheme in their energy.
        assert report.contacts["energyLost"] == pytest.approx(2.0 * 2.0 / 7.0, abs=1e-5)
        expected = 0.499282281720027 + (0.5 - ROLLS) * 1.42857142857143
        assert sink.table("states")[-1, 1] == pytest.approx(expected, abs=1e-5)
    if scheme in ("preserving", "decaying"):
        assert report.extremes["energyErrorMax"] < 1e-12 * 10.0


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), [ALL[0], ALL[2], ALL[5]])
def test_block_slides_up_a_slope_and_back(scheme, dt, tolerance):
    model = block(0.3, slope(30.0), velocity=(3.0, 0.0, 0.0))
    report, sink, events = run_events(model, scheme, dt, 1.11833197793229, tolerance)
    assert kinds(events) == ["slides"]
    assert times_of(events, "slides")[-1] == pytest.approx(0.402483982848927, abs=1e-13)
    assert sink.table("states")[-1, [1, 7]] == pytest.approx([0.0, -1.6867434942053], abs=1e-12)
    assert report.extremes["energyErrorMax"] < 1e-12 * 4.5


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), [ALL[0], ALL[2], ALL[5]])
def test_block_sticks_on_a_slope_without_creep(scheme, dt, tolerance):
    _, sink, events = run_events(block(0.5, slope(10.0)), scheme, dt, 100.0, tolerance)
    assert [event[1] for event in events] == ["closes", "sticks"]
    assert np.abs(sink.table("states")[:, 1:4]).max() < 1e-12


def test_corners_of_a_box_stick_without_creep():
    """Eight equations of the slips, of which three are independent."""
    model = replace(box((0.0, 0.0, 0.1)), gravity=slope(10.0))
    contacts = tuple(replace(contact, friction=0.5) for contact in model.contacts)
    report, sink, _ = run_events(replace(model, contacts=contacts), "preserving", 0.05, 10.0)
    assert report.contacts["closed"] == [contact.name for contact in contacts]
    assert np.abs(sink.table("states")[:, 1:4] - [0.0, 0.0, 0.1]).max() < 1e-12


def test_box_slides_up_a_slope_and_stays():
    report, sink, events = run_events(deck("box_on_slope"), "gauss2")
    assert times_of(events, "sticks") == pytest.approx([0.245068687475227] * 4, abs=1e-12)
    assert sink.table("states")[-1, 1:4] == pytest.approx([0.18380151560642, 0, 0.1], abs=1e-12)
    assert report.contacts["energyLost"] == pytest.approx(0.508305918823294, abs=1e-12)
    assert report.extremes["energyErrorMax"] < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
def test_balance_closes_where_a_box_with_friction_falls_on_an_edge(scheme):
    model = box((0.0, 0.0, 0.5), 0.3, 0.3)
    contacts = tuple(replace(contact, friction=0.3) for contact in model.contacts)
    report, sink, _ = run_events(replace(model, contacts=contacts), scheme, 0.01, 1.5)
    allowed = 1e-12 * 4.0 if scheme == "preserving" else 1e-7
    assert report.extremes["energyErrorMax"] < allowed
    assert report.contacts["energyLost"] == pytest.approx(9.81 * 0.4, abs=allowed)
    assert sink.table("states")[-1, 3:7] == pytest.approx([0.1, 0, 0, 0], abs=1e-10)


@pytest.mark.parametrize(
    ("scheme", "steps", "least"),
    [("gauss2", (0.04, 0.02, 0.01), 3.9), ("gauss3", (0.08, 0.04, 0.02), 5.8)],
)
def test_order_through_reversals_and_the_end_of_a_slip(scheme, steps, least):
    """x = .2 at rest: reversals every pi/10 s, at rest at .0038 m after four half periods."""
    errors = []
    for dt in steps:
        report, sink, events = run_events(oscillator(x=0.2), scheme, dt, 2.0)
        assert kinds(events) == ["slides", "slides", "slides", "sticks"]
        errors.append(abs(events[-1][0] - 0.4 * np.pi))
        assert sink.table("states")[-1, 1] == pytest.approx(0.0038, abs=1e-12)
        assert report.contacts["energyLost"] == pytest.approx(1.999278, abs=1e-12)
    assert (np.log2(np.divide(errors[:-1], errors[1:])) >= least).all()


def in_closed_form(t):
    """Place of the block of ``oscillator(x=0.2)`` at the times ``t`` (m,)."""
    half, mu = np.minimum((10.0 * t / np.pi).astype(int), 4), 0.25 * 9.81 / 100.0
    sign, amplitude = (-1.0) ** half, 0.2 - 2.0 * mu * half - mu
    moving = sign * (amplitude * np.cos(10.0 * t - np.pi * half) + mu)
    return np.where(half == 4, 0.0038, moving)


@pytest.mark.parametrize(
    ("scheme", "dt"),
    [
        ("preserving", 0.01),
        ("decaying", 0.005),
        ("gauss2", 0.02),
        ("gauss3", 0.04),
        ("radau2", 0.01),
    ],
)
def test_estimated_error_is_that_through_reversals(scheme, dt):
    report, sink, _ = run_events(oscillator(x=0.2), scheme, dt, 1.2, error="estimate")
    states = sink.table("states")
    error = np.abs(states[:, 1] - in_closed_form(states[:, 0])).max()
    assert 1.0 < report.error["position"] / error < 2.0
    assert report.verdict["word"] == "PASS"


def test_tolerance_holds_through_reversals():
    _, sink, events = run_events(oscillator(x=0.2), "auto", None, 2.0, 1e-9)
    times = [event[0] for event in events if event[0] > 0.0]
    assert times == pytest.approx(0.1 * np.pi * np.arange(1, 5), abs=1e-8)
    assert sink.table("states")[-1, 1] == pytest.approx(0.0038, abs=1e-12)


def test_static_friction_holds_longer():
    """A force 6 sin 7t moves a block of 1 kg where it has grown to 0.4 g, against 0.2 g."""
    push = ConcentratedLoad(
        "Push",
        "Block",
        ZERO,
        (6.0, 0.0, 0.0),
        GROUND.name,
        ZERO,
        GROUND.name,
        law=Law("sine", (1.0, 7.0, 0.0, 0.0)),
    )
    model = oscillator(0.0, (push,), mu=0.2, static_friction=0.4)
    _, sink, events = run_events(model, "gauss3", 0.02, 0.2)
    begins = np.arcsin(0.4 * 9.81 / 6.0) / 7.0
    assert times_of(events, "slides") == pytest.approx([begins], abs=1e-12)
    v = 6.0 / 7.0 * (np.cos(7.0 * begins) - np.cos(1.4)) - 0.2 * 9.81 * (0.2 - begins)
    assert sink.table("states")[-1, 7] == pytest.approx(v, abs=1e-9)


@pytest.mark.parametrize("scheme", ["preserving", "gauss3"])
def test_block_slips_to_the_other_side_when_its_load_is_reversed(scheme):
    """It sticks between; the force at which it slips is that of the instant."""
    push = ConcentratedLoad(
        "Push",
        "Block",
        ZERO,
        (6.0, 0.0, 0.0),
        GROUND.name,
        ZERO,
        GROUND.name,
        law=Law("sine", (1.0, 7.0, 0.0, 0.0)),
    )
    model = oscillator(0.0, (push,), mu=0.4, static_friction=0.55)
    _, sink, events = run_events(model, scheme, 0.005, 1.0)
    assert kinds(events) == ["slides", "sticks", "slides", "sticks"]
    allowed = 1e-9 if scheme == "gauss3" else 1e-4  # their errors at this step
    first, _, again, _ = (event[0] for event in events if event[0] > 0.0)
    assert first == pytest.approx(np.arcsin(0.55 * 9.81 / 6.0) / 7.0, abs=allowed)
    assert again - first == pytest.approx(np.pi / 7.0, abs=allowed)
    states = sink.table("states")
    assert states[:, 1].max() > 0.01
    assert states[-1, 1] == pytest.approx(0.0, abs=allowed)


@pytest.mark.parametrize(
    ("scheme", "dt", "allowed"), [("gauss3", 0.02, 1e-8), ("gauss3", 0.01, 1e-10)]
)
def test_slip_rotates_and_ends_on_a_curved_way(scheme, dt, allowed):
    """Thrown across a slope, a block slows down while its slip rotates downhill.

    Its speed v and the part v_d of it downhill satisfy v' = -mu g cos + g sin v_d/v and v_d' =
    g sin - mu g cos v_d/v, so v_d + c v with c = mu cos/sin is linear in t, and zero at the end.
    """
    model = block(0.5, slope(20.0), velocity=(0.5, 1.5, 0.0))
    report, _, events = run_events(model, scheme, dt, 1.0)
    g, mu, theta = 9.81, 0.5, np.radians(20.0)
    c = mu * g * np.cos(theta) / (g * np.sin(theta))
    speed, along = np.hypot(0.5, 1.5), -0.5
    ends = (c * speed + along) / (g * np.sin(theta) * (c * c - 1.0))
    assert times_of(events, "sticks") == pytest.approx([ends], abs=allowed)
    assert report.extremes["energyErrorMax"] < 1e-12


def test_rocking_block_changes_its_edge():
    report, _, events = run_events(deck("rocking_block"), "gauss3")
    expected = [0.312308575112622, 0.820592229082601, 1.25187674446184]
    assert times_of(events, "impact") == pytest.approx(expected, abs=EXACT)
    lost = [event[6] for event in events if event[1] == "impact"]
    assert lost[0] == pytest.approx(0.0152594979682, abs=1e-12)
    # The energy of each is that of the last one by the square of the ratio of rates.
    ratio = 0.911764705882353**2
    assert np.divide(lost[1:], lost[:-1]) == pytest.approx([ratio, ratio], abs=1e-7)
    assert report.contacts["energyLost"] == pytest.approx(sum(lost), abs=1e-12)


def rod(mu, degrees):
    """A uniform rod of 1 m whose lower end slides with -1 m/s, at an angle with the floor."""
    angle = float(np.radians(degrees))
    orientation = from_axis_angle((0.0, 1.0, 0.0), -angle)
    tip = PlaneContact("Tip", GROUND.name, "Rod", ZERO, (-0.5, 0.0, 0.0), UP, friction=mu)
    centre = (0.5 * float(np.cos(angle)), 0.0, 0.5 * float(np.sin(angle)))
    velocity = tuple((np.array(matrix(orientation)).T @ [-1.0, 0.0, 0.0]).tolist())
    given = {"orientation": orientation, "velocity": velocity}
    bodies = [body("Rod", 1.0, (1e-6, 1.0 / 12.0, 1.0 / 12.0), centre, **given)]
    return build_model(bodies, gravity=DOWN, contacts=(tip,))


@pytest.mark.parametrize("degrees", [50.65, 60.0, 73.04])
def test_rod_without_a_unique_motion_is_refused(degrees):
    """Painleve's rod: between 50.6416 and 73.0485 degrees for mu = 1.5."""
    with pytest.raises(StartError, match=r"'Tip' has no unique motion .*Painleve"):
        run_events(rod(1.5, degrees), "preserving", 0.001, 0.01)


@pytest.mark.parametrize(("mu", "degrees"), [(1.5, 50.6), (1.5, 73.1), (1.3, 60.0)])
def test_rod_beside_that_range_slides_and_sticks(mu, degrees):
    report, _, events = run_events(rod(mu, degrees), "preserving", 0.001, 0.01)
    assert kinds(events) == ["sticks"]
    assert report.extremes["energyErrorMax"] < 1e-12


@pytest.mark.parametrize(
    ("law", "ratio"),
    [("newton", 3.111489586383), ("poisson", 0.5385416067797), ("stronge", 0.5707831253395)],
)
def test_frictional_impact_of_a_double_pendulum(law, ratio):
    """Two rods of 1 m and 1 kg, at 20 and 30 degrees; Newton's law gains energy."""
    angle, rate = np.radians([20.0, 30.0]), np.array([-0.1, -0.2])
    along = np.stack([np.sin(angle), 0.0 * angle, -np.cos(angle)], axis=1)
    across = np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    centre = np.stack([0.5 * along[0], along[0] + 0.5 * along[1]])
    speed = np.stack([0.5 * rate[0] * across[0], rate[0] * across[0] + 0.5 * rate[1] * across[1]])
    bodies = []
    for k, name in enumerate("AB"):
        orientation = from_axis_angle((0.0, 1.0, 0.0), -float(angle[k]))
        velocity = np.array(matrix(orientation)).T @ speed[k]
        bodies.append(
            body(
                *(name, 1.0, (1.0 / 12.0, 1.0 / 12.0, 1e-4), tuple(centre[k].tolist())),
                orientation=orientation,
                velocity=tuple(velocity.tolist()),
                angular_velocity=(0.0, -float(rate[k]), 0.0),
            )
        )
    top, end = (0.0, 0.0, 0.5), (0.0, 0.0, -0.5)
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    joints = [
        Joint("First", "spherical", GROUND.name, "A", ZERO, top, axes, axes),
        Joint("Second", "spherical", "A", "B", end, top, axes, axes),
    ]
    floor = (0.0, 0.0, float(along[:, 2].sum()))
    tip = PlaneContact("Tip", GROUND.name, "B", floor, end, UP, restitution=0.7, friction=0.7)
    model = build_model(bodies, joints, contacts=(tip,))
    model = replace(model, simulation=replace(model.simulation, impact_law=law))
    report, _, events = run_events(model, "preserving", 0.001, 0.002)
    M = np.array([[4.0 / 3.0, 0.5 * np.cos(0.1745329251994)], [0.0, 1.0 / 3.0]])
    M[1, 0] = M[0, 1]
    energy = 0.5 * rate @ M @ rate
    assert 1.0 - events[0][6] / energy == pytest.approx(ratio, abs=1e-11)
    assert events[0][10] < 0.0 if law == "newton" else 0.0 < events[0][10] < events[0][6]
    assert (report.contacts["energyGained"] > 0.0) == (law == "newton")
    assert report.extremes["energyErrorMax"] < 1e-15


@pytest.mark.parametrize("law", ["poisson", "newton", "stronge"])
@pytest.mark.parametrize(
    ("mu", "v", "spin"), [(0.1, 2.36, -16.0), (0.3, 2.14285714285714, -21.4285714285714)]
)
def test_oblique_impact_of_a_sphere(law, mu, v, spin):
    floor = PlaneContact("Floor", GROUND.name, "Ball", ZERO, ZERO, UP, 0.1, 0.6, friction=mu)
    bodies = [body("Ball", 1.0, 0.004, (0.0, 0.0, 0.1), velocity=(3.0, 0.0, -4.0))]
    model = build_model(bodies, contacts=(floor,))
    model = replace(model, simulation=replace(model.simulation, impact_law=law))
    _, sink, events = run_events(model, "preserving", 0.01, 0.01)
    state = sink.table("states")[0]
    assert state[[7, 9]] == pytest.approx([v, 2.4], abs=1e-13)
    assert -state[11] == pytest.approx(spin, abs=1e-12)
    assert events[0][5] == pytest.approx(6.4, abs=1e-13)


def test_point_sticks_on_a_plane_that_moves():
    """A block on a carriage that a force of 3 N accelerates: both have 3/(2 + 1) m/s^2."""
    axes = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    guide = Joint("Guide", "prismatic", GROUND.name, "Carriage", ZERO, ZERO, axes, axes)
    push = ConcentratedLoad(
        "Push", "Carriage", ZERO, (3.0, 0.0, 0.0), GROUND.name, ZERO, GROUND.name
    )
    top = PlaneContact("Top", "Carriage", "Block", ZERO, ZERO, UP, friction=0.5)
    bodies = [body("Carriage", 2.0, 0.01), body("Block", 1.0, 0.01)]
    model = build_model(bodies, [guide], [push], gravity=DOWN, contacts=(top,))
    _, sink, events = run_events(model, "gauss2", 0.05, 1.0)
    assert [event[1] for event in events] == ["closes", "sticks"]
    assert sink.table("states")[-1, [1, 13]] == pytest.approx([0.5, 0.5], abs=1e-12)


def test_friction_works_between_steps_as_well():
    """At output times between the steps of ``auto`` the kinetic energy is that at the start and the
    work of friction, which is interpolated: to the tolerance.
    """
    model = deck("sliding_sphere")
    _, sink, _ = run_events(model, "auto", tolerance=1e-6)
    (sphere,) = model.bodies
    states, work = sink.table("states")[:, 1:], sink.table("work")[:, 1:]
    v, w = states[:, 6:9], states[:, 9:12]
    kinetic = 0.5 * sphere.mass * (v**2).sum(axis=1)
    kinetic += 0.5 * sphere.inertia[0][0] * (w**2).sum(axis=1)
    assert work[-1].sum() == pytest.approx(-0.571428571428571, abs=1e-6)
    np.testing.assert_allclose(kinetic, kinetic[0] + work.sum(axis=1), rtol=0.0, atol=1e-6)


def stick_slip():
    """Times of the events of a block of 1 kg on a spring of 100 N/m with a force 12 sin 5t, mu = .2
    and a static .4, up to 2 s, and its velocity at 2 s: pieces x = A cos 10t + B sin 10t + .16 sin
    5t - s mu g/100 in a slip towards s, each from where the force at rest is .4 g to where v = 0.
    """
    from scipy.optimize import brentq

    def first(f, t):  # change of sign after t; the shortest piece takes 40 ms
        while f(t) * f(t + 1e-3) > 0.0:
            t += 1e-3
        return brentq(f, t, t + 1e-3, xtol=1e-15)

    begins = first(lambda t: 12.0 * np.sin(5.0 * t) - 3.924, 0.0)
    times, x = [begins], 0.0
    while True:
        force = 12.0 * np.sin(5.0 * begins) - 100.0 * x
        middle = -np.sign(force) * 0.01962
        shift, rate = x - middle - 0.16 * np.sin(5.0 * begins), -0.8 * np.cos(5.0 * begins)

        def v(t, begins=begins, shift=shift, rate=rate):
            angle = 10.0 * (t - begins)
            return -10.0 * shift * np.sin(angle) + rate * np.cos(angle) + 0.8 * np.cos(5.0 * t)

        ends = first(v, begins + 1e-3)
        if ends > 2.0:
            return times, v(2.0)
        angle = 10.0 * (ends - begins)
        x = middle + 0.16 * np.sin(5.0 * ends)
        x += shift * np.cos(angle) + 0.1 * rate * np.sin(angle)
        times.append(ends)
        begins = ends
        if abs(12.0 * np.sin(5.0 * ends) - 100.0 * x) < 3.924:
            grip = np.sign(5.0 * np.cos(5.0 * ends)) * 3.924
            begins = first(lambda t, x=x, F=grip: 12.0 * np.sin(5.0 * t) - 100.0 * x - F, ends)
            times.append(begins)


def shaken():
    """The block of ``stick_slip``."""
    push = ConcentratedLoad(
        "Push",
        "Block",
        ZERO,
        (12.0, 0.0, 0.0),
        GROUND.name,
        ZERO,
        GROUND.name,
        law=Law("sine", (1.0, 5.0, 0.0, 0.0)),
    )
    return oscillator(100.0, (push,), mu=0.2, static_friction=0.4)


@pytest.mark.parametrize(
    ("scheme", "steps", "least"),
    [("gauss2", (0.02, 0.01, 0.005), 3.9), ("gauss3", (0.04, 0.02, 0.01), 5.8)],
)
def test_order_through_breaks_from_static_friction(scheme, steps, least):
    """Steps are halved: at other ratios the parts into which events divide steps differ more."""
    model = shaken()
    times, v = stick_slip()
    errors = []
    for dt in steps:
        _, sink, events = run_events(model, scheme, dt, 2.0)
        assert kinds(events) == ["slides", "slides", "slides", "sticks", "slides"]
        found = [event[0] for event in events if event[0] > 0.0]
        assert found[0] == pytest.approx(times[0], abs=1e-13)
        errors.append([*np.subtract(found, times)[1:], sink.table("states")[-1, 7] - v])
    orders = np.log2(np.abs(np.divide(errors[:-1], errors[1:])))
    assert (orders >= least).all()


@pytest.mark.slow
def test_tolerance_holds_through_breaks_in_large_steps():
    """A step from the break may last beyond the end of the slip, which is zero at both."""
    model = shaken()
    model = replace(model, simulation=replace(model.simulation, output_interval=2.0))
    _, sink, events = run_events(model, "auto", None, 2.0, 1e-6)
    times, v = stick_slip()
    found = [event[0] for event in events if event[0] > 0.0]
    assert found == pytest.approx(times, abs=1e-5)  # places to 1e-6 m at up to 1 m/s
    assert sink.table("states")[-1, 7] == pytest.approx(v, abs=1e-4)
