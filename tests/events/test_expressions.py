"""Steps end where expressions change their formulas, at known times and in the motion."""

import math
from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.functions import Law
from msahl.algebra.surfaces import Surface
from msahl.algebra.vector import ZERO
from msahl.expressions.syntax import parse
from msahl.model import ConcentratedLoad, Joint, JointActuator, Options, SignalState
from msahl.model.signals import SignalTable
from tests.run.test_resume import advance as in_memory
from tests.run.test_resume import bits, in_two_parts
from tests.support.models import GROUND, body, build_model
from tests.support.models import simulate_and_estimate as simulate

MASS = 2.0
HALF = math.pi / 10.0
"""Half a period of the spring [s] of 200 N/m."""
SPIKE = (0.0, 0.3, 0.301, 0.302, 1.0)


def rail(force, speed=1.0, signals=()):
    """A body of 2 kg that slides freely, under a ``force`` by an expression."""
    slider = body("Body", mass=MASS, velocity=(0.0, 0.0, speed))
    joint = Joint("Rail", "prismatic", GROUND.name, "Body", ZERO, ZERO)
    load = JointActuator("Force", "Rail", "slide", parse(force))
    return build_model([slider], [joint], [load], signals=signals)


def bounced(t):
    """Where a body is that flies at -1 m/s to a spring 0.3 m away, and back."""
    touching = -0.3 - np.sin(10.0 * (t - 0.3)) / 10.0
    return np.select([t < 0.3, t < 0.3 + HALF], [-t, touching], t - 0.6 - HALF)


def in_dead_zone(t):
    """Where a body of 1 m/s is that meets a spring 0.1 m from the middle on either side."""
    quarter = 0.2 + HALF  # from the middle to the middle again
    half, rest = divmod(t, quarter)
    touching = 0.1 + math.sin(10.0 * (rest - 0.1)) / 10.0
    place = rest if rest < 0.1 else touching if rest < 0.1 + HALF else 0.2 + HALF - rest
    return place if half % 2 == 0 else -place


def switched(t):
    """Where a body of 1 m/s is that a force of 20 N drives to the middle."""
    half, rest = divmod(t, 0.2)
    return (rest - 5.0 * rest * rest) * (1.0 if half % 2 == 0 else -1.0)


def piecewise(t):
    """As ``switched``, by springs of 200 N/m on one side and of 800 N/m on the other."""
    rest = t % (1.5 * HALF)
    stiff = rest - HALF
    return math.sin(10.0 * rest) / 10.0 if stiff < 0.0 else -math.sin(20.0 * stiff) / 20.0


def braked(t):
    """Where a body of 1 m/s is that 1 N + 6 Ns/m (v - 0.5 m/s) brakes, and below 2 Ns/m v."""
    slow = math.log(4.0) / 3.0
    fast = min(t, slow)
    passed = fast / 3.0 + 2.0 / 9.0 * (1.0 - math.exp(-3.0 * fast))
    return passed + 0.5 * (1.0 - math.exp(-max(0.0, t - slow)))


def grid(name, x, y, along_x, along_y):
    """A bilinear table of two variables, the sum of one of each."""
    values = tuple(tuple(a + b for b in along_y) for a in along_x)
    return SignalTable(name, Surface("linear", x, y, values))


