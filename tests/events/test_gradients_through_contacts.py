"""Derivatives by complete runs: through impacts, slips and events of decks, and of explicit steps.

Closed forms are met to 1e-7: differences of order 4 at 2e-3 of the scale of positions have errors
of 1e-10, times a factor of the function, and round-off of events over that shift; gauss resolves
the motions further than that.
"""

import math

import pytest

import msahl
from msahl.analysis.gradients import neighbouring_runs
from msahl.analysis.gradients.step_sequence import Step, halved, undivided
from msahl.api.derivatives import GradientError
from tests.support.models import ROOT

DECKS = ROOT / "decks"
G = 9.81
CLOSE = 1e-7


def gradient(deck, measures, wrt, **options):
    return msahl.load(DECKS / f"{deck}.xml").gradient(measures, wrt, **options)


def height(t, h, e):
    """Height [m] above the floor of a ball that falls from ``h`` and rebounds with ``e``."""
    t, v = t - math.sqrt(2.0 * h / G), e * math.sqrt(2.0 * G * h)
    while t > 2.0 * v / G:
        t, v = t - 2.0 * v / G, e * v
    return v * t - 0.5 * G * t * t


def slope(function, x):
    """Derivative of a smooth function: 1e-12 by differences of order 4."""
    d = 1e-3 * x
    near = [function(x + k * d) for k in (-2, -1, 1, 2)]
    return (near[0] - 8.0 * near[1] + 8.0 * near[2] - near[3]) / (12.0 * d)


@pytest.mark.slow
@pytest.mark.parametrize("options", [
    {"scheme": "preserving"}, {"scheme": "gauss3", "dt": 0.03},
    {"scheme": "auto", "tolerance": 1e-8},
], ids=lambda options: options["scheme"])  # fmt: skip
def test_impacts_move_with_height_and_restitution(options):
    """Parabolas are exact in every scheme, so their error is that of differences: the estimate is
    as small."""
    times = (1.0, 2.9)
    measures = [f"Ball.z at {t}" for t in times]
    found = gradient(
        "contact/bouncing_ball", measures, "Floor.restitution,Ball.z", t_final=2.9, **options
    )
    for i, t in enumerate(times):
        by_e = slope(lambda e, t=t: height(t, 1.0, e), 0.8)
        by_h = slope(lambda h, t=t: height(t, h, 0.8), 1.0)
        assert found.jacobian[i].tolist() == pytest.approx([by_e, by_h], rel=CLOSE)
    assert found.errors.max() < CLOSE
    assert not found.remarks


def test_rest_after_infinitely_many_impacts_has_no_derivative_left():
    found = gradient("contact/bouncing_ball", "Ball.z final", "Floor.restitution", error="off")
    assert abs(found.jacobian[0, 0]) < CLOSE


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["preserving", "gauss3"])
def test_the_time_at_which_a_slip_ends_moves(scheme):
    """x = 12 v^2/(49 mu g) + 5/7 v (t - 2 v/(7 mu g)), when the sphere rolls."""
    v, mu = 2.0, 0.2
    wanted = {"scheme": scheme, "error": "off"}
    found = gradient("contact/sliding_sphere", "Ball.x final", "Floor.friction,Ball.v1", **wanted)
    by_mu = -2.0 * v * v / (49.0 * mu * mu * G)
    by_v = 5.0 / 7.0 + 4.0 * v / (49.0 * mu * G)
    assert found.jacobian[0].tolist() == pytest.approx([by_mu, by_v], rel=CLOSE)


def test_an_engaged_clutch():
    """After 0.5 s at the common rate w J1/(J1 + J2)."""
    found = gradient(
        "contact/clutch", ["Output.angle final"], "Driver.Izz,Driver.omega3", error="off"
    )
    by_inertia, by_rate = 0.5 * 10.0 * 0.03 / 0.05**2, 0.5 * 0.02 / 0.05
    assert found.jacobian[0].tolist() == pytest.approx([by_inertia, by_rate], rel=CLOSE)


def test_a_compliant_contact():
    """Hertz's: it lasts T, which goes with v^(-1/5) and k^(-2/5), and z = 0.1 + v (t - T). The
    force of the exponent 1.5 is not smooth where it begins, so the error is 1e-5 of the derivatives
    at a tolerance of 1e-9 m, and the estimate says so."""
    T = 0.00203046203682776
    model = msahl.load(ROOT / "tests/contact/hertz_impact.xml")
    found = model.gradient("Ball.z final", "Ball.v3,Floor.stiffness")
    exact = [-(0.004 - 0.8 * T), 0.4e-8 * T]
    for j in range(2):
        error = abs(found.jacobian[0, j] - exact[j])
        assert error < 3.0 * found.errors[0, j]
        assert found.errors[0, j] < 1e-4 * abs(exact[j])


