"""A sphere that slides over an edge of a box: steps end where the curvature jumps."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from msahl.model import BoxContact
from tests.contact.models import DOWN, run_events
from tests.support.models import GROUND, body, build_model

SPEED, WAY = 0.5, 0.04
"""Of the sphere on top [m/s], and what it slides up to the edge [m]."""
EDGE, END = WAY / SPEED, 2.0 * WAY / SPEED
"""When it is at the edge, and when it is looked at [s]: it leaves the edge 0.11 s after the former.
In an odd number of steps the edge is in the middle of one, so the error is a power series in the
step, and a slope is that of the order."""
ARM = 0.15
"""From the edge's centre of curvature to that of the sphere [m]. With 0.1 the error of gauss2 is
zero at 12 steps, where its terms of orders 4 and 5 cancel, and no slope near that is an order."""


def sphere_on(half, parent_radius=0.0):
    """A smooth sphere on a box of these ``half`` sizes, rounded by a radius, whose top is z = 0."""
    radius = ARM - parent_radius
    ball = body("Ball", 1.0, 0.004, (half[0] - WAY, 0.0, radius), velocity=(SPEED, 0.0, 0.0))
    middle = (0.0, 0.0, -half[2] - parent_radius)
    box = BoxContact(
        "Top", GROUND.name, "Ball", middle, (0.0,) * 3, half, parent_radius, radius, 0.0
    )
    return build_model([ball], gravity=DOWN, contacts=(box,))


def way_about_the_edge():
    """Where the sphere's centre is at the end, from the edge: a pendulum that falls over [m]."""
    found = solve_ivp(
        lambda t, y: (y[1], 9.81 / ARM * math.sin(y[0])),
        (EDGE, END),
        (0.0, SPEED / ARM),
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
    )
    angle = found.y[0, -1]
    return ARM * math.sin(angle), ARM * math.cos(angle)


@pytest.mark.parametrize(
    ("half", "rounded"),
    [((0.5, 0.5, 0.5), 0.0), ((0.5, 0.0, 0.0), 0.05)],
    ids=["box", "capsule"],
)
@pytest.mark.parametrize(
    ("scheme", "counts", "order"),
    [("gauss2", (15, 21, 31, 43, 61), 3.9), ("gauss3", (5, 7, 9, 11, 15), 5.8)],
)
def test_the_order_holds_over_an_edge(half, rounded, scheme, counts, order):
    """The slope is fitted where steps are below 0.3 of the pendulum's sqrt(ARM / g) = 0.12 s, and
    errors above 5e-13 m, many times that of the reference. Steps that do not end at the edge, where
    the acceleration jumps, have the order 2.
    """
    model, errors = sphere_on(half, rounded), []
    x, z = way_about_the_edge()
    for count in counts:
        _, sink, events = run_events(model, scheme, END / count, END)
        assert {event[1] for event in events} <= {"closes"}
        last = sink.table("states")[-1]
        errors.append(float(np.hypot(last[1] - half[0] - x, last[3] - z + rounded)))
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] > order
