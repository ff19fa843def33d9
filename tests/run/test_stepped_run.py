"""A run that is advanced from outside: its rows, jumps of inputs, states saved and restored."""

import math

import numpy as np
import pytest

import msahl
from msahl.api.running import at_start
from msahl.run.stepped_run import RunEnded, SteppedRun
from tests.support.models import ROOT

DECKS = ROOT / "decks"
CART = DECKS / "forces" / "actuator_input.xml"
M, K = 2.0, 8.0
"""Mass [kg] and stiffness [N/m] of that deck."""
W = math.sqrt(K / M)


def stepped(deck, **options):
    job = at_start(msahl.load(deck).job(**options))
    return SteppedRun(job.model, job.options)


def tables(run, times):
    """The rows at ``times`` [s]."""
    rows = [run.row]
    for t in times:
        run.advance(t)
        rows.append(run.row)
    return np.array(rows)


def column(run, name):
    names = [head for heads in run.columns.values() for head in heads]
    return run.row[names.index(name)]


def of_run(deck, run, **options):
    """The same rows of a run in one go, and their times."""
    result = msahl.load(deck).run(error="off", **options)
    columns = [result.array(name)[:, 1:] for name in run.columns]
    return np.hstack(columns), result.time


def oscillate(x, v, force, t):
    """Position and velocity after a time ``t`` [s] with a constant force [N]: exact."""
    rest = x - force / K
    c, s = math.cos(W * t), math.sin(W * t)
    return force / K + rest * c + v / W * s, v * c - rest * W * s


@pytest.mark.parametrize(
    ("deck", "options"),
    [
        ("forces/actuator_input", {}),
        ("forces/actuator_pid", {"dt": 0.02}),
        ("contact/bouncing_ball", {"t_final": 1.0}),
        ("mechanisms/two_pendulums", {"t_final": 0.2}),
        ("forces/actuator_pid", {"scheme": "gauss2", "dt": 0.03, "output_interval": 0.007}),
        ("forces/actuator_pid", {"scheme": "auto", "local_tolerance": 1e-8}),
        ("contact/bouncing_ball", {"scheme": "gauss3", "local_tolerance": 1e-8}),
    ],
)
def test_rows_are_those_of_a_run_to_the_bit(deck, options):
    """Times of a master are sums: they may differ by round-off from those of the run."""
    path = DECKS / f"{deck}.xml"
    run = stepped(path, **options)
    rows, times = of_run(path, run, **options)
    found = tables(run, times[1:] * (1.0 + 1e-15))
    assert np.array_equal(found, rows)


def test_points_within_steps_change_no_step():
    """Positions at three points per step; every third one is the end of a step of the run."""
    run = stepped(CART, scheme="gauss2", dt=0.03, t_final=0.6)
    rows, _ = of_run(CART, run, scheme="gauss2", dt=0.03, t_final=0.6)
    found = tables(run, 0.01 * np.arange(1, 61))
    assert np.array_equal(found[::3], rows)


FORCES = (4.0, -3.0, 6.0, 1.5)


def driven(point, **options):
    """Position and velocity after forces that change every ``point`` [s]: computed, and exact."""
    run, x, v = stepped(CART, **options), 0.0, 0.0
    for k, force in enumerate(FORCES):
        if k:
            run.set({"force": force}, {})
        run.advance((k + 1) * point)
        x, v = oscillate(x, v, force, point)
    return column(run, "Cart.x") - x, column(run, "Cart.vx") - v


@pytest.mark.parametrize(
    ("scheme", "steps", "order"),
    [("preserving", (0.04, 0.02), 2), ("gauss2", (0.2, 0.1), 4), ("radau2", (0.1, 0.05), 3)],
)
def test_jumps_of_inputs_are_ends_of_steps(scheme, steps, order):
    """Forces jump within what would be a step; across a jump any scheme would have order 1. The
    slope is within 0.4 of the order, as the parts of steps at jumps are not halved with them.
    """
    errors = [np.hypot(*driven(0.25, scheme=scheme, dt=h)) for h in steps]
    assert abs(math.log2(errors[0] / errors[1]) - order) < 0.4


def test_jumps_of_inputs_with_a_tolerance():
    error, _ = driven(0.25, scheme="gauss3", local_tolerance=1e-9)
    assert abs(error) < 1e-9  # the sum of local errors, of a motion that does not amplify them


def test_a_number_of_a_load_changes():
    """From t = 0.5 s on the spring is four times as stiff, and its frequency twice as high."""
    run = stepped(CART, scheme="gauss3", dt=0.05)
    run.advance(0.5)
    x, v = oscillate(0.0, 0.0, 4.0, 0.5)
    run.set({}, {("Spring", "stiffness"): 4.0 * K})
    run.advance(1.0)
    rest, w = x - 4.0 / (4.0 * K), 2.0 * W
    exact = 4.0 / (4.0 * K) + rest * math.cos(0.5 * w) + v / w * math.sin(0.5 * w)
    assert column(run, "Cart.x") == pytest.approx(exact, abs=1e-9)  # order 6 at w h = 0.2


