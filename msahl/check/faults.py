"""Records of what is wrong with a model, and the limits of its numbers.

A rule about one element yields findings: the part of the element that is wrong, as the name of the
record's field or of the deck's tag, and a message that ends with the remedy. ``msahl.check.check``
makes faults of them by adding kind and name of the element; the reader of decks adds file and line.
"""

import math
from collections.abc import Collection, Iterator
from dataclasses import fields
from itertools import islice
from typing import Any, NamedTuple, cast

from msahl.algebra.many import Many, isfinite
from msahl.algebra.vector import Vector
from msahl.records import record

LARGEST, SMALLEST = 1e100, 1e-100
"""Range of numbers in SI whose products of three can be computed, apart from zero. Physical
quantities stay far below: the mass of the universe is some 1e53 kg."""

ROTATED = 2.0
"""Factor on ``LARGEST`` for components of vectors, which a change of axes can enlarge."""

DERIVED = ("inertia", "force")
"""Fields that contain products of given numbers, and may therefore exceed ``LARGEST``."""

MOST_LISTED = 20
"""Names listed in a message."""


class Finding(NamedTuple):
    """What is wrong with the ``part`` of an element ("": the element itself), with the remedy."""

    part: str
    message: str


@record
class Fault:
    """What is wrong with an element of a model: its ``kind`` (body, joint, motion, load or
    simulation; "" for the model itself), its ``name``, the ``part`` of it, and what to do."""

    kind: str
    name: str
    part: str
    message: str

    def __str__(self) -> str:
        element = f"{self.kind} '{self.name}'" if self.name else self.kind
        place = ", ".join(filter(None, (element, self.part)))
        return f"{place}: {self.message}" if place else self.message


class ModelError(ValueError):
    """A model with ``faults``, all of them; no run is made of it."""

    def __init__(self, faults: list[Fault]) -> None:
        super().__init__("\n".join(map(str, faults)))
        self.faults = faults


def number_findings(record: Any) -> Iterator[Finding]:
    """Find numbers of a record that are not finite or too large to compute with."""
    for field in fields(record):
        most = math.inf if field.name in DERIVED else LARGEST
        for value in _numbers(getattr(record, field.name)):
            if not isfinite(value):
                yield Finding(field.name, f"{value:g} is not a finite number; give a finite one")
            elif abs(value) > ROTATED * most:
                yield Finding(field.name, f"{value:g} is too large; numbers go up to {LARGEST:g}")


def _numbers(value: Any) -> Iterator[float]:
    """Yield the numbers in a field: one, or those in tuples of tuples."""
    if isinstance(value, int | float):
        yield float(value)
    elif isinstance(value, Many):
        yield cast(float, value)
    elif isinstance(value, tuple):
        for entry in value:
            # A parameter that is NaN has its default, by name.
            if not (isinstance(value[0], str) and isinstance(entry, float) and math.isnan(entry)):
                yield from _numbers(entry)


def negative(part: str, value: float | None) -> Iterator[Finding]:
    """Find a number below zero where there may be none."""
    if value is not None and value < 0.0:
        yield Finding(part, f"it is {value:g}; it must not be less than zero")


def listed(names: Collection[str]) -> str:
    """Return names for a message: the first of them, and how many more there are."""
    more = f", and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    return ", ".join(islice(names, MOST_LISTED)) + more


def shown(a: Vector) -> str:
    """Return a vector for a message."""
    x, y, z = (component + 0.0 for component in a)  # no minus before a zero
    return f"({x:.9g}, {y:.9g}, {z:.9g})"
