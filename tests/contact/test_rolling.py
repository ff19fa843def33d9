"""Friction between round surfaces, and on planes that move, against closed forms."""

import numpy as np
import pytest
from scipy.special import ellipk

from msahl.algebra.functions import Law
from msahl.algebra.rotation import matrix
from msahl.check.directions import frame
from msahl.model import Compliance, Joint, JointMotion, PlaneContact, SphereContact
from tests.contact.models import DOWN, run_events, times_of
from tests.support.models import GROUND, body, build_model, deck

ZERO, UP, ALONG = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
G = 9.81
LARGE, SMALL = 0.9, 0.1
ROUGH = 1e6
"""Coefficient by which a contact sticks until it hardly presses."""
SCHEMES = [("gauss3", 0.01, 1e-10), ("preserving", 0.005, 2e-4)]
"""Scheme, step, and what it leaves of positions [m] after some oscillations."""


def ball(name, position, mass=1.0, radius=SMALL, **others):
    """A solid sphere."""
    return body(name, mass, 0.4 * mass * radius**2, position, **others)


def revolute(child, axis):
    axes = frame(axis)
    return Joint("Hinge", "revolute", GROUND.name, child, ZERO, ZERO, axes, axes)


def velocity(row, number=0):
    """(3,) inertial axes, of a body in a row of ``states``, which has it in the body's."""
    own = row[1 + 12 * number : 13 + 12 * number]
    return np.array(matrix(tuple(own[3:6]))) @ own[6:9]


def outside(angle, distance):
    return (distance * float(np.sin(angle)), 0.0, distance * float(np.cos(angle)))


@pytest.mark.parametrize("axis", [None, ALONG])
@pytest.mark.parametrize(("scheme", "dt", "allowed"), SCHEMES)
def test_a_ball_rolls_in_a_bowl_as_a_long_pendulum(axis, scheme, dt, allowed):
    """Of 7/5 of the length, at 60 degrees: after a quarter of its period it is at the bottom."""
    angle, length = np.radians(60.0), LARGE - SMALL
    bodies = [ball("Ball", outside(np.pi - angle, length))]
    contact = SphereContact(
        "Bowl", GROUND.name, "Ball", ZERO, ZERO, -LARGE, SMALL, axis, friction=ROUGH
    )
    model = build_model(bodies, gravity=DOWN, contacts=(contact,))
    quarter = np.sqrt(1.4 * length / G) * ellipk(np.sin(0.5 * angle) ** 2)
    report, sink, events = run_events(model, scheme, dt, quarter)
    assert [event[1] for event in events] == ["closes", "sticks"]
    assert sink.table("states")[-1, 1:4] == pytest.approx([0.0, 0.0, -length], abs=allowed)
    speed = np.sqrt(2.0 * G * length * 0.5 / 1.4)
    assert velocity(sink.table("states")[-1]) == pytest.approx([-speed, 0.0, 0.0], abs=allowed)
    assert report.extremes["energyErrorMax"] < 1e-9


@pytest.mark.parametrize("axis", [None, ALONG])
def test_a_ball_that_rolls_off_a_sphere_leaves_it(axis):
    """Where cos = 10/17 of that of the start: with the grip it has, until it presses no more."""
    start, distance = np.radians(10.0), 1.0
    bodies = [ball("Ball", outside(start, distance), radius=0.3)]
    contact = SphereContact(
        *("Top", GROUND.name, "Ball", ZERO, ZERO, 0.7, 0.3, axis),
        friction=0.0,
        static_friction=1e9,
    )
    model = build_model(bodies, gravity=DOWN, contacts=(contact,))
    _, sink, events = run_events(model, "gauss3", 0.02, 1.5)
    assert [event[1] for event in events] == ["closes", "sticks", "slides", "opens"]
    (left,) = times_of(events, "opens")
    states = sink.table("states")
    cosine = 10.0 / 17.0 * np.cos(start)
    speed = np.sqrt(G * cosine)  # gravity alone holds it on the round
    t = states[-1, 0] - left
    place = [distance * np.sqrt(1.0 - cosine**2) + speed * cosine * t]
    place += [0.0, distance * cosine - speed * np.sqrt(1.0 - cosine**2) * t - 0.5 * G * t * t]
    assert states[-1, 1:4] == pytest.approx(place, abs=1e-8)


@pytest.mark.parametrize(("scheme", "dt", "allowed"), SCHEMES)
def test_a_ball_rolls_in_a_vertical_pipe_up_and_down(scheme, dt, allowed):
    """It goes round with Omega and up and down with sqrt(2/7) of it: the golfer's dilemma."""
    omega, length = 8.0, LARGE - SMALL
    spin = -omega * length / SMALL
    bodies = [
        ball(
            "Ball",
            (length, 0.0, 0.0),
            velocity=(0.0, omega * length, 0.0),
            angular_velocity=(0.0, 0.0, spin),
        )
    ]
    contact = SphereContact(
        "Pipe", GROUND.name, "Ball", ZERO, ZERO, -LARGE, SMALL, UP, friction=ROUGH
    )
    model = build_model(bodies, gravity=DOWN, contacts=(contact,))
    _, sink, _ = run_events(model, scheme, dt if scheme == "gauss3" else 0.2 * dt, 2.0)
    states = sink.table("states")
    fall = 2.5 * G / omega**2 * (1.0 - np.cos(np.sqrt(2.0 / 7.0) * omega * states[:, 0]))
    assert states[:, 3] == pytest.approx(-fall, abs=1e3 * allowed if dt > 0.01 else 5e-3)
    assert states[-1, 1] == pytest.approx(length * np.cos(2.0 * omega), abs=1e-2)


