"""Order and repetition of events, refusals, contacts, and what a run reports of them."""

from dataclasses import replace

import pytest

from msahl.algebra.functions import Law
from msahl.model import JointMotion, PlaneContact, PointMotion
from tests.contact.models import ball, run_events
from tests.support.models import GROUND
from tests.switching.models import catch, event, flywheels, pendulum

SCHEMES = [("gauss2", 0.02, None), ("preserving", 0.02, None), ("auto", None, 1e-6)]


def of(model, *events, **others):
    return replace(model, events=events, **others)


def names(rows):
    """(event, kind, element) of each line of events.csv."""
    return [(row[-2], row[1], row[2]) for row in rows]


@pytest.mark.sampled
@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
def test_events_of_one_time_happen_in_the_order_of_the_deck(scheme, dt, tolerance):
    """The one whose condition the first makes true happens before the next, at the same time."""
    model = of(
        flywheels(),
        event("One", "t >= 0.5", engages=("Clutch",)),
        event("Two", "t >= 0.5", releases=("Clutch",)),
        event("Three", "B.angleRate > 1", message="second moves"),
    )
    report, _, rows = run_events(model, scheme, dt, None, tolerance)
    assert names(rows) == [
        ("One", "engages", "Clutch"),
        ("Three", "happens", ""),
        ("Two", "releases", "Clutch"),
    ]
    assert {row[0] for row in rows} == {rows[0][0]}
    assert report.events["messages"][0]["message"] == "second moves"
    assert report.events["released"] == ["Clutch"]


@pytest.mark.sampled
@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
@pytest.mark.parametrize(("repeats", "times"), [(False, 1), (True, 2)])
def test_an_event_repeats_if_it_is_to(repeats, times, scheme, dt, tolerance):
    """The pendulum, of period 2.380 s, is on the left twice in 5 s."""
    model = of(pendulum("t > 9"), event("Left", "Tip.x < 0", message="left", repeats=repeats))
    _, _, rows = run_events(model, scheme, dt, 5.0, tolerance)
    assert [row[0] for row in rows] == pytest.approx([0.5949, 2.9746][:times], abs=2e-3)


