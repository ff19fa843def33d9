"""Rules about expressions of the motion: their names, circles of signals, actuators."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

from msahl.algebra.functions import Law
from msahl.algebra.surfaces import Surface
from msahl.check.context import Context
from msahl.check.faults import Finding
from msahl.check.joints import coordinate_findings
from msahl.check.laws import law_findings
from msahl.expressions.evaluate import CONDITIONS, evaluate
from msahl.expressions.syntax import (
    RESERVED,
    Call,
    ExpressionError,
    Lookup,
    Name,
    Tree,
    check_names,
    nearest,
    postorder,
)
from msahl.model.loads import JointActuator, MarkerActuator
from msahl.model.signals import AnySignal, Signal, SignalState, names_in, tree_of


def expression_findings(part: str, tree: Tree, context: Context) -> Iterator[Finding]:
    """Find names and tables in an expression that the model does not have."""
    try:
        check_names(tree, context.values, context.tables)
    except ExpressionError as error:
        yield Finding(part, f"{error.message} (at column {error.column})")
        return
    for node in postorder(tree):
        if isinstance(node, Lookup) and len(node.arguments) != context.tables[node.table]:
            wanted = ("one argument", "two arguments")[context.tables[node.table] - 1]
            message = f"the table '{node.table}' has {wanted} (at column {node.column})"
            yield Finding(part, message)
            return
    yield from constant_findings(part, tree)


def constant_findings(part: str, tree: Tree) -> Iterator[Finding]:
    """Find the first part of an expression that depends on no name and has no value, such as 1/0,
    unless a condition decides whether it is needed.
    """
    constant: dict[int, bool] = {}
    parts = [tree]
    for node in postorder(tree):
        inside = node.arguments if isinstance(node, Call | Lookup) else ()
        among = all(constant[id(argument)] for argument in inside)
        constant[id(node)] = among and not isinstance(node, Name | Lookup)
        lazy = isinstance(node, Call) and node.function in CONDITIONS
        parts += [] if constant[id(node)] or lazy else inside
    for node in parts:
        if constant[id(node)]:
            try:
                evaluate(node, {})
            except ExpressionError as error:
                yield Finding(part, f"{error.message} (at column {error.column})")
                return


def signal_findings(signal: AnySignal, context: Context) -> Iterator[Finding]:
    """Find what is wrong with a signal, a state or a table."""
    if signal.name in RESERVED:
        message = f"'{signal.name}' is a word of expressions; choose another name"
        yield Finding("name", message)
    if isinstance(signal, Signal):
        yield from expression_findings("expression", signal.expression, context)
    elif isinstance(signal, SignalState):
        yield from expression_findings("rate", signal.rate, context)
    elif isinstance(signal.table, Law):
        yield from law_findings(signal.table)
    else:
        yield from surface_findings(signal.table)


def surface_findings(surface: Surface) -> Iterator[Finding]:
    """Find arguments of a table of two variables that do not increase, and missing values."""
    if surface.kind not in ("linear", "cubic"):
        message = f"unknown interpolation '{surface.kind}'; expected linear or cubic"
        yield Finding("interpolation", message)
    for part, numbers in (("x", surface.x), ("y", surface.y)):
        fewest = 3 if surface.kind == "cubic" else 2
        if len(numbers) < fewest:
            message = f"a {surface.kind} table needs {fewest} or more; it has {len(numbers)}"
            yield Finding(part, message)
        elif any(not b > a for a, b in pairwise(numbers)):
            yield Finding(part, "the numbers must increase")
    wanted = (len(surface.x), len(surface.y))
    if len(surface.values) != wanted[0]:
        message = f"{wanted[0]} rows are needed, one for each x; there are {len(surface.values)}"
        yield Finding("values", message)
    for row in surface.values:
        if len(row) != wanted[1]:
            message = f"a row has {wanted[1]} values, one for each y; one has {len(row)}"
            yield Finding("values", message)
            break


def circle_findings(signals: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield (name, message) for each signal that depends on itself; states may."""
    uses = {
        name: {used for used in names_in(tree) if isinstance(signals.get(used), Signal)}
        for name, signal in signals.items()
        if isinstance(signal, Signal) and (tree := tree_of(signal)) is not None
    }
    if not uses:
        return
    from msahl.expressions.order import in_order, shown_circle  # which most models do without

    for circle in in_order(uses)[1]:
        path = shown_circle(circle)
        yield circle[0], f"the signal depends on itself: {path}; make one of them a <state>"


def joint_actuator_findings(load: JointActuator, context: Context) -> Iterator[Finding]:
    """Find a coordinate or a name that does not exist."""
    yield from coordinate_findings("joint", load.joint, load.coordinate, context)
    yield from expression_findings("expression", load.expression, context)


def marker_actuator_findings(load: MarkerActuator, context: Context) -> Iterator[Finding]:
    """Find markers that do not exist or are on one body, and names that do not exist."""
    unknown = False
    for part, name in (("from", load.start), ("to", load.end)):
        if name not in context.markers:
            unknown = True
            message = f"'{name}' is not a marker of this model{nearest(name, context.markers)}"
            yield Finding(part, message)
    if not unknown:
        bodies = {context.markers[name] for name in (load.start, load.end)}
        if len(bodies) == 1 or bodies <= {*context.grounds}:
            yield Finding("to", "both markers are on one body; name markers of two")
    yield from expression_findings("expression", load.expression, context)