@pytest.fixture
def marked(tmp_path):
    """The bouncing ball with a marker, which conditions can name."""
    text = (DECKS / "contact/bouncing_ball.xml").read_text()
    marker = "<markers><marker><name>P</name><body>Ball</body></marker></markers>"
    path = tmp_path / "ball.xml"
    path.write_text(text.replace("<contacts>", f"{marker}<contacts>"))
    return msahl.load(path)


def test_the_end_of_a_run_moves_after_an_impact(marked):
    """At a height of 0.4 m, as it rises, the speed is sqrt(e^2 v0^2 - 2 g 0.4)."""
    e, square = 0.8, 2.0 * G
    wanted = {"stop_when": "P.z > 0.5 and t > 0.46", "error": "off", "scheme": "gauss2"}
    found = marked.gradient("Ball.vz final", "Floor.restitution", **wanted)
    v = math.sqrt(e * e * square - 0.8 * G)
    assert found.values[0] == pytest.approx(v, rel=1e-9)
    assert found.jacobian[0, 0] == pytest.approx(e * square / v, rel=CLOSE)


def test_steps_of_an_explicit_scheme():
    measures, wrt = ["Lower.angle final"], "L1"
    by_runs, by_steps = (
        gradient("basics/two_rods", measures, wrt, scheme=scheme, error="off", dt=0.005)
        for scheme in ("rk8", "gauss4")
    )
    assert by_runs.jacobian[0, 0] == pytest.approx(by_steps.jacobian[0, 0], rel=CLOSE)


def test_the_error_is_that_of_the_steps():
    """A pendulum at a wall by steps of order 2: held against gauss5, near which the true error is
    that of the former."""
    measures, wrt = ["Pivot.angle at 1.5"], "Wall.restitution"
    wanted = {"t_final": 1.5}
    found = gradient("contact/pendulum_at_a_wall", measures, wrt, scheme="preserving", **wanted)
    exact = gradient("contact/pendulum_at_a_wall", measures, wrt, scheme="gauss5", **wanted)
    true = abs(found.jacobian[0, 0] - exact.jacobian[0, 0])
    assert 0.5 < found.errors[0, 0] / true < 3.0
    assert exact.errors[0, 0] < 1e-7


def test_the_time_of_an_impact_that_stops_the_run_is_refused(marked):
    with pytest.raises(GradientError, match="stopped by the jump of an impact"):
        marked.gradient("Ball.z final", "Floor.restitution", error="off", stop_when="P.vz > 1")


@pytest.mark.slow
def test_other_events_near_the_value_are_refused():
    """With a smaller radius the ball falls first, and with a larger one it overlaps."""
    with pytest.raises(GradientError, match="the events of runs with values near it are others"):
        gradient("contact/sliding_sphere", "Ball.z final", "Floor.radius", error="off")


def test_an_impact_at_the_output_time_is_said():
    """It is at sqrt(2 h/g), which is an output time by the chosen step."""
    wanted = {"dt": math.sqrt(2.0 / G) / 50.0, "t_final": 0.6, "error": "off"}
    measure = f"Ball.vz at {math.sqrt(2.0 / G)!r}"
    found = gradient("contact/bouncing_ball", measure, "Floor.restitution,Ball.z", **wanted)
    assert math.isnan(found.jacobian[0, 1])
    assert any("an impact or event is at the output time" in remark for remark in found.remarks)


def test_each_parameter_takes_five_runs_more(monkeypatch):
    """A pilot for the shift and four of the difference, beside that of the deck's own values."""
    traces, trace = [], neighbouring_runs.trace
    monkeypatch.setattr(
        neighbouring_runs, "trace", lambda *given: traces.append(given) or trace(*given)
    )
    wanted = {"error": "off", "t_final": 1.0}
    gradient("contact/bouncing_ball", "Ball.z final", "Floor.restitution,Ball.z", **wanted)
    assert len(traces) == 1 + 2 * 5


def test_parts_of_steps_are_joined_and_halved():
    parts = [
        Step(0.02, 2, (1,), (0.5,), True),
        Step(0.03, 2, (2, 3), (0.5, 1.0)),
        Step(0.05, 2, (), ()),
    ]
    undivided_steps = undivided(parts)
    assert [step.size for step in undivided_steps] == pytest.approx([0.05, 0.05])
    assert undivided_steps[0].rows == (1, 2, 3)
    assert undivided_steps[0].shares == pytest.approx((0.2, 0.7, 1.0))
    first, second, *_ = halved(undivided_steps)
    assert (first.rows, second.rows) == ((1,), (2, 3))
    assert (first.shares, second.shares) == (pytest.approx((0.4,)), pytest.approx((0.4, 1.0)))
    assert first.size == second.size == pytest.approx(0.025)