def test_a_set_value_holds_from_the_point_on():
    """The row at the point is that before the jump, and does not change afterwards."""
    run = stepped(CART)
    run.advance(0.5)
    before = run.row.copy()
    run.set({"force": 0.0}, {})
    assert np.array_equal(run.row, before)
    run.advance(0.501)
    assert column(run, "Drive.load") == 0.0


def with_signals(signals, drive):
    text = CART.read_text()
    text = text.replace('<input name="force" units="N" value="4"/>', signals)
    return text.replace("{force}", drive)


def test_switches_follow_an_input():
    """A condition of the input is on its other side after the jump, at once."""
    deck = with_signals('<input name="on" value="0"/>', "{where(on &gt; 0.5, 4, -4)}")
    run = stepped(deck, scheme="gauss3", dt=0.1)
    run.advance(0.35)
    x, v = oscillate(0.0, 0.0, -4.0, 0.35)
    run.set({"on": 1.0}, {})
    run.advance(1.0)
    x, _ = oscillate(x, v, 4.0, 0.65)
    assert column(run, "Cart.x") == pytest.approx(x, abs=1e-7)  # order 6 at w h = 0.2


def test_an_event_happens_where_an_input_fulfils_its_condition():
    event = '<event name="off" when="force &gt; 5"><set name="force">0</set></event>'
    text = CART.read_text().replace("</loads>", f"</loads>\n<events>{event}</events>")
    run = stepped(text, scheme="gauss3", dt=0.1)
    run.advance(0.25)
    x, v = oscillate(0.0, 0.0, 4.0, 0.25)
    run.set({"force": 6.0}, {})
    run.advance(1.0)
    x, _ = oscillate(x, v, 0.0, 0.75)
    assert column(run, "force") == 0.0
    assert column(run, "Cart.x") == pytest.approx(x, abs=1e-7)  # order 6 at w h = 0.2


def test_a_contact_opens_where_an_input_pulls():
    """The cart rests on a stop, with 4 N towards it, until it is pulled off by 10 N."""
    stop = """<contacts><jointLimit><name>Stop</name><joint>Rail</joint>
      <coordinate>slide</coordinate><lower>0</lower></jointLimit></contacts>"""
    text = CART.read_text().replace('value="4"', 'value="-4"')
    run = stepped(text.replace("</joints>", f"</joints>\n{stop}"), scheme="gauss3", dt=0.1)
    run.advance(0.25)
    assert column(run, "Cart.x") == 0.0
    run.set({"force": 10.0}, {})
    run.advance(0.75)
    x, _ = oscillate(0.0, 0.0, 10.0, 0.5)
    assert column(run, "Cart.x") == pytest.approx(x, abs=1e-7)  # order 6 at w h = 0.2


@pytest.mark.parametrize(
    "options",
    [{}, {"scheme": "gauss2", "dt": 0.03}, {"scheme": "auto", "local_tolerance": 1e-8}],
)
def test_a_restored_run_goes_on_to_the_bit(options):
    """Also of another object, from a point within a step, and back from beyond it."""
    run, other = stepped(CART, **options), stepped(CART, **options)
    run.advance(0.1)
    run.set({"force": 7.0}, {("Spring", "stiffness"): 20.0})
    run.advance(0.25)
    saved = run.save()
    rows = tables(run, (0.26, 0.4, 0.5))
    for one in (run, other):
        one.restore(saved)
        assert one.time == 0.25
        assert np.array_equal(tables(one, (0.26, 0.4, 0.5)), rows)


def test_where_a_run_cannot_go():
    run = stepped(CART)
    run.advance(1.0)
    for to, words in ((1.0, "is not after"), (0.5, "is not after"), (2.5, "give --t-final")):
        with pytest.raises(RunEnded, match=words):
            run.advance(to)
    run.advance(1.5)  # a step that was refused does no harm


def test_a_condition_ends_the_run():
    """At x = 0.5 m, t = pi/4 s; no step beyond, until a state is restored."""
    run = stepped(CART, stop_when="Rail.slide > 0.5")
    run.advance(0.5)
    saved = run.save()
    for _ in range(2):
        with pytest.raises(RunEnded, match=r"ended at t = 0\.78539.*, where Rail.slide > 0.5"):
            run.advance(1.0)
    run.restore(saved)
    run.advance(0.7)


def test_points_that_are_nearly_ends_of_steps():
    """Late in a run, a point a millionth of a step before the end of one is a point of its own, and
    one that differs by round-off is not.
    """
    run = stepped(CART, scheme="gauss2", dt=0.001)
    run.advance(1.5 - 1e-9)
    run.set({"force": 0.0}, {})
    x, v = oscillate(0.0, 0.0, 4.0, 1.5 - 1e-9)
    run.advance(1.5)
    run.advance(1.6 * (1.0 + 1e-15))
    x, v = oscillate(x, v, 0.0, 0.1 + 1e-9)
    assert column(run, "Cart.x") == pytest.approx(x, abs=1e-12)  # (w h)^4 = 2e-11, over 180
    assert run.plan.progress.steps == 1600
    assert run.time == run.plan.grid.time(1600)
