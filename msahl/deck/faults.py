"""Faults of a deck: collected, told all at once, each with file, line, place and remedy."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from typing import NoReturn

from lxml import etree

from msahl.vector import Vector

Element = etree._Element

KINDS = {"bodies": "body", "joints": "joint", "motions": "motion", "loads": "load"}
"""What a child of these elements is called in a message."""

MOST_FAULTS = 1000
"""Told at once: a file with more is no deck with slips."""
MOST_LISTED = 20
"""Names listed in a message."""
LONGEST = 600
"""Characters of each part of a message; of a longer one the middle is left out."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: ``file`` as the user named it, ``line`` (0: the file as a whole), ``where`` (an
    element's path, or its body, joint, motion or load by name), ``message`` with the remedy."""

    file: str
    line: int
    where: str
    message: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        return ": ".join(_fit(part) for part in (place, self.where, self.message) if part)


class DeckError(Exception):
    """A deck that cannot be run; ``faults`` holds every fault found, in the order of lines."""

    def __init__(self, faults: tuple[Fault, ...]) -> None:
        super().__init__(faults)
        self.faults = faults

    def __str__(self) -> str:
        return "\n".join(map(str, self.faults))


class Faults:
    """Collects the faults of the deck ``file``, and knows which elements are free of them."""

    def __init__(self, file: str) -> None:
        self.file = file
        self._found: dict[Fault, None] = {}  # ordered, without repetitions
        self._touched: set[Element] = set()

    def add(self, element: Element, message: str, at: Element | None = None) -> None:
        """A fault of ``element``, on the line of ``at`` if that is given.

        Raises ``DeckError``, as ``add_line`` does, where there are too many to go on.
        """
        self._add(line_of(element if at is None else at), where(element), message)
        self.doubt(element)

    def add_line(self, root: Element, line: int, message: str) -> None:
        """A fault of the tree ``root`` of which no more is known than its line."""
        self._add(line, "", message)
        self.doubt(root)

    def _add(self, line: int, where: str, message: str) -> None:
        self._found[Fault(self.file, line, where, message)] = None
        if len(self._found) >= MOST_FAULTS:
            self._raise(Fault(self.file, 0, "", f"{MOST_FAULTS} faults so far; mend these first"))

    def doubt(self, element: Element) -> None:
        """``element`` is not sound, through no fault of its own."""
        self._touched.update((element, *element.iterancestors()))

    def sound(self, element: Element) -> bool:
        """No fault was found in ``element`` or in anything inside it."""
        return element not in self._touched

    def stop(self, message: str, line: int = 0) -> NoReturn:
        """Raise ``DeckError`` for a file that cannot be read any further."""
        raise DeckError((Fault(self.file, line, "", message),))

    def raise_if_any(self) -> None:
        """Raise ``DeckError`` with all faults, in the order of lines, if there are any."""
        if self._found:
            self._raise()

    def _raise(self, *more: Fault) -> NoReturn:
        """Raise ``DeckError`` with all faults, in the order of lines, and what is to be added."""
        raise DeckError((*sorted(self._found, key=lambda fault: fault.line), *more))


def line_of(element: Element) -> int:
    """Line of an element in its file; 0 if it came from no file."""
    line = element.sourceline
    return line if isinstance(line, int) else 0


def collapsed(given: str) -> str:
    """``given`` with white space collapsed: XML's own four characters, which the schema collapses,
    and none of those that Python counts as well."""
    return " ".join(re.findall(r"[^ \t\r\n]+", given))


def text(element: Element | None) -> str:
    """Text of an element with white space collapsed; empty without element."""
    return "" if element is None else collapsed(element.text or "")


def attribute(element: Element, name: str, default: str = "") -> str:
    """Value of an attribute with white space collapsed; ``default`` without it."""
    return collapsed(element.get(name, default))


def printable(given: str) -> str:
    """``given`` with escapes in place of what does not print, which a terminal might obey."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in given)


def listed(names: Iterable[str]) -> str:
    """Names for a reader: the first of them, and how many more there are."""
    names = list(names)
    more = f", and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    return ", ".join(islice(names, MOST_LISTED)) + more


def _fit(part: str) -> str:
    """A part of a message as it may be shown: printable, and not of any length."""
    if len(part) > LONGEST:
        part = f"{part[: LONGEST // 2]} ... {part[-LONGEST // 2 :]}"
    return printable(part)


def where(element: Element) -> str:
    """Place of an element for a reader: ``body 'Bob', moi/Ixx`` or ``system/gravity/g3``."""
    path: list[str] = []
    for step in (element, *element.iterancestors()):
        record = _record(step)
        if record:
            return ", ".join(filter(None, (record, "/".join(path))))
        path.insert(0, str(step.tag))
    return "/".join(path[1:] or path)


def _record(element: Element) -> str:
    """``body 'Bob'`` for a body, joint, motion or load; "" for any other element."""
    parent = element.getparent()
    kind = KINDS.get(str(parent.tag)) if parent is not None else None
    if parent is None or kind is None:
        return ""
    name = text(element.find("name"))
    return f"{kind} '{name}'" if name else f"{kind} {parent.index(element) + 1}"


def shown(a: Vector) -> str:
    """A vector for a reader."""
    x, y, z = (component + 0.0 for component in a)  # no minus before a zero
    return f"({x:.9g}, {y:.9g}, {z:.9g})"