SCENES = {
    "one-sided spring": (rail("200*max(0, -0.3 - Rail.slide)", -1.0), bounced),
    "by a comparison": (
        rail("where(Rail.slide < -0.3, -200*(Rail.slide + 0.3), 0)", -1.0),
        bounced,
    ),
    "dead zone": (
        rail("-200*(max(Rail.slide - 0.1, 0) + min(Rail.slide + 0.1, 0))"),
        in_dead_zone,
    ),
    "two stiffnesses": (rail("-500*Rail.slide + 300*abs(Rail.slide)"), piecewise),
    "two-point control": (rail("-20*sign(Rail.slide)"), switched),
    "table of the motion": (
        rail(
            "push(Rail.slide)",
            -1.0,
            (SignalTable("push", Law("linear", (-1.3, -0.3, 0.7, 200.0, 0.0, 0.0))),),
        ),
        bounced,
    ),
    "table of the motion and the time": (
        rail(
            "push(Rail.slide, t)",
            -1.0,
            (grid("push", (-1.3, -0.3, 0.7), (0.0, 2.0), (200.0, 0.0, 0.0), (0.0, 0.0)),),
        ),
        bounced,
    ),
    "table of the motion and its rate": (
        rail(
            "brake(Rail.slide, Rail.slideRate)",
            1.0,
            (grid("brake", (-9.0, 9.0), (0.0, 0.5, 2.0), (0.0, 0.0), (0.0, -1.0, -10.0)),),
        ),
        braked,
    ),
}


def error(model, exact, t_final=1.0, **given):
    run = simulate(model, t_final=t_final, solver="newton", error="off", **given)
    assert run.report.status == "completed"
    return abs(run.states[-1, 3] - exact(t_final))


@pytest.mark.parametrize(("scheme", "least", "dt"), [("gauss2", 3.9, 0.02), ("gauss3", 5.8, 0.025)])
@pytest.mark.parametrize("scene", SCENES)
def test_order_is_kept_where_the_motion_passes_a_kink_or_a_jump(scene, scheme, least, dt):
    model, exact = SCENES[scene]
    errors = [error(model, exact, scheme=scheme, dt=size) for size in (dt, 0.5 * dt)]
    # Parts of steps are not quite halved: of orders 4 and 6 this is left. Parabolas are exact.
    assert errors[1] < 1e-13 or math.log2(errors[0] / errors[1]) > least


@pytest.mark.sampled
@pytest.mark.parametrize("scene", SCENES)
def test_tolerances_are_kept_where_the_motion_passes_a_kink_or_a_jump(scene):
    model, exact = SCENES[scene]
    for tolerance in (1e-3, 1e-6, 1e-9):
        simulation = replace(model.simulation, scheme="auto", tolerance=tolerance)
        run = simulate(replace(model, simulation=simulation), solver="newton")
        assert run.report.status == "completed"
        assert abs(run.states[-1, 3] - exact(1.0)) < tolerance


def touched(t):
    """Where a body of 0.7071 m/s on a spring of 8 N/m is, which meets one of 400 N/m at 0.3533 m,
    a quarter of a millimetre before it would come back.
    """
    place, rate = 0.3533, math.sqrt(408.0 / MASS)
    first = 0.5 * math.asin(place / 0.35355)
    speed, middle = 0.7071 * math.cos(2.0 * first), 400.0 / 408.0 * place
    phase = math.atan2(speed / rate, place - middle)
    size, left = math.hypot(speed / rate, place - middle), first + 2.0 * phase / rate
    touching = middle + size * np.cos(rate * (t - first) - phase)
    back = place * np.cos(2.0 * (t - left)) - 0.5 * speed * np.sin(2.0 * (t - left))
    return np.select([t < first, t < left], [0.35355 * np.sin(2.0 * t), touching], back)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_a_contact_smaller_than_the_tolerance_takes_few_steps(tolerance):
    """Long steps showed it where the motion did not come to it yet, by the error of their dense
    output, again and again: 33,180 steps of 1e-9 s and more.
    """
    force = "-400*max(Rail.slide - 0.3533, 0) - 8*Rail.slide"
    model = rail(force, speed=0.7071)
    simulation = replace(model.simulation, scheme="auto", tolerance=tolerance)
    run = simulate(replace(model, simulation=simulation), 0.02, 3.0)
    assert run.report.steps <= 200
    assert np.abs(run.others["joints"][:, 1] - touched(run.time)).max() <= tolerance
    assert run.report.verdict["word"] == "PASS", run.report.verdict["reasons"]


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_a_screw_press_meets_its_tolerance(tolerance):
    """It rotates at 20 rad/s, meets the work after 20 mm, is thrown back, and rotates freely."""
    advance, inertia, speed, stiffness, gap = 0.05 / (2.0 * math.pi), 0.05, 20.0, 2e5, 0.02
    velocity = (0.0, 0.0, advance * speed)
    spindle = {"velocity": velocity, "angular_velocity": (0.0, 0.0, speed)}
    screw = body("Screw", mass=4.0, inertia=(0.3, 0.3, inertia), **spindle)
    thread = (("pitch", 0.05),)
    joint = Joint("Nut", "screw", GROUND.name, "Screw", ZERO, ZERO, parameters=thread)
    work = JointActuator("Work", "Nut", "slide", parse(f"-{stiffness}*max(0, Nut.slide - {gap})"))
    model = build_model([screw], [joint], [work])
    simulation = replace(model.simulation, scheme="auto", tolerance=tolerance)
    run = simulate(replace(model, simulation=simulation), solver="newton")
    rate = advance * math.sqrt(stiffness / (inertia + 4.0 * advance**2))
    meets, free = gap / velocity[2], math.pi / rate
    t = run.time
    touching = gap + velocity[2] / rate * np.sin(rate * (t - meets))
    back = gap - velocity[2] * (t - meets - free)
    exact = np.select([t < meets, t < meets + free], [velocity[2] * t, touching], back)
    assert abs(run.states[:, 3] - exact).max() < tolerance
    assert run.report.verdict["word"] == "PASS"


