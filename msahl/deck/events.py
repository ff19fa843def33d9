"""Reader of events: elements -> records."""

from collections.abc import Iterator
from fractions import Fraction

from msahl.check.events import event_findings, state_findings, switchable_findings
from msahl.deck.faults import Element, attribute, text
from msahl.deck.loads import basis_of
from msahl.deck.signals import (
    FORCE,
    LENGTH,
    MOMENT,
    NO_TREE,
    PER_SECOND,
    read_measured,
    read_tree,
)
from msahl.deck.units import DEFAULTS, parse_unit
from msahl.deck.values import Reader
from msahl.expressions.conditions import margin
from msahl.expressions.dimensions import ANGLE, PURE, Dimension
from msahl.expressions.evaluate import evaluate
from msahl.expressions.syntax import ExpressionError, Name, inside_braces, postorder
from msahl.model.events import Event, Impulse, ParameterChange, StateChange
from msahl.model.settable import settable
from msahl.model.signals import element_and_value

EVENTS = ("event", "released")
"""Tags of what ``<events>`` holds."""
SECOND = Dimension(s=Fraction(1))


def read_event(element: Element, reader: Reader) -> Event:
    """Return the record of an ``<event>``."""
    given = attribute(element, "when")
    inside = inside_braces(given)
    condition = given if inside is None else inside.strip()
    changes = list(_changes(element, reader))
    event = Event(
        name=attribute(element, "name"),
        condition=condition,
        expression=read_tree(element, condition, PURE, reader, margin),
        releases=_texts(element, "release"),
        engages=_texts(element, "engage"),
        message=" ".join(_texts(element, "message")),
        repeats=attribute(element, "repeats") == "true",
        states=tuple(change for change in changes if isinstance(change, StateChange)),
        parameters=tuple(change for change in changes if isinstance(change, ParameterChange)),
        impulses=tuple(_read_impulse(e, reader) for e in element.iterfind("impulse")),
    )
    reader.add(element, event_findings(event, reader.context))
    return event


def read_released(element: Element, reader: Reader) -> str:
    """Return the name of an element that is released at t = 0."""
    name = text(element)
    reader.add(element, switchable_findings("released", name, reader.context.switchable))
    return name


def _texts(element: Element, tag: str) -> tuple[str, ...]:
    return tuple(text(part) for part in element.iterfind(tag))


def _changes(element: Element, reader: Reader) -> Iterator[StateChange | ParameterChange]:
    """Yield what sets auxiliary states and numbers of loads; what sets nothing there is, is a
    fault.
    """
    context = reader.context
    for part in element.iterfind("set"):
        name = attribute(part, "name")
        load, parameter = element_and_value(name)
        if name in context.states:
            wanted = reader.signal_dimensions.get(name)
            yield StateChange(name, read_measured(part, wanted, reader))
        elif load in context.loads and parameter in settable(context.loads[load]):
            quantity = settable(context.loads[load])[parameter]
            yield ParameterChange(load, parameter, _number(part, quantity, reader))
        else:
            reader.add(element, state_findings(name, context))


def _number(part: Element, quantity: str, reader: Reader) -> float:
    """Return the number [SI] in a ``<set>`` of a load; 0 with a fault."""
    if inside_braces(text(part)) is None:
        try:
            return reader.number(part, quantity)
        except ValueError:
            pass  # an expression without braces
    wanted = parse_unit(DEFAULTS["SI"][quantity]) if quantity else None
    tree = read_measured(part, wanted.dimension if wanted else PURE, reader)
    names = [node.text for node in postorder(tree) if isinstance(node, Name)]
    if names:
        message = (
            f"a number of a load is constant from the event on, and '{names[0]}' is not; give an "
            "actuator, whose load is an expression, a <state> that the event sets"
        )
        reader.faults.add(part, message)
        return 0.0
    try:
        return evaluate(tree, {})
    except ExpressionError as error:
        reader.faults.add(part, error.message)
        return 0.0


def _read_impulse(element: Element, reader: Reader) -> Impulse:
    """Return the record of an ``<impulse>`` along a joint's coordinate or at a marker."""
    tags = ("joint", "coordinate", "marker")
    joint, coordinate, marker = (text(element.find(tag)) for tag in tags)
    if bool(joint) == bool(marker) or bool(joint) != bool(coordinate):
        message = "give either <joint> and <coordinate>, or <marker> and <direction>"
        reader.faults.add(element, message)
    direction, size = element.find("direction"), element.find("size")
    change = element.find("velocityChange")
    if direction is not None and joint:
        reader.faults.add(direction, "along a joint's coordinate it has no effect; delete it")
    if (size is None) == (change is None):
        message = "give either its <size>, or the <velocityChange> along it"
        reader.faults.add(element, message)
    angle = coordinate == "angle"
    if change is None:
        wanted, given = (MOMENT if angle else FORCE).times(SECOND), size
    else:
        wanted, given = (ANGLE if angle else LENGTH).times(PER_SECOND), change
    return Impulse(
        expression=NO_TREE if given is None else read_measured(given, wanted, reader),
        changes_velocity=change is not None,
        joint=joint,
        coordinate=coordinate,
        marker=marker,
        direction=reader.components(direction),
        basis=basis_of(direction, reader) if marker else "",
    )
