"""Reader of expressions of the motion: signals, auxiliary states, tables, actuators -> records.

An expression is in SI: the numbers written in it have the SI unit that their place asks for.
Parameters are replaced by their values. Dimensions are compared where they are known: of
parameters with units, of coordinates and markers, and of signals that state their ``units``.
"""

import math
from collections.abc import Callable, Mapping
from fractions import Fraction

from msahl.algebra.functions import Law
from msahl.algebra.surfaces import Surface
from msahl.check.loads import element_findings
from msahl.check.signals import expression_findings, signal_findings
from msahl.deck.faults import Element, attribute, text
from msahl.deck.units import Unit, parse_unit, to_si_by
from msahl.deck.values import Reader
from msahl.expressions.conditions import margin
from msahl.expressions.dimensions import ANGLE, PURE, Dimension, TableDimensions, dimension
from msahl.expressions.syntax import (
    Call,
    ExpressionError,
    Lookup,
    Name,
    Number,
    Tree,
    inside_braces,
    parse,
    postorder,
)
from msahl.model.loads import JointActuator, MarkerActuator
from msahl.model.signals import (
    TIME,
    AnySignal,
    Signal,
    SignalState,
    SignalTable,
    Stop,
    element_and_value,
)

LENGTH = Dimension(m=Fraction(1))
FORCE = Dimension(kg=Fraction(1), m=Fraction(1), s=Fraction(-2))
MOMENT = FORCE.times(LENGTH)
NO_TREE = Number(0.0)
"""Stands for an expression that cannot be read."""

PER_SECOND = Dimension(s=Fraction(-1))
VALUES: Mapping[str, Dimension] = {
    **dict.fromkeys(("angle",), ANGLE),
    **dict.fromkeys(("slide", "slide1", "slide2", "x", "y", "z"), LENGTH),
    **dict.fromkeys(("vx", "vy", "vz"), LENGTH.times(PER_SECOND)),
    **dict.fromkeys(("q0", "q1", "q2", "q3"), PURE),
    **dict.fromkeys(("wx", "wy", "wz"), ANGLE.times(PER_SECOND)),
    **dict.fromkeys(("Fx", "Fy", "Fz"), FORCE),
    **dict.fromkeys(("Mx", "My", "Mz"), MOMENT),
}
"""Dimensions of the values of joints and markers; a rate has that of its coordinate per second."""


def declare_signals(elements: list[Element], reader: Reader) -> None:
    """Make names of signals, states and tables known, before any expression is read."""
    context = reader.context
    context.values[TIME] = None
    for element in elements:
        name = attribute(element, "name")
        if element.tag == "table":
            axes = [axis for axis in (element.find("x"), element.find("y")) if axis is not None]
            context.tables[name] = len(axes)
            arguments = tuple(_dimension_in(axis) for axis in axes)
            reader.table_dimensions[name] = TableDimensions(arguments, _dimension_in(element))
        else:
            context.values[name] = None
            reader.signal_dimensions[name] = _dimension_in(element)


def _dimension_in(element: Element) -> Dimension | None:
    """Return the dimension that ``units`` state, None if there are none."""
    unit = parse_unit(attribute(element, "units", "?"))
    return None if unit is None else unit.dimension


def read_signal(element: Element, reader: Reader) -> AnySignal:
    """Return the record of a ``<signal>``, ``<state>``, ``<input>`` or ``<table>`` of signals."""
    name = attribute(element, "name")
    record: AnySignal
    if element.tag == "table":
        record = SignalTable(name, read_table_of_numbers(element, reader))
    elif element.tag == "signal":
        unit = _unit(element, reader)
        tree = read_expression(element, unit and unit.dimension, reader)
        record = Signal(name, tree, attribute(element, "units"))
    elif element.tag == "input":
        _unit(element, reader)
        value = float(attribute(element, "value", "0"))
        record = SignalState(name, NO_TREE, value, attribute(element, "units"), is_input=True)
    else:
        unit = _unit(element, reader)
        wanted = unit and unit.dimension.times(PER_SECOND)
        initial = float(attribute(element, "initial", "0"))
        tree = read_expression(element, wanted, reader)
        record = SignalState(name, tree, initial, attribute(element, "units"))
    reader.add(element, signal_findings(record, reader.context))
    if name in reader.parameters:
        reader.faults.add(element, f"'{name}' is the name of a parameter; choose another")
    return record


