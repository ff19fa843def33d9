"""A sphere that slides over an edge of a box: steps end where the curvature jumps."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from msahl.model import BoxContact
from tests.contact.models import DOWN, run_events
from tests.support.models import GROUND, body, build_model

RADIUS, SPEED, WAY = 0.1, 0.5, 0.05
"""Of the sphere [m], its speed on top [m/s], and what it slides up to the edge [m]."""
EDGE, END = WAY / SPEED, 0.18
"""When it is at the edge, and when it is looked at [s]: it leaves the edge later."""


def sphere_on(half, parent_radius=0.0):
    """A smooth sphere on a box of these ``half`` sizes, rounded by a radius, whose top is z = 0."""
    place = (half[0] - WAY, 0.0, RADIUS)
    ball = body("Ball", 1.0, 0.004, place, velocity=(SPEED, 0.0, 0.0))
    middle = (0.0, 0.0, -half[2] - parent_radius)
    box = BoxContact(
        "Top", GROUND.name, "Ball", middle, (0.0,) * 3, half, parent_radius, RADIUS, 0.0
    )
    return build_model([ball], gravity=DOWN, contacts=(box,))


def way_about_the_edge(radius):
    """Where the sphere's centre is at the end, from the edge: a pendulum that falls over [m]."""
    found = solve_ivp(
        lambda t, y: (y[1], 9.81 / radius * math.sin(y[0])),
        (EDGE, END),
        (0.0, SPEED / radius),
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
    )
    angle = found.y[0, -1]
    return radius * math.sin(angle), radius * math.cos(angle)


@pytest.mark.parametrize(
    ("half", "rounded"),
    [((0.5, 0.5, 0.5), 0.0), ((0.5, 0.0, 0.0), 0.05)],
    ids=["box", "capsule"],
)
@pytest.mark.parametrize(
    ("scheme", "counts", "order"), [("gauss2", (8, 64), 4.0), ("gauss3", (4, 16), 6.0)]
)
def test_the_order_holds_over_an_edge(half, rounded, scheme, counts, order):
    """Where in a step the edge is differs from size to size, which moves a slope over 4 or 8 sizes
    by 0.2; steps that do not end there have an order of 1.8 and 3.4.
    """
    model, errors = sphere_on(half, rounded), []
    x, z = way_about_the_edge(RADIUS + rounded)
    for count in counts:
        _, sink, events = run_events(model, scheme, END / count, END)
        assert {event[1] for event in events} <= {"closes"}
        last = sink.table("states")[-1]
        errors.append(float(np.hypot(last[1] - half[0] - x, last[3] - z + rounded)))
    assert math.log(errors[0] / errors[1], counts[1] / counts[0]) > order - 0.3
