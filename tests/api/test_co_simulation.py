"""Runs that another program advances, from Python: names, values, faults, a controller outside."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

import msahl
from tests.support.models import ROOT

DECK = ROOT / "decks" / "forces" / "actuator_input.xml"
M, K = 2.0, 8.0
"""Mass [kg] and stiffness [N/m] of the deck."""
P, D, GOAL = 60.0, 14.0, 1.0
"""Of a controller: gains [N/m, N s/m] and where the cart is to be [m]."""
END = 0.4
"""Time at which its results are compared [s]: the cart is under way."""


def cart(**options):
    return msahl.load(DECK).co_simulation(**options)


def control(point, **options):
    """Position after control from outside every ``point`` [s], by forces held in between."""
    run = cart(**options)
    for k in range(round(END / point)):
        run.set({"force": P * (GOAL - run["Rail.slide"]) - D * run["Rail.slideRate"]})
        run.advance((k + 1) * point)
    return run["Rail.slide"]


def controlled_in_deck():
    law = f"{P}*({GOAL} - Rail.slide) - {D}*Rail.slideRate"
    given = '<input name="force" units="N" value="4"/>'
    text = DECK.read_text().replace(given, f'<signal name="force" units="N">{{{law}}}</signal>')
    result = msahl.load(text).run(scheme="gauss3", dt=0.01, t_final=END, error="off")
    return result["Rail.slide"][-1]


def sampled(point):
    """The position with forces held, exactly: the map of one interval, again and again."""
    A = np.array([[0.0, 1.0, 0.0], [-K / M, 0.0, 1.0 / M], [0.0, 0.0, 0.0]])
    step, state = expm(A * point), np.zeros(3)
    for _ in range(round(END / point)):
        state[2] = P * (GOAL - state[0]) - D * state[1]
        state = step @ state
    return state[0]


@pytest.mark.slow
def test_a_controller_outside_has_the_order_of_its_interval():
    """Forces held over an interval come half of it too late: order 1, at 1 kHz 1.2 mm here."""
    exact = controlled_in_deck()
    errors = [abs(control(point) - exact) for point in (0.002, 0.001)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.01)
    assert errors[-1] == pytest.approx(1.21e-3, rel=0.01)


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"scheme": "gauss2", "dt": 0.05}, 1e-11),  # order 4, (w h)^4 = 3e-10 with w h = 0.004
        ({"scheme": "gauss2", "dt": 0.003}, 1e-11),
        ({"scheme": "gauss3", "local_tolerance": 1e-9}, 1e-9),
    ],
)
def test_a_controller_outside_is_a_sampled_one_exactly(options, error):
    """Every jump of the force is the end of a step, whatever the steps would be."""
    assert control(0.002, **options) == pytest.approx(sampled(0.002), abs=error)


def test_names_and_values():
    run = cart()
    kinds = {variable.name: variable.kind for variable in run.variables.values()}
    assert {name for name, kind in kinds.items() if kind == "parameter"} == {"m"}
    assert {name for name, kind in kinds.items() if kind == "input"} == {"force"}
    assert "Spring.stiffness" in {name for name, kind in kinds.items() if kind == "tunable"}
    assert run.variables["Cart.vx"].unit == "m/s"
    assert run.variables["Spring.stiffness"].unit == "N/m"
    assert (run["m"], run["force"], run["Spring.stiffness"]) == (2.0, 4.0, 8.0)
    assert set(run.values) == {name for name, kind in kinds.items() if kind == "output"}
    run.advance(0.5)
    assert run.time == 0.5
    assert run["Rail.slide"] == run.values["Rail.slide"] > 0.0


def test_what_is_set_before_the_first_step_is_as_in_the_deck():
    """Parameters, numbers of loads and inputs: the same run to the bit, from its first row on."""
    run = cart()
    run.set({"m": 3.0, "Spring.stiffness": 20.0, "force": 1.0})
    text = DECK.read_text().replace('value="4"', 'value="1"')
    result = msahl.load(text, m=3.0, **{"Spring.stiffness": 20.0}).run(error="off")
    for k in (0, 100, 700):
        if k:
            run.advance(result.time[k])
        assert all(value == result[name][k] for name, value in run.values.items())


def test_an_input_that_an_event_sets():
    event = '<event name="off" when="Rail.slide &gt; 0.3"><set name="force">0.5</set></event>'
    text = DECK.read_text().replace("</loads>", f"</loads>\n<events>{event}</events>")
    run = msahl.load(text).co_simulation()
    run.advance(1.0)
    assert run["force"] == 0.5
    run.set({"force": 4.0})
    assert run["force"] == 4.0
    run.advance(1.1)
    assert run["Drive.load"] == 4.0


def test_a_saved_run_goes_on_in_another_object():
    run = cart()
    run.set({"m": 3.0})
    run.advance(0.3)
    run.set({"force": 5.0})
    saved = run.save()
    run.advance(0.6)
    for other in (cart(), run):
        other.restore(saved)
        assert (other.time, other["force"], other["m"]) == (0.3, 5.0, 3.0)
        other.advance(0.6)
        assert other.values == run.values
    fresh = cart()
    fresh.set({"m": 5.0})
    other.restore(fresh.save())
    assert (other.time, other["m"]) == (0.0, 5.0)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"forse": 1.0}, "forse: the model has no such number; did you mean force"),
        ({"Cart.x": 1.0}, "Cart.x is a result of the run"),
        ({"force": math.nan}, "force: it is nan; give a finite number"),
        ({"force": math.inf}, "force: it is inf; give a finite number"),
        ({"force": "4"}, "force: it is '4'; give a finite number"),
        ({"m": 3.0}, "m is a parameter of the deck, constant from t = 0 on"),
    ],
)
def test_faults_of_values(values, words):
    """None of the values is set."""
    run = cart()
    run.advance(0.1)
    with pytest.raises(msahl.OptionError, match=words):
        run.set({"Spring.stiffness": 1.0, **values})
    assert run["Spring.stiffness"] == 8.0


def test_faults_of_the_model_are_those_of_a_deck():
    run = cart()
    run.set({"m": -1.0})
    with pytest.raises(msahl.DeckError, match="the mass is -1 kg; it must be greater than zero"):
        run.advance(0.1)


def test_faults_of_options_times_and_states():
    with pytest.raises(msahl.OptionError, match="tolerance of the global error needs complete"):
        cart(scheme="auto")
    run = cart()
    with pytest.raises(msahl.OptionError, match="it must be a time in seconds"):
        run.advance(math.nan)
    with pytest.raises(msahl.OptionError, match="no such number"):
        run["forse"]
    run.advance(0.1)
    saved = run.save()
    for wrong in (b"", b"{}", b"[]", saved[:-100], b"\xff"):
        with pytest.raises(msahl.ResumeError, match="it is not the saved state of a run"):
            run.restore(wrong)
    other = msahl.load(ROOT / "decks" / "forces" / "actuator_pid.xml").co_simulation()
    other.advance(0.1)
    for another in (other, cart(dt=0.002)):
        another.advance(0.2)
        with pytest.raises(msahl.ResumeError, match="of another deck, or with other options"):
            run.restore(another.save())
    assert run.time == 0.1
