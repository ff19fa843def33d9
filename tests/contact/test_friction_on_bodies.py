"""Friction on boxes and capsules, and of rims on planes that move, against closed forms."""

import numpy as np
import pytest

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.check.directions import frame
from msahl.model import BoxContact, Compliance, Joint, PlaneContact
from tests.contact.models import DOWN, run_events, times_of
from tests.support.models import GROUND, body, build_model, deck

ZERO, UP, ALONG = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
G, R, MU, V = 9.81, 0.1, 0.2, 1.0
HALF = (2.0, 0.5, 0.05)
SCHEMES = [("gauss3", 0.02, 1e-11), ("preserving", 0.02, 1e-11)]
"""Sliding and rolling on a plane are parabolas, which both schemes follow to round-off."""


def plank(mass):
    """A plank whose upper side is at z = 0, on a rail along x."""
    axes = frame((1.0, 0.0, 0.0))
    place = (0.0, 0.0, -HALF[2])
    rail = Joint("Rail", "prismatic", GROUND.name, "Plank", place, ZERO, axes, axes)
    return body("Plank", mass, 1.0, place), rail


def on_plank(child, contact, mass=3.0):
    carrier, rail = plank(mass)
    return build_model([carrier, child], joints=(rail,), gravity=DOWN, contacts=(contact,))


def ball(position=(0.0, 0.0, R), **others):
    return body("Ball", 1.0, 0.4 * R * R, position, **others)


def on_box(**others):
    law = {"friction": MU} | others
    return BoxContact("Touch", "Plank", "Ball", ZERO, ZERO, HALF, radius=R, **law)


def under_rim(**others):
    """The upper side of the plank as a plane, for an upright coin that rolls along x."""
    law = {"friction": MU, "axis": UP} | others
    return PlaneContact("Touch", "Plank", "Ball", (0.0, 0.0, HALF[2]), ZERO, UP, R, **law)


def coin(**others):
    upright = from_axis_angle((1.0, 0.0, 0.0), 0.5 * np.pi)
    inertia = (0.25 * R * R, 0.25 * R * R, 0.5 * R * R)
    return body("Ball", 1.0, inertia, (0.0, 0.0, R), orientation=upright, **others)


CASES = {"ball": (ball, on_box, 2.5), "coin": (coin, under_rim, 2.0)}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("scheme", "dt", "allowed"), SCHEMES)
def test_what_slides_on_a_plank_comes_to_roll_as_both_move(case, scheme, dt, allowed):
    """It rolls from t on with v - mu g t = mu g t (m r^2/I + m/M): the plank is accelerated."""
    child, touch, share = CASES[case]
    mass = 3.0
    model = on_plank(child(velocity=(V, 0.0, 0.0)), touch(), mass)
    report, sink, events = run_events(model, scheme, dt, 0.5)
    assert [event[1] for event in events] == ["closes", "slides", "sticks"]
    t = V / (MU * G * (1.0 + share + 1.0 / mass))
    assert times_of(events, "sticks") == pytest.approx([t], abs=allowed)
    rolling, carried = V - MU * G * t, MU * G * t / mass
    last = sink.table("states")[-1]
    way = V * t - 0.5 * MU * G * t * t + rolling * (0.5 - t)
    assert last[13:16] == pytest.approx([way, 0.0, R], abs=allowed)
    assert last[1] == pytest.approx(0.5 * carried * t + carried * (0.5 - t), abs=allowed)
    # Order 2 books the work of friction exactly, gauss by its quadrature.
    assert report.extremes["energyErrorMax"] < (1e-14 if scheme == "preserving" else 1e-11)


@pytest.mark.parametrize("case", CASES)
def test_what_is_soft_creeps_as_both_move(case):
    """A compliant contact has the same friction while it slides: the loss of speed is mu g t."""
    child, touch, _ = CASES[case]
    law = {"restitution": 1.0, "compliance": Compliance(1e4, friction_width=1e-4)}
    placed = child(velocity=(V, 0.0, 0.0))
    model = on_plank(placed, touch(**law))
    _, sink, _ = run_events(model, "gauss3", 1e-3, 0.05)
    last = sink.table("states")[-1]
    # It bounces on its spring, so the impulse of friction is mu times that of the normal force.
    pressed = G * 0.05 + velocity(last, 1)[2]
    assert 3.0 * last[7] == pytest.approx(MU * pressed, rel=1e-9)


def velocity(row, number=0):
    """(3,) inertial axes, of a body in a row of ``states``, which has it in the body's."""
    own = row[1 + 12 * number : 13 + 12 * number]
    return np.array(matrix(tuple(own[3:6]))) @ own[6:9]


