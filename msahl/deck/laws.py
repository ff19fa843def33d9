"""Laws of time, and tables of force over length or angle: elements -> records."""

import warnings
from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np

from msahl.algebra.functions import Law, build_laws
from msahl.deck.faults import Element, attribute
from msahl.deck.values import Reader

COEFFICIENTS = ("c0", "c1", "c2", "c3", "c4", "c5")

FEWEST = {"linear": 2, "cubic": 3, "periodic": 4}
"""Entries a table needs, by its interpolation."""

CLOSED = 1e-9
"""A periodic table's last value may differ from its first by this part of its range."""


def read_law(element: Element | None, quantity: str, reader: Reader) -> Law | None:
    """Record of a ``<law>``, whose values are of ``quantity`` ("": plain numbers) over time."""
    if element is None:
        return None
    (given,) = element
    return _READERS[str(given.tag)](given, quantity, reader)


def _constant(element: Element, quantity: str, reader: Reader) -> Law:
    return Law("constant", (reader.number(element, quantity),))


def _polynomial(element: Element, quantity: str, reader: Reader) -> Law:
    numbers = reader.numbers(element, COEFFICIENTS, quantity)
    if reader.faults.sound(element) and element.find("*") is None:
        reader.faults.add(element, "it has no coefficient; add <c0> to <c5>, those that are not 0")
    return Law("polynomial", numbers)


def _sine(element: Element, quantity: str, reader: Reader) -> Law:
    frequency = element.find("frequency")
    omega = reader.number(frequency, "frequency")
    if omega == 0.0 and frequency is not None and reader.faults.sound(frequency):
        reader.faults.add(frequency, "it is zero; give one, or <constant> in place of <sine>")
    amplitude, offset = reader.numbers(element, ("amplitude", "offset"), quantity)
    return Law("sine", (amplitude, omega, reader.number(element.find("phase"), "angle"), offset))


def _ramp(element: Element, quantity: str, reader: Reader) -> Law:
    first, last = reader.numbers(element, ("from", "to"), quantity)
    start, end = reader.numbers(element, ("start", "end"), "time")
    if end <= start and reader.faults.sound(element):
        message = f"it ends at {end:g} s, not after its start at {start:g} s; give a later <end>"
        reader.faults.add(element, message)
    return _drawn(element, Law("ramp", (first, last, start, end)), reader)


def _time_table(element: Element, quantity: str, reader: Reader) -> Law:
    return read_table(element, ("t", "time"), ("value", quantity), reader)


_READERS: Mapping[str, Callable[[Element, str, Reader], Law]] = {
    "constant": _constant,
    "polynomial": _polynomial,
    "sine": _sine,
    "ramp": _ramp,
    "table": _time_table,
}


def read_table(
    element: Element, argument: tuple[str, str], value: tuple[str, str], reader: Reader
) -> Law:
    """Record of a ``<table>`` whose entries hold an ``argument`` and a ``value``: each a tag and a
    quantity."""
    kind = attribute(element, "interpolation", "linear")
    entries = list(element)
    x = [reader.number(entry.find(argument[0]), argument[1]) for entry in entries]
    y = [reader.number(entry.find(value[0]), value[1]) for entry in entries]
    if len(entries) < FEWEST[kind]:
        message = f"a {kind} table needs {FEWEST[kind]} entries or more; it has {len(entries)}"
        reader.faults.add(element, message)
    for entry, (before, here) in zip(entries[1:], pairwise(x), strict=True):
        if here <= before and reader.faults.sound(entry):
            message = f"<{argument[0]}> must increase; {here:g} follows {before:g} (SI)"
            reader.faults.add(entry, message)
    if kind == "periodic" and reader.faults.sound(element):
        y[-1] = _closed(element, y, reader)
    return _drawn(element, Law(kind, (*x, *y)), reader)


def _drawn(element: Element, law: Law, reader: Reader) -> Law:
    """The ``law``; a fault if its curve cannot be computed, as of entries 1e-90 apart."""
    if reader.faults.sound(element):
        try:
            with np.errstate(all="ignore"), warnings.catch_warnings(action="error"):
                numbers = build_laws([law]).numbers
        except (np.linalg.LinAlgError, RuntimeWarning, ValueError):  # scipy's words for no spline
            numbers = np.array(np.nan)
        if not np.isfinite(numbers).all():
            message = "no curve can be computed through it; space its places wider or more evenly"
            reader.faults.add(element, message)
    return law


def _closed(element: Element, y: list[float], reader: Reader) -> float:
    """The last value of a periodic table: its first."""
    if abs(y[-1] - y[0]) > CLOSED * (max(y) - min(y)):
        message = (
            f"a periodic table ends with the value it begins with; {y[0]:.9g} and {y[-1]:.9g} "
            "differ, add an entry that closes it"
        )
        reader.faults.add(element[-1], message)
    return y[0]
