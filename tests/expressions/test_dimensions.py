"""Dimensions of expressions: what fits, what contradicts, in decks and in laws of motion."""

from fractions import Fraction

import pytest

from msahl.deck.units import parse_unit
from msahl.expressions.dimensions import Dimension, TableDimensions, dimension
from msahl.expressions.syntax import ExpressionError, parse

NAMES = {
    name: parse_unit(unit).dimension
    for name, unit in {
        "L": "m", "r": "m", "m": "kg", "T": "s", "a": "rad", "k": "N-m/rad", "n": "1",
        "rho": "kg/m^3", "w": "rad/s", "i": "A",
    }.items()
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("rho*pi*r^2*L", "kg"),
        ("m*L^2/12", "kg-m^2"),
        ("sqrt(L*r)", "m"),
        ("L^0.5*L^(1/2)", "m"),
        ("L/r", "a pure number"),
        ("k*a", "kg-m^2/s^2"),
        ("atan2(L, r)", "rad"),
        ("asin(L/r)", "rad"),
        ("a + 0.1", "rad"),
        ("1/T + w", "rad/s"),
        ("sin(a)", "a pure number"),
        ("where(L > r, L, 2*r)", "m"),
        ("max(L, 0)", "m"),
        ("L^n", "m^2"),
        ("step(T, 0, L, 2*T, r)", "m"),
        ("mod(L, r)", "m"),
        ("hypot(L, r)", "m"),
        ("-abs(L)", "m"),
        ("not L > 0 and sign(m)", "a pure number"),
        ("sqrt(L)", "m^(1/2)"),
    ],
)
def test_dimensions(text, expected):
    assert str(dimension(parse(text), NAMES, constants={"n": 2.0})) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("L + m", "'+' joins m and kg"),
        ("L + 1", "'+' joins m and a pure number"),
        ("sin(L)", "argument of sin is a pure number, not m"),
        ("2^L", "exponent is a pure number, not m"),
        ("L^a", "must be a number"),
        ("L < m", "'<' joins"),
        ("where(1, L, m)", "'where' joins"),
        ("step(T, 0, L, r, L)", "'step' joins s and m"),
        ("exp(m)", "argument of exp"),
        ("L^1000", "the most"),
        ("q", "unknown name 'q'"),
    ],
)
def test_contradictions_of_numbers(text, message):
    with pytest.raises(ExpressionError) as error:
        dimension(parse(text), NAMES)
    assert message in error.value.message


def test_laws_of_motion_take_literals_in_si():
    assert dimension(parse("L + 1"), NAMES, None) == NAMES["L"]
    assert dimension(parse("3*L + m"), NAMES, None) == NAMES["m"]
    with pytest.raises(ExpressionError):
        dimension(parse("L + 1 + m"), NAMES, None)


def test_tables_have_dimensions():
    tables = {"gas": TableDimensions((NAMES["a"], None), NAMES["m"])}
    assert dimension(parse("gas(a, L)"), NAMES, tables=tables) == NAMES["m"]
    for text in ("gas(L, L)", "gas(a)"):
        with pytest.raises(ExpressionError, match="gas"):
            dimension(parse(text), NAMES, tables=tables)


def test_exponents_are_fractions():
    assert dimension(parse("(L*r*L)^(1/3)"), NAMES) == Dimension(m=Fraction(1))
