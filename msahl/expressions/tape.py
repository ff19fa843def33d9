"""Expressions as a tape: values of many expressions and their gradients, by one generic kernel.

A tape is a list of operations, each on values that were computed before it:

    value = constants, inputs, results of the operations in their order

One sweep over the tape computes all expressions (``sweep``), one sweep backwards the gradient of
one of them by all inputs (``gradient``): with adjoint_i = d(result)/d(value_i), each operation adds
its adjoint times its own derivatives to the adjoints of its operands. Equal parts of expressions
are computed once. A tape is data, so no model compiles anything for its expressions.

Where a function has no derivative (``sign``, ``floor``, comparisons; ``abs``, ``min``, ``where`` at
the place where they change over) it is that of the branch taken. ``sqrt``, ``asin``, ``acos``,
``hypot`` and powers have the derivative zero where it is infinite: it serves Newton's method, which
then converges more slowly there. Values outside a function's domain are nan, and do no harm in a
branch that is not taken. ``both`` and ``either`` are the smaller and the larger margin of two
conditions (``expressions.conditions``).

Where an expression changes its formula, the tape has a *switch*: a value that is constant between
such places, and a *margin*, at whose level it changes:

    expression                                      switch       margin         level
    a < b, a <= b, a > b, a >= b                    0 or 1       b - a, a - b   0
    min(a, b), max(a, b): which of both             0 or 1       b - a, a - b   0
    sign(x), abs(x) = x sign(x)                     -1 or 1      x              0
    floor(x), mod(x, y) = x - y floor(x/y)          floor        x, x/y         integers

A step that is to be smooth holds its switches at the values that they have in it (``held``), also
where the margin is beyond: then its formula goes on, and where the margin is at its level is found.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from msahl.algebra import functions, surfaces
from msahl.algebra.functions import Law, Laws, build_laws
from msahl.algebra.surfaces import Surface, Surfaces, build_surfaces
from msahl.expressions.syntax import Call, Lookup, Name, Number, Tree
from msahl.jit.kernel import apart, kernel

UNARY = (
    *("negate", "not", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("exp", "log", "sqrt", "sign", "floor"),
)
BINARY = (
    *("+", "-", "*", "/", "^", "<", "<=", ">", ">=", "==", "!=", "and", "or"),
    *("atan2", "hypot", "both", "either"),
)
(
    NEGATE,
    NOT,
    SIN,
    COS,
    TAN,
    ASIN,
    ACOS,
    ATAN,
    SINH,
    COSH,
    TANH,
    EXP,
    LOG,
    SQRT,
    SIGN,
    FLOOR,
) = range(len(UNARY))
FIRST_BINARY = len(UNARY)
(
    ADD,
    SUBTRACT,
    MULTIPLY,
    DIVIDE,
    POWER,
    LESS,
    AT_MOST,
    GREATER,
    AT_LEAST,
    EQUAL,
    UNEQUAL,
    AND,
    OR,
    ATAN2,
    HYPOT,
    BOTH,
    EITHER,
) = range(FIRST_BINARY, FIRST_BINARY + len(BINARY))
WHERE, CURVE, SURFACE, HELD = range(FIRST_BINARY + len(BINARY), FIRST_BINARY + len(BINARY) + 4)
"""Choice between two values; tables of one and of two variables; which side a switch is on."""

FREE = 9e99
"""Value of ``Tape.held`` where a switch follows its argument. It is a number, so that differences
of tapes are numbers, too."""

CODES: Mapping[str, int] = {name: code for code, name in enumerate((*UNARY, *BINARY, "where"))}
LARGEST_EXPONENT = 709.0
"""Of e, above which the power is infinite; Python's own functions would raise there."""


class Tape(NamedTuple):
    """Operations on values; ``a``, ``b`` and ``c`` are places of operands among the values."""

    constant: np.ndarray  # (k,) the first values
    inputs: int  # number of inputs, which come next
    op: np.ndarray  # (m,) code of each operation
    a: np.ndarray  # (m,)
    b: np.ndarray  # (m,)
    c: np.ndarray  # (m,) of a table its number
    laws: Laws  # tables of one variable
    surfaces: Surfaces  # tables of two
    held: np.ndarray  # (s,) held values of the switches, or FREE
    switches: "Switches"


