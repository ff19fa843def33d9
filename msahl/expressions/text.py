"""Write the tree of an expression as a text that is read back to the same tree."""

from msahl.expressions.syntax import (
    BINARY,
    COMPARISONS,
    UNARY,
    Call,
    Lookup,
    Name,
    Number,
    Tree,
    postorder,
    quoted,
)

SIGN = UNARY["-"][1]
"""Precedence of a sign, also of that of a number below zero."""
CLOSED = 1 + max(BINARY.values())
"""Stands for the precedence of what needs no parentheses anywhere."""

Part = tuple[str, int]
"""A text, and the precedence of its outermost operation."""


def text_of(tree: Tree) -> str:
    """Return the text of an expression, with numbers to the last digit; without recursion."""
    parts: list[Part] = []
    for node in postorder(tree):
        count = len(node.arguments) if isinstance(node, Call | Lookup) else 0
        arguments = parts[len(parts) - count :]
        del parts[len(parts) - count :]
        parts.append(_part(node, arguments))
    return parts[0][0]


def _part(node: Tree, arguments: list[Part]) -> Part:
    """Return the text of a node from those of its arguments."""
    if isinstance(node, Number):
        word = repr(float(node.value))
        return word, SIGN if word.startswith("-") else CLOSED
    if isinstance(node, Name):
        return "t" if node.text == "t" else quoted(node.text), CLOSED
    if isinstance(node, Call) and node.function in BINARY:
        return _binary(node.function, *arguments)
    if isinstance(node, Call) and node.function in ("negate", "not"):
        sign = "-" if node.function == "negate" else "not "
        precedence = UNARY[sign.strip()][1]
        is_number = isinstance(node.arguments[0], Number)  # which a sign would be a part of
        return sign + _within(arguments[0], CLOSED + 1 if is_number else precedence), precedence
    function = quoted(node.table) if isinstance(node, Lookup) else node.function
    return f"{function}({', '.join(word for word, _ in arguments)})", CLOSED


def _binary(operator: str, left: Part, right: Part) -> Part:
    """Return the text of an operation of two operands: powers bind to the right, comparisons are
    not chained, and all else binds to the left."""
    precedence = BINARY[operator]
    to_right = operator == "^"
    first = _within(left, precedence + (to_right or operator in COMPARISONS))
    second = _within(right, precedence + (not to_right))
    return f"{first}{operator}{second}" if to_right else f"{first} {operator} {second}", precedence


def _within(part: Part, least: int) -> str:
    """Return a text in parentheses unless its operation has ``least`` precedence."""
    word, precedence = part
    return word if precedence >= least else f"({word})"
