"""Capsules against capsules: impacts of sides and ends, and a rod that leaves another."""

import json
from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.functions import Law
from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.check import check
from msahl.check.directions import frame
from msahl.model import CapsuleContact, Joint, JointMotion
from msahl.model.contacts import Compliance
from msahl.run.parallel_capsules import ParallelCapsules
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


def soft(model):
    """The model with a compliant contact instead of a rigid one."""
    law = {"restitution": 1.0, "friction": 0.0, "compliance": Compliance(1e4)}
    return replace(model, contacts=(replace(model.contacts[0], **law),))


def guided():
    """A capsule that falls on another one, parallel to it, on a rail that keeps it so."""
    rail = frame(UP)
    model = soft(parallel(0.05))
    joint = Joint("Rail", "prismatic", "A", "B", ZERO, (-0.1, 0.0, -0.25), rail, rail)
    return replace(model, joints=(joint,))


def swung():
    """A capsule that is pressed on one below it by a hinge, about which it rotates through
    parallel at 0.05 s.
    """
    hinge, place = frame(Y), (0.0, 0.0, 2.0 * R - 0.02)
    axis = (np.cos(0.05), 0.0, np.sin(0.05))
    rod = body("B", 1.0, 50.0, place, angular_velocity=Y)
    joint = Joint("Hinge", "revolute", GROUND.name, "B", place, ZERO, hinge, hinge)
    contact = CapsuleContact("Touch", GROUND.name, "B", ZERO, ZERO, X, axis, *SIZES)
    return soft(build_model([rod], joints=(joint,), contacts=(contact,)))


def lifted():
    """A hinged rod that lies on the end of a capsule, which lifts it through parallel, where the
    other end hits it; rigid.
    """
    rail, hinge, tilt = frame(UP), frame(Y), 0.1
    axis, side = (np.cos(tilt), 0.0, -np.sin(tilt)), (np.sin(tilt), 0.0, np.cos(tilt))
    place, end = tuple(1.4 * np.array(axis)), tuple(-1.4 * np.array(axis))
    right = np.array(place) - 2.0 * R * np.array(side)
    middle = tuple(right - np.array((0.4, 0.0, 0.0)))
    rate = float(np.cos(tilt)) / 1.4
    bodies = [
        body("A", 100.0, 1.0, middle, velocity=(0.0, 0.0, 1.0)),
        body(
            "B",
            1.0,
            0.1,
            place,
            velocity=tuple(1.4 * rate * np.array(side)),
            angular_velocity=(0.0, -rate, 0.0),
        ),
    ]
    joints = (
        Joint("Rail", "prismatic", GROUND.name, "A", middle, ZERO, rail, rail),
        Joint("Hinge", "revolute", GROUND.name, "B", ZERO, end, hinge, hinge),
    )
    contact = CapsuleContact("Touch", "A", "B", ZERO, ZERO, X, axis, 0.4, 1.4, R, R)
    up = (JointMotion("Up", "Rail", "slide", Law("polynomial", (0.0, 1.0))),)
    return build_model(bodies, joints=joints, motions=up, gravity=DOWN, contacts=(contact,))


@pytest.mark.parametrize(
    ("model", "dt", "end", "about"),
    [(guided(), 0.01, 0.1, 0.05), (swung(), 0.01, 0.1, 0.05), (lifted(), 0.01, 0.25, 0.14)],
    ids=["guided", "swung", "lifted"],
)
def test_capsules_that_press_while_parallel_do_not_pass(model, dt, end, about):
    report, _, _ = run_events(model, "gauss2", dt, end, error="estimate")
    check = report.verdict["checks"]["parallelCapsules"]
    assert check["word"] == "WARN"
    assert "contact 'Touch' at t = " in check["text"]
    assert float(check["text"].split("t = ")[1].split(" s")[0]) == pytest.approx(about, abs=0.02)


@pytest.mark.parametrize("case", STARTS)
def test_capsules_that_cross_are_not_warned_of(case):
    for model in (pair(*STARTS[case]), soft(pair(*STARTS[case]))):
        report, _, _ = run_events(model, "gauss2", 0.01, 0.4)
        assert "parallelCapsules" not in report.verdict["checks"]


def test_a_run_that_is_resumed_finds_the_same_parallel_capsules():
    model = swung()
    _, sink, _ = run_events(model, "gauss2", 0.01, 0.1)
    rows, complete = sink.table("states"), ParallelCapsules(model)
    complete.add(rows)
    for cut in (3, 5, 6, 8):
        before, after = ParallelCapsules(model), ParallelCapsules(model)
        before.add(rows[:cut])
        after.restore(json.loads(json.dumps(before.numbers())))
        after.add(rows[cut:])
        assert after.found == complete.found != {}