class Switches(NamedTuple):
    """The switches of a tape, in the order of its operations; see the top of this module."""

    margin: np.ndarray  # (s,) place of the margin
    free: np.ndarray  # (s,) place of the switch's own value
    integers: np.ndarray  # (s,) whether the levels of the margin are all integers
    jumps: np.ndarray  # (s,) whether an expression may jump there; else it has a kink


class Values(NamedTuple):
    """Work arrays of a tape, (k + inputs + m,) each."""

    value: np.ndarray
    adjoint: np.ndarray


Table: TypeAlias = Law | Surface
Part: TypeAlias = tuple[str, int]
"""Where a value stands: among the constants, the inputs or the operations, and its number there."""


def new_values(tape: Tape) -> Values:
    """Return the work arrays of a ``tape``, its constants set."""
    value = np.zeros(tape.constant.size + tape.inputs + tape.op.size)
    values = Values(value, np.zeros_like(value))
    set_constants(tape, values)
    return values


def set_constants(tape: Tape, values: Values) -> None:
    """Set the constants among the values of a ``tape``."""
    values.value[: tape.constant.size] = tape.constant


def build_tape(
    trees: Sequence[Tree],
    inputs: Sequence[str],
    named: Mapping[str, Tree],
    tables: Mapping[str, Table],
) -> tuple[Tape, np.ndarray]:
    """Return the tape that computes all ``trees`` from the ``inputs``, and the place of each one's
    value; ``named`` has the expressions that others name, without circles.
    """
    builder = _Builder(inputs, named, tables)
    parts = [builder.add(tree) for tree in trees]
    return builder.tape(), builder.places(parts)


@dataclass(slots=True)
class _Switch:
    """A switch while the tape grows."""

    margin: Part
    free: Part
    integers: bool
    jumps: bool


