"""Departures from the schema in the words of a deck: what is wrong, and what would be right.

Every element is looked at once, whatever is wrong with others, so the time is proportional to the
deck and a message costs nothing until it is wanted.
"""

import difflib
from collections.abc import Callable, Iterator
from functools import partial

from msahl.deck.faults import Element, Faults, collapsed, text
from msahl.deck.rules import Rule, Word

NAMES = ("name", "body", "joint", "first", "second")
"""Elements that hold a name."""

Departure = tuple[Element, Callable[[], str]]
"""An element that is wrong, and the message."""


def add_faults(root: Element, rule: Rule, faults: Faults) -> None:
    """Add a fault for everything in ``root`` that its ``rule`` forbids."""
    waiting = [(root, rule)]
    while waiting:
        element, rule = waiting.pop()
        for place, message in _departures(element, rule):
            faults.add(place, message)
        known = rule.children
        inside = [(child, known[str(child.tag)]) for child in element if child.tag in known]
        waiting += reversed(inside)  # so the next is the first: faults come in the order of lines


def _departures(element: Element, rule: Rule) -> Iterator[Departure]:
    """What is wrong with an element, apart from what its known children hold."""
    yield from _attributes(element, rule)
    if rule.word is None:
        yield from _children(element, rule)
    elif len(element):
        for child in element:
            yield child, partial(_misplaced, str(child.tag), str(element.tag))
    elif not rule.word.accepts(element.text or "") and (text(element) or not rule.optional):
        yield element, partial(_wrong_text, str(element.tag), text(element), rule.word)


def _attributes(element: Element, rule: Rule) -> Iterator[Departure]:
    """Attributes the element does not take, or not with this value. (None is required.)"""
    for key, value in element.attrib.items():
        name, word = str(key), rule.attributes.get(str(key))
        if word is None:
            yield element, partial(_unknown_attribute, name, tuple(rule.attributes))
        elif not word.accepts(str(value)):
            yield element, partial(_wrong_attribute, name, collapsed(str(value)), word)


def _children(element: Element, rule: Rule) -> Iterator[Departure]:
    """Children that are unknown, repeated or missing, and text where children belong."""
    tag, known = str(element.tag), rule.children
    seen: set[str] = set()
    for child in element:
        name = str(child.tag)
        if name not in known:
            yield child, partial(_unknown_child, name, tag, tuple(known))
        elif rule.model == "all" and name in seen:
            yield child, partial("<{}> stands twice in <{}>; keep one".format, name, tag)
        seen.add(name)
    for name in rule.required:
        if name not in seen:
            yield element, partial("<{}> is missing; add it to <{}>".format, name, tag)
    if rule.model == "choice" and rule.once and len(element) > 1:
        first, *others = element
        for child in others:
            yield child, partial("<{}> stands beside <{}>; keep one".format, child.tag, first.tag)
    elif rule.model in ("choice", "sequence") and rule.needed and not seen & known.keys():
        yield element, partial("<{}> is empty; add {}".format, tag, _listed(_tags(tuple(known))))
    stray = _stray_text(element)
    if not rule.model and element.text:
        yield element, partial("<{}> holds nothing, not even spaces; write <{}/>".format, tag, tag)
    elif stray:
        holds = _listed(_tags(tuple(known)))
        yield element, partial("stray text '{}'; <{}> holds {}".format, stray, tag, holds)


def _stray_text(element: Element) -> str:
    """Text between the children, shortened."""
    pieces = [element.text, *(child.tail for child in element)]
    return collapsed(" ".join(piece for piece in pieces if piece))[:40]


def _misplaced(child: str, tag: str) -> str:
    return f"<{child}> does not belong in <{tag}>, which holds a value"


def _unknown_attribute(name: str, known: tuple[str, ...]) -> str:
    return f"unknown attribute {name}{_choice(name, known)}"


def _unknown_child(name: str, tag: str, known: tuple[str, ...]) -> str:
    return f"unknown element <{name}> in <{tag}>{_choice(f'<{name}>', _tags(known))}"


def _wrong_attribute(name: str, value: str, word: Word) -> str:
    """Why an attribute's value is refused."""
    if word.allowed:
        what = "unknown unit " if name == "units" else f"unknown value {name}="
        return f"{what}'{value}'{_choice(value, word.allowed)}"
    if word.filled:
        return f"the {name} is empty; give a name"
    return f"{name}='{value}' is not a number from {word.low:g} to {word.high:g}"


def _wrong_text(tag: str, given: str, word: Word) -> str:
    """Why the text of an element is refused."""
    if word.allowed:
        return f"unknown value '{given}'{_choice(given, word.allowed)}"
    if tag in NAMES:
        return "the name is empty; give a name"
    return f"'{given}' is not a finite number such as 2, -0.5 or 1.5e-3"


def _choice(given: str, known: tuple[str, ...]) -> str:
    """The remedy for an unknown word: the likely one first, then all."""
    if not known:
        return "; none is expected here"
    near = difflib.get_close_matches(given, known, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"; {hint}expected {_listed(known)}"


def _tags(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"<{name}>" for name in names)


def _listed(names: tuple[str, ...]) -> str:
    if not names:
        return "nothing"
    return names[0] if len(names) == 1 else f"one of {', '.join(names)}"