@pytest.mark.parametrize(("scheme", "dt", "allowed"), SCHEMES)
def test_a_ball_rolls_in_a_drum_that_rotates(scheme, dt, allowed):
    """Both move: 1 + .4/(1 + c) in place of 7/5, c = .4 m R^2/I, I the drum's inertia."""
    angle, length, inertia = np.radians(60.0), LARGE - SMALL, 0.5
    bodies = [
        body("Drum", 2.0, inertia, ZERO),
        ball("Ball", outside(np.pi - angle, length)),
    ]
    contact = SphereContact(
        "Drum wall", "Drum", "Ball", ZERO, ZERO, -LARGE, SMALL, ALONG, friction=ROUGH
    )
    model = build_model(
        bodies, joints=(revolute("Drum", ALONG),), gravity=DOWN, contacts=(contact,)
    )
    factor = 1.0 + 0.4 / (1.0 + 0.4 * LARGE**2 / inertia)
    quarter = np.sqrt(factor * length / G) * ellipk(np.sin(0.5 * angle) ** 2)
    report, sink, events = run_events(model, scheme, dt, quarter)
    assert [event[1] for event in events] == ["closes", "sticks"]
    assert sink.table("states")[-1, 13:16] == pytest.approx([0.0, 0.0, -length], abs=allowed)
    assert report.extremes["energyErrorMax"] < 1e-9


@pytest.mark.parametrize(("scheme", "dt", "allowed"), SCHEMES)
def test_a_ball_on_a_turntable_goes_round_in_circles(scheme, dt, allowed):
    """With 2/7 of the table's speed, about a point that its start determines."""
    omega, v = 3.0, 0.4
    table = body("Table", 5.0, 0.5, ZERO, angular_velocity=(0.0, 0.0, omega))
    start, r = (0.5, 0.0, SMALL), SMALL
    # Rolling: v - r e_y-axis spin equals the table's velocity (0, omega x, 0) below the ball.
    spin = ((omega * start[0]) / r, v / r, 0.0)
    bodies = [table, ball("Ball", start, velocity=(v, 0.0, 0.0), angular_velocity=spin)]
    contact = PlaneContact("Plate", "Table", "Ball", ZERO, ZERO, UP, SMALL, friction=ROUGH)
    motion = JointMotion("Motor", "Hinge", "angle", Law("polynomial", (0.0, omega)))
    joints = (revolute("Table", UP),)
    model = build_model(bodies, joints=joints, motions=(motion,), gravity=DOWN, contacts=(contact,))
    _, sink, events = run_events(model, scheme, dt, 2.0)
    assert [event[1] for event in events] == ["closes", "sticks"]
    w = 2.0 / 7.0 * omega
    x, y = sink.table("states")[-1, 13:15]
    found = np.array([x, y])
    expected = np.array([0.5 + v / w * np.sin(2.0 * w), v / w * (1.0 - np.cos(2.0 * w))])
    assert found == pytest.approx(expected, abs=100.0 * allowed)


def throw(mu, across):
    """Two equal balls; the first meets the second with 1 m/s along the line of their centres, and
    its surface moves ``across`` it."""
    spin = across / SMALL
    first = ball(
        "First", (-0.5, 0.0, 0.0), velocity=(1.0, 0.0, 0.0), angular_velocity=(0.0, 0.0, spin)
    )
    contact = SphereContact(
        *("Touch", "First", "Second", ZERO, ZERO, SMALL, SMALL),
        restitution=1.0,
        friction=mu,
    )
    return build_model([first, ball("Second", ZERO)], contacts=(contact,))


@pytest.mark.parametrize(("mu", "across"), [(0.05, 1.0), (0.3, 1.0)])
@pytest.mark.parametrize("scheme", ["gauss2", "preserving"])
def test_spin_throws_a_ball(mu, across, scheme):
    """The tangential impulse is mu of the normal one, 1 N s, or at most across/7, where it ends the
    slip."""
    report, sink, events = run_events(throw(mu, across), scheme, 0.01, 0.6)
    (impact,) = [event for event in events if event[1] == "impact"]
    pushed = min(mu, across / 7.0)
    assert impact[0] == pytest.approx(0.3, abs=1e-14)
    assert impact[9] == pytest.approx(pushed, rel=1e-13)
    states = sink.table("states")[-1]
    assert velocity(states) == pytest.approx([0.0, -pushed, 0.0], abs=1e-13)
    assert velocity(states, 1) == pytest.approx([1.0, pushed, 0.0], abs=1e-13)
    spin = across / SMALL - 2.5 * pushed / SMALL
    assert states[10:13] == pytest.approx([0.0, 0.0, spin], abs=1e-12)
    assert states[22:25] == pytest.approx([0.0, 0.0, -2.5 * pushed / SMALL], abs=1e-12)
    assert report.extremes["energyErrorMax"] < 1e-13


