"""Faults of signals, states and conditions: names, numbers, parts without a value."""

from dataclasses import replace

import pytest

from msahl.check import check
from msahl.deck import DeckError, read_deck
from msahl.expressions.syntax import parse
from msahl.model.signals import Signal
from tests.support.models import ROOT

DECK = ROOT / "decks/forces/actuator_motor.xml"


@pytest.fixture
def faults(tmp_path):
    """The faults of the deck with more signals, without the file."""

    def found(signals="", stop=""):
        path = tmp_path / "deck.xml"
        given = DECK.read_text().replace("<signals>", f"<signals>{signals}")
        path.write_text(given.replace("</simulation>", f"{stop}</simulation>"))
        try:
            read_deck(path)
        except DeckError as error:
            return [str(fault).removeprefix(f"{path}:") for fault in error.faults]
        return []

    return found


def names():
    """Names that are taken in the deck: of a joint, a load, an actuator's column, a coordinate."""
    model = read_deck(DECK)
    (joint, *_), (load, *_) = model.joints, model.loads
    return {
        joint.name: "the name is taken by",
        load.name: "the name is taken by",
        f"{load.name}.power": f"is the power of '{load.name}'",
        f"{joint.name}.angle": f"is the angle of '{joint.name}'",
        "time": "the first column of signals.csv",
        "scheme": "the scheme's own column",
    }


def test_names_of_signals_mean_nothing_else(faults):
    """A deck is refused where the model is: two columns or values have one name."""
    for name, message in names().items():
        (found,) = faults(f'<signal name="{name}">1</signal>')
        assert f"signal '{name}': " in found
        assert message in found
        model = read_deck(DECK)
        model = replace(model, signals=(*model.signals, Signal(name, parse("1"))))
        (fault,) = check(model)
        assert (fault.name, fault.part) == (name, "name")


@pytest.mark.parametrize("given", ["x", "L/2", "nan", "", "{1", "1 2"])
def test_the_initial_value_of_a_state_is_a_number(faults, given):
    (found,) = faults(f'<state name="new" initial="{given}">1</state>')
    assert f"state 'new': initial='{given}' is not a finite number" in found


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        ("0/0", "division by zero (at column 2)"),
        ("t*log(2 - 3)", "log(-1) is not a real number (at column 3)"),
        ("sin(exp(1000))*t", "the result of 'exp' is too large"),
        ("where(t &lt; 1, 2, 3) + 1/0", "division by zero"),
    ],
)
def test_constant_parts_of_expressions_have_a_value(faults, expression, message):
    (found,) = faults(f'<signal name="new">{expression}</signal>')
    assert f"signal 'new': {message}" in found
    (found,) = faults(stop=f'<stop when="{expression} &gt; 1"/>')
    assert "simulation/stop: " in found


def test_what_a_condition_decides_on_needs_no_value(faults):
    assert not faults(
        '<signal name="new">where(0 &lt; 1, t, 1/0) + where(t &lt; 1, 1/0, 2)</signal>'
    )