def test_a_condition_that_is_true_at_the_start_waits():
    model = of(pendulum("t > 9"), event("Right", "Tip.x > 0", message="right"))
    _, _, rows = run_events(model, "gauss2", 0.02, 3.0)
    assert [row[0] for row in rows] == pytest.approx([3.0 * 0.594913 - 0.0], abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
def test_endless_events_end_the_run(scheme, dt, tolerance):
    """Each of two motors makes the condition true that engages the other one."""
    up, down = (Law("polynomial", (0.0, rate)) for rate in (1.0, -1.0))
    motions = (JointMotion("Up", "A", "angle", up), JointMotion("Down", "A", "angle", down))
    model = of(
        flywheels(),
        event("Go", "t > 0.5", engages=("Down",)),
        event("One", "A.angleRate < -0.5", ("Down",), ("Up",), repeats=True),
        event("Two", "t >= 0.5 and A.angleRate > 0.5", ("Up",), ("Down",), repeats=True),
        motions=motions,
        released=("Up", "Down", "Clutch"),
    )
    report, _, _ = run_events(model, scheme, dt, None, tolerance)
    assert report.status == "not converged"
    assert "happens again and again without an end" in report.message
    assert "t = 0.5 s" in report.message


def test_a_motor_is_engaged_and_another_takes_over():
    """A motion goes on by the changes of its law; its impulse may bring energy."""
    up, down = (Law("polynomial", (0.0, rate)) for rate in (1.0, -20.0))
    motions = (JointMotion("Up", "A", "angle", up), JointMotion("Down", "A", "angle", down))
    model = of(
        flywheels(),
        event("Slow", "t > 0.25", engages=("Up",)),
        event("Fast", "t > 0.75", ("Up",), ("Down",)),
        motions=motions,
        released=("Up", "Down", "Clutch"),
    )
    report, sink, rows = run_events(model, "gauss4", 0.02)
    lost = [0.01 * (100.0 - 1.0), 0.01 * (1.0 - 400.0)]
    assert [row[6] for row in rows] == pytest.approx([lost[0], 0.0, lost[1]], abs=1e-12)
    assert report.events["energyLost"] == pytest.approx(sum(lost), abs=1e-12)
    assert report.extremes["energyErrorMax"] < 1e-12
    angle = 2.5 + 0.5 - 5.0  # of 10 rad/s, 1 rad/s and -20 rad/s
    assert sink.table("joints")[-1, 1] == pytest.approx(angle, abs=1e-11)


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
def test_what_does_not_fit_is_not_engaged(scheme, dt, tolerance):
    """After 0.2 s of flight the bob's point is away from the pivot by 0.22 m."""
    model = of(
        pendulum("t > 9"),
        event("Off", "t > 0.2", ("Pivot",)),
        event("On", "t > 0.4", (), ("Pivot",)),
    )
    report, _, rows = run_events(model, scheme, dt, None, tolerance)
    assert report.status == "not converged"
    assert "event 'On' cannot engage 'Pivot': its sides are 0.2" in report.message
    assert names(rows) == [("Off", "releases", "Pivot")]


def test_what_is_redundant_is_not_engaged():
    law = Law("constant", (0.0,))
    motions = (JointMotion("First", "A", "angle", law), JointMotion("Second", "A", "angle", law))
    model = of(
        flywheels(),
        event("One", "t > 0.3", (), ("First",)),
        event("Two", "t > 0.6", (), ("Second",)),
        motions=motions,
        released=("First", "Second", "Clutch"),
    )
    report, _, _ = run_events(model, "gauss2", 0.02)
    assert "cannot engage 'Second': others constrain the same already" in report.message


def trapdoor(*events, **others):
    return of(ball(0.5), *events, **others)


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
def test_a_contact_is_released(scheme, dt, tolerance):
    """The ball falls through the floor on which it bounced."""
    model = trapdoor(event("Trap", "t > 1.2", ("Floor",)))
    report, sink, rows = run_events(model, scheme, dt, 2.0, tolerance)
    assert [row[1] for row in rows] == ["impact"] * 3 + ["releases"]
    assert sink.table("states")[-1, 3] < -3.0
    assert report.extremes["energyErrorMax"] < 1e-11
    assert report.events["released"] == ["Floor"]


def test_a_contact_is_engaged_where_it_does_not_overlap():
    early = trapdoor(event("On", "t > 0.2", (), ("Floor",)), released=("Floor",))
    _, _, rows = run_events(early, "gauss2", 0.02, 1.0)
    assert [row[1] for row in rows[:2]] == ["engages", "impact"]
    late = trapdoor(event("On", "t > 0.5", (), ("Floor",)), released=("Floor",))
    report, _, _ = run_events(late, "gauss2", 0.02, 1.0)
    assert "cannot engage 'Floor': it overlaps by 0.22" in report.message


def test_a_latch_with_a_closed_contact():
    """A bob at rest on a floor is released from nothing: it stays, and the floor bears it."""
    model = trapdoor(event("Tell", "t > 3.5", message="rests"))
    _, sink, rows = run_events(model, "gauss2", 0.02, 4.0)
    assert rows[-1][1] == "happens"
    assert sink.table("reactions")[-1, 1] == pytest.approx(9.81, abs=1e-10)


def test_estimated_errors_are_those_of_the_run():
    report, sink, _ = run_events(catch(), "gauss2", 0.02, error="estimate")
    fine, other, _ = run_events(catch(), "gauss4", 0.01)
    off = abs(sink.table("states")[-1, 3] - other.table("states")[-1, 3])
    assert 0.3 < report.error["position"] / off < 10.0
    assert fine.verdict["word"] == "DONE"


def test_an_event_that_does_not_happen_has_a_warning():
    report, _, _ = run_events(pendulum("Tip.z > 5"), "gauss2", 0.02)
    assert report.warnings == ["event 'LetGo' did not happen during the run"]


def test_degrees_of_freedom_are_those_at_the_start():
    report, _, _ = run_events(flywheels(), "gauss2", 0.02, 0.1)
    assert report.degrees_of_freedom["byRank"] == 2


@pytest.mark.sampled
@pytest.mark.parametrize(("scheme", "dt", "tolerance"), SCHEMES)
def test_a_motor_lifts_a_ball_from_the_floor(scheme, dt, tolerance):
    """The floor cannot pull: the impulse of the motor is that without it."""
    rise = Law("polynomial", (0.0, 1.0))
    lift = PointMotion("Lift", "Ball", (0.0,) * 3, (0.0, 0.0, 1.0), rise)
    model = of(
        ball(0.0, height=0.0),
        event("Go", "t > 0.3", (), ("Lift",)),
        event("Drop", "t > 0.5", ("Lift",)),
        motions=(lift,),
        released=("Lift",),
    )
    report, _, rows = run_events(model, scheme, dt, 1.0, tolerance)
    kinds = ["closes", "engages", "opens", "releases", "impact", "closes"]
    assert [row[1] for row in rows] == kinds
    assert rows[1][6] == pytest.approx(-0.5, abs=1e-12)
    fall = (1.0 + (1.0 + 2.0 * 9.81 * 0.2) ** 0.5) / 9.81
    assert rows[4][0] == pytest.approx(0.5 + fall, abs=1e-11)
    assert report.extremes["energyErrorMax"] < 1e-11


def test_a_motor_does_not_press_through_the_floor():
    """What has no solution ends the run."""
    fall = Law("polynomial", (0.0, -1.0))
    press = PointMotion("Press", "Ball", (0.0,) * 3, (0.0, 0.0, 1.0), fall)
    model = of(
        ball(0.0, height=0.0),
        event("Go", "t > 0.3", (), ("Press",)),
        motions=(press,),
        released=("Press",),
    )
    report, _, _ = run_events(model, "gauss2", 0.02, 1.0)
    assert "impulses or forces of the contacts Floor have no solution" in report.message


def test_a_latch_and_the_floor_take_an_impact_together():
    """The plate lies on a floor: the mass that it catches comes to rest at once."""
    floor = PlaneContact(
        "Floor", GROUND.name, "Plate", (0.0, 0.0, 0.0), (0.0,) * 3, (0.0, 0.0, 1.0)
    )
    model = replace(catch(), loads=(), contacts=(floor,))
    report, sink, rows = run_events(model, "gauss2", 0.02)
    assert [row[1:3].tolist() for row in rows[1:]] == [["engages", "Latch"], ["impact", "Floor"]]
    energy = 9.81 * 0.5
    assert rows[1][6] == pytest.approx(energy * 2.0 / 3.0, abs=1e-11)
    assert rows[2][6] == pytest.approx(energy / 3.0, abs=1e-11)
    assert sink.table("states")[-1, [3, 9, 15, 21]] == pytest.approx([0.0] * 4, abs=1e-12)
    assert report.extremes["energyErrorMax"] < 1e-11
