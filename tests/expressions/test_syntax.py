"""Expressions: precedence, names, faults with their columns, bounds."""

import copy
import math
import pickle

import pytest

from msahl.expressions.evaluate import evaluate
from msahl.expressions.syntax import (
    FUNCTIONS,
    MAX_DEPTH,
    MAX_LENGTH,
    MAX_SIZE,
    Call,
    ExpressionError,
    Lookup,
    Name,
    Number,
    check_names,
    inside_braces,
    parse,
    postorder,
)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2*3", 7.0),
        ("2*3^2", 18.0),
        ("2^3^2", 512.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("2^-2^2", 2.0**-4),
        ("6/3/2", 1.0),
        ("1 - 2 - 3", -4.0),
        ("2 - -3", 5.0),
        ("+3", 3.0),
        ("(1 + 2)*3", 9.0),
        (".5e1 + 1.", 6.0),
        ("not 1 < 2 or 3 > 2", 1.0),
        ("not (1 < 2 or 3 > 2)", 0.0),
        ("1 or 0 and 0", 1.0),
        ("1 + 1 == 2", 1.0),
        ("1 != 1", 0.0),
        ("2 <= 2 and 2 >= 2", 1.0),
        ("min(3, 1, 2)", 1.0),
        ("max(3, 1, 7, 2)", 7.0),
        ("sin(pi/6)", math.sin(math.pi / 6)),
        ("lambda*in", 6.0),
    ],
)
def test_precedence_is_that_of_mathematics(text, value):
    assert evaluate(parse(text), {"lambda": 2.0, "in": 3.0}) == value


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("L", "L"),
        ("Crank.angle", "Crank.angle"),
        ("'Crank-1'.angle", "Crank-1.angle"),
        ("FL.Wheel.angle", "FL.Wheel.angle"),
        ('FL."Wheel 2".angle', "FL.Wheel 2.angle"),
        ("'sin'", "sin"),
        ("Größe", "Größe"),
    ],
)
def test_names(text, name):
    assert parse(text) == Name(name)


def test_records_of_a_tree():
    tree = parse("gas(a, 2) - 3")
    assert tree == Call("-", (Lookup("gas", (Name("a"), Number(2.0))), Number(3.0)))
    assert [node.column for node in postorder(tree)] == [5, 8, 1, 13, 11]


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("", 1, "empty"),
        ("1 +", 4, "ends too early"),
        ("(1", 1, "not closed"),
        ("1)", 2, "no parenthesis is open"),
        ("2 L", 3, "operator is missing"),
        ("1,5", 2, "decimal is written with a point"),
        ("a < b < c", 7, "a < b and b < c"),
        ("2**3", 2, "written ^"),
        ("a = b", 3, "written =="),
        ("sin(1, 2)", 1, "sin takes 1 argument, not 2"),
        ("min(1)", 1, "at least 2 arguments, not 1"),
        ("cos", 1, "write cos(...)"),
        ("1e999", 1, "too large"),
        ("x[0]", 2, "use parentheses"),
        ("'x", 1, "not closed"),
        ("f(1, 2, 3)", 1, "one or two"),
        ("* 2", 1, "a value is missing"),
        ("x$", 2, "no meaning"),
    ],
)
def test_faults_have_their_column(text, column, message):
    with pytest.raises(ExpressionError) as error:
        parse(text)
    assert error.value.column == column
    assert message in error.value.message


@pytest.mark.parametrize(
    "text",
    [
        "(" * 10**5,
        "-" * (MAX_LENGTH - 1),
        "+".join("1" * (MAX_SIZE + 1)),
        "1^" * 4000 + "1",
        "sin(" * 999,
    ],
)
def test_texts_are_bounded(text):
    with pytest.raises(ExpressionError):
        parse(text)


def test_nesting_up_to_the_bound_is_read():
    inside = MAX_DEPTH - 1
    assert evaluate(parse("(" * inside + "1" + ")" * inside), {}) == 1.0
    assert evaluate(parse("+".join("1" * (MAX_SIZE // 2))), {}) == MAX_SIZE // 2


@pytest.mark.parametrize("text", ["+".join(["table(x) + -2"] * 300), "+".join("x" * 990)])
def test_long_expressions_are_records_like_all_others(text):
    """They are deeper than Python's stack; models are compared, hashed, shown, copied and sent."""
    tree = parse(text)
    assert tree == parse(f" {text} ") != parse(f"{text} + 1")
    assert hash(tree) == hash(parse(f" {text} "))
    assert repr(tree) == repr(parse(text)) != repr(parse(f"{text} - 1"))
    for copied in (pickle.loads(pickle.dumps(tree)), copy.deepcopy(tree)):
        assert copied == tree
        assert [n.column for n in postorder(copied)] == [n.column for n in postorder(tree)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("lenght/2", "did you mean length?"),
        ("Crank.angel", "did you mean Crank.angle?"),
        ("sni(2)", "did you mean sin"),
        ("gas", "write gas(x)"),
        ("length(2)", "to multiply write length*(...)"),
        ("zzz", "known here: length, Crank.angle"),
    ],
)
def test_unknown_names_have_the_nearest_told(text, message):
    with pytest.raises(ExpressionError) as error:
        check_names(parse(text), ("length", "Crank.angle"), ("gas",))
    assert message in error.value.message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1/x", "division by zero"),
        ("mod(1, x)", "division by zero"),
        ("x^-1", "division by zero"),
        ("step(1, x, 0, x, 1)", "division by zero"),
        ("log(x)", "log(0) is not a real number"),
        ("sqrt(x - 1)", "sqrt(-1) is not a real number"),
        ("(-8)^(1/3)", "is not a real number"),
        ("exp(1000)", "too large"),
        ("1e200*1e200", "too large"),
        ("floor(1e308*10)", "too large"),
    ],
)
def test_values_that_do_not_exist(text, message):
    with pytest.raises(ExpressionError) as error:
        evaluate(parse(text), {"x": 0.0})
    assert message in error.value.message


def test_what_a_condition_excludes_needs_no_value():
    assert evaluate(parse("where(x > 0, log(x), 7)"), {"x": 0.0}) == 7.0
    assert evaluate(parse("x > 0 and 1/x > 1"), {"x": 0.0}) == 0.0
    assert evaluate(parse("x == 0 or 1/x > 1"), {"x": 0.0}) == 1.0


def test_values_of_all_functions():
    a = 0.3
    values = {
        "atan2": math.atan2(a, a),
        "hypot": math.hypot(a, a),
        "mod": 0.0,
        "where": a,
        "step": a,
        "min": a,
        "max": a,
        "floor": 0.0,
        "sign": 1.0,
        "abs": a,
    }
    for name, count in FUNCTIONS.items():
        expected = values[name] if name in values else getattr(math, name)(a)
        arguments = "0.5, 0, 0, 1, 0.6" if name == "step" else ", ".join(["x"] * count)
        assert evaluate(parse(f"{name}({arguments})"), {"x": a}) == pytest.approx(
            expected, abs=1e-16
        )
    assert evaluate(parse("mod(-1, 3)"), {}) == 2.0
    assert evaluate(parse("sign(-2)*sign(0)"), {}) == 0.0


def test_tables_are_called():
    tables = {"gas": lambda x: 2.0 * x, "map": lambda x, y: x - y}
    assert evaluate(parse("gas(3) + map(1, 2)"), {}, tables) == 5.0


def test_braces():
    assert inside_braces(" { L/2 } ") == " L/2 "
    assert inside_braces("L/2") is None
    assert inside_braces("{") is None