def spike(height):
    table = SignalTable("spike", Law("linear", (*SPIKE, 0.0, 0.0, height, 0.0, 0.0)))
    return rail("spike(t)", 0.0, (table,)), lambda t: 1e-3 * height / MASS * (t - 0.301)


def spikes():
    """Of two tables, and of one over the motion as well."""
    other = (0.0, 0.6, 0.601, 0.602, 1.0)
    tables = (
        SignalTable("one", Law("linear", (*SPIKE, 0.0, 0.0, 500.0, 0.0, 0.0))),
        SignalTable("two", Law("linear", (*other, 0.0, 0.0, 500.0, 0.0, 0.0))),
        grid("map", (-9.0, 9.0), (0.0, 0.8, 0.801, 0.802), (0.0, 0.0), (0.0, 0.0, 500.0, 0.0)),
    )
    model = rail("one(t) + two(t) + map(Rail.slide, t)", 0.0, tables)
    return model, lambda t: 0.5 / MASS * (3.0 * t - 0.301 - 0.601 - 0.801)


def square_wave(speed=0.0):
    """A state that follows a square wave of 1 Hz, and pushes."""
    signals = (SignalState("s", parse("sign(sin(2*pi*t))"), 0.0),)
    return rail("2*s", speed, signals), lambda t: {1.0: 1.0 / 8.0, 0.5: 1.0 / 48.0}[t]


def sampled():
    """A force that holds each value of t for a third of a second, and begins to act at 1/7 s."""

    def exact(t):
        total = 0.0
        for k in range(3):
            begin = max(k / 3.0, 1.0 / 7.0)
            end = (k + 1) / 3.0
            total += 6.0 / MASS * (k + 1) / 3.0 * (end - begin) * (t - 0.5 * (begin + end))
        return total

    return rail("where(t < 1/7, 0, 6*(floor(3*t) + 1)/3)", 0.0), exact


TIMED = {
    "spike": spike(500.0),
    "spikes": spikes(),
    "square wave": square_wave(),
    "sampled": sampled(),
}