class _Builder:
    """A tape while it grows."""

    def __init__(
        self, inputs: Sequence[str], named: Mapping[str, Tree], tables: Mapping[str, Table]
    ) -> None:
        self._named, self._tables = named, tables
        self._inputs = len(inputs)
        self._constants: list[float] = []
        self._operations: list[tuple[int, Part, Part, Part | int]] = []
        self._known: dict[object, Part] = {}
        # Of inputs and of the named expressions met so far.
        self._values: dict[str, Part] = {name: ("input", i) for i, name in enumerate(inputs)}
        self._curves: dict[str, int] = {}
        self._surfaces: dict[str, int] = {}
        self._switches: list[_Switch] = []

    def add(self, tree: Tree) -> Part:
        """Add the operations of a ``tree``; return where its value is. Without recursion: trees and
        chains of named expressions, may be deeper than Python's stack.
        """
        results: list[Part] = []
        waiting: list[tuple[Tree, bool]] = [(tree, False)]
        while waiting:
            node, ready = waiting.pop()
            if isinstance(node, Number):
                results.append(self._constant(node.value))
            elif isinstance(node, Name) and node.text in self._values:
                results.append(self._values[node.text])
            elif not ready:
                waiting.append((node, True))
                inside = (self._named[node.text],) if isinstance(node, Name) else node.arguments
                waiting.extend((argument, False) for argument in reversed(inside))
            elif isinstance(node, Name):
                self._values[node.text] = results[-1]
            else:
                count = len(node.arguments)
                given = results[-count:]
                del results[-count:]
                results.append(self._applied(node, given))
        (result,) = results
        return result

    def _constant(self, value: float) -> Part:
        key = ("constant", value, math.copysign(1.0, value))
        if key not in self._known:
            self._constants.append(value)
            self._known[key] = ("constant", len(self._constants) - 1)
        return self._known[key]

    def _applied(self, node: Call | Lookup, given: list[Part]) -> Part:
        if isinstance(node, Call):
            return self._call(node.function, given)
        table = self._tables[node.table]
        numbers = self._curves if isinstance(table, Law) else self._surfaces
        number = numbers.setdefault(node.table, len(numbers))
        return self._operation(CURVE if isinstance(table, Law) else SURFACE, given, number)

    def _operation(self, code: int, given: Sequence[Part], table: int = 0) -> Part:
        """Add an operation, unless the same one is there already."""
        a, b = given[0], given[1] if len(given) > 1 else given[0]
        c: Part | int = given[2] if len(given) > 2 else table
        key = (code, a, b, c)
        if key not in self._known:
            self._operations.append(key)
            self._known[key] = ("operation", len(self._operations) - 1)
        return self._known[key]

    def _call(self, function: str, given: list[Part]) -> Part:
        """Add the operations of a function or an operator."""
        if function == "step":
            return self._step(given)
        if function in ("min", "max"):
            return self._chosen(function, *given)
        if function in ("<", "<=", ">", ">="):
            return self._compared(function, *given)
        if function in ("sign", "abs"):
            side = self._switch(self._does("sign", *given), given[0], jumps=function == "sign")
            return side if function == "sign" else self._does("*", given[0], side)
        if function in ("floor", "mod"):
            x = given[0] if function == "floor" else self._does("/", *given)
            integers = self._switch(self._does("floor", x), x, jumps=True, integers=True)
            if function == "floor":
                return integers
            return self._does("-", given[0], self._does("*", given[1], integers))
        return self._does(function, *given)

    def _does(self, name: str, *parts: Part) -> Part:
        return self._operation(CODES[name], parts)

    def _compared(self, comparison: str, a: Part, b: Part) -> Part:
        """Add a comparison, whose margin is positive where it holds."""
        margin = self._does("-", *((a, b) if comparison in (">", ">=") else (b, a)))
        return self._switch(self._does(comparison, a, b), margin, jumps=True)

    def _chosen(self, function: str, a: Part, b: Part) -> Part:
        """Add the smaller or the larger of two values: the first if they are equal, and one that is
        no number before all others.
        """
        smaller = function == "min"
        second = self._does("<" if smaller else ">", b, a)
        if a[0] == "constant":
            second = self._does("not", self._does(">=" if smaller else "<=", b, a))
        elif b[0] != "constant":
            second = self._does("or", second, self._does("!=", b, b))
        margin = self._does("-", *((a, b) if smaller else (b, a)))
        return self._operation(WHERE, (self._switch(second, margin, jumps=False), b, a))

    def _switch(self, free: Part, margin: Part, jumps: bool, integers: bool = False) -> Part:
        """Add a switch whose own value is ``free``, unless it is there already."""
        key = (HELD, free)
        if key not in self._known:
            self._switches.append(_Switch(margin, free, integers, jumps))
            self._operations.append((HELD, free, free, len(self._switches) - 1))
            self._known[key] = ("operation", len(self._operations) - 1)
        found = self._known[key]
        switch = self._switches[self._operations[found[1]][3]]  # type: ignore[index]
        switch.jumps = switch.jumps or jumps
        return found

    def _step(self, given: list[Part]) -> Part:
        """Add the operations of ``step(x, x0, y0, x1, y1)``."""
        x, x0, y0, x1, y1 = given
        number = self._constant

        def does(name: str, *parts: Part) -> Part:
            return self._call(name, list(parts))

        u = does("/", does("-", x, x0), does("-", x1, x0))
        u = does("min", does("max", u, number(0.0)), number(1.0))
        cube = does("*", does("*", u, u), u)
        rest = does("-", does("*", number(6.0), does("*", u, u)), does("*", number(15.0), u))
        share = does("*", cube, does("+", number(10.0), rest))
        return does("+", y0, does("*", does("-", y1, y0), share))

    def places(self, parts: Sequence[Part]) -> np.ndarray:
        """(n,) places among the values."""
        inputs = len(self._constants)
        first = {"constant": 0, "input": inputs, "operation": inputs + self._inputs}
        return np.array([first[kind] + number for kind, number in parts], dtype=np.int64)

    def tape(self) -> Tape:
        """Return the tape of all that was added."""
        a, b = (self.places([entry[k] for entry in self._operations]) for k in (1, 2))  # type: ignore[misc]
        last = [entry[3] for entry in self._operations]
        c = [part if isinstance(part, int) else int(self.places([part])[0]) for part in last]
        laws = [self._tables[name] for name in self._curves]
        grids = [self._tables[name] for name in self._surfaces]
        return Tape(
            constant=np.array(self._constants, dtype=float),
            inputs=self._inputs,
            op=np.array([entry[0] for entry in self._operations], dtype=np.int64),
            a=a,
            b=b,
            c=np.array(c, dtype=np.int64),
            laws=build_laws([law for law in laws if isinstance(law, Law)]),
            surfaces=build_surfaces([grid for grid in grids if isinstance(grid, Surface)]),
            held=np.full(len(self._switches), FREE),
            switches=Switches(
                margin=self.places([switch.margin for switch in self._switches]),
                free=self.places([switch.free for switch in self._switches]),
                integers=np.array([switch.integers for switch in self._switches], dtype=bool),
                jumps=np.array([switch.jumps for switch in self._switches], dtype=bool),
            ),
        )


