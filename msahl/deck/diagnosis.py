"""Diagnosis of a deck that is not valid by the schema: what is wrong, and what would be right.

The rules are those of xmlschema's components. Every element is checked once, whatever is wrong with
others, and a message is made only if it is kept, so the time is proportional to the size of the
deck. xmlschema's own search for errors takes a time that grows with the square of the number of
unknown elements.
"""

import difflib
import re
from collections.abc import Callable, Iterator
from functools import cache, lru_cache, partial
from typing import TYPE_CHECKING, Any

from msahl.deck.faults import Element, Faults, collapsed, text
from msahl.records import record

if TYPE_CHECKING:  # a run of a valid deck does not import it
    from xmlschema.validators import XsdElement, XsdSimpleType

NAMES = ("name", "body", "joint", "first", "second")
"""Elements whose text is a name."""

EMPTY = {"units": "give a unit, or delete it", "href": "name a file"}
"""Remedies for empty attributes."""

Departure = tuple[Element, Callable[[], str]]
"""An element with a fault, and a function that returns the message."""

_PYTHONS_OWN = re.compile(r"(?![ \t\r\n0-9])[\s\d]")
"""Characters that are spaces or digits for Python, and so for xmlschema, but not in XML."""

_INSIDE = re.compile(r"[A-Za-z_{}*/^]")
"""Characters of texts that may be meant as expressions."""


@record
class _Rule:
    """What an element may contain: text of the type ``word``, or ``children`` in a group of one
    ``model`` (empty: no children).

    ``once`` means that the group is not repeated, ``needed`` that it may not be empty; ``required``
    are the children that may not be missing, ``stated`` the attributes. ``optional`` text may be
    empty, as it has a default.
    """

    word: "XsdSimpleType | None"
    optional: bool
    model: str
    once: bool
    needed: bool
    children: "dict[str, XsdElement]"
    required: tuple[str, ...]
    fewest: tuple[tuple[str, int], ...]
    attributes: "dict[str, XsdSimpleType]"
    stated: tuple[str, ...]


def add_faults(root: Element, declaration: "XsdElement", faults: Faults) -> None:
    """Add a fault for everything in ``root`` that its ``declaration`` in the schema forbids."""
    waiting = [(root, declaration)]
    while waiting:
        element, declaration = waiting.pop()
        rule = _rule(declaration)
        for place, message in _departures(element, rule):
            faults.add(place, message)
        known = rule.children
        inside = [(child, known[name]) for child in element if (name := str(child.tag)) in known]
        waiting += reversed(inside)  # so the next is the first: faults come in the order of lines


@cache
def _rule(declaration: "XsdElement") -> _Rule:
    """Return the rule of an element, kept because xmlschema collects its parts anew each time."""
    group = declaration.type.model_group
    members: list[Any] = [] if group is None else list(group.iter_elements())  # no wildcards
    attributes: dict[Any, Any] = dict(declaration.attributes.items())
    return _Rule(
        word=declaration.type.simple_type,
        optional=declaration.default is not None,
        model=group.model if group is not None and members else "",
        once=group is not None and group.max_occurs == 1,
        needed=group is not None and not group.is_emptiable(),
        children={member.local_name: member for member in members},
        required=tuple(
            member.local_name
            for member in members
            if group is not None and group.model == "all" and member.min_occurs
        ),
        fewest=tuple(
            (member.local_name, member.min_occurs)
            for member in members
            if group is not None and group.model == "sequence" and member.min_occurs > 1
        ),
        attributes={name: attribute.type for name, attribute in attributes.items()},
        stated=tuple(name for name, attribute in attributes.items() if attribute.use == "required"),
    )


@lru_cache(maxsize=10_000)  # most texts of a deck recur: units, names, small numbers
def _accepts(word: "XsdSimpleType", given: str) -> bool:
    """Return whether text is valid by xmlschema; white space is collapsed first."""
    return word.text_is_valid(_PYTHONS_OWN.sub("\ufffd", collapsed(given)))


def _departures(element: Element, rule: _Rule) -> Iterator[Departure]:
    """Yield what is wrong with an element, apart from the contents of its known children."""
    yield from _attributes(element, rule)
    if rule.word is None:
        yield from _children(element, rule)
    elif len(element):
        for child in element:
            yield child, partial(_misplaced, str(child.tag), str(element.tag))
    elif not _accepts(rule.word, element.text or "") and (text(element) or not rule.optional):
        yield element, partial(_wrong_text, str(element.tag), text(element), rule.word)


