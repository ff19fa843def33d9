"""Spheres against boxes and capsules, whose nearest points pass from sides to edges and corners."""

import numpy as np
import pytest

from msahl.elements.constraints.coordinate_kinds import beyond, share_beyond
from msahl.model import BoxContact
from tests.contact.models import DOWN, run_events
from tests.support.models import GROUND, body, build_model

ZERO = (0.0, 0.0, 0.0)
HALF = (0.4, 0.3, 0.2)
R = 0.1
SIDES = {
    "side": ((0.1, -0.2, 1.0), (0.0, 0.0, 1.0)),
    "edge": ((0.0, 0.3 + 0.6 * 0.7, 0.2 + 0.8 * 0.7), (0.0, 0.6, 0.8)),
    "corner": ((0.4 + 0.48 * 0.7, 0.3 + 0.6 * 0.7, 0.2 + 0.64 * 0.7), (0.48, 0.6, 0.64)),
}


def thrown(start, n, half=HALF, radius=R, parent=GROUND.name, others=(), **given):
    """A smooth ball that meets a box along the normal ``n``."""
    velocity = tuple(-2.0 * float(c) for c in n)
    ball = body("Ball", 1.0, 0.004, start, velocity=velocity)
    contact = BoxContact(
        *("Hit", parent, "Ball", ZERO, ZERO, half), radius=radius, restitution=1.0, **given
    )
    return build_model([*others, ball], contacts=(contact,))


@pytest.mark.parametrize("where", SIDES)
@pytest.mark.parametrize("scheme", ["gauss2", "preserving"])
def test_a_ball_bounces_back_from_sides_edges_and_corners(where, scheme):
    start, n = SIDES[where]
    report, sink, events = run_events(thrown(start, n), scheme, 0.01, 0.6)
    (impact,) = events
    gap = 1.0 - HALF[2] - R if where == "side" else 0.7 - R
    assert impact[0] == pytest.approx(0.5 * gap, abs=1e-13)
    back = np.array(start) + np.array(n) * 2.0 * (0.6 - gap)
    assert sink.table("states")[-1, 1:4] == pytest.approx(back, abs=1e-12)
    assert report.extremes["energyErrorMax"] < 1e-13


def test_a_free_box_takes_the_impulse_about_its_centre():
    """Momentum and angular momentum stay as they are, at round-off, on an edge off the centre."""
    box = body("Box", 2.0, (0.1, 0.2, 0.3), ZERO)
    start, n = (0.3, 0.3 + 0.6 * 0.7, 0.2 + 0.8 * 0.7), (0.0, 0.6, 0.8)
    model = thrown(start, n, parent="Box", others=[box])
    report, _, events = run_events(model, "preserving", 0.01, 0.6)
    assert [event[1] for event in events] == ["impact"]
    assert events[0][3] == pytest.approx(-events[0][4], rel=1e-13)
    assert report.extremes["energyErrorMax"] < 1e-13


def test_a_ball_rolls_off_an_edge_at_the_angle_of_its_speed():
    """A smooth ball slides over a rounded edge: energy holds where the nearest point changes."""
    ball = body("Ball", 1.0, 0.004, (0.0, 0.0, 0.2 + R), velocity=(0.3, 0.0, 0.0))
    contact = BoxContact("Shelf", GROUND.name, "Ball", ZERO, ZERO, HALF, radius=R)
    model = build_model([ball], gravity=DOWN, contacts=(contact,))
    _, sink, events = run_events(model, "gauss3", 0.005, 1.6)
    assert [event[1] for event in events] == ["closes", "opens"]
    # It leaves where g cos = v^2/r, with v^2 = v0^2 + 2 g r (1 - cos): cos = (2 + v0^2/(g r))/3.
    cosine = (2.0 + 0.09 / (9.81 * R)) / 3.0
    falls = sink.table("states")
    v = np.sqrt(9.81 * R * cosine)
    assert falls[-1, 7] == pytest.approx(v * cosine, abs=1e-6)  # the step over the edge's error


@pytest.mark.parametrize(
    ("half", "place", "n"),
    [
        ((0.0, 0.0, 0.5), (0.8, 0.0, 0.3), (1.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.5), (0.6 * 0.8, 0.0, 0.5 + 0.8 * 0.8), (0.6, 0.0, 0.8)),
    ],
)
def test_a_ball_bounces_back_from_a_capsule(half, place, n):
    model = thrown(place, n, half, parent_radius=0.2)
    _, _, events = run_events(model, "gauss2", 0.01, 0.6)
    (impact,) = events
    assert impact[0] == pytest.approx(0.25, abs=1e-13)


def test_what_is_beyond_changes_by_its_share():
    rng = np.random.default_rng(3)
    for p, dp in rng.normal(size=(200, 2)):
        share, slope = share_beyond(p, dp, 0.5)
        assert share * dp == pytest.approx(beyond(p + dp, 0.5) - beyond(p, 0.5), abs=1e-15)
        ends = [share_beyond(p, dp + sign * 1e-6, 0.5)[0] for sign in (1.0, -1.0)]
        if abs(abs(p + dp) - 0.5) > 1e-5 and abs(dp) > 1e-2:
            assert slope == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-6)
    assert beyond(0.7, 0.0) == 0.7
    assert share_beyond(0.7, 0.1, 0.0) == (1.0, 0.0)
