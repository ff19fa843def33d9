"""Conditions as continuous functions, whose zeros can be located.

The margin of a condition is positive where the condition holds and negative where it does not:

    a > b, a >= b    a - b          A and B    smaller margin        not A    minus A's margin
    a < b, a <= b    b - a          A or B     larger margin

The margin of B may be no number where that of A is below zero, as in ``x > 0 and log(x) > 1``.
"""

from msahl.expressions.syntax import Call, ExpressionError, Tree

_JOINED = {"and": "both", "or": "either"}
_SWAPPED = {">": False, ">=": False, "<": True, "<=": True}


def margin(condition: Tree) -> Tree:
    """Return the margin of a ``condition``; raise ``ExpressionError`` if it is none."""
    if isinstance(condition, Call):
        function, column = condition.function, condition.column
        if function in _SWAPPED:
            a, b = condition.arguments
            return Call("-", (b, a) if _SWAPPED[function] else (a, b), column)
        if function in _JOINED:
            return Call(_JOINED[function], tuple(map(margin, condition.arguments)), column)
        if function == "not":
            return Call("negate", (margin(condition.arguments[0]),), column)
        if function in ("==", "!="):
            message = f"{function} is true at single times only; compare with >= or <="
            raise ExpressionError(message, column)
    raise ExpressionError(
        "this is no condition; compare two values, as in 'a > b'", condition.column
    )
