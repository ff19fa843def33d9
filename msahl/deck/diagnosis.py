"""Schema errors in the words of a deck: what is wrong, and what would be right.

``xmlschema`` finds the elements and says which of its rules they break; the sentence is ours, made
from the rule (accepted units, expected children) and not from its text.
"""

import difflib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from typing import Any

from xmlschema import XMLSchema10
from xmlschema.validators import XsdAttributeGroup, XsdGroup

from msahl.deck.faults import Element, Faults, text

NAMES = ("name", "body", "joint", "first", "second")
"""Elements that hold a name."""


def add_faults(root: Element, schema: bytes, faults: Faults) -> None:
    """Add a fault for everything in ``root`` that the ``schema`` forbids."""
    told: set[tuple[Element, str]] = set()
    explained: set[tuple[Element, int]] = set()
    for error in _built(schema).iter_errors(root):
        group: Any = (error.elem, id(error.validator))
        if isinstance(error.validator, XsdGroup | XsdAttributeGroup):
            if group in explained:  # an error for each child, and each time all are looked at
                continue
            explained.add(group)
        for element, key, message in _explain(error):
            if (element, key) not in told:  # one rule after another fails on the same text
                told.add((element, key))
                faults.add(element, message)


@cache
def _built(schema: bytes) -> XMLSchema10:
    """The schema, built once for all decks."""
    return XMLSchema10(schema.decode())


Explained = Iterator[tuple[Element, str, str]]


def _explain(error: Any) -> Explained:
    """Element, the part of it that is wrong, and the message, for each fault in ``error``."""
    element, rule = error.elem, error.validator
    if isinstance(rule, XsdAttributeGroup):
        yield from _attributes(element, rule)
    elif isinstance(rule, XsdGroup):
        yield from _children(element, rule)
    else:
        yield from _value(error)


def _attributes(element: Element, rule: Any) -> Explained:
    """Attributes the element does not take. (None of the schema's is required.)"""
    known = [str(name) for name in rule if name]
    for name in set(map(str, element.attrib)) - set(known):
        yield element, name, f"unknown attribute {name}{_choice(name, known)}"


def _children(element: Element, group: Any) -> Explained:
    """Children that are unknown, repeated or missing, and text where children belong."""
    known = {child.local_name: child for child in group.iter_elements()}
    names = [f"<{name}>" for name in known]
    counts = Counter(str(child.tag) for child in element)
    for child in element:
        if child.tag not in known:
            tag = f"<{child.tag}>"
            yield child, "", f"unknown element {tag} in <{element.tag}>{_choice(tag, names)}"
    if group.model == "all":
        for child in _repeated(element):
            yield child, "", f"<{child.tag}> stands twice in <{element.tag}>; keep one"
        for name, child in known.items():
            if child.min_occurs and not counts[name]:
                yield element, name, f"<{name}> is missing; add it to <{element.tag}>"
    elif group.model == "choice" and group.max_occurs == 1 and len(element) > 1:
        first, *others = element
        for child in others:
            yield child, "", f"<{child.tag}> stands beside <{first.tag}>; keep one"
    elif group.min_occurs and not counts.keys() & known.keys():
        yield element, "", f"<{element.tag}> is empty; add {_listed(names)}"
    stray = _stray_text(element)
    if stray:
        yield element, "text", f"stray text '{stray}'; <{element.tag}> holds {_listed(names)}"


def _repeated(element: Element) -> Iterator[Element]:
    """Every child whose tag an earlier child has."""
    seen = set()
    for child in element:
        if child.tag in seen:
            yield child
        seen.add(child.tag)


def _stray_text(element: Element) -> str:
    """Text between the children, shortened."""
    pieces = [element.text, *(child.tail for child in element)]
    return " ".join(" ".join(piece for piece in pieces if piece).split())[:40]


def _value(error: Any) -> Explained:
    """A wrong value of an attribute, or wrong text of an element."""
    element, value = error.elem, error.obj
    name = next((str(key) for key in element.attrib if _same(element.get(key), value)), "")
    allowed = [str(entry) for entry in getattr(error.validator, "enumeration", None) or ()]
    if len(element) and not name:
        for child in element:
            place = f"<{element.tag}>, which holds a value"
            yield child, "", f"<{child.tag}> does not belong in {place}"
    elif allowed:
        shown = value if name else text(element)
        what = {"units": "unknown unit ", "": "unknown value "}.get(name, f"unknown value {name}=")
        yield element, name, f"{what}'{shown}'{_choice(str(shown), allowed)}"
    elif name == "basis" or element.tag in NAMES:
        yield element, name, f"the {name or 'name'} is empty; give a name"
    elif name:  # all attributes that hold no word hold a fraction
        given = element.get(name)
        yield element, name, f"{name}='{given}' is not a number from 0 to 1"
    elif error.reason and "attribute" in error.reason:
        yield element, name, error.reason
    else:
        yield element, name, f"'{text(element)}' is not a finite number such as 2, -0.5 or 1.5e-3"


def _same(held: str | None, value: object) -> bool:
    """The text of an attribute is this value, or the number it was read as, but for white space."""
    if isinstance(value, float):
        return value == _number(held)
    return isinstance(value, str) and (held or "").split() == value.split()


def _number(held: str | None) -> float | None:
    try:
        return float(held or "")
    except ValueError:
        return None


def _choice(given: str, known: list[str]) -> str:
    """The remedy for an unknown word: the likely one first, then all."""
    if not known:
        return "; none is expected here"
    near = difflib.get_close_matches(given, known, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"; {hint}expected {_listed(known)}"


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"one of {', '.join(names)}"
