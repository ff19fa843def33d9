"""Compute the value of an expression from the values of its names.

Conditions decide first: what ``where``, ``and`` and ``or`` do not need may have no value, as in
``where(x > 0, log(x), 0)``.

    mod(a, b) = a - b floor(a/b)
    step(x, x0, y0, x1, y1) = y0 + (y1 - y0) u^3 (10 - 15 u + 6 u^2),  u = (x - x0)/(x1 - x0)
                              limited to [0, 1]: no jump up to the second derivative
"""

import math
import operator
from collections.abc import Callable, Mapping

from msahl.expressions.syntax import (
    Call,
    ExpressionError,
    Lookup,
    Name,
    Number,
    Tree,
    check_names,
    postorder,
)

Table = Callable[..., float]
NO_TABLES: Mapping[str, Table] = {}

Value = float | ExpressionError
"""A number, or why there is none."""


def evaluate(
    tree: Tree, names: Mapping[str, float], tables: Mapping[str, Table] = NO_TABLES
) -> float:
    """Return the value of a tree, a finite number; raise ``ExpressionError`` if there is none."""
    check_names(tree, names, tables)
    values: list[Value] = []
    for node in postorder(tree):
        match node:
            case Number(value):
                values.append(float(value))
            case Name(text):
                values.append(float(names[text]))
            case Call(_, arguments) | Lookup(_, arguments):
                first = len(values) - len(arguments)
                given = values[first:]
                del values[first:]
                values.append(_applied(node, given, tables))
    (result,) = values
    if isinstance(result, ExpressionError):
        raise result
    return result


def _applied(node: Call | Lookup, given: list[Value], tables: Mapping[str, Table]) -> Value:
    """Return the value of an operation on ``given`` arguments, or why there is none."""
    if isinstance(node, Call) and node.function in CONDITIONS:
        return CONDITIONS[node.function](*given)
    for argument in given:
        if isinstance(argument, ExpressionError):
            return argument
    numbers = [argument for argument in given if isinstance(argument, float)]
    name = node.function if isinstance(node, Call) else node.table
    function = ARITHMETIC[name] if isinstance(node, Call) else tables[name]
    try:
        value = float(function(*numbers))
    except ZeroDivisionError:
        return ExpressionError("division by zero", node.column)
    except OverflowError:
        value = math.inf
    except ValueError:
        value = math.nan
    if math.isnan(value):
        shown = ", ".join(f"{number:g}" for number in numbers)
        what = f"{name}({shown})" if name.isidentifier() else f" {name} ".join(shown.split(", "))
        return ExpressionError(f"{what} is not a real number", node.column)
    if math.isinf(value):
        return ExpressionError(f"the result of '{name}' is too large", node.column)
    return value


def _where(condition: Value, if_true: Value, if_false: Value) -> Value:
    if isinstance(condition, ExpressionError):
        return condition
    return if_true if condition else if_false


def _and(first: Value, second: Value) -> Value:
    return _where(first, _where(second, 1.0, 0.0), 0.0)


def _or(first: Value, second: Value) -> Value:
    return _where(first, 1.0, _where(second, 1.0, 0.0))


def _modulo(a: float, b: float) -> float:
    return a - b * math.floor(a / b)


def _power(a: float, b: float) -> float:
    if a == 0.0 and b < 0.0:
        raise ZeroDivisionError
    return math.pow(a, b)


def _sign(x: float) -> float:
    return math.copysign(1.0, x) if x else 0.0


def _step(x: float, x0: float, y0: float, x1: float, y1: float) -> float:
    u = min(max((x - x0) / (x1 - x0), 0.0), 1.0)
    return y0 + (y1 - y0) * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)


CONDITIONS: Mapping[str, Callable[..., Value]] = {"where": _where, "and": _and, "or": _or}
"""Functions that do not need all their arguments."""

ARITHMETIC: Mapping[str, Table] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "^": _power,
    "negate": operator.neg,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "not": operator.not_,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "atan2": math.atan2,
    "sinh": math.sinh,
    "cosh": math.cosh,
    "tanh": math.tanh,
    "exp": math.exp,
    "log": math.log,
    "sqrt": math.sqrt,
    "abs": abs,
    "sign": _sign,
    "min": min,
    "max": max,
    "both": min,
    "either": max,
    "hypot": math.hypot,
    "floor": math.floor,
    "mod": _modulo,
    "step": _step,
}
"""All other functions and operators."""
