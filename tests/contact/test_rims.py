"""Rims of disks and cylinders on planes: a coin that rolls, against closed forms."""

import numpy as np
import pytest

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.check import check
from msahl.model import Compliance, PlaneContact
from tests.contact.models import DOWN, run_events, times_of
from tests.support.models import GROUND, body, build_model, deck

ZERO, UP = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
G, R = 9.81, 0.2


def coin(tilt, height, precession=0.0, spin=0.0, velocity=ZERO, friction=1e6, **others):
    """A thin disk of 1 kg whose axis is ``tilt`` from the vertical towards x; angular velocities
    about the vertical and about its axis.
    """
    axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    W = precession * np.array(UP) + spin * axis
    orientation = from_axis_angle((0.0, 1.0, 0.0), tilt)
    own = np.array(matrix(orientation)).T
    disk = body(
        "Coin",
        1.0,
        (0.25 * R * R, 0.25 * R * R, 0.5 * R * R),
        (0.0, 0.0, height),
        orientation=orientation,
        velocity=tuple(float(x) for x in own @ np.array(velocity)),
        angular_velocity=tuple(float(x) for x in own @ W),
    )
    contact = PlaneContact(
        *("Rim", GROUND.name, "Coin", ZERO, ZERO, UP, R), friction=friction, axis=UP, **others
    )
    return build_model([disk], gravity=DOWN, contacts=(contact,))


def steady(tilt, precession):
    """Angular velocity along the axis of a coin that rolls in circles.

    3/2 w Omega sin - Omega^2/4 sin cos + (g/r) cos = 0: the moment of the ground's force about the
    centre of mass rotates the angular momentum.
    """
    s, c = np.sin(tilt), np.cos(tilt)
    return (0.25 * precession**2 * s * c - G / R * c) / (1.5 * precession * s)


@pytest.mark.parametrize(
    ("scheme", "dt", "allowed"), [("gauss3", 0.01, 1e-8), ("preserving", 1e-3, 1e-3)]
)
def test_a_coin_rolls_in_circles(scheme, dt, allowed):
    tilt, precession = np.radians(60.0), 4.0
    along = steady(tilt, precession)
    spin = along - precession * np.cos(tilt)
    velocity = (0.0, -R * along, 0.0)  # along the vertical times the axis' horizontal part
    model = coin(tilt, R * np.sin(tilt), precession, spin, velocity)
    report, sink, events = run_events(model, scheme, dt, 1.0)
    assert [event[1] for event in events] == ["closes", "sticks"]
    states = sink.table("states")
    radius, angle = R * along / precession, precession * states[:, 0]
    place = np.stack([-radius * np.cos(angle) + radius, -radius * np.sin(angle)], axis=1)
    assert states[:, 1:3] == pytest.approx(place, abs=allowed)
    assert states[:, 3] == pytest.approx(R * np.sin(tilt), abs=allowed)
    assert report.extremes["energyErrorMax"] < 1e-9


def test_an_upright_coin_that_is_fast_stays_up_and_a_slow_one_falls():
    """Upright rolling is stable from w^2 = g/(3 r) on."""
    critical = np.sqrt(G / (3.0 * R))
    angles = []
    for factor in (1.5, 0.3):
        w = factor * critical
        model = coin(np.radians(91.0), R * np.sin(np.radians(91.0)), 0.0, w, (0.0, -R * w, 0.0))
        _, sink, _ = run_events(model, "gauss3", 0.005, 0.8)
        lowest = sink.table("states")[:, 3].min() / R
        angles.append(np.degrees(np.arcsin(lowest)))
    assert angles[0] > 87.0
    assert angles[1] < 60.0


def test_a_smooth_coin_bounces_on_its_rim():
    """The impulse acts at the lowest point of a tilted rim: 1/W = 1/m + (r cos)^2/A."""
    tilt, drop = np.radians(60.0), 0.1
    model = coin(tilt, R * np.sin(tilt) + drop, friction=0.0, restitution=0.5)
    _, _, events = run_events(model, "gauss3", 0.01, 0.2)
    (impact,) = [event for event in events if event[1] == "impact"][:1]
    speed = np.sqrt(2.0 * G * drop)
    assert impact[0] == pytest.approx(speed / G, abs=1e-12)
    W = 1.0 + (R * np.cos(tilt)) ** 2 / (0.25 * R * R)
    assert impact[5] == pytest.approx(1.5 * speed / W, rel=1e-12)


def test_a_soft_rim_carries_a_coin():
    """Upright at rest, at the depth of its weight: a state of rest of the compliant contact."""
    soft = Compliance(1e5)
    model = coin(np.radians(90.0), R - G / 1e5, friction=0.0, restitution=1.0, compliance=soft)
    _, sink, _ = run_events(model, "gauss3", 0.01, 0.1)
    assert sink.table("states")[-1, 3] == pytest.approx(R - G / 1e5, abs=1e-12)


def test_a_flat_coin_is_refused_in_words():
    (fault,) = check(coin(0.0, 0.0))
    assert "a disk that lies flat has no lowest point" in fault.message


def test_the_coin_of_the_deck_comes_round():
    model = deck("rolling_coin")
    _, sink, events = run_events(model, "gauss3")
    assert not times_of(events, "opens").size
    states = sink.table("states")
    assert states[-1, 1:4] == pytest.approx(states[0, 1:4], abs=1e-7)
