"""Compliant contacts: their law, order, restitution and energy, against closed forms."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.laws.contact import CONTACT
from msahl.laws.restitution import damping_of
from msahl.model import Compliance, DistanceLimit, Joint, JointLimit, PlaneContact
from tests.contact.models import run_events
from tests.support.models import GROUND, body, build_model

HERTZ = Compliance(1e8, 1.5)
DURATION, LARGEST = 0.00203046203682776, 1811.94915919424
"""Of the impact of 1 kg at 1 m/s by Hertz's law: time [s] and force [N], with 15 digits."""
ABOVE = 1.3e-3
"""Where a ball begins above the floor [m]: the touch is within a step."""


def ball(compliance, height=0.0, restitution=1.0, speed=1.0, gravity=0.0):
    """A point of 1 kg that falls onto a compliant floor."""
    floor = PlaneContact(
        *("Floor", GROUND.name, "Ball", (0.0,) * 3, (0.0,) * 3, (0.0, 0.0, 1.0)),
        restitution=restitution,
        compliance=compliance,
    )
    bodies = [body("Ball", 1.0, 0.01, (0.0, 0.0, height), velocity=(0.0, 0.0, -speed))]
    return build_model(bodies, gravity=(0.0, 0.0, -gravity), contacts=(floor,))


def duration(n, k):
    """Time [s] that a contact of stiffness ``k`` and exponent ``n`` takes for 1 kg at 1 m/s."""
    deepest, a = ((n + 1.0) / (2.0 * k)) ** (1.0 / (n + 1.0)), 1.0 / (n + 1.0)
    return 2.0 * deepest * math.sqrt(math.pi) * math.gamma(1.0 + a) / math.gamma(0.5 + a)


@pytest.mark.parametrize("e", [0.05, 0.1, 0.5, 0.8, 0.99, 1.0 - 1e-9])
def test_the_damping_solves_the_equation_of_the_restitution(e):
    """The quadrature of v/(1 + c v) from -e v to v, which the collision makes zero."""
    c = damping_of(e, 2.0)
    x, weight = np.polynomial.legendre.leggauss(400)
    # From the pole at -1/c outwards in the logarithm of the distance from it.
    low, high = math.log(1.0 - 2.0 * e * c), math.log1p(2.0 * c)
    u = 0.5 * (low + high) + 0.5 * (high - low) * x
    v = np.expm1(u) / c
    work = 0.5 * (high - low) / c * (weight @ v)
    assert abs(work) <= 1e-7 * 0.5 * (high - low) / c * (weight @ abs(v))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("n", [1.0, 1.5, 2.2])
def test_tension_is_the_slope_of_the_potential_and_never_pulls(n, side):
    c, free, e = np.array([30.0, n, 0.4, side]), 0.2, 1e-6
    for depth in (-0.3, 0.01, 0.2, 1.5):
        q = free - side * depth
        T, slope = CONTACT.tension(c, q, free)
        V = [CONTACT.potential(c, q + d, free) for d in (-e, e)]
        beside = [CONTACT.tension(c, q + d, free)[0] for d in (-e, e)]
        assert (V[1] - V[0]) / (2 * e) == pytest.approx(T, abs=1e-7)
        assert (beside[1] - beside[0]) / (2 * e) == pytest.approx(slope, rel=1e-5, abs=1e-9)
        for rate in (-9.0, -0.1, 0.0, 0.3, 9.0):
            R, by_rate = CONTACT.resistance(c, rate, abs(T))
            assert -side * (T + R) >= 0.0
            R2, _ = CONTACT.resistance(c, rate + e, abs(T))
            assert (R2 - R) / e == pytest.approx(by_rate, rel=1e-6, abs=1e-9)
            assert R * rate >= 0.0


SCHEMES = [("gauss3", 1000, None), ("auto", 20, 1e-10), ("preserving", 1000, None)]


