"""Reader of laws of time, and of tables of force over length or angle: elements -> records."""

from collections.abc import Callable, Mapping
from fractions import Fraction

from msahl.algebra.functions import Law
from msahl.check.laws import closed, law_findings
from msahl.deck.faults import Element, attribute
from msahl.deck.units import UNITS, dimension_of, parse_unit, to_si_by
from msahl.deck.values import Reader
from msahl.expressions.dimensions import Dimension

COEFFICIENTS = ("c0", "c1", "c2", "c3", "c4", "c5")


def read_law(element: Element | None, quantity: str, reader: Reader) -> Law | None:
    """Return the record of a ``<law>``, whose values are of ``quantity`` ("": plain numbers)."""
    if element is None:
        return None
    (given,) = element
    if given.tag == "table":
        return read_table(given, ("t", "time"), ("value", quantity), reader)
    law = _READERS[str(given.tag)](given, quantity, reader)
    reader.add(given, law_findings(law))
    return law


def _constant(element: Element, quantity: str, reader: Reader) -> Law:
    return Law("constant", (reader.number(element, quantity),))


def _polynomial(element: Element, quantity: str, reader: Reader) -> Law:
    given = [element.find(tag) for tag in COEFFICIENTS]
    while given and given[-1] is None:
        del given[-1]
    numbers = tuple(_coefficient(place, k, quantity, reader) for k, place in enumerate(given))
    if reader.faults.sound(element) and element.find("*") is None:
        reader.faults.add(element, "it has no coefficient; add <c0> to <c5>, those that are not 0")
    return Law("polynomial", numbers or (0.0,))


def _coefficient(element: Element | None, k: int, quantity: str, reader: Reader) -> float:
    """Return the coefficient of t^k in SI; its unit is one of the ``quantity`` or that over s^k."""
    units = "" if element is None else attribute(element, "units")
    if element is None or not k or not quantity or not units or units in UNITS[quantity]:
        return reader.number(element, quantity)
    unit, per_second = parse_unit(units), Dimension(s=Fraction(-k))
    if unit is None or not unit.dimension.fits(dimension_of(quantity).times(per_second)):
        usual = f"{next(iter(UNITS[quantity]))}/sec{'' if k == 1 else f'^{k}'}"
        message = f"'{units}' does not fit here; expected a unit such as {usual}"
        reader.faults.add(element, message)
        return 0.0
    return reader.limited(element, to_si_by(float(element.text or ""), unit.factor))


def _sine(element: Element, quantity: str, reader: Reader) -> Law:
    omega = reader.number(element.find("frequency"), "frequency")
    amplitude, offset = reader.numbers(element, ("amplitude", "offset"), quantity)
    return Law("sine", (amplitude, omega, reader.number(element.find("phase"), "angle"), offset))


def _ramp(element: Element, quantity: str, reader: Reader) -> Law:
    first, last = reader.numbers(element, ("from", "to"), quantity)
    start, end = reader.numbers(element, ("start", "end"), "time")
    return Law("ramp", (first, last, start, end))


_READERS: Mapping[str, Callable[[Element, str, Reader], Law]] = {
    "constant": _constant,
    "polynomial": _polynomial,
    "sine": _sine,
    "ramp": _ramp,
}


def read_table(
    element: Element, argument: tuple[str, str], value: tuple[str, str], reader: Reader
) -> Law:
    """Return the record of a ``<table>`` whose entries hold an ``argument`` and a ``value``: each a
    tag and a physical quantity."""
    kind = attribute(element, "interpolation", "linear")
    x = [reader.number(entry.find(argument[0]), argument[1]) for entry in element]
    y = [reader.number(entry.find(value[0]), value[1]) for entry in element]
    law = Law(kind, (*x, *y))
    reader.add(element, law_findings(law, f"<{argument[0]}>"))
    return closed(law)
