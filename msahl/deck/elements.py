"""Make elements of decks from numbers in SI, names, vectors and laws.

Numbers are written so that reading returns the same double.
"""

from collections.abc import Iterable

from lxml.etree import Comment, SubElement, tostring

from msahl.algebra.functions import Law
from msahl.algebra.vector import Vector
from msahl.check.faults import SMALLEST
from msahl.deck.faults import Element
from msahl.deck.laws import COEFFICIENTS
from msahl.deck.units import DEFAULTS
from msahl.deck.values import VECTORS

LINE = 100
"""Characters of a line in which an element is written with all that it contains."""
EACH_LINE = 6
"""Numbers of a list in one line."""


def deck_bytes(root: Element, note: str = "") -> bytes:
    """Return the text of a deck, with a ``note`` as a comment at its head."""
    parts = [Comment(note), root] if note else [root]
    lines = [tostring(part, encoding="UTF-8") for part in parts]
    return b"\n".join([b"<?xml version='1.0' encoding='UTF-8'?>", *lines, b""])


def child(parent: Element, tag: str, text: str = "", **attributes: str) -> Element:
    """Return a new child; it has those attributes that are not empty."""
    element = SubElement(parent, tag, {key: word for key, word in attributes.items() if word})
    element.text = text or None
    return element


def number(parent: Element, tag: str, value: float | None, quantity: str = "") -> None:
    """Add a number with its unit; nothing for None. A deck has none that is smaller than
    ``SMALLEST`` but not zero."""
    if value is not None:
        units = DEFAULTS["SI"][quantity] if quantity else ""
        child(parent, tag, repr(float(value) if abs(value) >= SMALLEST else 0.0), units=units)


def number_unless(
    parent: Element, default: float, tag: str, value: float, quantity: str = ""
) -> None:
    """Add a number with its unit unless it is the default."""
    if value != default:
        number(parent, tag, value, quantity)


def numbers(parent: Element, tag: str, values: Iterable[float]) -> Element:
    """Add a list of numbers."""
    words = [repr(float(value)) for value in values]
    lines = [" ".join(words[i : i + EACH_LINE]) for i in range(0, len(words), EACH_LINE)]
    return child(parent, tag, "\n".join(lines))


def vector(parent: Element, tag: str, a: Vector, basis: str = "", always: bool = False) -> None:
    """Add a vector by those components that are not zero; a zero vector only ``always``."""
    if not any(a) and not always:
        return
    quantity, tags = VECTORS[tag]
    element = child(parent, tag, basis=basis)
    given = list(zip(tags, a, strict=True))
    for name, value in [(name, value) for name, value in given if value] or given[:1]:
        number(element, name, value, quantity)


def law(parent: Element, given: Law, quantity: str) -> None:
    """Add a ``<law>`` of time whose values are of a ``quantity``."""
    holder, a = child(parent, "law"), given.numbers
    if given.kind == "constant":
        number(holder, "constant", a[0], quantity)
    elif given.kind == "polynomial" and len(a) <= len(COEFFICIENTS):
        element = child(holder, "polynomial")
        for tag, value in zip(COEFFICIENTS, a, strict=False):
            number(element, tag, value, quantity)
    elif given.kind == "sine":
        element = child(holder, "sine")
        number(element, "amplitude", a[0], quantity)
        number(element, "frequency", a[1], "frequency")
        number(element, "phase", a[2], "angle")
        number(element, "offset", a[3], quantity)
    elif given.kind == "ramp":
        element = child(holder, "ramp")
        for tag, value, of in zip(
            ("from", "to", "start", "end"), a, (quantity, quantity, "time", "time"), strict=True
        ):
            number(element, tag, value, of)
    elif len(a) and not len(a) % 2:
        table(holder, given, ("t", "time"), ("value", quantity))
    else:
        raise ValueError(f"a deck has no {given.kind} of {len(a)} numbers; write another law")


def table(parent: Element, given: Law, argument: tuple[str, str], value: tuple[str, str]) -> None:
    """Add a ``<table>`` whose entries hold an ``argument`` and a ``value``: each a tag and a
    physical quantity."""
    element, half = child(parent, "table", interpolation=given.kind), len(given.numbers) // 2
    for x, y in zip(given.numbers[:half], given.numbers[half:], strict=True):
        entry = child(element, "entry")
        number(entry, argument[0], x, argument[1])
        number(entry, value[0], y, value[1])


def lay_out(element: Element, depth: int = 0) -> None:
    """Put each element into a line of its own; one that contains only few and short ones into one
    line with these."""
    flat = not any(len(inner) for inner in element)
    if not len(element) or (flat and len(tostring(element)) <= LINE - 2 * depth and depth > 1):
        return
    element.text = "\n" + "  " * (depth + 1)
    for inner in element:
        lay_out(inner, depth + 1)
        inner.tail = element.text
    element[-1].tail = "\n" + "  " * depth