def read_actuator(element: Element, reader: Reader) -> JointActuator | MarkerActuator:
    """Return the record of an ``<actuator>`` along a joint's coordinate or between two markers."""
    name, expression = text(element.find("name")), element.find("expression")
    joint, coordinate = element.find("joint"), element.find("coordinate")
    start, end = element.find("from"), element.find("to")
    along_joint = joint is not None and coordinate is not None
    between = start is not None and end is not None
    if (
        along_joint == between
        or (joint is None) != (coordinate is None)
        or (start is None) != (end is None)
    ):
        message = "give either <joint> and <coordinate>, or the markers <from> and <to>"
        reader.faults.add(element, message)
    wanted = MOMENT if text(coordinate) == "angle" else FORCE
    tree: Tree = NO_TREE
    if expression is not None:
        tree = read_measured(expression, wanted, reader)
    record: JointActuator | MarkerActuator
    if along_joint:
        record = JointActuator(name, text(joint), text(coordinate), tree)
    else:
        record = MarkerActuator(name, text(start), text(end), tree)
    if reader.faults.sound(element):
        reader.add(element, element_findings(record, reader.context))
    return record


def read_factor(element: Element, reader: Reader) -> Tree:
    """Return the tree of an ``<expression>`` whose value is a pure number."""
    return read_measured(element, PURE, reader)


def read_measured(element: Element, wanted: Dimension | None, reader: Reader) -> Tree:
    """Return the tree of an element's text whose ``units``, if it gives some, and whose value are
    ``wanted``; any are if that is None.
    """
    unit = _unit(element, reader, wanted)
    if unit is None and attribute(element, "units"):
        return NO_TREE
    return read_expression(element, wanted or (unit and unit.dimension), reader)


def read_stop(element: Element, reader: Reader) -> Stop:
    """Return the record of a ``<stop>``: a condition, as a function that is positive where it
    holds.
    """
    condition = attribute(element, "when")
    inside = inside_braces(condition)
    condition = condition if inside is None else inside.strip()
    record = Stop(condition, read_tree(element, condition, PURE, reader, margin))
    reader.add(element, expression_findings("when", record.expression, reader.context))
    return record


def read_expression(element: Element, wanted: Dimension | None, reader: Reader) -> Tree:
    """Return the tree of an element's text, with parameters replaced by their values; ``wanted`` is
    the dimension of the value, None if any will do.
    """
    given = text(element)
    inside = inside_braces(given)
    return read_tree(element, given if inside is None else inside, wanted, reader)


def read_tree(
    element: Element,
    given: str,
    wanted: Dimension | None,
    reader: Reader,
    converted: Callable[[Tree], Tree] = lambda tree: tree,
) -> Tree:
    """Return the tree of a ``given`` expression of an element, as ``read_expression`` does, or what
    it is ``converted`` to.
    """
    try:
        tree = parse(given)
        if all(_is_known(node, reader) for node in postorder(tree)):
            _check_dimension(tree, wanted, reader)
        tree = converted(tree)
    except ExpressionError as error:
        reader.faults.add(element, f"{error.message} (at column {error.column} of the expression)")
        return NO_TREE
    return _bound(tree, reader)


def _is_known(node: Tree, reader: Reader) -> bool:
    """Return whether there are the name or the table of a node."""
    if isinstance(node, Lookup):
        return node.table in reader.context.tables
    if isinstance(node, Name):
        return node.text in reader.parameters or node.text in reader.context.values
    return True


