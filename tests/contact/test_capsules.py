"""Capsules against capsules: impacts of sides and ends, and a rod that leaves another."""

import numpy as np
import pytest

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.check import check
from msahl.check.directions import frame
from msahl.model import CapsuleContact, Joint
from tests.contact.models import DOWN, run_events
from tests.contact.test_friction_on_bodies import momenta
from tests.support.models import GROUND, body, build_model, deck

ZERO, UP, X, Y = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
R = 0.1
INERTIA = (0.05, 0.08, 0.11)
SIZES = (0.4, 0.4, R, R)


def pair(start, axis, **others):
    """A capsule along x at rest, and one that spins and comes down at 2 m/s."""
    given = {"velocity": (0.3, -0.2, -2.0), "angular_velocity": (0.4, -0.3, 0.5)} | others
    law = {"restitution": 0.6, "friction": 0.3}
    contact = CapsuleContact("Touch", "A", "B", ZERO, ZERO, X, axis, *SIZES, **law)
    bodies = [body("A", 2.0, INERTIA, ZERO), body("B", 1.0, INERTIA, start, **given)]
    return build_model(bodies, contacts=(contact,))


STARTS = {
    "side on side": ((0.1, 0.1, 0.6), (0.28, 0.96, 0.0)),
    "end on side": ((0.1, 0.5, 0.6), (0.0, 0.8, 0.6)),
    "side on end": ((0.5, 0.0, 0.6), (0.28, 0.96, 0.0)),
    "end on end": ((0.6, 0.3, 0.7), (0.6, 0.64, 0.48)),
}


@pytest.mark.parametrize("case", STARTS)
@pytest.mark.parametrize(("scheme", "allowed"), [("gauss3", 1e-9), ("preserving", 1e-13)])
def test_free_impacts_with_friction_keep_both_momenta(case, scheme, allowed):
    model = pair(*STARTS[case])
    report, sink, events = run_events(model, scheme, 0.01, 0.5)
    assert events[0][1] == "impact"
    slip, friction = events[0][7], events[0][9]
    assert slip > 0.1
    assert friction > 0.01
    states = sink.table("states")
    before, after = momenta(states[0], model.bodies), momenta(states[-1], model.bodies)
    assert after == pytest.approx(before, abs=allowed)
    assert report.extremes["energyErrorMax"] < 1e-9


def carried():
    """A rod, hinged at one end, lies across one that is on a rail and moves away under it: over
    the end of the rod, from where its half sphere touches.
    """
    rail, hinge = frame(X), frame(Y)
    bodies = [
        body("Carrier", 2.0, 0.1, (0.5, 0.0, -2.0 * R), velocity=(1.5, 0.0, 0.0)),
        body("Rod", 1.0, (0.001, 0.05, 0.05), (0.4, 0.0, 0.0)),
    ]
    joints = (
        Joint("Rail", "prismatic", GROUND.name, "Carrier", (0.0, 0.0, -2.0 * R), ZERO, rail, rail),
        Joint("Hinge", "revolute", GROUND.name, "Rod", ZERO, (-0.4, 0.0, 0.0), hinge, hinge),
    )
    contact = CapsuleContact("Touch", "Carrier", "Rod", ZERO, ZERO, Y, X, *SIZES)
    return build_model(bodies, joints=joints, gravity=DOWN, contacts=(contact,))


def test_the_order_holds_where_the_side_is_left_for_the_end():
    """The second derivative of the distance jumps there, at which steps end."""
    ends = []
    for dt in (0.02, 0.01, 0.00125):
        _, sink, events = run_events(carried(), "gauss3", dt, 0.22)
        assert [event[1] for event in events] == ["closes"]
        ends.append(sink.table("states")[-1, 1:])
    errors = [np.abs(found - ends[-1]).max() for found in ends[:-1]]
    assert errors[0] > 1e-12  # above round-off
    assert np.log2(errors[0] / errors[1]) > 5.5


def test_energy_holds_where_the_side_is_left_for_the_end():
    report, _, _ = run_events(carried(), "preserving", 0.005, 0.22)
    assert report.extremes["energyErrorMax"] < 1e-13


def test_the_rod_of_the_deck_bounces_on_another_one():
    report, sink, events = run_events(deck("crossed_rods"), "gauss2")
    (impact,) = events
    # Digits of the deck's numbers.
    assert impact[0] == pytest.approx(0.319275428407, abs=1e-12)
    assert impact[5] == pytest.approx(2.818882757406, abs=1e-11)
    last = sink.table("states")[-1]
    assert last[1:4] == pytest.approx([0.2, 0.0, 0.042753102962], abs=1e-11)
    pitch = from_axis_angle(Y, 0.758510343208)
    assert np.array(matrix(tuple(last[4:7]))) == pytest.approx(
        np.array(matrix(pitch)), abs=2e-8
    )  # by steps of 0.1 rad
    assert report.contacts["energyLost"] == pytest.approx(2.207250000000, abs=1e-10)


def parallel(gap):
    given = {"velocity": (0.0, 0.0, -1.0), "angular_velocity": ZERO}
    return pair((0.1, 0.0, 2.0 * R + gap), X, **given)


def test_capsules_that_touch_along_a_line_end_the_run_in_words():
    report, _, _ = run_events(parallel(0.1), "gauss3", 0.01, 0.5)
    assert report.time == pytest.approx(0.1)
    assert "are parallel and touch along a line" in report.message


def test_capsules_that_overlap_are_refused():
    (fault,) = check(parallel(-0.01))
    assert "it overlaps by 0.01 m" in fault.message
