"""Texts of --set and --over become values, units, distributions, or a message."""

import pytest

from msahl.sweep.axes import Column, number_text, parse_over, parse_set
from msahl.sweep.faults import PlanError


@pytest.mark.parametrize(
    ("text", "unit", "cells"),
    [
        ("L=0.5,1,2", "", ("0.5", "1", "2")),
        ("L=60,80, 100 cm", "cm", ("60", "80", "100")),
        ("L=60 cm,1 m", "", ("60 cm", "1 m")),
        ("L=1 m,2 m", "m", ("1", "2")),
        ("Bob.mass=1:10:5", "", ("1", "3.25", "5.5", "7.75", "10")),
        ("L=60:100:3 cm", "cm", ("60", "80", "100")),
        ("k=1:100:3:log", "", ("1", "10", "100")),
        ("x=3:3:1", "", ("3",)),
        ("x=-1:1:3,5", "", ("-1", "0", "1", "5")),
        ("L={a/2},{max(a,b)} cm", "cm", ("{a/2}", "{max(a,b)}")),
        ("L=1e-3", "", ("0.001",)),
    ],
)
def test_lists_and_ranges(text, unit, cells):
    axis = parse_set(text)
    assert (axis.column.unit, axis.cells) == (unit, cells)


def test_a_condition_is_one_value_whatever_it_contains():
    axis = parse_set("simulation.stop.when=Crank.angle > max(1,2)")
    assert axis.cells == ("Crank.angle > max(1,2)",)
    assert axis.column.setting(axis.cells[0]) == "simulation.stop.when=Crank.angle > max(1,2)"


def test_cells_become_settings_with_their_unit():
    assert Column("L", "cm").setting("80") == "L=80 cm"
    assert Column.of_head("L [cm]") == Column("L", "cm")
    assert Column.of_head("--t-final") == Column("t_final", option=True)
    assert Column("t_final", option=True).head == "--t-final"


def test_options_have_their_types():
    assert Column("every", option=True).option_value("10") == 10
    assert Column("dt", option=True).option_value("1e-3") == 1e-3
    assert Column("full", option=True).option_value("yes") is True
    assert parse_over("scheme=gauss2, preserving").cells == ("gauss2", "preserving")
    assert parse_over("--t-final=1,2").column.name == "t_final"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("L", "write NAME=VALUES"),
        ("L=", "write NAME=VALUES"),
        ("L=a", "'a' is not a value"),
        ("L=1,,2", "'' is not a value"),
        ("L=1:2", "'1:2' is not a value"),
        ("L=1:2:0", "at least one value"),
        ("L=1:2:1", "no two ends"),
        ("L=0:2:3:log", "positive"),
        ("L=1:2:99999999999", "more than"),
        ("L=1:1e999:3", "too large"),
        ("L=1,1e999", "1e999 is too large"),
        ("L~uniform(1)", "uniform takes 2 numbers: least, most"),
        ("L~uniform(2,1)", "smaller than the most"),
        ("L~normal(0,0)", "standard deviation is positive"),
        ("L~loguniform(0,1)", "positive"),
        ("L~triangular(0,2,1)", "between the least and the most"),
        ("L~truncnormal(0,1,2,1)", "smaller than the most"),
        ("L~cauchy(0,1)", "expected one of uniform"),
        ("L\n=1", "write NAME=VALUES"),
    ],
)
def test_faults_of_set(text, words):
    with pytest.raises(PlanError, match="--set") as fault:
        parse_set(text)
    assert words in str(fault.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("stride=1", "no option '--stride'"),
        ("scheme=euler,gauss2", "'euler' is not one of preserving"),
        ("dt=0.1 s", "omit the unit"),
        ("every=1.5", "not an integer"),
        ("damping=2", "out of range"),
        ("accuracy=0", "out of range"),
        ("scheme~uniform(0,1)", "only numbers"),
        ("dt~uniform(1,2) s", "omit the unit"),
    ],
)
def test_faults_of_over(text, words):
    with pytest.raises(PlanError) as fault:
        parse_over(text)
    assert words in str(fault.value)


def test_numbers_read_back_to_the_same_double():
    for value in (0.1, 1 / 3, 1e300, -2.0, 5e-324):
        assert float(number_text(value)) == value
    assert number_text(3.0) == "3"


def test_a_range_has_short_numbers():
    """By np.linspace the third number is 0.30000000000000004."""
    assert parse_set("a=0.1:0.5:5").cells == ("0.1", "0.2", "0.3", "0.4", "0.5")
    assert parse_set("a=1:1e3:4:log").cells == ("1", "10", "100", "1000")
    assert parse_set("a=0:1:4").cells[1] == repr(1 / 3)