def _check_dimension(tree: Tree, wanted: Dimension | None, reader: Reader) -> None:
    """Raise ``ExpressionError`` if dimensions in an expression contradict each other."""
    nodes = list(postorder(tree))
    names = {n.text: _dimension_of(n.text, reader) for n in nodes if isinstance(n, Name)}
    parameters = reader.parameters
    constants = {name: parameters[name].value for name in names if name in parameters}
    tables = {n.table: reader.table_dimensions[n.table] for n in nodes if isinstance(n, Lookup)}
    found = dimension(tree, names, None, constants, tables)
    if found is not None and wanted is not None and not found.fits(wanted):
        raise ExpressionError(f"the expression is {found}, and {wanted} is needed", tree.column)


def _dimension_of(name: str, reader: Reader) -> Dimension | None:
    """Return the dimension of a name, None if it is not known."""
    parameter = reader.parameters.get(name)
    if parameter is not None:
        return None if parameter.dimension == PURE else parameter.dimension
    if name == TIME:  # as a number: sin(t) is usual
        return None
    if name in reader.signal_dimensions:
        return reader.signal_dimensions[name]
    _, value = element_and_value(name)
    known = VALUES.get(value.removesuffix("Rate"))
    return known.times(PER_SECOND) if known is not None and value.endswith("Rate") else known


def _bound(tree: Tree, reader: Reader) -> Tree:
    """Return the tree with numbers for parameters; without recursion."""
    results: list[Tree] = []
    for node in postorder(tree):
        if isinstance(node, Name) and node.text in reader.parameters:
            results.append(Number(reader.parameters[node.text].value, node.column))
        elif isinstance(node, Call | Lookup):
            first = len(results) - len(node.arguments)
            arguments = tuple(results[first:])
            del results[first:]
            if isinstance(node, Call):
                results.append(Call(node.function, arguments, node.column))
            else:
                results.append(Lookup(node.table, arguments, node.column))
        else:
            results.append(node)
    return results[0]


def _unit(element: Element, reader: Reader, wanted: Dimension | None = None) -> Unit | None:
    """Return the unit of an expression, an SI unit; None with a fault, or without ``units`` if
    nothing is ``wanted``.
    """
    name = attribute(element, "units")
    if not name:
        return Unit(Fraction(1), wanted) if wanted is not None else None
    unit = parse_unit(name)
    if unit is None:
        reader.faults.add(element, f"unknown unit '{name}'; write products with - and one /: N-m/A")
    elif unit.factor != 1:
        message = f"expressions of the motion are in SI; give {unit.dimension}, not {name}"
        reader.faults.add(element, message)
    elif wanted is not None and not unit.dimension.fits(wanted):
        reader.faults.add(element, f"'{name}' does not fit here; {wanted} is needed")
    else:
        return unit
    return None


def read_table_of_numbers(
    element: Element,
    reader: Reader,
    kind: str = "linear",
    units: tuple[str, str] = ("1", "1"),
) -> Law | Surface:
    """Return a table of one or of two variables [SI]; its ``kind``, and the units of x and of the
    values, are those that an element has which does not say otherwise."""
    kind = attribute(element, "interpolation", kind)
    x, y = element.find("x"), element.find("y")
    rows = tuple(_numbers(row, element, reader, units[1]) for row in element.iterfind("values"))
    across = () if x is None else _numbers(x, x, reader, units[0])
    if y is None:
        numbers = rows[0] if len(rows) == 1 else ()
        if len(rows) != 1 or len(numbers) != len(across):
            message = f"<values> must hold {len(across)} numbers, one for each x"
            reader.faults.add(element, message)
            return Law("constant", (0.0,))
        return Law(kind, (*across, *numbers))
    return Surface(kind, across, _numbers(y, y, reader), rows)


def _numbers(
    element: Element, units: Element, reader: Reader, default: str = "1"
) -> tuple[float, ...]:
    """Return the numbers of a list in SI; the unit is an attribute of the element ``units``."""
    name = attribute(units, "units", default)
    unit = parse_unit(name)
    if unit is None:
        reader.faults.add(units, f"unknown unit '{name}'; write products with - and one /: N-m/A")
        return ()
    values = tuple(to_si_by(float(word), unit.factor) for word in text(element).split())
    if not all(map(math.isfinite, values)):
        reader.faults.add(element, "a number is too large; numbers go up to 1e100 in SI")
    return values