@kernel
def set_input(tape: Tape, values: Values, number: int, value: float) -> None:
    """Set an input to its ``value``."""
    values.value[tape.constant.size + number] = value


@kernel
def by_input(tape: Tape, values: Values, number: int) -> float:
    """Return the derivative by an input, after ``gradient``."""
    slope: float = values.adjoint[tape.constant.size + number]
    return slope


@apart
def sweep(tape: Tape, values: Values) -> None:
    """Compute all values of the tape from its inputs."""
    value, first = values.value, tape.constant.size + tape.inputs
    for i in range(tape.op.size):
        op, x = tape.op[i], value[tape.a[i]]
        if op < FIRST_BINARY:
            value[first + i] = unary(op, x)
        elif op < WHERE:
            value[first + i] = binary(op, x, value[tape.b[i]])
        elif op == WHERE:
            value[first + i] = value[tape.b[i]] if x != 0.0 else value[tape.c[i]]
        elif op == CURVE:
            # A periodic table rounds its argument down, which needs a number.
            known = math.isfinite(x)
            value[first + i] = functions.evaluate(tape.laws, tape.c[i], x)[0] if known else math.nan
        elif op == HELD:
            held = tape.held[tape.c[i]]
            value[first + i] = x if held == FREE else held
        else:
            y = value[tape.b[i]]
            value[first + i] = surfaces.evaluate(tape.surfaces, tape.c[i], x, y)[0]


@apart
def gradient(tape: Tape, values: Values, place: int) -> None:
    """Set the adjoints to the derivatives of the value at ``place``, after ``sweep``."""
    adjoint, first = values.adjoint, tape.constant.size + tape.inputs
    for i in range(adjoint.size):
        adjoint[i] = 0.0
    adjoint[place] = 1.0
    for i in range(place - first, -1, -1):
        if adjoint[first + i] != 0.0:
            _pull(tape, values, i)


@apart
def gradient_along(
    tape: Tape, values: Values, place: int, operations: np.ndarray, begin: int, end: int
) -> None:
    """As ``gradient``, by the ``operations`` from ``begin`` to ``end`` alone: those that the value
    needs, in order. Adjoints of other operations stay as they were.
    """
    adjoint, first = values.adjoint, tape.constant.size + tape.inputs
    for i in range(first):
        adjoint[i] = 0.0
    for e in range(begin, end):
        adjoint[first + operations[e]] = 0.0
    adjoint[place] = 1.0
    for e in range(end - 1, begin - 1, -1):
        if adjoint[first + operations[e]] != 0.0:
            _pull(tape, values, operations[e])