def _attributes(element: Element, rule: _Rule) -> Iterator[Departure]:
    """Yield attributes that are unknown, missing, or have a wrong value."""
    for name in rule.stated:
        if name not in element.attrib:
            yield element, partial("attribute {} is missing; add it".format, name)
    for key, value in element.attrib.items():
        name, word = str(key), rule.attributes.get(str(key))
        if word is None:
            yield element, partial(_unknown_attribute, name, tuple(rule.attributes))
        elif not _accepts(word, str(value)):
            yield element, partial(_wrong_attribute, name, collapsed(str(value)), word)


def _children(element: Element, rule: _Rule) -> Iterator[Departure]:
    """Yield children that are unknown, repeated or missing, and text where children belong."""
    tag, known = str(element.tag), rule.children
    seen: set[str] = set()
    for child in element:
        name = str(child.tag)
        if name not in known:
            yield child, partial(_unknown_child, name, tag, tuple(known))
        elif rule.model == "all" and name in seen:
            yield child, partial("<{}> is given twice in <{}>; keep one".format, name, tag)
        seen.add(name)
    for name in rule.required:
        if name not in seen:
            yield element, partial("<{}> is missing; add it to <{}>".format, name, tag)
    for name, least in rule.fewest:
        count = sum(str(child.tag) == name for child in element)
        if 0 < count < least:
            few = "too few <{}> in <{}>: {}; give {} or more"
            yield element, partial(few.format, name, tag, count, least)
    if rule.model == "choice" and rule.once and len(element) > 1:
        first, *others = element
        for child in others:
            yield child, partial("<{}> is given beside <{}>; keep one".format, child.tag, first.tag)
    elif rule.model in ("choice", "sequence") and rule.needed and not seen & known.keys():
        yield element, partial("<{}> is empty; add {}".format, tag, _listed(_tags(tuple(known))))
    stray = _stray_text(element)
    if not rule.model and element.text:
        yield element, partial("<{}> must be empty, without spaces; write <{}/>".format, tag, tag)
    elif stray:
        holds = _listed(_tags(tuple(known)))
        yield element, partial("stray text '{}'; <{}> holds {}".format, stray, tag, holds)


def _stray_text(element: Element) -> str:
    """Return the text between the children, shortened."""
    pieces = [element.text, *(child.tail for child in element)]
    return collapsed(" ".join(piece for piece in pieces if piece))[:40]


def _misplaced(child: str, tag: str) -> str:
    return f"<{child}> does not belong in <{tag}>, which holds a value"


def _unknown_attribute(name: str, known: tuple[str, ...]) -> str:
    return f"unknown attribute {name}{_choice(name, known)}"


def _unknown_child(name: str, tag: str, known: tuple[str, ...]) -> str:
    return f"unknown element <{name}> in <{tag}>{_choice(f'<{name}>', _tags(known))}"


def _wrong_attribute(name: str, value: str, word: "XsdSimpleType") -> str:
    """Return why an attribute's value is refused."""
    allowed = _allowed(word)
    if allowed:
        what = "unknown unit " if name == "units" else f"unknown value {name}="
        return f"{what}'{value}'{_choice(value, allowed)}"
    if name == "colour":
        return f"'{value}' is not a colour; give red green blue in hexadecimal such as #4e79a7"
    if name == "node":
        return f"{name}='{value}' is no node; give first, last or a number from 1"
    if word.min_length:
        return f"attribute {name} is empty; {EMPTY.get(name, 'give a name')}"
    return f"{name}={_wrong_number(value, word)}"


def _wrong_text(tag: str, given: str, word: "XsdSimpleType") -> str:
    """Return why the text of an element is refused."""
    allowed = _allowed(word)
    if allowed:
        return f"unknown value '{given}'{_choice(given, allowed)}"
    if tag in NAMES:
        return "the name is empty; give a name"
    return _wrong_number(given, word)


def _wrong_number(given: str, word: "XsdSimpleType") -> str:
    """Return why a number is refused, with the limits that it must keep."""
    number = getattr(word, "member_types", (word,))[0]  # the other is that of expressions
    low, high = (getattr(number, name, None) for name in ("min_value", "max_value"))
    if low is None or high is None:
        return _no_number(given)
    return f"'{given}' is not a number from {low:g} to {high:g}"


def _no_number(given: str) -> str:
    message = f"'{given}' is not a finite number such as 2, -0.5 or 1.5e-3"
    return f"{message}; an expression is written in braces" if _INSIDE.search(given) else message


def _allowed(word: "XsdSimpleType") -> tuple[str, ...]:
    """Return the only words that are valid; empty if they are not listed."""
    if word.local_name == "boolean":
        return ("true", "false")
    return tuple(map(str, word.enumeration or ()))


def _choice(given: str, known: tuple[str, ...]) -> str:
    """Return the remedy for an unknown word: the likely one first, then all."""
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
