"""Coefficients of polynomial laws: units per second^k, alone and in expressions."""

import math

import pytest

from msahl.deck import DeckError, read_deck

DECK = """<data><parameters><parameter name="w" units="rpm">30</parameter>
<parameter name="v" units="m/s">2</parameter><parameter name="T" units="s">4</parameter>
<parameter name="L" units="m">4</parameter></parameters>
<system><bodies><ground><name>Base</name></ground><rigidBody><name>A</name><mass>1</mass>
<moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi></rigidBody></bodies>
<joints><cylindrical><name>J</name><parent><name>Base</name><axis><z>1</z></axis></parent>
<child><name>A</name></child></cylindrical></joints>
<motions><jointMotion><name>M</name><joint>J</joint><coordinate>{coordinate}</coordinate>
<law><polynomial><c{k}{units}>{value}</c{k}></polynomial></law></jointMotion></motions>
<loads><concentrated><name>P</name><body>A</body><force><zForce>1</zForce></force>
<law><polynomial><c1>{factor}</c1></polynomial></law></concentrated></loads></system>
<simulation>
<deltaT>0.01</deltaT><tFinal>1</tFinal><assembly velocity="asGiven"/></simulation></data>
"""
REVOLUTION = 2.0 * math.pi


@pytest.fixture
def model(tmp_path):
    def read(value, k=1, units="", coordinate="angle", factor="1"):
        path = tmp_path / "deck.xml"
        units = f' units="{units}"' if units else ""
        given = {"value": value, "k": k, "units": units, "factor": factor}
        path.write_text(DECK.format(coordinate=coordinate, **given))
        return read_deck(path)

    return read


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"value": "60", "units": "rpm"}, REVOLUTION),
        ({"value": "90", "units": "deg/sec"}, REVOLUTION / 4),
        ({"value": "90", "units": "deg"}, REVOLUTION / 4),
        ({"value": "90", "units": "deg/s^2", "k": 2}, REVOLUTION / 4),
        ({"value": "7", "k": 5}, 7.0),
        ({"value": "9", "units": "mm/sec^3", "k": 3, "coordinate": "slide"}, 0.009),
        ({"value": "{w}"}, REVOLUTION / 2),
        ({"value": "{2*w}", "units": "rpm"}, REVOLUTION),
        ({"value": "{w/T}", "units": "deg/sec^2", "k": 2}, REVOLUTION / 8),
        ({"value": "{1/T}"}, 0.25),
        ({"value": "{3}", "units": "rpm"}, REVOLUTION / 20),
        ({"value": "{v/T}", "k": 2, "coordinate": "slide"}, 0.5),
    ],
)
def test_units_of_coefficients(model, given, expected):
    (motion,) = model(**given).motions
    # Two roundings: of the unit and of the expression.
    assert motion.law.numbers[given.get("k", 1)] == pytest.approx(expected, rel=4e-16)


def test_factors_of_loads_have_plain_coefficients(model):
    (load,) = model("0", factor="{1/T}").loads
    assert load.law.numbers[1] == 0.25


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"value": "1", "units": "m/sec"}, "expected a unit such as rad/s"),
        ({"value": "1", "units": "rpm", "coordinate": "slide"}, "expected a unit such as m/sec"),
        ({"value": "1", "units": "deg/sec", "k": 2}, "did you mean deg/sec^2"),
        ({"value": "{L}"}, "{L} is m; expected rad/s or m/s"),
        ({"value": "{v}"}, "'m/sec' does not fit here"),
        ({"value": "{w}", "units": "deg"}, "{w} is rad/s; expected what 'deg' measures"),
        ({"value": "0", "factor": "{w}"}, "it is a plain number here; delete units"),
    ],
)  # fmt: skip
def test_units_that_do_not_fit(model, given, message):
    with pytest.raises(DeckError) as error:
        model(**given)
    assert message in str(error.value)
