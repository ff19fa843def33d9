"""Impacts, openings and rest of contacts, against closed forms computed with 30 digits."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.contact.events import COLUMNS
from msahl.model import ConcentratedLoad, Law, PlaneContact, SpringDamper
from tests.contact.models import ball, pendulum, point_on_sphere, run_events, times_of
from tests.support.models import GROUND, body, build_model, deck

EXACT = 1e-9
"""Difference of times [s] that gauss at small steps, and auto at the tolerance 1e-9, may leave."""
BOUNCES = [0.451523640985731, 1.1739614665629, 1.75191172702464]
AT_REST = 4.06371276887158
WALL = [0.714016571971165, 2.18721558874023, 3.71860985122535, 5.31417414235383]
LEAVES = 0.731294865970823
SCHEMES = [("gauss2", 0.02, None), ("gauss3", 0.02, None), ("auto", None, 1e-9)]


def times(events, kind):
    return times_of(events, kind)


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), [*SCHEMES, ("preserving", 0.02, None)])
def test_ball_bounces_and_comes_to_rest(scheme, dt, tolerance):
    report, sink, events = run_events(ball(0.8), scheme, dt, 5.0, tolerance)
    impacts = times(events, "impact")
    assert impacts[:3] == pytest.approx(BOUNCES, abs=1e-12)  # a parabola is exact in all of them
    (rest,) = [event for event in events if event[1] == "closes"]
    remaining = rest[COLUMNS.index("remainingTime")]
    assert rest[0] + remaining == pytest.approx(AT_REST, abs=1e-11)
    lost = sum(event[6] for event in events)
    assert lost == pytest.approx(9.81, abs=1e-11)  # all of m g h, and no round-off of it more
    assert report.contacts["energyLost"] == pytest.approx(lost, abs=1e-12)
    assert report.contacts["closed"] == ["Floor"]
    assert report.extremes["energyErrorMax"] < 1e-11
    assert sink.table("reactions")[-1, 1] == pytest.approx(9.81, abs=1e-11)
    assert sink.table("states")[-1, 3] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("scheme", ["radau2", "decaying"])
def test_dissipative_schemes_close_the_energy_balance(scheme):
    report, _, events = run_events(ball(0.8), scheme, 0.01, 5.0)
    assert times(events, "closes").size == 1
    assert report.extremes["energyErrorMax"] < 1e-11


@pytest.mark.parametrize(("scheme", "dt", "tolerance"), [("gauss3", 0.01, None), SCHEMES[2]])
def test_pendulum_at_a_wall(scheme, dt, tolerance):
    report, _, events = run_events(pendulum(0.8), scheme, dt, 6.0, tolerance)
    assert times(events, "impact") == pytest.approx(WALL, abs=EXACT)
    assert report.extremes["energyErrorMax"] < 1e-9


def test_order_two_keeps_the_energy_balance_of_impacts():
    """Impulses do no work on what a scheme of order 2 leaves of the joints' velocities."""
    report, _, events = run_events(pendulum(0.8), "preserving", 0.01, 6.0)
    assert times(events, "impact") == pytest.approx(WALL, abs=2e-3)  # its error at this step
    assert report.extremes["energyErrorMax"] < 1e-12 * report.extremes["largestKineticEnergy"] * 10


def test_preserving_finds_impacts_to_its_order():
    late = []
    for dt in (0.02, 0.01, 0.005):
        _, _, events = run_events(pendulum(0.8), "preserving", dt, 4.0)
        late.append(np.abs(times(events, "impact") - WALL[:3]).max())
    order = np.log2(np.divide(late[:-1], late[1:]))
    assert order == pytest.approx([2.0, 2.0], abs=0.1)


PERIOD, DOWN = 1.42803314394233, 0.714016571971165


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "steps", "least"),
    [("gauss2", (0.04, 0.02, 0.01), 3.9), ("gauss3", (0.08, 0.04, 0.02), 5.8)],
)
def test_order_through_thirty_impacts(scheme, steps, least):
    errors = []
    for dt in steps:
        _, _, events = run_events(pendulum(1.0), scheme, dt, 43.0)
        assert len(events) == 30
        errors.append(abs(events[29][0] - (DOWN + 29 * PERIOD)))
    assert (np.log2(np.divide(errors[:-1], errors[1:])) >= least).all()


@pytest.mark.parametrize(
    ("scheme", "dt", "tolerance", "allowed"),
    [
        ("gauss3", 0.02, None, 1e-12),
        ("auto", None, 1e-9, EXACT),
        ("gauss2", 0.01, None, EXACT),
        ("preserving", 0.005, None, 2e-5),  # its error at this step
    ],
)
def test_point_leaves_a_smooth_sphere(scheme, dt, tolerance, allowed):
    report, _, events = run_events(point_on_sphere(), scheme, dt, None, tolerance)
    assert [event[1] for event in events] == ["closes", "opens"]
    assert events[1][0] == pytest.approx(LEAVES, abs=allowed)
    assert report.extremes["energyErrorMax"] < 1e-6