def test_a_ball_that_rolls_off_a_capsule_leaves_it():
    """Across its side as on a cylinder: where cos = 10/17 of that of the start."""
    angle, distance = np.radians(10.0), 1.0
    start = (distance * float(np.sin(angle)), 0.2, distance * float(np.cos(angle)))
    contact = BoxContact(
        *("Top", GROUND.name, "Ball", ZERO, ZERO, (0.0, 0.0, 0.5), 0.9, R),
        friction=0.0,
        static_friction=1e9,
        axes=frame(ALONG),
    )
    model = build_model([ball(start)], gravity=DOWN, contacts=(contact,))
    _, sink, events = run_events(model, "gauss3", 0.02, 1.5)
    assert [event[1] for event in events] == ["closes", "sticks", "slides", "opens"]
    (left,) = times_of(events, "opens")
    states = sink.table("states")
    cosine = 10.0 / 17.0 * np.cos(angle)
    sine, speed = np.sqrt(1.0 - cosine**2), np.sqrt(G * cosine)
    t = states[-1, 0] - left
    place = [distance * sine + speed * cosine * t, 0.2]
    place += [distance * cosine - speed * sine * t - 0.5 * G * t * t]
    assert states[-1, 1:4] == pytest.approx(place, abs=1e-8)


FREE = body("Plank", 2.0, (0.05, 0.08, 0.11), ZERO)
CAPSULE = {"half": (0.0, 0.0, 0.4), "parent_radius": 0.1, "axes": frame((0.6, 0.0, 0.8))}
HITS = {
    "side of a box": ((0.1, 0.05, 0.5), {"half": (0.4, 0.3, 0.2)}),
    "edge of a box": ((0.4 + 0.3, 0.1, 0.2 + 0.3), {"half": (0.4, 0.3, 0.2)}),
    "corner of a box": ((0.4 + 0.2, 0.3 + 0.2, 0.2 + 0.3), {"half": (0.4, 0.3, 0.2)}),
    "side of a capsule": ((0.8 * 0.4, 0.1, -0.6 * 0.4), CAPSULE),
    "end of a capsule": ((0.6 * 0.7, 0.1, 0.8 * 0.8), CAPSULE),
}


def thrown_at(start, **given):
    """A ball that spins and comes towards a body at rest, from aside."""
    towards = tuple(-2.0 * c / float(np.linalg.norm(start)) for c in start)
    spinning = ball(start, velocity=towards, angular_velocity=(7.0, -3.0, 5.0))
    law = {"friction": 0.3, "restitution": 0.6, "radius": R}
    contact = BoxContact("Touch", "Plank", "Ball", ZERO, ZERO, **law, **given)
    return build_model([FREE, spinning], contacts=(contact,))


def rim_on_plate():
    """A tilted disk that spins and falls on a plate, which is free as well."""
    tilted = from_axis_angle((0.0, 1.0, 0.0), 1.0)
    inertia = (0.25 * R * R, 0.25 * R * R, 0.5 * R * R)
    given = {"velocity": (1.0, 0.3, -1.0), "angular_velocity": (1.0, 2.0, 30.0)}
    disk = body("Ball", 1.0, inertia, (0.2, 0.1, 0.3), orientation=tilted, **given)
    plane = PlaneContact(
        *("Touch", "Plank", "Ball", ZERO, ZERO, UP, R), restitution=0.6, friction=0.3, axis=UP
    )
    return build_model([FREE, disk], contacts=(plane,))


MODELS = {name: lambda hit=hit: thrown_at(hit[0], **hit[1]) for name, hit in HITS.items()}
MODELS["rim"] = rim_on_plate


def momenta(row, bodies):
    """Momentum and angular momentum about the origin (6,), inertial axes."""
    total = np.zeros(6)
    for k, one in enumerate(bodies):
        own = row[1 + 12 * k : 13 + 12 * k]
        A = np.array(matrix(tuple(own[3:6])))
        p = one.mass * A @ own[6:9]
        total += [*p, *(np.cross(own[:3], p) + A @ np.array(one.inertia) @ own[9:])]
    return total


@pytest.mark.parametrize("case", MODELS)
@pytest.mark.parametrize(
    ("scheme", "dt", "allowed"), [("gauss3", 0.01, 1e-9), ("preserving", 0.01, 1e-13)]
)
def test_free_impacts_with_friction_keep_both_momenta(case, scheme, dt, allowed):
    """Both bodies are pushed at one point, by friction as well, which takes some energy."""
    model = MODELS[case]()
    report, sink, events = run_events(model, scheme, dt, 0.4)
    assert events[0][1] == "impact"
    slip, friction, lost = events[0][7], events[0][9], events[0][10]
    assert slip > 0.1
    assert friction > 0.01
    assert lost > 0.0
    states = sink.table("states")
    before, after = momenta(states[0], model.bodies), momenta(states[-1], model.bodies)
    assert after == pytest.approx(before, abs=allowed)
    assert report.extremes["energyErrorMax"] < 1e-9


def test_the_ball_of_the_deck_comes_to_roll():
    report, sink, events = run_events(deck("ball_on_a_plank"), "preserving")
    assert [event[1] for event in events] == ["closes", "slides", "sticks"]
    last = sink.table("states")[-1]
    # Digits of the deck's numbers.
    assert last[[1, 13, 15]] == pytest.approx([0.0376973460, 0.3869079621, 0.1], abs=1e-10)
    assert events[2][0] == pytest.approx(0.132961042415, abs=1e-11)
    assert report.contacts["energyLost"] == pytest.approx(0.130434782609, abs=1e-10)
