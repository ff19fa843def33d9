"""Read foreign XML safely: numbers of elements, and what is wrong or not carried over.

Files are parsed as decks are (``msahl.deck.parse``): no entity, no other file, bounded size. Every
message has the file and the line of its element.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from msahl.deck.faults import DeckError, Element, Fault, attribute, line_of

LARGEST = 1e15
"""Largest number in SI: products of several stay finite. The heaviest machines have 1e9 kg."""
MOST_FAULTS = 100
"""Faults after which reading ends."""

LOST, CHANGED, DOUBTFUL = "not carried over", "changed", "inertia"
"""Kinds of notes: what the deck does not have, what it has in another form, impossible bodies."""


@dataclass(frozen=True, slots=True)
class Note:
    """What a reader of the deck should know of an element of the file: ``kind`` is LOST, CHANGED or
    DOUBTFUL, ``where`` the element, with its name if it has one."""

    kind: str
    file: str
    line: int
    where: str
    message: str

    def __str__(self) -> str:
        return str(Fault(self.file, self.line, self.where, f"{self.kind}: {self.message}"))


@dataclass
class Log:
    """Faults and notes of the ``file`` that is imported; ``origins`` are the files of elements that
    it includes."""

    file: str
    faults: list[Fault] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    origins: dict[Element, str] = field(default_factory=dict)

    def fault(self, element: Element, message: str) -> None:
        """Add a fault; raises ``DeckError`` if there are too many to go on."""
        self.faults.append(Fault(self.file_of(element), line_of(element), where(element), message))
        if len(self.faults) >= MOST_FAULTS:
            self.raise_if_any()

    def stop(self, element: Element, message: str) -> NoReturn:
        """Raise ``DeckError`` with this fault and all others."""
        self.fault(element, message)
        raise DeckError(tuple(self.faults))

    def raise_if_any(self) -> None:
        """Raise ``DeckError`` with all faults, if there are any."""
        if self.faults:
            raise DeckError(tuple(sorted(set(self.faults), key=lambda f: (f.file, f.line))))

    def lost(self, element: Element, message: str) -> None:
        """Note that an element is not carried over."""
        self._note(LOST, element, message)

    def changed(self, element: Element, message: str) -> None:
        """Note that an element is carried over in another form."""
        self._note(CHANGED, element, message)

    def doubtful(self, element: Element, message: str) -> None:
        """Note that an element states an inertia that no body has."""
        self._note(DOUBTFUL, element, message)

    def _note(self, kind: str, element: Element, message: str) -> None:
        self.notes.append(
            Note(kind, self.file_of(element), line_of(element), where(element), message)
        )

    def file_of(self, element: Element) -> str:
        """Return the file that an element stands in."""
        steps = (element, *element.iterancestors()) if self.origins else ()
        return next((self.origins[e] for e in steps if e in self.origins), self.file)


def where(element: Element) -> str:
    """Return an element for a message: ``link 'arm', inertial/mass``."""
    path: list[str] = []
    for step in (element, *element.iterancestors()):
        name = attribute(step, "name")
        if name:
            return ", ".join(filter(None, (f"{step.tag} '{name}'", "/".join(path))))
        path.insert(0, str(step.tag))
    return "/".join(path[1:] or path)


def numbers(
    element: Element, name: str, log: Log, given: Sequence[float] | None = None, count: int = 3
) -> list[float]:
    """Return the ``count`` numbers of an attribute; the ones ``given`` (by default zeros) without
    it, or with a fault."""
    default = list(given) if given is not None else [0.0] * count
    text = element.get(name)
    if text is None:
        return default
    values = floats(text)
    if values is None or len(values) != count:
        expected = "a finite number" if count == 1 else f"{count} finite numbers"
        log.fault(element, f'{name}="{text[:60]}": expected {expected} up to {LARGEST:g}')
        return default
    return values


def number(element: Element, name: str, log: Log, given: float = 0.0) -> float:
    """Return the number of an attribute; ``given`` without it, or with a fault."""
    return numbers(element, name, log, (given,), 1)[0]


def floats(text: str) -> list[float] | None:
    """Return the numbers in a text; None if one is no number, not finite or too large."""
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return None
    # Python reads 1_000 and words such as nan as numbers.
    good = "_" not in text and all(map(math.isfinite, values))
    return values if good and all(abs(value) <= LARGEST for value in values) else None


def direction(element: Element, name: str, log: Log, given: Sequence[float]) -> np.ndarray:
    """Return the unit vector (3,) of an attribute; that of ``given`` without it or with a fault."""
    a = np.array(numbers(element, name, log, given))
    length = math.hypot(*a)
    if length > 0.0:
        return a / length
    log.fault(element, f"{name} is zero; give a direction")
    return np.array(given) / math.hypot(*given)


def unknown(element: Element, known: Mapping[str, object] | Sequence[str], log: Log) -> None:
    """Note the children of an element that are none of the ``known`` ones."""
    for child in element:
        if child.tag not in known:
            log.lost(child, "msahl has no such element")
