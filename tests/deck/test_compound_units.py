"""Units of parameters: products and powers of others, with exact factors."""

from fractions import Fraction

import pytest

from msahl.deck.units import UNITS, dimension_of, parse_unit


@pytest.mark.parametrize("quantity", UNITS)
def test_units_of_elements_are_read_with_the_same_factors(quantity):
    for name, factor in UNITS[quantity].items():
        unit = parse_unit(name)
        assert unit is not None
        assert unit.factor == factor
        assert unit.dimension == dimension_of(quantity)


@pytest.mark.parametrize(
    ("name", "factor", "dimension"),
    [
        ("kg/m^3", 1, "kg/m^3"),
        ("g/cm^3", 1000, "kg/m^3"),
        ("V", 1, "kg-m^2/s^3-A"),
        ("mH", Fraction(1, 1000), "kg-m^2/s^2-A^2"),
        ("N-m/A", 1, "kg-m^2/s^2-A"),
        ("1/s", 1, "1/s"),
        ("s^-1", 1, "1/s"),
        ("kW", 1000, "kg-m^2/s^3"),
        ("1", 1, "a pure number"),
    ],
)
def test_compound_units(name, factor, dimension):
    unit = parse_unit(name)
    assert unit is not None
    assert unit.factor == factor
    assert str(unit.dimension) == dimension


@pytest.mark.parametrize(
    "name", ["", "kq", "kg/", "kg--m", "m/s/s", "m^12", "m^0", "-m", "m" * 999]
)
def test_what_is_no_unit(name):
    assert parse_unit(name) is None


@pytest.mark.parametrize("name", ["kg-m/s^2", "kg/m^3", "A", "1/s^2", "m^2"])
def test_the_text_of_a_dimension_is_its_unit(name):
    unit = parse_unit(name)
    assert unit is not None
    assert parse_unit(str(unit.dimension)) == unit