@pytest.mark.parametrize("scheme", ["preserving", "gauss2", "radau3", "auto"])
@pytest.mark.parametrize("scene", TIMED)
def test_times_in_expressions_are_not_jumped_over(scene, scheme):
    """Between them the laws are polynomials of degree one, which all schemes integrate exactly; a
    spike of 2 ms is within one step. The discrete midpoint of the state has order 2."""
    model, exact = TIMED[scene]
    if scheme == "auto":
        simulation = replace(model.simulation, scheme="auto", tolerance=1e-9)
        model, scheme = replace(model, simulation=simulation), None
    given = {} if scheme is None else {"error": "off"}
    run = simulate(model, dt=0.01, scheme=scheme, solver="newton", **given)
    assert run.report.status == "completed"
    off = abs(run.states[-1, 3] - exact(1.0))
    assert off < (1e-5 if (scene, scheme) == ("square wave", "preserving") else 1e-9)


def test_parts_of_divided_steps_have_an_estimated_error():
    """A spike ends within the step in which its second half began. A companion at half the step
    divided it at the same times, so it had the same error."""
    spike = SignalTable("spike", Law("linear", (0.0, 0.011, 0.012, 0.013, 1.0, 0, 0, 500.0, 0, 0)))
    model = rail("spike(t)", 0.0, (spike,))
    run = simulate(model, dt=1 / 320, t_final=0.05, scheme="radau1", solver="newton")
    true = abs(run.states[-1, 3] - 0.5 / MASS * (0.05 - 0.012))
    assert true > 1e-3
    assert 0.3 < run.report.error["position"] / true < 10.0


@pytest.mark.parametrize("scheme", ["gauss2", "radau2"])
def test_motion_that_slides_along_a_jump_is_named(scheme):
    """Beyond x + v/5 = 0.1 the force drives the body back, and before it forth."""
    model = rail("-20*sign(Rail.slide + 0.2*Rail.slideRate - 0.1)")
    run = simulate(model, dt=0.02, scheme=scheme, solver="newton", error="off")
    assert "slides along a jump in the expression of load 'Force'" in run.report.message


def test_roots_beyond_a_level_do_no_harm():
    """The switch is not held where its branch has no value beyond the level."""
    model = rail("where(Rail.slide < -0.3, 900*(-0.3 - Rail.slide)^1.5, 0)", -1.0)
    smooth = rail("900*max(0, -0.3 - Rail.slide)^1.5", -1.0)
    given = {"dt": 0.005, "scheme": "gauss2", "solver": "newton", "error": "off"}
    runs = [simulate(one, **given) for one in (model, smooth)]
    assert runs[0].report.status == "completed"
    assert abs(runs[0].states[-1, 3] - runs[1].states[-1, 3]) < 1e-9


def test_inputs_that_are_faster_than_the_steps_are_in_the_estimated_error():
    """400 Hz at steps of 10 ms: both runs would meet the same phase in each step."""
    omega = 800.0 * math.pi
    model = rail(f"800*sin({omega}*t)", 0.0)
    run = simulate(model, dt=0.01, t_final=0.1, scheme="preserving", solver="newton")
    true = abs(run.states[-1, 3] - 400.0 / omega * 0.1)
    assert true > 1e-2
    assert 0.3 < run.report.error["position"] / true < 10.0


PULSES = {
    "1000*exp(-((t - .4567)/.0007)^2)": 1000.0 * 0.0007 * math.sqrt(math.pi) * (1.0 - 0.4567),
    "50/cosh((t - .3)/1e-6)^2": 50.0 * 2e-6 * (1.0 - 0.3),
    "2000*t/.001*exp(-t/.001)": 2000.0 * 0.001 * (1.0 - 2.0 * 0.001),
}
"""Integrals of (1 - t) times a pulse within a second."""


@pytest.mark.parametrize("pulse", PULSES)
def test_a_pulse_far_shorter_than_the_steps_is_resolved_by_tolerance(pulse):
    model = rail(pulse, 0.0)
    simulation = replace(model.simulation, scheme="auto", tolerance=1e-6, t_final=1.0)
    run = simulate(replace(model, simulation=simulation), solver="newton")
    assert abs(run.states[-1, 3] - PULSES[pulse] / MASS) < 1e-6
    assert run.report.verdict["word"] == "PASS"
    assert run.report.steps < 250  # from a pulse of 1e-3 s on, sizes double at most


