"""Compute the dimension of an expression from the dimensions of its names.

A dimension is a product of powers of kg, m, s and A. Angles are followed as well, in powers of rad,
but rad counts as 1 wherever two dimensions are compared: r*angle is a length, 1/s a rate of angle.
The power of rad is needed only to distinguish an angle, in rad, from a pure number, which a deck
takes to be in the units of the element that holds it.

None is the dimension of what may have any, in SI units: the literals of laws of motion.
"""

from collections.abc import Mapping
from fractions import Fraction
from typing import NamedTuple, TypeAlias

from msahl.expressions.evaluate import evaluate
from msahl.expressions.syntax import (
    COMPARISONS,
    Call,
    ExpressionError,
    Lookup,
    Name,
    Number,
    Tree,
    postorder,
    unknown,
)

_0 = Fraction(0)

MOST = 100
"""Largest exponent of a unit."""


class Dimension(NamedTuple):
    """Exponents of the base units."""

    kg: Fraction = _0
    m: Fraction = _0
    s: Fraction = _0
    A: Fraction = _0
    rad: Fraction = _0

    def __str__(self) -> str:
        """The SI unit, such as ``kg-m/s^2``, or "a pure number"."""
        above = [_power(unit, n) for unit, n in self._asdict().items() if n > 0]
        below = [_power(unit, -n) for unit, n in self._asdict().items() if n < 0]
        if not below:
            return "-".join(above) or "a pure number"
        return f"{'-'.join(above) or '1'}/{'-'.join(below)}"

    def times(self, other: "Dimension") -> "Dimension":
        """Return the dimension of a product."""
        return Dimension(*(a + b for a, b in zip(self, other, strict=True)))

    def power(self, n: Fraction) -> "Dimension":
        """Return the dimension of the ``n``-th power."""
        return Dimension(*(a * n for a in self))

    def fits(self, other: "Dimension") -> bool:
        """Return whether both may be added, compared, or stand for one another."""
        return self[:-1] == other[:-1]


Any: TypeAlias = Dimension | None

PURE = Dimension()
ANGLE = Dimension(rad=Fraction(1))


class TableDimensions(NamedTuple):
    """Dimensions of the arguments and of the values of a table."""

    arguments: tuple[Any, ...]
    value: Any


NO_TABLES: Mapping[str, TableDimensions] = {}


def dimension(
    tree: Tree,
    names: Mapping[str, Any],
    literal: Any = PURE,
    constants: Mapping[str, float] | None = None,
    tables: Mapping[str, TableDimensions] = NO_TABLES,
) -> Any:
    """Return the dimension of the value of a tree; raise ``ExpressionError`` at a contradiction.

    ``literal`` is the dimension of the numbers in the text; zero may have any. ``constants`` are
    the names of known value, which exponents of what has a dimension may contain.
    """
    found: list[Any] = []
    for node in postorder(tree):
        match node:
            case Number(value):
                found.append(literal if value else None)
            case Name(text, column):
                if text not in names:
                    raise ExpressionError(unknown(text, names), column)
                found.append(names[text])
            case Call(_, arguments) | Lookup(_, arguments):
                first = len(found) - len(arguments)
                given = found[first:]
                del found[first:]
                if isinstance(node, Lookup):
                    found.append(_of_table(node, given, tables))
                elif node.function == "^":
                    found.append(_of_power(node, given, constants or {}))
                else:
                    found.append(_of_call(node, given))
    (result,) = found
    return result


def _of_call(node: Call, given: list[Any]) -> Any:
    """Return the dimension of the value of a function or operator other than a power."""
    match node.function:
        case "*" | "/":
            a, b = given
            if a is None or b is None:
                return None
            return a.times(b if node.function == "*" else b.power(Fraction(-1)))
        case "+" | "-" | "min" | "max" | "hypot" | "mod":
            return _common(node, given)
        case "negate" | "abs":
            return given[0]
        case "where":
            return _common(node, given[1:])
        case "step":
            _common(node, [given[0], given[1], given[3]])
            return _common(node, [given[2], given[4]])
        case "atan2":
            _common(node, given)
            return ANGLE
        case "asin" | "acos" | "atan":
            _pure(node, given)
            return ANGLE
        case "sqrt":
            return None if given[0] is None else given[0].power(Fraction(1, 2))
        case "sign" | "and" | "or" | "not" | "both" | "either":
            return PURE
        case function if function in COMPARISONS:
            _common(node, given)
            return PURE
    _pure(node, given)
    return PURE


def _of_power(node: Call, given: list[Any], constants: Mapping[str, float]) -> Any:
    """Return the dimension of a power; the exponent of what has a dimension has to be known."""
    base, exponent = given
    _pure(node, [exponent])
    if base is None or base == PURE:
        return base
    try:
        n = evaluate(node.arguments[1], constants)
    except ExpressionError:
        message = f"the exponent of {base} must be a number; write it out, or divide by a unit"
        raise ExpressionError(message, node.column) from None
    if abs(n) > MOST:
        raise ExpressionError(f"the exponent of {base} is {n:g}; {MOST} is the most", node.column)
    return base.power(Fraction(n).limit_denominator(60))


def _of_table(node: Lookup, given: list[Any], tables: Mapping[str, TableDimensions]) -> Any:
    """Return the dimension of a table's values."""
    table = tables[node.table]
    if len(given) != len(table.arguments):
        message = f"the table '{node.table}' has {len(table.arguments)} arguments, not {len(given)}"
        raise ExpressionError(message, node.column)
    for has, wants in zip(given, table.arguments, strict=True):
        if has is not None and wants is not None and not has.fits(wants):
            message = f"an argument of '{node.table}' is {wants}, not {has}"
            raise ExpressionError(message, node.column)
    return table.value


def _common(node: Call, given: list[Any]) -> Any:
    """Return the one dimension of several values; an angle if one of them is."""
    known = [a for a in given if a is not None]
    for other in known[1:]:
        if not other.fits(known[0]):
            what = f"'{node.function}' joins {known[0]} and {other}"
            message = f"{what}; both must have the same dimension"
            raise ExpressionError(message, node.column)
    return max(known, key=lambda a: abs(a.rad), default=None)


def _pure(node: Call, given: list[Any]) -> None:
    """Check that all values are pure numbers or angles."""
    for a in given:
        if a is not None and not a.fits(PURE):
            what = "an exponent" if node.function == "^" else f"the argument of {node.function}"
            raise ExpressionError(f"{what} is a pure number, not {a}", node.column)


def _power(unit: str, n: Fraction) -> str:
    return unit if n == 1 else f"{unit}^{n}" if n.denominator == 1 else f"{unit}^({n})"
