"""Read the text of an expression into a tree of records.

    or < and < not < comparison < + - < * / < unary minus < ^

``^`` is the power, which binds to the right; ``-x^2`` is ``-(x^2)``, and ``-2`` is one number.
Comparisons are not chained. A name is ``NAME`` or ``ELEMENT.VALUE``, each part an identifier or any
text in quotes; a name before a parenthesis is a function of ``FUNCTIONS`` or else a table. Nothing
is ever executed: a text is only split into numbers, names and signs. Length, depth and size are
bounded, so every text is read in a time proportional to its length.

Python's own parser (``ast``) is not used: it gives ``^`` the place of a logical operation, reserves
words such as ``lambda`` and ``in`` that are good names, and warns of, or normalises, what it reads.
"""

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import field
from functools import partial
from itertools import islice
from typing import Any, NoReturn, TypeAlias

from msahl.records import record

MAX_LENGTH = 10_000
"""Characters of an expression."""
MAX_DEPTH = 60
"""Parentheses, functions, signs and powers inside one another."""
MAX_SIZE = 2_000
"""Numbers, names and operations of an expression."""

MOST_COMPARED = 300
"""Known names that an unknown one is compared with."""

FUNCTIONS: Mapping[str, int] = {
    "sin": 1,
    "cos": 1,
    "tan": 1,
    "asin": 1,
    "acos": 1,
    "atan": 1,
    "atan2": 2,
    "sinh": 1,
    "cosh": 1,
    "tanh": 1,
    "exp": 1,
    "log": 1,
    "sqrt": 1,
    "abs": 1,
    "sign": 1,
    "min": 2,
    "max": 2,
    "hypot": 2,
    "floor": 1,
    "mod": 2,
    "where": 3,
    "step": 5,
}
"""Number of arguments of each function. ``min`` and ``max`` may be written with more, and are then
read as calls of two arguments inside one another."""

ANY_NUMBER = ("min", "max")
"""Functions that may be written with more arguments than ``FUNCTIONS`` says."""

CONSTANTS: Mapping[str, float] = {"pi": math.pi}

COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")

BINARY: Mapping[str, int] = {
    "or": 1,
    "and": 2,
    **dict.fromkeys(COMPARISONS, 4),
    "+": 5,
    "-": 5,
    "*": 6,
    "/": 6,
    "^": 8,
}
"""Operators of two operands, with their precedence."""

UNARY: Mapping[str, tuple[str, int]] = {"not": ("not", 3), "-": ("negate", 7), "+": ("", 7)}
"""Operators before an operand: the function that a ``Call`` names, and their precedence."""

RESERVED = frozenset((*FUNCTIONS, *CONSTANTS, "and", "or", "not", "t"))
"""Words that no parameter, signal, state or table may have as its name."""


@record
class Number:
    """A number; ``column`` in the text from 1, as in all records."""

    value: float
    column: int = field(default=1, compare=False)


@record
class Name:
    """The value called ``text``: ``L``, ``t``, or ``Crank.angle``, without quotes."""

    text: str
    column: int = field(default=1, compare=False)