@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
@pytest.mark.parametrize("pulse", PULSES)
def test_a_pulse_within_a_given_step_is_in_the_estimated_error(pulse, scheme):
    """Both the run and its companion took some of it, or none: .337 m were wrong, with PASS."""
    run = simulate(rail(pulse, 0.0), dt=0.01, t_final=1.0, scheme=scheme, solver="newton")
    true = abs(run.states[-1, 3] - PULSES[pulse] / MASS)
    assert true < 0.02 * PULSES[pulse]
    assert 0.3 * true < run.report.error["position"] + 1e-9


RESUMED = {
    "dead zone": SCENES["dead zone"][0],
    "two-point control": SCENES["two-point control"][0],
    # Thrown at the spring twice. Its switch is released at the first contact.
    "root": rail("where(Rail.slide < -0.3, 900*(-0.3 - Rail.slide)^1.5, 0) - 10", -1.0),
    # Known times, and no switches.
    "pulse": rail("1000*exp(-((t - .4567)/.0007)^2)", 0.0),
}


@pytest.mark.parametrize("given", [{"dt": 0.03, "degree": 2}, {"local_tolerance": 1e-6}])
@pytest.mark.parametrize("scene", RESUMED)
def test_runs_go_on_bit_for_bit_while_switches_are_held_or_released(monkeypatch, scene, given):
    model, options = RESUMED[scene], Options(solver="newton")
    simulation = replace(model.simulation, scheme="gauss", t_final=1.5, **given)
    model = replace(model, simulation=simulation)
    complete, rows = in_memory(model, options)
    for steps in {4, 22} if "dt" in given else {complete.steps // 4 * 2}:
        (_, first), (_, rest) = in_two_parts(monkeypatch, model, options, steps)
        assert bits(first, rest) == bits(rows)


@pytest.mark.parametrize(
    ("force", "word"), [("5*sign(Rail.Fx + 2)", "WARN"), ("max(0, Rail.Fx - 3)", "PASS")]
)
def test_jumps_by_reactions_warn(force, word):
    """They occur a step late: without the warning the first passes at some tolerances with errors
    of a hundred times these. A kink is in the estimate, of order 1 like the delay itself."""
    model = rail(force)
    side = ConcentratedLoad(
        *("Side", "Body", ZERO, (1.0, 0.0, 0.0), GROUND.name, ZERO, GROUND.name),
        expression=parse("10*sin(3*t)"),
    )
    model = replace(model, loads=(*model.loads, side))
    run = simulate(model, dt=0.005, t_final=0.9, scheme="gauss2", solver="newton")
    assert run.report.verdict["word"] == word
    assert ("jumps" in run.report.verdict["checks"]) == (word == "WARN")
    if word == "WARN":
        assert "the expression of load 'Force' may jump" in run.report.verdict["reasons"][-1]


@pytest.mark.parametrize(
    ("argument", "tolerance"), [("t", 1e-3), ("t", 1e-9), ("Rail.slide", 1e-6)]
)
def test_a_state_may_be_zero_until_its_table_begins(argument, tolerance):
    """No step met a tolerance from there: up to there the state was round-off, and its own scale.

    The body's speed is 1 m/s, so its displacement [m] is the time [s].
    """
    late, steep = 0.3137, 40.0
    table = SignalTable("p", Law("linear", (0.0, late, 1.0, 0.0, 0.0, steep * (1.0 - late))))
    state = SignalState("z", parse(f"p({argument})"))
    model = rail("0", signals=(table, state))
    given = replace(model.simulation, tolerance=tolerance)
    run = simulate(replace(model, simulation=given), 0.05, 0.9, "gauss2", solver="newton")
    assert run.report.verdict["word"] == "PASS"
    # The rate is linear, which steps of order 4 integrate but for round-off.
    assert run.signals[:, 1] == pytest.approx(
        0.5 * steep * np.maximum(0.0, run.time - late) ** 2, abs=1e-12
    )