@pytest.mark.parametrize(("scheme", "steps", "tolerance"), SCHEMES)
def test_hertz_impact_lasts_and_presses_as_in_the_closed_form(scheme, steps, tolerance):
    """Half of the duration is an output time, and so is a time after it, up to which a speed that
    is as wrong as the tolerance allows moves the ball by that.
    """
    model, after = ball(HERTZ), 0.5 * DURATION
    report, sink, _ = run_events(model, scheme, DURATION / steps, 1.5 * DURATION, tolerance)
    states, loads = sink.table("states"), sink.table("reactions")
    order_two = scheme == "preserving"
    speed = 3e-8 if tolerance is None else tolerance / after
    assert states[-1, 9] == pytest.approx(1.0, abs=1e-12 if order_two else speed)
    left = states[-1, 0] - states[-1, 3] / states[-1, 9]
    assert left == pytest.approx(DURATION, abs=DURATION * (2e-6 if order_two else 3e-8))
    assert loads[steps // 2, 1] == pytest.approx(LARGEST, rel=2e-6 if order_two else 5e-8)
    assert report.extremes["energyErrorMax"] < (1e-13 if order_two else 1e-7)


@pytest.mark.parametrize(
    ("n", "k", "scheme", "least"),
    [
        (1.0, 2.4e6, "gauss2", 3.8),
        (1.0, 2.4e6, "gauss3", 5.8),
        (2.0, 3e9, "gauss2", 3.9),
        (2.0, 3e9, "gauss3", 5.8),
        (1.5, 1e8, "preserving", 1.9),
        # The force has a root of the time since the touch in its second derivative.
        (1.5, 1e8, "gauss1", 1.7),
    ],
)
def test_the_order_holds_through_touch_and_release(n, k, scheme, least):
    errors = []
    for dt in (2e-4, 1e-4, 5e-5):
        _, sink, _ = run_events(ball(Compliance(k, n), ABOVE), scheme, dt, 4e-3)
        errors.append(abs(sink.table("states")[-1, 3] - (4e-3 - ABOVE - duration(n, k))))
    assert np.log2(errors[0] / errors[2]) / 2.0 >= least


def test_a_touch_is_found_wherever_it_is_in_a_step():
    for part in (0.001, 0.01, 0.03, 0.1, 0.3, 0.7, 0.97, 0.999):
        height = 2e-3 + 2.5e-4 * part
        model = ball(Compliance(2.5e5, 1.0, 1.0), height, 0.6)
        _, sink, _ = run_events(model, "gauss3", 2.5e-4, 0.012)
        assert sink.table("states")[-1, 9] == pytest.approx(0.6, abs=1e-8)


@pytest.mark.parametrize("n", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("e", [0.1, 0.5, 0.9])
def test_the_restitution_asked_for_is_reached(n, e):
    """At the speed it is for, whatever stiffness and exponent are; slower impacts have more."""
    k = {1.0: 2.4e6, 1.5: 1e8, 2.0: 3e9}[n]
    for speed, scheme in ((1.0, "gauss3"), (1.0, "preserving"), (0.5, "gauss3")):
        model = ball(Compliance(k, n, 1.0), 0.0, e, speed)
        report, sink, _ = run_events(model, scheme, 2e-5, 0.02)
        found = sink.table("states")[-1, 9] / speed
        if speed == 1.0:
            assert found == pytest.approx(e, abs=1e-7 if scheme == "gauss3" else 1e-4)
        else:  # the same damping is that of another restitution
            assert damping_of(found, speed) == pytest.approx(damping_of(e, 1.0), rel=1e-5)
        lost = 0.5 * speed**2 * (1.0 - found**2)
        assert sink.table("work")[-1, 1] == pytest.approx(-lost, abs=1e-7)
        assert report.extremes["energyErrorMax"] < 1e-7
        assert sink.table("reactions")[:, 1].min() >= 0.0


def test_a_stiffer_contact_tends_to_the_rigid_one():
    """A bouncing ball of e = 1: the difference from the rigid one is the time of the contacts,
    which for the exponent n goes with k^(-1/(n + 1))."""
    far, stiffness = [], (1e6, 1e8, 1e10)
    rigid = ball(None, 0.5, speed=0.0, gravity=9.81)
    _, sink, _ = run_events(rigid, "gauss2", 0.01, 1.0)
    wanted = sink.table("states")[-1, 3]
    for k in stiffness:
        model = ball(Compliance(k, 1.5), 0.5, speed=0.0, gravity=9.81)
        _, sink, _ = run_events(model, "auto", 0.01, 1.0, 1e-8)
        far.append(abs(sink.table("states")[-1, 3] - wanted))
    slopes = -np.diff(np.log10(far)) / 2.0
    assert slopes == pytest.approx([0.4, 0.4], abs=0.01)


def test_preserving_keeps_the_energy_of_many_impacts():
    model = ball(Compliance(1e5), 0.1, speed=0.0, gravity=9.81)
    report, sink, _ = run_events(model, "preserving", 2e-3, 50.0)
    assert np.count_nonzero(np.diff(np.sign(sink.table("states")[:, 9])) > 0) > 150
    assert report.extremes["energyErrorMax"] < 2e-11  # 25,000 steps, each to 1e-15 J


@pytest.mark.parametrize("scheme", ["preserving", "gauss3"])
def test_limits_of_a_joint_and_of_a_distance_push_from_both_ends(scheme):
    """A slide between stops at both ends is a billiard of one ball: the period follows."""
    wall = JointLimit("Stops", "Track", "slide", -0.1, 0.2, 1.0, Compliance(1e6))
    free, half = 0.3, math.pi / math.sqrt(1e6)
    _, sink, _ = run_events(_slider(wall), scheme, 2e-4, 4.0 * (free + half))
    assert sink.table("states")[-1, [1, 7]] == pytest.approx([0.0, 1.0], abs=2e-4)
    loads = sink.table("reactions")[:, -2:]
    assert loads[:, 0].min() == 0.0
    assert loads[:, 1].max() == 0.0
    assert loads[:, 0].max() == pytest.approx(1000.0, rel=2e-2)
    assert loads[:, 1].min() == pytest.approx(-1000.0, rel=2e-2)


def _slider(wall):
    axes = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    track = Joint("Track", "prismatic", GROUND.name, "Ball", (0.0,) * 3, (0.0,) * 3, axes, axes)
    bodies = [body("Ball", 1.0, 0.01, velocity=(1.0, 0.0, 0.0))]
    return build_model(bodies, [track], contacts=(wall,))


def test_a_rope_that_gives_way_is_a_spring_while_it_is_taut():
    rope = DistanceLimit(
        *("Rope", GROUND.name, "Ball", (0.0,) * 3, (0.0,) * 3),
        upper=1.0,
        restitution=1.0,
        compliance=Compliance(400.0),
    )
    bodies = [body("Ball", 1.0, 0.01, (0.9, 0.0, 0.0), velocity=(2.0, 0.0, 0.0))]
    model = build_model(bodies, contacts=(rope,))
    taut = math.pi / 20.0
    report, sink, _ = run_events(model, "gauss3", 0.01, 0.5)
    left = 0.5 - 0.05 - taut
    assert sink.table("states")[-1, [1, 7]] == pytest.approx([1.0 - 2.0 * left, -2.0], abs=1e-9)
    assert report.extremes["energyErrorMax"] < 1e-10


def resting_deck(tmp_path):
    """The deck of Hertz's impact with gravity, at rest with a depth that is too large."""
    text = (Path(__file__).parent / "hertz_impact.xml").read_text()
    for old, new in (
        ("<bodies>", "<gravity><g3>-9.81</g3></gravity><bodies>"),
        ("<v3>-1</v3>", "<v3>0</v3>"),
        ("<z>0.1</z>", "<z>0.0995</z>"),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "rest.xml"
    path.write_text(text)
    return path


def test_a_ball_rests_on_a_compliant_floor_and_vibrates(tmp_path):
    """Depth (m g/k)^(1/n), and the stiffness there n k d^(n - 1)."""
    done = CliRunner().invoke(
        main, ["equilibrium", str(resting_deck(tmp_path)), "-o", str(tmp_path / "eq")]
    )
    assert done.exit_code == 0, done.output
    depth = (9.81 / 1e8) ** (2.0 / 3.0)
    (states,) = rows_of(tmp_path / "eq" / "states.csv")
    (loads,) = rows_of(tmp_path / "eq" / "reactions.csv")
    assert float(states["Ball.z"]) == pytest.approx(0.1 - depth, abs=1e-14)
    assert float(loads["Floor.load"]) == pytest.approx(9.81, rel=1e-10)
    found = tmp_path / "eq" / "equilibrium1.xml"
    done = CliRunner().invoke(main, ["modes", str(found), "-o", str(tmp_path / "modes")])
    assert done.exit_code == 0, done.output
    largest = max(float(row["imaginary"]) for row in rows_of(tmp_path / "modes" / "modes.csv"))
    assert largest == pytest.approx(math.sqrt(1.5e8 * math.sqrt(depth)), rel=1e-9)


def rows_of(path):
    with path.open() as table:
        return [*csv.DictReader(table)]
