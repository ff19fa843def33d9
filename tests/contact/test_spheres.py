"""Spheres outside and inside of spheres and cylinders, against closed forms."""

import numpy as np
import pytest
from scipy.special import ellipk

from msahl.deck import read_deck
from msahl.model import Compliance, SphereContact
from tests.contact.models import DOWN, run_events
from tests.support.models import GROUND, ROOT, body, build_model, deck

ZERO = (0.0, 0.0, 0.0)


@pytest.mark.parametrize("scheme", ["gauss2", "preserving"])
def test_two_balls_exchange_what_is_along_the_line_of_their_centres(scheme):
    report, sink, events = run_events(deck("billiard"), scheme)
    (impact,) = events
    assert impact[0] == pytest.approx(0.348038475772934, abs=1e-14)
    states = sink.table("states")[-1]
    cue, target = states[1:4], states[13:16]
    assert cue == pytest.approx([0.111028856829700, 0.312307621135332, 0.0], abs=1e-14)
    assert target == pytest.approx([0.488971143170300, -0.282307621135332, 0.0], abs=1e-14)
    assert states[7:10] + states[19:22] == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    assert report.extremes["energyErrorMax"] < 1e-15


@pytest.mark.parametrize(
    ("scheme", "dt", "allowed"), [("gauss3", 0.02, 1e-10), ("preserving", 0.002, 5e-5)]
)
def test_a_ball_in_a_trough_is_a_pendulum(scheme, dt, allowed):
    report, sink, events = run_events(deck("trough"), scheme, dt)
    assert [event[1] for event in events] == ["closes"]
    wanted = [0.775580397203224, 0.4, -0.456590678260178]
    assert sink.table("states")[-1, 1:4] == pytest.approx(wanted, abs=allowed)
    assert sink.table("reactions")[0, 1] == pytest.approx(-4.905, rel=1e-12)
    assert report.extremes["energyErrorMax"] < 1e-9


def test_a_ball_leaves_a_smooth_sphere():
    """Radii .7 and .3 m are a point on a sphere of 1 m, from 10 degrees at rest."""
    angle = np.radians(10.0)
    bodies = [body("Ball", 1.0, 0.01, (float(np.sin(angle)), 0.0, float(np.cos(angle))))]
    contact = SphereContact("Top", GROUND.name, "Ball", ZERO, ZERO, 0.7, 0.3)
    model = build_model(bodies, gravity=DOWN, t_final=1.0, contacts=(contact,))
    _, _, events = run_events(model, "gauss3", 0.02)
    assert [event[1] for event in events] == ["closes", "opens"]
    assert events[1][0] == pytest.approx(0.731294865970823, abs=1e-12)


@pytest.mark.parametrize("axis", [None, (0.0, 1.0, 0.0)])
@pytest.mark.parametrize("scheme", ["gauss3", "preserving"])
def test_a_point_bounces_across_a_soft_hollow_round(axis, scheme):
    """Without gravity, through x = 0 a little off the centre: radial vibration between flights."""
    contact = SphereContact(
        *("Round", GROUND.name, "Ball", ZERO, ZERO, -1.0, 0.2, axis),
        restitution=1.0,
        compliance=Compliance(400.0),
    )
    bodies = [body("Ball", 1.0, 0.01, (0.5, 0.0, 0.0), velocity=(2.0, 0.0, 0.0))]
    model = build_model(bodies, contacts=(contact,))
    taut = np.pi / 20.0
    report, sink, _ = run_events(model, scheme, 1e-3, 0.6)
    left = 0.6 - 0.15 - taut
    found = sink.table("states")[-1, [1, 7]]
    assert found == pytest.approx(
        [0.8 - 2.0 * left, -2.0], abs=1e-9 if scheme == "gauss3" else 1e-4
    )
    assert report.extremes["energyErrorMax"] < 1e-12


def test_balls_of_a_cradle_strike_one_after_the_other():
    _, sink, events = run_events(deck("newtons_cradle"), "gauss3", t_final=1.0)
    assert [event[2] for event in events] == ["Hit1", "Hit2", "Hit3", "Hit4"]
    quarter = float(np.sqrt(0.502 / 9.81) * ellipk(np.sin(np.radians(15.0)) ** 2))
    speed = 0.5 * float(np.sqrt(2.0 * 9.81 / 0.502 * (1.0 - np.cos(np.pi / 6.0))))
    # From there the first ball still has the gap of 1 um to go.
    assert events[0][0] - quarter == pytest.approx(1e-6 / speed, abs=1e-9)
    # Each swings on for at most four gaps before it is struck, to a height of 2e-11 m.
    assert [event[4] for event in events] == pytest.approx([speed] * 4, abs=1e-9)
    angles = np.abs(sink.table("joints")[:, 1::2])
    assert angles[:, 4].max() == pytest.approx(np.radians(30.0), abs=1e-4)  # rows every 10 ms
    assert angles[40:, :4].max() < 2e-5  # they stay where they were struck, four gaps over 0.5 m


def test_balls_of_a_cradle_that_touch_are_struck_at_once():
    """Bodies that stay together come back as one: the first with 1 - 2 (4/5), the others 2/5."""
    model = read_deck(ROOT / "decks/contact/newtons_cradle.xml", settings=["distance=0.1 m"])
    report, _, events = run_events(model, "gauss3", t_final=0.5)
    assert len({event[0] for event in events}) == 1
    speed = -events[0][3]
    assert [event[4] / speed for event in events] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-12)
    impulses = [event[5] / speed for event in events]
    # Each ball gets what is left of 8/5 m v; m is that of the pendulum at the ball, 1.004 kg.
    assert impulses == pytest.approx([1.004 * k / 2.5 for k in (4, 3, 2, 1)], rel=1e-9)
    assert report.extremes["energyErrorMax"] < 1e-11