@apart
def _pull(tape: Tape, values: Values, i: int) -> None:
    """Add what operation ``i`` contributes to the adjoints of its operands."""
    value, adjoint, first = values.value, values.adjoint, tape.constant.size + tape.inputs
    slope, op, a, b = adjoint[first + i], tape.op[i], tape.a[i], tape.b[i]
    if op < FIRST_BINARY:
        adjoint[a] += slope * unary_slope(op, value[a], value[first + i])
    elif op < WHERE:
        by_a, by_b = binary_slopes(op, value[a], value[b], value[first + i])
        adjoint[a] += slope * by_a
        adjoint[b] += slope * by_b
    elif op == WHERE:
        adjoint[b if value[a] != 0.0 else tape.c[i]] += slope
    elif op == CURVE:
        if math.isfinite(value[a]):
            adjoint[a] += slope * functions.evaluate(tape.laws, tape.c[i], value[a])[1]
    elif op == SURFACE:
        _, by_a, by_b = surfaces.evaluate(tape.surfaces, tape.c[i], value[a], value[b])
        adjoint[a] += slope * by_a
        adjoint[b] += slope * by_b


def magnitudes(
    tape: Tape, values: Values, of_inputs: np.ndarray, anywhere: bool = False
) -> np.ndarray:
    """Sizes of all values after ``sweep``: the largest that each and the terms of which it consists
    may have, where the inputs are known by their sizes ``of_inputs`` (inputs,) alone; of tables of
    one variable where they are now, or ``anywhere``.

    Not compiled: it is asked once in a run.
    """
    return _propagate(tape, values, of_inputs, np.abs(values.value), anywhere)


def errors(tape: Tape, values: Values, of_inputs: np.ndarray) -> np.ndarray:
    """Errors of all values after ``sweep`` that follow from those ``of_inputs`` (inputs,), to first
    order. Not compiled, as ``magnitudes``.
    """
    return _propagate(tape, values, of_inputs, np.zeros_like(values.value), False)


def _propagate(
    tape: Tape, values: Values, of_inputs: np.ndarray, size: np.ndarray, anywhere: bool
) -> np.ndarray:
    """Let ``size`` be the larger of what it is and of what follows from the inputs by the slopes of
    the operations; return it.
    """
    value, first = values.value, tape.constant.size + tape.inputs
    size[tape.constant.size : first] = np.maximum(size[tape.constant.size : first], of_inputs)
    for i, (op, a, b) in enumerate(zip(tape.op, tape.a, tape.b, strict=True)):
        x, y, result = value[a], value[b], value[first + i]
        by_a, by_b = 0.0, 0.0
        if op < FIRST_BINARY:
            by_a = unary_slope(op, x, result)
        elif op < WHERE:
            by_a, by_b = binary_slopes(op, x, y, result)
        elif op == CURVE and math.isfinite(x):
            by_a = functions.evaluate(tape.laws, tape.c[i], x)[1]
            if anywhere:
                by_a = functions.steepest(tape.laws, tape.c[i])
        elif op == SURFACE:
            _, by_a, by_b = surfaces.evaluate(tape.surfaces, tape.c[i], x, y)
        elif op == WHERE:
            a, by_a = (b if x != 0.0 else tape.c[i]), 1.0
        terms = abs(by_a) * size[a] + abs(by_b) * size[b]
        if terms > size[first + i]:
            size[first + i] = terms
    return size


@apart
def unary(op: int, x: float) -> float:
    """Return the result of an operation on one value."""
    if op == NEGATE:
        return -x
    if op == NOT:
        return 1.0 if x == 0.0 else 0.0
    if op == SIN:
        return math.sin(x) if math.isfinite(x) else math.nan
    if op == COS:
        return math.cos(x) if math.isfinite(x) else math.nan
    if op == TAN:
        return math.tan(x) if math.isfinite(x) else math.nan
    if op == ASIN:
        return math.asin(x) if abs(x) <= 1.0 else math.nan
    if op == ACOS:
        return math.acos(x) if abs(x) <= 1.0 else math.nan
    if op == ATAN:
        return math.atan(x)
    if op == SINH:
        return math.sinh(x) if abs(x) <= LARGEST_EXPONENT else x * math.inf
    if op == COSH:
        return math.cosh(x) if abs(x) <= LARGEST_EXPONENT else abs(x) * math.inf
    if op == TANH:
        return math.tanh(x)
    if op == EXP:
        return math.exp(x) if x <= LARGEST_EXPONENT else x * math.inf
    if op == LOG:
        return math.log(x) if x > 0.0 else (-math.inf if x == 0.0 else math.nan)
    if op == SQRT:
        return math.sqrt(x) if x >= 0.0 else math.nan
    if op == SIGN:
        return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else x)
    return float(np.floor(x))


