"""Faults of a deck: collected and raised all at once, each with file, line, place and remedy."""

import re
from collections.abc import Callable, Iterable
from typing import NoReturn

from lxml import etree

from msahl.printable import printable
from msahl.records import record

Element = etree._Element

KINDS = {
    "bodies": "body",
    "joints": "joint",
    "motions": "motion",
    "contacts": "contact",
    "events": "event",
    "loads": "load",
    "markers": "marker",
    "groups": "group",
}
"""What a child of these elements is called in a message."""

MOST_SHOWN = 100
"""Messages given at once; further faults are only counted."""
MOST_KEPT = 1000
"""Faults whose messages are made; the first of them in the order of lines are given."""
MOST_COUNTED = 1_000_000
"""Faults after which the search ends: each that is counted takes memory."""
LONGEST = 600
"""Characters of each part of a message; a longer part is given without its middle."""


@record
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
    """A deck that cannot be run. ``faults`` holds its faults in the order of lines; if there are
    very many, the first ones and the number of the others."""

    def __init__(self, faults: tuple[Fault, ...]) -> None:
        super().__init__(faults)
        self.faults = faults

    def __str__(self) -> str:
        return "\n".join(map(str, self.faults))


class Faults:
    """Collects the faults of the deck ``file``, and says which elements are free of them."""

    def __init__(self, file: str, word: str = "--set ") -> None:
        self.file = file
        self.word = word
        """What stands before a setting in messages."""
        self._found: dict[Fault, None] = {}  # ordered, without repetitions
        self._made = 0  # messages, those that were made twice among them
        self._more = 0  # elements with faults whose messages are not kept
        self._own: set[Element] = set()
        self._touched: set[Element] = set()
        self.origins: dict[Element, str] = {}
        """Files of the elements that were included from other files."""
        self.options: dict[Element, str] = {}
        """Options of the command line that elements were changed by: their line has no fault."""

    def add(
        self, element: Element, message: str | Callable[[], str], at: Element | None = None
    ) -> None:
        """Add a fault of ``element``, on the line of ``at`` if that is given. A ``message`` that
        takes time to make may be a function, which is called only if the message is kept.

        Raises ``DeckError`` if there are too many faults to go on.
        """
        if self._made < MOST_KEPT:
            self._made += 1
            text = message if isinstance(message, str) else message()
            self._found[self._fault(element, text, element if at is None else at)] = None
        elif element not in self._own:
            self._more += 1
            if self._more >= MOST_COUNTED:
                self._raise("at least ")
        self._own.add(element)
        self.doubt(element)

    def add_beside(self, place: str, message: str) -> None:
        """Add a fault of something that is not in the file, such as an option."""
        self._found[Fault(self.file, 0, place, message)] = None

    def take(self, faults: Iterable[Fault], element: Element) -> None:
        """Add the faults of a file that ``element`` includes."""
        self._found.update(dict.fromkeys(faults))
        self.doubt(element)

    def doubt(self, element: Element) -> None:
        """Mark ``element`` as not sound, for a fault that is not its own."""
        self._touched.update((element, *element.iterancestors()))

    @property
    def none(self) -> bool:
        """Whether nothing was found so far."""
        return not (self._found or self._touched)

    def own(self, element: Element) -> bool:
        """Return whether ``element`` itself has a fault, not only something inside it."""
        return element in self._own

    def sound(self, element: Element) -> bool:
        """Return whether neither ``element`` nor anything inside it has a fault."""
        return element not in self._touched

    def stop(self, message: str, line: int = 0) -> NoReturn:
        """Raise ``DeckError`` for a file that cannot be read any further."""
        raise DeckError((Fault(self.file, line, "", message),))

    def raise_if_any(self) -> None:
        """Raise ``DeckError`` with the first faults and the number of others, if there are any."""
        if self._found:
            self._raise()

    def _file_of(self, element: Element) -> str:
        """Return the file that an element comes from."""
        steps = (element, *element.iterancestors()) if self.origins else ()
        return next((self.origins[e] for e in steps if e in self.origins), self.file)

    def place_of(self, element: Element) -> str:
        """Return file and line of an element."""
        return f"{self._file_of(element)}:{line_of(element)}"

    def line_in_words(self, element: Element) -> str:
        """Return the line of an element, with its file if that is another one."""
        file = self._file_of(element)
        return f"line {line_of(element)}{'' if file == self.file else f' of {file}'}"

    def _fault(self, element: Element, message: str, at: Element) -> Fault:
        """Return a fault of ``element`` on the line of ``at``, or at the option that set it."""
        if at in self.options:
            return Fault(self.file, 0, f"{self.options[at]}: {where(element)}", message)
        return Fault(self._file_of(at), line_of(at), where(element), message)

    def _raise(self, about: str = "") -> NoReturn:
        """Raise ``DeckError``; ``about`` precedes the number of faults that are not shown."""
        found = sorted(self._found, key=lambda f: (f.file != self.file, f.file, f.line))
        shown, more = found[:MOST_SHOWN], len(found[MOST_SHOWN:]) + self._more
        if more:
            message = f"{about}{more} more faults are not shown; correct these first"
            shown.append(Fault(self.file, 0, "", message))
        raise DeckError(tuple(shown))


def line_of(element: Element) -> int:
    """Return the line of an element in its file; 0 if it came from no file."""
    line = element.sourceline
    return line if isinstance(line, int) else 0


def collapsed(given: str) -> str:
    """Return ``given`` with white space collapsed: XML's own four characters, which the schema
    collapses, and none of those that Python counts as well."""
    if given.isalnum():  # most names and units
        return given
    # ASCII text in XML has no other white space, and Python's own function is ten times as fast.
    return " ".join(given.split() if given.isascii() else re.findall(r"[^ \t\r\n]+", given))


def text(element: Element | None) -> str:
    """Return the text of an element with white space collapsed; empty without element."""
    return "" if element is None else collapsed(element.text or "")


def attribute(element: Element, name: str, default: str = "") -> str:
    """Return an attribute with white space collapsed, or ``default`` if there is none."""
    given = element.get(name)
    return default if given is None else collapsed(given)


def is_true(element: Element, name: str) -> bool:
    """Return whether an attribute that is true or false is true; without it, it is not."""
    return attribute(element, name) in ("true", "1")


def _fit(part: str) -> str:
    """Return a part of a message as it may be shown: printable, and of bounded length."""
    if len(part) > LONGEST:
        part = f"{part[: LONGEST // 2]} ... {part[-LONGEST // 2 :]}"
    return printable(part)


def where(element: Element) -> str:
    """Return the place of an element: ``body 'Bob', moi/Ixx`` or ``system/gravity/g3``."""
    path: list[str] = []
    for step in (element, *element.iterancestors()):
        record = _record(step)
        if record:
            return ", ".join(filter(None, (record, "/".join(path))))
        path.insert(0, str(step.tag))
    return "/".join(path[1:] or path)


def _record(element: Element) -> str:
    """Return ``body 'Bob'`` for a body, joint, motion, load, parameter or signal; "" for any other
    element."""
    parent = element.getparent()
    if element.tag == "parameter" or (parent is not None and parent.tag == "signals"):
        return f"{element.tag!s} '{attribute(element, 'name')}'"
    kind = KINDS.get(str(parent.tag)) if parent is not None else None
    if parent is None or kind is None or element.tag == "released":
        return ""
    name = text(element.find("name")) or attribute(element, "name")
    return f"{kind} '{name}'" if name else f"{kind} {parent.index(element) + 1}"
