"""Spheres outside and inside of spheres and cylinders, against closed forms."""

import numpy as np
import pytest

from msahl.model import Compliance, SphereContact
from tests.contact.models import DOWN, run_events
from tests.support.models import GROUND, body, build_model, deck

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
