"""Records of signals: named expressions, auxiliary states and tables; and the names they use.

An expression names ``t`` [s], signals and states, values of joints and markers (``Crank.angle``,
``Tip.vx``), and tables. All values are in SI.
"""

from collections.abc import Iterable, Iterator, Mapping

from msahl.algebra.functions import Law
from msahl.algebra.surfaces import Surface
from msahl.expressions.syntax import Name, Tree, postorder
from msahl.records import record

TIME = "t"


@record
class Signal:
    """An ``expression`` of the motion under a name, which others may use. ``unit`` is the SI unit
    that its deck states, empty if it states none. An ``is_input`` is an input that nothing sets:
    its expression is a number."""

    name: str
    expression: Tree
    unit: str = ""
    is_input: bool = False


@record
class SignalState:
    """An auxiliary state: it begins at ``initial``, and its ``rate`` is an expression [1/s].
    ``unit`` is that of a ``Signal``. An ``is_input`` has the rate zero: it keeps its value until
    an event or another program sets it."""

    name: str
    rate: Tree
    initial: float = 0.0
    unit: str = ""
    is_input: bool = False


@record
class SignalTable:
    """A ``table`` of one or two variables, which expressions call like a function."""

    name: str
    table: Law | Surface


@record
class Stop:
    """The run ends where ``expression`` becomes positive: the margin of a ``condition`` in words
    (``expressions.conditions``)."""

    condition: str
    expression: Tree


AnySignal = Signal | SignalState | SignalTable


def tree_of(signal: AnySignal) -> Tree | None:
    """Return the expression of a signal, or of a state's rate; None of a table."""
    if isinstance(signal, Signal):
        return signal.expression
    return signal.rate if isinstance(signal, SignalState) else None


def names_in(tree: Tree) -> Iterator[str]:
    """Yield the names in an expression, as often as they occur."""
    for node in postorder(tree):
        if isinstance(node, Name):
            yield node.text


def element_and_value(name: str) -> tuple[str, str]:
    """Return the parts of ``ELEMENT.VALUE``: "Crank" and "angle"; an element's name may have points
    itself. The first is empty for a name without a point.
    """
    element, _, value = name.rpartition(".")
    return element, value


def reached(trees: Iterable[Tree], signals: Mapping[str, AnySignal]) -> dict[str, None]:
    """Return all names on which the ``trees`` depend, also by way of signals and states, in the
    order in which they are met.
    """
    found: dict[str, None] = {}
    waiting = list(trees)
    while waiting:
        for name in names_in(waiting.pop(0)):
            if name not in found:
                found[name] = None
                tree = tree_of(signals[name]) if name in signals else None
                if tree is not None:
                    waiting.append(tree)
    return found