SOFT = Compliance(1e6, 1.5, friction_width=1e-3)


def soft_floor(gravity, position, **others):
    """A ball on a soft floor."""
    contact = PlaneContact(
        *("Floor", GROUND.name, "Ball", ZERO, ZERO, UP, SMALL),
        restitution=1.0,
        compliance=SOFT,
        friction=0.2,
    )
    return build_model([ball("Ball", position, **others)], gravity=gravity, contacts=(contact,))


@pytest.mark.parametrize(("scheme", "allowed"), [("gauss3", 2e-7), ("preserving", 2e-5)])
def test_a_spin_leaves_a_soft_floor_with_the_impulse_of_friction(scheme, allowed):
    """mu of the normal impulse, 2 N s, while the slip is far beyond its width. By Hertz's law any
    scheme has the order 2.5 at the touch.
    """
    spin = 30.0
    start = {"velocity": (0.0, 0.0, -1.0), "angular_velocity": (0.0, spin, 0.0)}
    model = soft_floor(ZERO, (0.0, 0.0, SMALL + 0.01), **start)
    report, sink, _ = run_events(model, scheme, 2e-4, 0.04)
    states = sink.table("states")[-1]
    assert velocity(states) == pytest.approx([0.4, 0.0, 1.0], abs=allowed)
    assert states[10:13] == pytest.approx([0.0, spin - 0.4 * 2.5 / SMALL, 0.0], abs=1e3 * allowed)
    lost = 0.5 * 0.004 * (30.0**2 - 20.0**2) - 0.5 * 0.4**2
    assert report.extremes["energyErrorMax"] < (1e-12 if scheme == "preserving" else allowed)
    assert sink.table("work")[-1, 1] == pytest.approx(-lost, abs=10.0 * allowed)


@pytest.mark.parametrize("scheme", ["gauss3", "preserving"])
def test_a_ball_rolls_down_a_soft_slope_with_the_creep_of_its_law(scheme):
    """T = 2/7 m g sin by the slip w artanh(T/(mu N)), which is constant."""
    sine, cosine = 0.28, 0.96
    depth = (G * cosine / SOFT.stiffness) ** (2.0 / 3.0)
    model = soft_floor((G * sine, 0.0, -G * cosine), (0.0, 0.0, SMALL - depth))
    _, sink, _ = run_events(model, scheme, 1e-3, 0.2)
    states = sink.table("states")[-1]
    v, spin = velocity(states)[0], states[11]
    creep = SOFT.friction_width * np.arctanh(2.0 / 7.0 * sine / (0.2 * cosine))
    slip = v - (SMALL) * spin
    assert slip == pytest.approx(creep, rel=1e-8)
    assert v == pytest.approx(5.0 / 7.0 * G * sine * 0.2 + 2.0 / 7.0 * creep, rel=1e-7)


DECKS = {
    "golf_hole": (0, [-0.7661275842, -0.2303226533, -0.6295936710], 1e-6),
    "turntable": (1, [0.9618707561, 0.5333988358, 0.1], 2e-8),
    "spinning_ball": (0, [0.0094377301, 0.0, 0.1171886507], 2e-7),
}


@pytest.mark.parametrize("name", DECKS)
def test_decks_end_where_they_say(name):
    number, place, allowed = DECKS[name]
    model = deck(name)
    report, sink, events = run_events(model, "gauss3")
    kinds = [event[1] for event in events]
    assert kinds == (["closes", "sticks"] if model.contacts[0].compliance is None else [])
    found = sink.table("states")[-1, 1 + 12 * number : 4 + 12 * number]
    assert found == pytest.approx(place, abs=allowed)  # the error of its steps
    assert report.extremes["energyErrorMax"] < allowed


def test_a_tippe_top_ends_upside_down_and_keeps_jelletts_constant():
    """Friction acts at the point of contact, so its moment does no work on the vector from there:
    the constant is one of the equations, which gauss3 keeps to its error of 1e-13."""
    _, sink, events = run_events(deck("tippe_top"), "gauss3", 1e-3, 1.1)
    assert [event[1] for event in events] == ["closes", "slides", "sticks"]
    inertia, radius, low = np.array([2.994285714285714e-6] * 2 + [3.2e-6]), 0.02, 0.006
    constants, axes = [], []
    for row in sink.table("states")[::100]:
        R = np.array(matrix(tuple(row[4:7])))
        arm = radius * np.array(UP) - low * R[:, 2]
        constants.append(float(R @ (inertia * row[10:13]) @ arm))
        axes.append(R[2, 2])
    assert constants == pytest.approx(np.full(len(constants), constants[0]), rel=1e-11)
    assert axes[0] == pytest.approx(np.cos(0.1), abs=1e-12)
    assert min(axes) < -0.9
