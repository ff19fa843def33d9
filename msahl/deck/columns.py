"""Columns: many elements of a deck that differ in numbers and names only, read as if they were one.

    elements -> those of one form -> a Column for all of them -> a record of arrays -> records

A column has the interface of an element, and ``ColumnReader`` that of a ``Reader``, so the same
functions read both, by the same tags, units and formulas: from an element a record, from a column
a record with arrays (n,) in place of numbers and lists of n in place of names. Elements that may
have a fault are only marked here. They are read one by one, which finds the words for it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NoReturn, cast

import numpy as np

from msahl.algebra.rotation import from_axis_angle, rescaled
from msahl.algebra.vector import ZERO, Matrix, times, transpose
from msahl.check.context import INERTIAL
from msahl.check.faults import LARGEST, SMALLEST
from msahl.deck.faults import Element, Faults, attribute, collapsed
from msahl.deck.units import DEFAULTS, UNIT_FACTORS, UNITS, to_si
from msahl.deck.values import INERTIAL_BASIS, Reader

LEAST = 32
"""Elements of one form for which arrays are faster than one by one."""


class Unusual(Exception):  # noqa: N818 - no error: these elements are read one by one
    """Raised where a column has what is not read in columns."""


class Column:
    """``n`` elements of one form, in place of one: ``text`` holds their texts, attributes are the
    same in all of them but for ``basis``, which is kept as ``bases``."""

    def __init__(self, element: Element, words: Iterator[tuple[str | None, ...]]) -> None:
        self.tag = str(element.tag)
        self.attributes = {str(key): str(value) for key, value in element.items()}
        self.bases = next(words) if "basis" in self.attributes else None
        self.text = next(words)
        self.children = [Column(child, words) for child in element]

    def __iter__(self) -> Iterator["Column"]:
        return iter(self.children)

    def get(self, name: str) -> str | None:
        """Return an attribute that is the same in all elements."""
        return self.attributes.get(name)

    def find(self, path: str) -> "Column | None":
        """Return the first column at a path of tags."""
        tag, _, rest = path.partition("/")
        child = next((child for child in self.children if child.tag == tag), None)
        return child.find(rest) if rest and child is not None else child

    def iterfind(self, path: str) -> Iterator["Column"]:
        """Yield the columns at a path of tags, of which there is one at most."""
        found = self.find(path)
        return iter(() if found is None else (found,))


def columns(elements: Sequence[Element]) -> Iterator[tuple[Column, list[int]]]:
    """Yield the columns of ``elements`` of one form, if they are many, and their indices."""
    forms: dict[tuple[Any, ...], list[int]] = {}
    words = []
    for index, element in enumerate(elements):
        form, own = _taken_apart(element)
        forms.setdefault(form, []).append(index)
        words.append(own)
    for indices in forms.values():
        if len(indices) >= LEAST:
            rows = zip(*(words[i] for i in indices), strict=True)
            yield Column(elements[indices[0]], rows), indices


def _taken_apart(element: Element) -> tuple[tuple[Any, ...], list[str | None]]:
    """Return the form of an element, and the words in which it may differ from others: texts, and
    names of axes before them."""
    form: list[Any] = []
    words: list[str | None] = []
    for part in element.iter():
        form += (part.tag, len(part))
        for key, value in part.items():
            form.append(key)
            (words if key == "basis" else form).append(str(value))
        words.append(part.text)
    return tuple(form), words


class _NoFaults:
    """Takes the place of faults: what would be one is read one by one."""

    def add(self, *_: object) -> NoReturn:
        raise Unusual

    def sound(self, _: object) -> bool:
        return True


@dataclass(frozen=True, slots=True)
class ColumnReader(Reader):
    """Reader of columns of ``size`` elements. ``doubtful`` (size,) marks those that may have a
    fault; what is returned for them is of no use."""

    size: int = 0
    doubtful: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    orientations: list[Any] = field(default_factory=list)

    @classmethod
    def beside(cls, reader: Reader, size: int) -> "ColumnReader":
        """Return a reader of columns that knows what ``reader`` does."""
        known = {f.name: getattr(reader, f.name) for f in fields(Reader)}
        known["faults"] = cast(Faults, _NoFaults())
        return cls(**known, size=size, doubtful=np.zeros(size, dtype=bool))

    def doubt(self, which: np.ndarray) -> None:
        """Mark elements that may have a fault."""
        self.doubtful[:] |= which

    def name(self, element: Any) -> Any:
        """Return the names of all elements."""
        return [collapsed(name or "") for name in element.find("name").text]

    def is_known(self, body: Any) -> bool:
        """Return True; elements that name a body which does not exist are doubtful."""
        axes = self.context.axes
        self.doubt(np.array([name not in axes for name in body]))
        return True

    def number(self, element: Any, quantity: str = "") -> Any:
        """Return the values (size,) in SI, zero without element."""
        if element is None:
            return 0.0
        words = [word or "" for word in element.text]
        if quantity:
            unit = attribute(element, "units") or DEFAULTS[self.unit_system][quantity]
            if unit not in UNITS[quantity]:
                raise Unusual
            if unit not in UNIT_FACTORS[quantity]:
                return self.limited(element, [to_si(float(w), unit, quantity) for w in words])
        elif element.get("units"):
            raise Unusual
        return self.limited(element, list(map(float, words)))

    def limited(self, element: Any, value: Any) -> Any:
        """Return the values as an array; those too large or too small are doubtful."""
        values = np.array(value)
        size = np.abs(values)
        self.doubt(~((size >= SMALLEST) & (size <= LARGEST) | (size == 0.0)))
        return values

    def numbers(self, parent: Any, tags: Sequence[str], quantity: str = "") -> tuple[Any, ...]:
        """Return the values of the children ``tags``; missing ones are zero."""
        values: dict[str, Any] = dict.fromkeys(tags, 0.0)
        for child in parent:
            if child.tag in values:
                values[child.tag] = self.number(child, quantity)
        return tuple(values.values())

    def vector(self, element: Any, own: Any, wanted: Any) -> Any:
        """Return the components of vectors in the axes of ``wanted``; the basis of each is ``own``
        unless it names another. Either is one name for all elements or one for each."""
        if element is None:
            return ZERO
        components = self.components(element)
        basis = self._bases(element, own)
        if basis == wanted:
            return components
        given, axes = self._axes(basis), self._axes(wanted)
        if given == axes:
            return components
        here, there = (tuple(np.moveaxis(np.array(a), 0, -1)) for a in (given, axes))
        rotated = times(transpose(cast(Matrix, there)), times(cast(Matrix, here), components))
        same = np.array([a == b for a, b in zip(given, axes, strict=True)])
        return tuple(np.where(same, *pair) for pair in zip(components, rotated, strict=True))

    def _bases(self, element: Column, own: Any) -> Any:
        """Return the names of the axes in which vectors are given."""
        if element.bases is None:
            return own
        axes, names = self.context.axes, [collapsed(name or "") for name in element.bases]
        known = {*axes, INERTIAL_BASIS} - {INERTIAL}
        self.doubt(np.array([name not in known for name in names]))
        return [name if name in axes else INERTIAL for name in names]

    def _axes(self, names: Any) -> list[Matrix]:
        """Return the axes of each name."""
        axes = self.context.axes
        return [axes[names]] * self.size if isinstance(names, str) else [axes[n] for n in names]

    def orientation(self, body: Any) -> Any:
        """Return the Wiener-Milenkovic parameters of all bodies, as vectors; computed once."""
        if not self.orientations:
            self.orientations.append(Reader.orientation(self, body))
        return self.orientations[0]

    def rescaled(self, P: Any) -> Any:
        """Return parameters as vectors, rescaled."""
        return list(map(rescaled, rows(P, self.size)))

    def rotation(self, rotation: Any) -> Any:
        """Return the parameters of rotations, as vectors; those about a zero axis are doubtful."""
        phi = rows(self.number(rotation.find("phi"), "angle"), self.size)
        axes = rows(self.numbers(rotation, ("u1", "u2", "u3")), self.size)
        self.doubt(np.array([axis == ZERO for axis in axes]))
        pairs = zip(axes, phi, strict=True)
        return [ZERO if axis == ZERO else from_axis_angle(axis, angle) for axis, angle in pairs]


def rows(value: Any, size: int) -> list[Any]:
    """Return the value of each of ``size`` elements, from arrays (size,) in place of numbers."""
    if isinstance(value, np.ndarray):
        return cast(list[Any], value.tolist())
    if isinstance(value, list):
        return value
    if isinstance(value, tuple) and not _is_constant(value):
        return list(zip(*(rows(part, size) for part in value), strict=True))
    return [value] * size


def _is_constant(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_constant, value))
    return not isinstance(value, np.ndarray | list)


def records(columns: Any, size: int) -> list[Any]:
    """Return the records of a record of columns."""
    parts = (rows(getattr(columns, part.name), size) for part in fields(columns))
    return list(map(type(columns), *parts))
