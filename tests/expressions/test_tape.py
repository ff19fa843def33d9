"""Tapes: values are those of the trees, gradients those of a complex step through the trees."""

import cmath
import math

import numpy as np
import pytest

from msahl.algebra import surfaces
from msahl.algebra.functions import Law
from msahl.algebra.surfaces import Surface, build_surfaces
from msahl.expressions.conditions import margin
from msahl.expressions.evaluate import evaluate
from msahl.expressions.syntax import Call, Lookup, Name, Number, parse
from msahl.expressions.tape import (
    BINARY,
    UNARY,
    build_tape,
    by_input,
    gradient,
    new_values,
    set_input,
    sweep,
)
from msahl.jit.compiled import compiled

NAMES = ("x", "y", "z")
TINY = 1e-30
"""Imaginary step: its square vanishes beside 1, so the derivative has round-off alone."""

COMPLEX = {
    "negate": lambda a: -a,
    "not": lambda a: 0j if a.real else 1 + 0j,
    "abs": lambda a: -a if a.real < 0 else a,
    "sign": lambda a: np.sign(a.real) + 0j,
    "floor": lambda a: math.floor(a.real) + 0j,
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "^": lambda a, b: cmath.exp(b * cmath.log(a)),
    "<": lambda a, b: float(a.real < b.real) + 0j,
    "<=": lambda a, b: float(a.real <= b.real) + 0j,
    ">": lambda a, b: float(a.real > b.real) + 0j,
    ">=": lambda a, b: float(a.real >= b.real) + 0j,
    "==": lambda a, b: float(a.real == b.real) + 0j,
    "!=": lambda a, b: float(a.real != b.real) + 0j,
    "and": lambda a, b: float(bool(a.real) and bool(b.real)) + 0j,
    "or": lambda a, b: float(bool(a.real) or bool(b.real)) + 0j,
    "atan2": lambda a, b: (
        math.atan2(a.real, b.real) + 1j * (b.real * a.imag - a.real * b.imag) / abs(a + 1j * b) ** 2
    ),
    "min": lambda a, b: b if b.real < a.real else a,
    "max": lambda a, b: b if b.real > a.real else a,
    "hypot": lambda a, b: cmath.sqrt(a * a + b * b),
    "mod": lambda a, b: a - b * math.floor((a / b).real),
    "where": lambda c, a, b: a if c.real else b,
    "step": lambda x, x0, y0, x1, y1: _step((x - x0) / (x1 - x0), y0, y1),
}


def _step(u, y0, y1):
    u = 0j if u.real < 0.0 else 1 + 0j if u.real > 1.0 else u
    return y0 + (y1 - y0) * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)


def complex_value(tree, names):
    match tree:
        case Number(value):
            return complex(value)
        case Name(text):
            return names[text]
        case Call(function, arguments):
            given = [complex_value(argument, names) for argument in arguments]
            return COMPLEX.get(function, getattr(cmath, function, None))(*given)
    raise AssertionError(tree)


def positive(tree):
    """1/2 + tree^2: an argument for functions with a half of the numbers."""
    return Call("+", (Number(0.5), Call("*", (tree, tree))))


def fraction(tree):
    """0.9 sin(tree): an argument of asin and acos."""
    return Call("*", (Number(0.9), Call("sin", (tree,))))


USED = tuple(name for name in BINARY if name not in ("both", "either"))
"""Operations that a deck can have; the others join conditions."""


def random_tree(rng, depth):
    """A tree of all operations, each within its domain, of values near one."""
    if depth == 0 or rng.random() < 0.1:
        return Name(str(rng.choice(NAMES))) if rng.random() < 0.8 else Number(rng.normal())
    kind = rng.random()
    if kind < 0.35:
        name = str(rng.choice(UNARY))
        given = random_tree(rng, depth - 1)
        if name in ("log", "sqrt"):
            given = positive(given)
        if name in ("asin", "acos", "exp", "sinh", "cosh", "tan"):
            given = fraction(given)
        return Call(name, (given,))
    if kind < 0.9:
        name = str(rng.choice(USED))
        a, b = random_tree(rng, depth - 1), random_tree(rng, depth - 1)
        if name in ("/", "mod", "hypot"):
            b = positive(b)
        if name == "^":
            a, b = positive(fraction(a)), fraction(b)
        if name == "atan2":
            b = positive(b)
        return Call(name, (a, b))
    if kind < 0.95:
        return Call("where", tuple(random_tree(rng, depth - 1) for _ in range(3)))
    x, y0, y1 = (random_tree(rng, depth - 1) for _ in range(3))
    return Call("step", (x, Number(-1.0), y0, Number(1.5), y1))


