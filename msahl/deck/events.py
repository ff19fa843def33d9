"""Reader of events: elements -> records."""

from msahl.check.events import event_findings, switchable_findings
from msahl.deck.faults import Element, attribute, text
from msahl.deck.signals import read_tree
from msahl.deck.values import Reader
from msahl.expressions.conditions import margin
from msahl.expressions.dimensions import PURE
from msahl.expressions.syntax import inside_braces
from msahl.model.events import Event

EVENTS = ("event", "released")
"""Tags of what ``<events>`` holds."""


def read_event(element: Element, reader: Reader) -> Event:
    """Return the record of an ``<event>``."""
    given = attribute(element, "when")
    inside = inside_braces(given)
    condition = given if inside is None else inside.strip()
    event = Event(
        name=attribute(element, "name"),
        condition=condition,
        expression=read_tree(element, condition, PURE, reader, margin),
        releases=_texts(element, "release"),
        engages=_texts(element, "engage"),
        message=" ".join(_texts(element, "message")),
        repeats=attribute(element, "repeats") == "true",
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