@apart
def unary_slope(op: int, x: float, result: float) -> float:
    """Return the derivative of an operation on one value."""
    if op == NEGATE:
        return -1.0
    if op == SIN:
        return math.cos(x) if math.isfinite(x) else math.nan
    if op == COS:
        return -math.sin(x) if math.isfinite(x) else math.nan
    if op == TAN:
        return 1.0 + result * result
    if op == ASIN:
        return 1.0 / math.sqrt(1.0 - x * x) if abs(x) < 1.0 else 0.0
    if op == ACOS:
        return -1.0 / math.sqrt(1.0 - x * x) if abs(x) < 1.0 else 0.0
    if op == ATAN:
        return 1.0 / (1.0 + x * x)
    if op == SINH:
        return unary(COSH, x)
    if op == COSH:
        return unary(SINH, x)
    if op == TANH:
        return 1.0 - result * result
    if op == EXP:
        return result
    if op == LOG:
        return 1.0 / x if x > 0.0 else 0.0
    if op == SQRT:
        return 0.5 / result if result > 0.0 else 0.0
    return 0.0


@apart
def binary(op: int, x: float, y: float) -> float:
    """Return the result of an operation on two values."""
    if op == ADD:
        return x + y
    if op == SUBTRACT:
        return x - y
    if op == MULTIPLY:
        return x * y
    if op == DIVIDE:
        return x / y
    if op == POWER:
        return float(x**y)
    if op == ATAN2:
        return math.atan2(x, y)
    # A condition that decides guards the one after it, as in 'x > 0 and log(x) > 1'.
    if op == BOTH:
        return y if y < x else x
    if op == EITHER:
        return y if y > x else x
    if op == HYPOT:
        return math.hypot(x, y)
    if op == AND:
        return 1.0 if x != 0.0 and y != 0.0 else 0.0
    if op == OR:
        return 1.0 if x != 0.0 or y != 0.0 else 0.0
    return 1.0 if compare(op, x, y) else 0.0


@kernel
def compare(op: int, x: float, y: float) -> bool:
    """Return the result of a comparison."""
    if op == LESS:
        return bool(x < y)
    if op == AT_MOST:
        return bool(x <= y)
    if op == GREATER:
        return bool(x > y)
    if op == AT_LEAST:
        return bool(x >= y)
    return bool(x == y) if op == EQUAL else bool(x != y)


@apart
def binary_slopes(op: int, x: float, y: float, result: float) -> tuple[float, float]:
    """Return the derivatives of an operation by both values."""
    if op == ADD:
        return 1.0, 1.0
    if op == SUBTRACT:
        return 1.0, -1.0
    if op == MULTIPLY:
        return y, x
    if op == DIVIDE:
        return 1.0 / y, -result / y
    if op == POWER:
        return power_slopes(x, y, result)
    if op == ATAN2:
        square = x * x + y * y
        return (y / square, -x / square) if square > 0.0 else (0.0, 0.0)
    if op == BOTH:
        return (0.0, 1.0) if y < x else (1.0, 0.0)
    if op == EITHER:
        return (0.0, 1.0) if y > x else (1.0, 0.0)
    if op == HYPOT:
        return (x / result, y / result) if result > 0.0 else (0.0, 0.0)
    return 0.0, 0.0


@kernel
def power_slopes(x: float, y: float, result: float) -> tuple[float, float]:
    """Return the derivatives of x^y by both."""
    by_x = 0.0
    if y != 0.0 and (x != 0.0 or y >= 1.0):
        by_x = float(y * x ** (y - 1.0))
    return by_x, result * math.log(x) if x > 0.0 else 0.0