@pytest.mark.parametrize("seed", range(40))
def test_values_and_gradients_of_random_expressions(seed):
    rng = np.random.default_rng(seed)
    trees = [random_tree(rng, 6) for _ in range(5)]
    tape, places = build_tape(trees, NAMES, {}, {})
    values, numbers = new_values(tape), rng.normal(size=3)
    for j, number in enumerate(numbers):
        set_input(tape, values, j, number)
    sweep(tape, values)
    known = dict(zip(NAMES, numbers.tolist(), strict=True))
    for tree, place in zip(trees, places, strict=True):
        # The same operations, but for powers within step.
        value = evaluate(tree, known)
        assert values.value[place] == pytest.approx(value, rel=1e-13, abs=1e-13)
        gradient(tape, values, place)
        for j, name in enumerate(NAMES):
            there = {n: complex(v, TINY * (n == name)) for n, v in known.items()}
            slope = complex_value(tree, there).imag / TINY
            # Sums of products of both signs: round-off of their largest terms.
            size = 1.0 + np.abs(values.adjoint).max() * np.abs(values.value).max()
            assert by_input(tape, values, j) == pytest.approx(slope, rel=1e-12, abs=1e-14 * size)


def test_equal_parts_are_computed_once():
    tape, places = build_tape(
        [parse("sin(x*y) + 1"), parse("error^2"), parse("sin(x*y) - 1")],
        ("x", "y"),
        {"error": parse("sin(x*y)")},
        {},
    )
    assert tape.op.size == 5  # x*y, sin, + 1, ^ 2, - 1
    assert len(set(places.tolist())) == 3


def test_chains_of_names_may_be_longer_than_the_stack():
    named = {f"s{i}": parse(f"s{i + 1} + s{i + 1}/100") for i in range(3000)}
    tape, (place,) = build_tape([parse("s0")], ("x", "s3000"), named, {})
    assert tape.op.size == 6000
    values = new_values(tape)
    set_input(tape, values, 1, 2.0)
    sweep(tape, values)
    assert values.value[place] == pytest.approx(
        2.0 * 1.01**3000
    )  # round-off of 6000 operations: 7e-13


@pytest.mark.parametrize(
    ("text", "at", "value", "slope"),
    [
        ("sqrt(x)", 0.0, 0.0, 0.0),
        ("hypot(x, 0)", 0.0, 0.0, 0.0),
        ("x^0.5", 0.0, 0.0, 0.0),
        ("x^2", 0.0, 0.0, 0.0),
        ("x^1", 0.0, 0.0, 1.0),
        ("where(x > 0, log(x), 0)", -1.0, 0.0, 0.0),
        ("where(x < 0, sqrt(x), x)", 2.0, 2.0, 1.0),
        ("asin(x)", 1.0, math.pi / 2, 0.0),
        ("atan2(x, 0*x)", 0.0, 0.0, 0.0),
    ],
)
def test_at_the_ends_of_their_domains_functions_have_finite_derivatives(text, at, value, slope):
    tape, (place,) = build_tape([parse(text)], ("x",), {}, {})
    values = new_values(tape)
    set_input(tape, values, 0, at)
    sweep(tape, values)
    gradient(tape, values, place)
    assert values.value[place] == value
    assert by_input(tape, values, 0) == slope


def test_outside_of_its_domain_a_function_is_nan_and_an_overflow_infinite():
    trees = [
        parse(text) for text in ("log(x)", "sqrt(x)", "asin(2*x)", "exp(-1000*x)", "cosh(x*1e4)")
    ]
    tape, places = build_tape(trees, ("x",), {}, {})
    values = new_values(tape)
    set_input(tape, values, 0, -1.0)
    sweep(tape, values)
    found = values.value[places]
    assert np.isnan(found[:3]).all()
    assert np.isinf(found[3:]).all()