class _Operation:
    """What ``Call`` and ``Lookup`` share: they are compared, hashed, shown and pickled without
    recursion, because a sum may have more terms than Python's stack has places."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Operation) and _flat(self) == _flat(other)

    def __hash__(self) -> int:
        return hash(_flat(self))

    def __repr__(self) -> str:
        return f"{type(self).__name__}{_flat(self)!r}"

    def __reduce__(self) -> tuple[Any, ...]:
        tree: Any = self
        return _rebuilt, (_flat(tree), [node.column for node in postorder(tree)])


@record
class Call(_Operation):
    """An operation: ``function`` is a key of ``FUNCTIONS`` or ``BINARY``, "not" or "negate".

    The number of ``arguments`` is that of the function. A condition is true unless it is zero;
    comparisons, ``and``, ``or`` and ``not`` give 1 or 0.
    """

    function: str
    arguments: tuple["Tree", ...]
    column: int = field(default=1, compare=False)


@record
class Lookup(_Operation):
    """The value of the table called ``table`` at one or two ``arguments``."""

    table: str
    arguments: tuple["Tree", ...]
    column: int = field(default=1, compare=False)


Tree: TypeAlias = Number | Name | Call | Lookup


def _flat(tree: Any) -> tuple[Any, ...]:
    """Return the numbers, names and operations of a tree, each after its arguments; an operation as
    its name, the number of its arguments, and whether it is a table."""
    return tuple(
        (node.function, len(node.arguments), False) if isinstance(node, Call)
        else (node.table, len(node.arguments), True) if isinstance(node, Lookup)
        else node
        for node in postorder(tree)
    )  # fmt: skip


def _rebuilt(flat: tuple[Any, ...], columns: list[int]) -> Tree:
    """Return the tree of which ``_flat`` is known, and the column of each record."""
    found: list[Tree] = []
    for node, column in zip(flat, columns, strict=True):
        if not isinstance(node, tuple):
            found.append(node)
            continue
        name, count, is_table = node
        arguments = tuple(found[len(found) - count :])
        del found[len(found) - count :]
        found.append((Lookup if is_table else Call)(name, arguments, column))
    return found[0]


class ExpressionError(ValueError):
    """What is wrong with an expression, and at which column of its text (from 1).

    A ``message`` that takes time to make may be a function, called when the message is read.
    """

    def __init__(self, message: str | Callable[[], str], column: int) -> None:
        super().__init__(message, column)
        self._message, self.column = message, column

    @property
    def message(self) -> str:
        """What is wrong."""
        return self._message if isinstance(self._message, str) else self._message()

    def __str__(self) -> str:
        return self.message


def inside_braces(text: str) -> str | None:
    """Return what is between the braces of ``{...}``; None if ``text`` is not in braces."""
    text = text.strip()
    return text[1:-1] if len(text) > 1 and text[0] == "{" and text[-1] == "}" else None


def parse(text: str) -> Tree:
    """Return the tree of an expression without braces; raise ``ExpressionError``."""
    if len(text) > MAX_LENGTH:
        message = f"the expression has {len(text)} characters; {MAX_LENGTH} are the most accepted"
        raise ExpressionError(message, 1)
    return _Parser(text).tree()


def postorder(tree: Tree) -> list[Tree]:
    """Return all records of a tree, each after its arguments; without recursion."""
    found, waiting = [], [tree]
    while waiting:
        node = waiting.pop()
        found.append(node)
        if isinstance(node, Call | Lookup):
            waiting.extend(node.arguments)
    return found[::-1]


def renamed(text: str, new: Callable[[str], str]) -> str:
    """Return the text of an expression with another name in place of each that is not reserved;
    a text that cannot be read is returned as it is."""
    try:
        tokens = list(_tokens(text))
    except ExpressionError:
        return text
    parts, end = [], 0
    for token in tokens:
        if token.kind != "name" or token.text in RESERVED:
            continue
        old = _unquoted(token.text)
        name = new(old)
        if name != old:
            start = token.column - 1
            parts += [text[end:start], quoted(name)]
            end = start + len(token.text)
    return "".join([*parts, text[end:]])


def quoted(name: str) -> str:
    """Return a name as expressions have it: in quotes if it needs them."""
    plain = re.fullmatch(r"[^\W\d]\w*(?:\.[^\W\d]\w*)*", name) and name not in RESERVED
    return name if plain else f"'{name}'"


def check_names(tree: Tree, names: Collection[str], tables: Collection[str] = ()) -> None:
    """Raise ``ExpressionError`` for the first name in the text that is neither of the ``names`` nor
    of the ``tables``, each in its place; the message gives the nearest names."""
    for node in sorted(postorder(tree), key=lambda node: node.column):
        if isinstance(node, Name) and node.text not in names:
            if node.text in tables:
                message = f"'{node.text}' is a table; write {node.text}(x)"
                raise ExpressionError(message, node.column)
            raise ExpressionError(partial(unknown, node.text, names), node.column)
        if isinstance(node, Lookup) and node.table not in tables:
            message = f"unknown function '{node.table}'{nearest(node.table, [*FUNCTIONS, *tables])}"
            if node.table in names:
                message = f"'{node.table}' is no function; to multiply write {node.table}*(...)"
            raise ExpressionError(message, node.column)


def unknown(name: str, names: Collection[str]) -> str:
    """Return the message for a name that is none of the ``names``."""
    return f"unknown name '{name}'{nearest(name, names)}"


def nearest(name: str, names: Collection[str]) -> str:
    """Return the remedy for an unknown name: those of the ``names`` that are most like it."""
    from difflib import get_close_matches

    # A comparison takes a tenth of a millisecond, and there may be many unknown names.
    length, ends = len(name), {name[:1], name[-1:]}
    alike = (n for n in names if abs(len(n) - length) <= length // 2 + 1 and {n[:1], n[-1:]} & ends)
    near = get_close_matches(name, list(islice(alike, MOST_COMPARED)), n=3)
    if near:
        return f"; did you mean {', '.join(near)}?"
    some = list(islice(names, 10))
    more = ", ..." if len(names) > len(some) else ""
    return f"; known here: {', '.join(some)}{more}" if some else "; none is known here"


_PART = r"(?:[^\W\d]\w*|'[^']*'|\"[^\"]*\")"
_TOKEN = re.compile(
    rf"""\s*(?:
    (?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)
    |(?P<name>{_PART}(?:\.{_PART})*)
    |(?P<sign><=|>=|==|!=|\*\*|[-+*/^(),<>])
    |(?P<end>$)
    )""",
    re.VERBOSE,
)

_INSTEAD = {
    "**": "the power is written ^",
    "=": "equality is written ==",
    "{": "braces stand around a complete expression only; use parentheses",
    "}": "braces stand around a complete expression only; use parentheses",
    "[": "use parentheses",
    "]": "use parentheses",
    "!": "negation is written not",
    "&": "write and",
    "|": "write or",
    "%": "the remainder of a division is mod(a, b)",
    ";": "arguments are separated by commas",
    "'": "a quote is not closed",
    '"': "a quote is not closed",
}
"""Remedies for signs that expressions do not have."""


@record
class _Token:
    """A piece of the text: ``kind`` is number, name, sign, word (and, or, not) or end."""

    kind: str
    text: str
    column: int


def _tokens(text: str) -> Iterator[_Token]:
    """Yield the pieces of a text; the last is its end."""
    position = 0
    while True:
        match = _TOKEN.match(text, position)
        if match is None:
            column = position + len(text[position:]) - len(text[position:].lstrip()) + 1
            sign = text[column - 1]
            remedy = _INSTEAD.get(sign, "it has no meaning in an expression")
            raise ExpressionError(f"unexpected '{sign}': {remedy}", column)
        kind, word = str(match.lastgroup), match.group(str(match.lastgroup))
        column, position = match.start(kind) + 1, match.end()
        if word in _INSTEAD:
            raise ExpressionError(f"unexpected '{word}': {_INSTEAD[word]}", column)
        yield _Token("word" if word in ("and", "or", "not") else kind, word, column)
        if kind == "end":
            return


def _unquoted(name: str) -> str:
    return name.replace("'", "").replace('"', "")


class _Parser:
    """Reads an expression from left to right, by the precedence of its operators."""

    def __init__(self, text: str) -> None:
        self._rest = _tokens(text)
        self._next = next(self._rest)
        self._depth = 0
        self._size = 0

    def tree(self) -> Tree:
        """Return the tree of the complete text."""
        if self._next.kind == "end":
            raise ExpressionError("the expression is empty", self._next.column)
        tree = self._expression(0)
        if self._next.kind != "end":
            self._unexpected()
        return tree

    def _take(self) -> _Token:
        token = self._next
        if token.kind != "end":
            self._next = next(self._rest)
        return token

    def _unexpected(self) -> NoReturn:
        """Raise the error of a token where an operator or the end belongs."""
        token = self._next
        if token.kind == "end":
            raise ExpressionError("the expression ends too early", token.column)
        message = f"unexpected '{token.text}'"
        if token.text == ",":
            message += "; a decimal is written with a point, and commas separate arguments"
        elif token.text == ")":
            message += "; no parenthesis is open here"
        elif token.kind in ("number", "name") or token.text == "(":
            message += "; an operator is missing before it, such as *"
        raise ExpressionError(message, token.column)

    def _counted(self, node: Tree) -> Tree:
        self._size += 1
        if self._size > MAX_SIZE:
            message = f"the expression has more than {MAX_SIZE} numbers, names and operations"
            raise ExpressionError(message, node.column)
        return node

    def _expression(self, least: int) -> Tree:
        """Return the tree of what follows, up to an operator of a precedence of ``least`` or less;
        ``^`` alone ends at none of its own."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            message = f"more than {MAX_DEPTH} levels inside one another"
            raise ExpressionError(message, self._next.column)
        left = self._operand()
        compared = False
        while self._next.kind in ("sign", "word") and BINARY.get(self._next.text, 0) > least:
            operator = self._take()
            if operator.text in COMPARISONS:
                if compared:
                    message = "comparisons are not chained; write a < b and b < c"
                    raise ExpressionError(message, operator.column)
                compared = True
            precedence = BINARY[operator.text]
            right = self._expression(precedence - (operator.text == "^"))
            left = self._counted(Call(operator.text, (left, right), operator.column))
        self._depth -= 1
        return left

    def _operand(self) -> Tree:
        """Return the tree of a number, a name, a call, a parenthesis or a sign before these."""
        token = self._take()
        if token.kind == "number":
            value = float(token.text)
            if math.isinf(value):
                raise ExpressionError(f"{token.text} is too large", token.column)
            return self._counted(Number(value, token.column))
        if token.kind == "name":
            return self._named(token)
        if token.text in UNARY:
            function, precedence = UNARY[token.text]
            literal = self._next.kind == "number"
            operand = self._expression(precedence)
            if not function:
                return operand
            if literal and isinstance(operand, Number) and function == "negate":
                return Number(-operand.value, token.column)
            return self._counted(Call(function, (operand,), token.column))
        if token.text == "(":
            tree = self._expression(0)
            self._close(token)
            return tree
        if token.kind == "end":
            raise ExpressionError("the expression ends too early", token.column)
        raise ExpressionError(f"unexpected '{token.text}'; a value is missing", token.column)

    def _close(self, opened: _Token) -> None:
        if self._next.kind == "end":
            raise ExpressionError("the parenthesis is not closed", opened.column)
        if self._next.text != ")":
            self._unexpected()
        self._take()

    def _named(self, token: _Token) -> Tree:
        """Return the tree of a name, or of the call that it begins."""
        name = _unquoted(token.text)
        in_quotes = name != token.text
        if self._next.text == "(":
            return self._call(token, name, in_quotes)
        if in_quotes:
            return self._counted(Name(name, token.column))
        if name in CONSTANTS:
            return self._counted(Number(CONSTANTS[name], token.column))
        if name in FUNCTIONS:
            raise ExpressionError(f"{name} is a function; write {name}(...)", token.column)
        return self._counted(Name(name, token.column))

    def _call(self, token: _Token, name: str, in_quotes: bool) -> Tree:
        """Return the tree of a call of a function or a table."""
        opened, arguments = self._take(), []
        if self._next.text != ")":
            arguments.append(self._expression(0))
            while self._next.text == ",":
                self._take()
                arguments.append(self._expression(0))
        self._close(opened)
        count = len(arguments)
        if in_quotes or name not in FUNCTIONS:
            if count not in (1, 2):
                message = f"'{name}' is given {count} arguments; a table has one or two"
                raise ExpressionError(message, token.column)
            return self._counted(Lookup(name, tuple(arguments), token.column))
        needed = FUNCTIONS[name]
        if count < needed or (count > needed and name not in ANY_NUMBER):
            least = "at least " if name in ANY_NUMBER else ""
            message = f"{name} takes {least}{needed} argument{'s' * (needed > 1)}, not {count}"
            raise ExpressionError(message, token.column)
        if name not in ANY_NUMBER:
            return self._counted(Call(name, tuple(arguments), token.column))
        tree = arguments[0]
        for argument in arguments[1:]:
            tree = self._counted(Call(name, (tree, argument), token.column))
        return tree
