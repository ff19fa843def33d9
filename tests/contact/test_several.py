"""Several contacts at once, starts in contact, and what the report says of them."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.functions import Law
from msahl.expressions.conditions import margin
from msahl.expressions.syntax import parse
from msahl.model import ConcentratedLoad, Joint, JointLimit, JointMotion, Stop
from msahl.start.velocities import StartError
from tests.contact.models import ball, box, pendulum, run_events, times_of
from tests.support.models import GROUND, body, build_model


@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
def test_box_falls_flat_as_a_ball_does(scheme):
    """Four corners at once: the motion is that of one contact, though their shares are not unique.

    Poisson's expansion of redundant corners may rotate the box only if their impulses do, and these
    have no moment.
    """
    report, sink, events = run_events(box((0.0, 0.0, 0.3)), scheme, 0.01, 2.0)
    fall = np.sqrt(2.0 * 0.2 / 9.81)
    impacts = np.unique(times_of(events, "impact").round(9))
    assert impacts[:3] == pytest.approx(fall * np.array([1.0, 2.0, 2.5]), abs=1e-9)
    assert max(times_of(events, "closes")) == pytest.approx(3.0 * fall, abs=1e-5)
    assert report.contacts["energyLost"] == pytest.approx(9.81 * 0.2, abs=1e-11)
    assert sink.table("states")[-1, 1:7] == pytest.approx([0, 0, 0.1, 0, 0, 0], abs=1e-11)
    assert sink.table("reactions")[-1, 1:].sum() == pytest.approx(9.81, abs=1e-10)


def test_box_that_falls_on_an_edge_comes_to_rest():
    report, sink, _ = run_events(box((0.0, 0.0, 0.5), 0.3), "preserving", 0.01, 2.0)
    energy = 9.81 * 0.4
    assert report.contacts["energyLost"] == pytest.approx(energy, abs=1e-10)
    assert report.extremes["energyErrorMax"] < 1e-11
    assert sink.table("states")[-1, 3:7] == pytest.approx([0.1, 0, 0, 0], abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["preserving", "decaying"])
def test_balance_closes_where_a_box_tumbles_in_three_dimensions(scheme):
    """Impacts of single corners: what the decaying scheme remembers takes no part in them."""
    model = box(
        (0.0, 0.0, 0.6), 0.7, 0.3, velocity=(0.5, -0.3, 1.0), angular_velocity=(3.0, 2.0, 1.0)
    )
    report, sink, events = run_events(model, scheme, 0.01, 1.5)
    assert times_of(events, "impact").size > 10
    assert report.extremes["energyErrorMax"] < 1e-12 * 6.0  # of m g h and what it moves with
    across = sink.table("states")[:, 1:3]
    assert np.abs(np.diff(across, 2, axis=0)).max() < 1e-12  # nothing pushes without friction


def test_box_slides_without_friction_and_names_shared_forces():
    model = box((0.0, 0.0, 0.1), velocity=(1.0, 0.0, 0.0))
    report, sink, events = run_events(model, "gauss2", 0.01, 1.0)
    assert times_of(events, "impact").size == 0
    assert sink.table("states")[-1, 1:4] == pytest.approx([1.0, 0.0, 0.1], abs=1e-12)
    assert sorted(report.non_unique_reactions) == ["Corner0", "Corner1", "Corner2", "Corner3"]
    assert report.contacts["impacts"] == 0


def test_approach_at_the_start_is_an_impact_there():
    report, _, events = run_events(
        ball(0.5, height=0.0, velocity=(0.0, 0.0, -2.0)), "gauss2", 0.01, 0.1
    )
    assert events[0][:2].tolist() == [0.0, "impact"]
    assert events[0][4] == pytest.approx(1.0, abs=1e-14)
    assert report.contacts["energyLost"] == pytest.approx(1.5, abs=1e-14)


def test_overlap_at_the_start_is_refused_with_its_depth():
    with pytest.raises(StartError, match=r"Stop.*overlaps by 0\.25"):
        run_events(slider(0.0, upper=-0.25), "gauss2", 0.01, 0.1)


def slider(force, lower=None, upper=None, restitution=0.0, motions=()):
    """A body of 1 kg on a slide along x, with a limit, under a constant force [N]."""
    axes = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    zero = (0.0, 0.0, 0.0)
    guide = Joint("Guide", "prismatic", GROUND.name, "Block", zero, zero, axes, axes)
    stop = JointLimit("Stop", "Guide", "slide", lower, upper, restitution)
    push = ConcentratedLoad(
        "Push", "Block", zero, (force, 0.0, 0.0), GROUND.name, zero, GROUND.name
    )
    return build_model(
        [body("Block", 1.0, 0.01)], [guide], [push], motions=motions, contacts=(stop,)
    )


def test_limit_holds_against_a_force_and_lets_go():
    """A force cos t presses a block against its stop until pi/2, and then pulls it away."""
    law = Law("sine", (1.0, 1.0, np.pi / 2.0, 0.0))
    model = slider(1.0, upper=0.0)
    (push,) = model.loads
    model = replace(model, loads=(replace(push, law=law),))
    report, sink, events = run_events(model, "gauss3", 0.05, 3.0)
    assert [event[1] for event in events] == ["closes", "opens"]
    assert events[1][0] == pytest.approx(np.pi / 2.0, abs=1e-9)
    # x'' = cos t from rest at pi/2.
    exact = -np.cos(3.0) - (3.0 - np.pi / 2.0)
    assert sink.table("states")[-1, 1] == pytest.approx(exact, abs=1e-9)
    assert report.extremes["energyErrorMax"] < 1e-8


def test_range_with_two_ends_has_a_column_for_each():
    model = slider(0.0, lower=-1.0, upper=1.0, restitution=1.0)
    moved = replace(model.bodies[0], velocity=(1.0, 0.0, 0.0))
    _, sink, events = run_events(replace(model, bodies=(moved,)), "gauss2", 0.1, 6.5)
    assert [event[2] for event in events] == ["Stop.upper", "Stop.lower", "Stop.upper"]
    assert times_of(events, "impact") == pytest.approx([1.0, 3.0, 5.0], abs=1e-12)
    assert sink.table("states")[-1, 1] == pytest.approx(-0.5, abs=1e-12)


def test_impact_takes_work_from_a_prescribed_motion():
    """A motor drives a bar whose end carries a free block into a wall: the balance counts it."""
    zero, axes = (0.0, 0.0, 0.0), ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    first = Joint("Drive", "prismatic", GROUND.name, "Carriage", zero, zero, axes, axes)
    second = Joint("Guide", "prismatic", "Carriage", "Block", zero, zero, axes, axes)
    motion = JointMotion("Motor", "Drive", "slide", Law("polynomial", (0.0, 1.0)))
    stop = JointLimit("Stop", "Guide", "slide", lower=-0.5, restitution=0.5)
    bodies = [body("Carriage", 2.0, 0.01, velocity=(1.0, 0.0, 0.0)), body("Block", 1.0, 0.01)]
    model = build_model(bodies, [first, second], motions=(motion,), contacts=(stop,))
    report, sink, events = run_events(model, "gauss2", 0.05, 1.0)
    assert times_of(events, "impact") == pytest.approx([0.5], abs=1e-12)
    # The block leaves at 1.5 m/s; the motor gives 1.5 N s at 1 m/s, the impact takes 0.375 J.
    assert sink.table("work")[-1, 1:] == pytest.approx([1.5, -0.375], abs=1e-12)
    assert sink.table("states")[-1, 12 + 7] == pytest.approx(1.5, abs=1e-12)
    assert report.extremes["energyErrorMax"] < 1e-12


def test_free_impact_keeps_the_momentum():
    """Two free spheres of 1 and 3 kg collide off centre, without gravity and e = 0.7."""
    from msahl.model import DistanceLimit

    bodies = [
        body("A", 1.0, 0.01, (0.0, 0.0, 0.0), velocity=(2.0, 0.0, 0.0)),
        body("B", 3.0, 0.01, (1.0, 0.12, 0.0)),
    ]
    zero = (0.0, 0.0, 0.0)
    touch = DistanceLimit("Touch", "A", "B", zero, zero, lower=0.2, restitution=0.7)
    _, sink, events = run_events(build_model(bodies, contacts=(touch,)), "gauss2", 0.05, 1.0)
    v = sink.table("states")[-1, 1:].reshape(2, 12)[:, 6:9]
    assert v[0] + 3.0 * v[1] == pytest.approx([2.0, 0.0, 0.0], abs=1e-13)
    n = np.array([0.16, 0.12, 0.0]) / 0.2
    assert (v[1] - v[0]) @ n == pytest.approx(0.7 * 2.0 * n[0], abs=1e-12)
    assert events[0][3] == pytest.approx(-2.0 * n[0], abs=1e-12)


@pytest.mark.parametrize(
    ("scheme", "dt", "tolerance"),
    [("preserving", 0.01, None), ("gauss3", 0.01, None), ("auto", None, 1e-7)],
)
def test_a_condition_that_an_impact_fulfils_ends_the_run_there(scheme, dt, tolerance):
    """The angle's rate jumps from -2.1 to 1.7 rad/s at the second impact."""
    model = replace(pendulum(0.8), stops=(stop_when("Pivot.angleRate > 0.5 and t > 2"),))
    report, _, events = run_events(model, scheme, dt, 6.0, tolerance)
    assert report.status == "completed"
    assert report.stop["time"] == pytest.approx(2.18721558874, abs=3e-4)  # of order 2 at this step
    assert len(events) == 2


def stop_when(condition):
    """The record of a condition that ends a run."""
    return Stop(condition, margin(parse(condition)))