def test_no_function_loses_a_nan():
    """But a condition guards the one after it, whose margin may then be none."""
    texts = ("max(0, sqrt(x))", "max(sqrt(x), 0)", "min(0, log(x))", "min(log(x), 0)", "y + log(x)")
    guarded = (
        margin(parse("x > 0 and log(x) > -9")),
        margin(parse("not (x <= 0 or log(x) < -9)")),
    )
    tape, places = build_tape([*map(parse, texts), *guarded], ("x", "y"), {}, {})
    values = new_values(tape)
    for run in (sweep, compiled(sweep)):
        set_input(tape, values, 0, -0.5)
        run(tape, values)
        assert np.isnan(values.value[places[: len(texts)]]).all()
        assert values.value[places[len(texts) :]].tolist() == [-0.5, -0.5]
        set_input(tape, values, 0, 4.0)
        run(tape, values)
        assert values.value[places[len(texts) :]].tolist() == [4.0, 4.0]


def test_compiled_code_gives_the_same_values():
    rng = np.random.default_rng(1)
    trees = [random_tree(rng, 5) for _ in range(20)]
    table = {"cam": Law("cubic", (0.0, 1.0, 2.0, 0.0, 3.0, 1.0))}
    trees.append(parse("cam(x + 1)"))
    tape, places = build_tape(trees, NAMES, {}, table)
    plain, fast = new_values(tape), new_values(tape)
    for values, run in ((plain, sweep), (fast, compiled(sweep))):
        for j in range(3):
            set_input(tape, values, j, 0.3 + 0.4 * j)
        run(tape, values)
    assert fast.value[places] == pytest.approx(plain.value[places], rel=1e-14)


X, Y = (0.0, 0.5, 2.0, 3.0), (-1.0, 0.0, 0.4, 2.0, 3.0)


@pytest.mark.parametrize("kind", ["linear", "cubic"])
def test_tables_of_two_variables(kind):
    """They pass through their entries, have the derivatives of differences, and end at edges."""
    rng = np.random.default_rng(2)
    entries = rng.normal(size=(4, 5))
    table = build_surfaces([Surface(kind, X, Y, tuple(map(tuple, entries.tolist())))])
    for i, x in enumerate(X):
        for j, y in enumerate(Y):
            assert surfaces.evaluate(table, 0, x, y)[0] == pytest.approx(entries[i, j], abs=1e-13)
    h = 1e-6
    for x, y in rng.uniform((0.0, -1.0), (3.0, 3.0), size=(50, 2)):
        _, by_x, by_y = surfaces.evaluate(table, 0, x, y)
        ahead = surfaces.evaluate(table, 0, x + h, y)[0] - surfaces.evaluate(table, 0, x - h, y)[0]
        # Second differences of numbers near one over h^2, and round-off over h.
        assert by_x == pytest.approx(ahead / (2 * h), abs=1e-4 if kind == "linear" else 1e-7)
        ahead = surfaces.evaluate(table, 0, x, y + h)[0] - surfaces.evaluate(table, 0, x, y - h)[0]
        assert by_y == pytest.approx(ahead / (2 * h), abs=1e-4 if kind == "linear" else 1e-7)
    inside, beyond = surfaces.evaluate(table, 0, 3.0, 0.2), surfaces.evaluate(table, 0, 7.0, 0.2)
    assert beyond == (inside[0], 0.0, inside[2])


def test_a_cubic_table_reproduces_cubic_polynomials():
    def f(x, y):
        return 1.0 + x**3 * y - 2.0 * x * y**2 + y**3

    values = tuple(tuple(f(x, y) for y in Y) for x in X)
    table = build_surfaces([Surface("cubic", X, Y, values)])
    for x, y in ((0.2, 0.1), (1.7, 2.2), (2.9, -0.8)):
        value, by_x, by_y = surfaces.evaluate(table, 0, x, y)
        # Not-a-knot splines of four and five entries are the polynomial itself.
        assert value == pytest.approx(f(x, y), rel=1e-13)
        assert by_x == pytest.approx(3 * x**2 * y - 2 * y**2, abs=1e-12)
        assert by_y == pytest.approx(x**3 - 4 * x * y + 3 * y**2, abs=1e-12)


def test_a_table_of_one_entry_of_a_lookup():
    tree = Lookup("map", (Name("x"), parse("2*x")))
    table = Surface("linear", (0.0, 1.0), (0.0, 2.0), ((0.0, 0.0), (0.0, 1.0)))
    tape, (place,) = build_tape([tree], ("x",), {}, {"map": table})
    values = new_values(tape)
    set_input(tape, values, 0, 0.5)
    sweep(tape, values)
    gradient(tape, values, place)
    assert values.value[place] == 0.25  # x y/2 with y = 2 x
    assert by_input(tape, values, 0) == 1.0  # 2 x