def test_rope_goes_slack_and_taut_again():
    report, _, events = run_events(deck("slack_rope"), "gauss3", 0.01)
    assert [event[1] for event in events] == ["closes", "opens", "impact", "closes"]
    assert events[1][0] == pytest.approx(0.48199428346142, abs=EXACT)
    assert events[2][0] == pytest.approx(1.26405617046720, abs=EXACT)
    assert events[2][6] == pytest.approx(16.554375, abs=EXACT)
    assert report.extremes["energyErrorMax"] < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "impacts"),
    [
        ("preserving", 1000),
        pytest.param("preserving", 10_000, marks=pytest.mark.slow),
    ],
)
def test_lossless_impacts_keep_the_energy(scheme, impacts):
    """The last one is late by the round-off of the sum of all times; energy drifts by none."""
    report, _, events = run_events(ball(1.0), scheme, 0.5, 2.0 * BOUNCES[0] * impacts)
    assert len(events) == impacts
    late = events[-1][0] - (2 * impacts - 1) * BOUNCES[0]
    assert abs(late) < 1e-13 * impacts
    assert report.extremes["energyErrorMax"] < 1e-12 * 9.81


@pytest.mark.parametrize("late", [2.5e-4, 0.1])
def test_velocity_error_at_a_row_that_an_impact_may_have_passed(late):
    """x'' + x = 0 from -1: it rebounds at pi/2. Run and companion, whose periods are too long by
    h^2/12 and h^2/48, are still before it in a row shortly ``late``, and have both passed later.
    """
    spring = SpringDamper(
        "Spring", GROUND.name, "Ball", (-10.0, 0.0, 0.0), (0.0,) * 3, 1.0, 0.0, 10.0
    )
    wall = PlaneContact("Wall", GROUND.name, "Ball", (0.0,) * 3, (0.0,) * 3, (-1.0, 0.0, 0.0))
    model = build_model(
        [body("Ball", 1.0, 0.01, (-1.0, 0.0, 0.0))],
        loads=(spring,),
        contacts=(replace(wall, restitution=0.5),),
    )
    row = 0.5 * np.pi + late
    report, sink, _ = run_events(model, "preserving", row / 10.0, 1.1 * row, error="estimate")
    t, v = sink.table("states")[:, [0, 7]].T
    impact = 0.5 * np.pi
    true = np.abs(v - np.where(t < impact, np.sin(t), -0.5 * np.cos(t - impact))).max()
    if late < 1e-3:
        assert true == pytest.approx(1.5, rel=1e-3)  # the jump, 1 + e; its speed is of order 2
        assert report.error["velocity"] == pytest.approx(true, rel=1e-3)
    else:  # as of smooth motions, by Richardson's factor with its safety of 1.5
        assert 1.3 < report.error["velocity"] / true < 1.8


@pytest.mark.slow
def test_impact_oscillator_comes_to_one_impact_per_cycle():
    """x'' + x = cos 2.2t, x <= 0, e = .8: deviations fall to .8 in each cycle."""
    lateral = ConcentratedLoad(
        *("Force", "Ball", (0.0,) * 3, (1.0, 0.0, 0.0), GROUND.name, (0.0,) * 3, GROUND.name),
        law=Law("sine", (1.0, 2.2, 0.5 * np.pi, 0.0)),
    )
    spring = SpringDamper(
        "Spring", GROUND.name, "Ball", (-10.0, 0.0, 0.0), (0.0,) * 3, 1.0, 0.0, 10.0
    )
    wall = PlaneContact("Wall", GROUND.name, "Ball", (0.0,) * 3, (0.0,) * 3, (-1.0, 0.0, 0.0))
    model = build_model(
        [body("Ball", 1.0, 0.01, (-1.0, 0.0, 0.0))],
        loads=(spring, lateral),
        contacts=(replace(wall, restitution=0.8),),
    )
    cycle = 2.0 * np.pi / 2.2
    _, sink, events = run_events(model, "gauss3", cycle / 32.0, 120.0 * cycle)
    hits = times(events, "impact")[-3:]
    assert np.diff(hits) == pytest.approx([cycle, cycle], abs=EXACT)
    assert [event[3] for event in events[-3:]] == pytest.approx([-1.8987487383113] * 3, abs=EXACT)
    x, v = sink.table("states")[-33:, [1, 7]].T
    k = int(np.argmin(x))
    left = v[k] ** 2 / (2.0 * abs(x[k]))  # to the turning point, to third order of 90 ms
    assert x[k] - left == pytest.approx(-1.978291969949, abs=1e-3)
