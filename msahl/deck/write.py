"""Writer of the deck as it ran: the user's own bytes, with the changes that the run was given.

A deck with parameters or parts is written expanded: numbers in place of expressions, which stand
beside them in comments, and the elements of all parts. So it is one file, reads as the deck that
ran to the bit, and its digest covers the files that were included.
"""

import hashlib
import re
from collections.abc import Mapping, Sequence
from copy import deepcopy
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.parsers import expat

from lxml.etree import Comment, SubElement, tostring

from msahl.deck.faults import Element, Faults, attribute, collapsed, text
from msahl.deck.parse import (
    is_plain,
    may_have_braces,
    parse,
    parse_with_comments,
)

if TYPE_CHECKING:
    from msahl.deck.includes import Parts

_SHAPES = "shapes"

OTHER = {"tolerance": "localTolerance", "localTolerance": "tolerance"}
"""Elements that replace one another."""
UNITS = {
    "deltaT": "sec",
    "tFinal": "sec",
    "outputInterval": "sec",
    "tolerance": "m",
    "localTolerance": "m",
}
"""Settings that are elements of ``<simulation>``, with their units; the others are attributes."""


def effective_text(
    path: Path,
    data: bytes,
    changes: Mapping[str, Any],
    settings: Sequence[str],
    parts: "Parts",
) -> bytes:
    """Return the text of the deck ``data``, which was read with these ``settings`` without faults,
    with ``changes`` of ``<simulation>``: values [s, m] by the names of its elements and attributes.

    Of a deck without parameters and changes the bytes are those given; otherwise the document is
    the same, comments included, but for numbers and parts, which lie beside ``path`` or are among
    those of ``parts``.
    """
    # Expressions in shapes alone may stay, so that the rest of the text is that without shapes.
    files = b"<includes" in data or b"<elasticBody" in data
    if settings or files or may_have_braces(without_shapes(data)):
        faults = Faults(str(path))
        root = parse(data, faults)
        if not is_plain(root, data, settings):
            data = _expanded(root, data, path, settings, faults, parts)
    numbers = {
        tag: (repr(float(changes[tag])), unit) for tag, unit in UNITS.items() if tag in changes
    }
    attributes = {
        key: repr(value) if isinstance(value, float) else str(value)
        for key, value in changes.items()
        if key not in UNITS
    }
    return _with_simulation(data, numbers, attributes) if changes else data


def _with_simulation(
    data: bytes, changes: dict[str, tuple[str, str]], attributes: dict[str, str]
) -> bytes:
    """Return the document with children of ``<simulation>`` (number and unit) and attributes
    replaced or added."""
    root = parse_with_comments(data)
    for simulation in root.iterfind("simulation"):
        for key, word in attributes.items():
            simulation.set(key, word)
        for tag, (number, unit) in changes.items():
            for other in simulation.findall(OTHER[tag]) if tag in OTHER else ():
                simulation.remove(other)
            element = simulation.find(tag)
            if element is None:
                element = SubElement(simulation, tag)
            tail = element.tail
            element.clear()
            element.tail = tail
            element.text = number
            element.set("units", unit)
    return document_bytes(root)


def document_bytes(root: Element) -> bytes:
    """Return the document of a tree, in its own encoding."""
    tree = root.getroottree()
    stream = BytesIO()
    tree.write(stream, xml_declaration=True, encoding=tree.docinfo.encoding or "UTF-8")
    return stream.getvalue()


def _expanded(
    root: Element,
    data: bytes,
    path: Path,
    settings: Sequence[str],
    faults: Faults,
    parts: "Parts",
) -> bytes:
    """Return the document ``data``, whose tree without comments is ``root``, expanded."""
    from msahl.deck.expand import expand
    from msahl.deck.includes import merge_parts
    from msahl.deck.schema_types import with_text

    document = parse_with_comments(data)
    twins = dict(zip(root.iter("*"), document.iter("*"), strict=True))
    merge_parts(root, path, faults, parts)
    before = {e: (text(e), dict(e.attrib)) for e in with_text(root, "{")}
    expand(root, path, settings, faults, parts)
    faults.raise_if_any()
    for element in list(root.iter("*")):
        holder, twin = element.getparent(), twins.get(element)
        place = None if holder is None else twins.get(holder)
        if twin is not None and twin.getparent() is place:
            _update(twin, element)
        elif place is not None:  # from a part
            place.append(_with_originals(element, before))
    for includes in document.findall("includes"):
        _add_comment(includes, tostring(includes, with_tail=False).decode())
        document.remove(includes)
    return document_bytes(document)


def _with_originals(
    element: Element, before: Mapping[Element, tuple[str, dict[str | bytes, str | bytes]]]
) -> Element:
    """Return a copy of an element of a part, with the expressions it had ``before`` in comments;
    its own stands within."""
    copy = deepcopy(element)
    for twin, original in list(zip(copy.iter("*"), element.iter("*"), strict=True)):
        if original not in before:
            continue
        had, attributes = before[original]
        words = [had] if len(original) == 0 and had != text(original) else []
        words += [f'{k!s}="{v!s}"' for k, v in attributes.items() if original.get(k) != v]
        if words and twin is copy:
            twin.append(Comment(f" {_safe(' '.join(words))} "))
        elif words:
            _add_comment(twin, " ".join(words))
    return copy


def _safe(words: str) -> str:
    """Return text as a comment may hold it, in which two hyphens would be its end."""
    return re.sub("-(?=-|$)", "- ", words)


def _update(twin: Element, element: Element) -> None:
    """Give ``twin`` the text and attributes of ``element``, and what it had in a comment."""
    had = []
    if len(element) == 0 and collapsed(element.text or "") != text(twin):
        had.append(text(twin))
        for comment in list(twin):
            twin.remove(comment)
        twin.text = element.text
    for name, value in element.attrib.items():
        old = twin.get(name)
        if old != value:
            had += [] if old is None else [f'{name!s}="{old}"']
            twin.set(name, value)
    if had:
        _add_comment(twin, " ".join(had))


def _add_comment(element: Element, words: str) -> None:
    """Add a comment behind an element."""
    comment = Comment(f" {_safe(words)} ")
    comment.tail, element.tail = element.tail, None
    element.addnext(comment)


def deck_digest(data: bytes) -> str:
    """Return the SHA-256 of a deck's bytes without its shapes, in hexadecimal: a deck that differs
    in what bodies look like gives the same results."""
    return hashlib.sha256(without_shapes(data)).hexdigest()


def without_shapes(data: bytes) -> bytes:
    """Return the bytes of a deck without every ``<shapes>`` and the white space before it."""
    if _SHAPES.encode() not in data:  # of a deck in UTF-16, too, where shapes count then
        return data
    found: list[tuple[int, int]] = []
    path: list[str] = []
    parser = expat.ParserCreate()

    def on_start(tag: str, _: object) -> None:
        path.append(tag)
        if tag == _SHAPES and path[1:3] == ["system", "bodies"] and len(path) == 5:
            found.append((parser.CurrentByteIndex, 0))

    def on_end(tag: str) -> None:
        if tag == _SHAPES and path[1:3] == ["system", "bodies"] and len(path) == 5:
            end = parser.CurrentByteIndex  # of the end tag, or behind an empty element
            if data.startswith(f"</{_SHAPES}".encode(), end):
                end = data.index(b">", end) + 1
            found[-1] = (found[-1][0], end)
        path.pop()

    parser.StartElementHandler, parser.EndElementHandler = on_start, on_end
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError):  # an encoding that only lxml reads
        return data
    pieces, last = [], 0
    for begin, end in found:
        pieces.append(data[last:begin].rstrip())
        last = end
    return b"".join([*pieces, data[last:]])


def listed_parameters(data: bytes) -> dict[str, dict[str, Any]]:
    """Return value and unit of the parameters of an expanded deck, by name, for ``run.json``."""
    if b"<parameters" not in data:
        return {}
    return {
        attribute(element, "name"): {
            "value": float(element.text or ""),
            "units": attribute(element, "units", "1"),
        }
        for element in parse_with_comments(data).iterfind("parameters/parameter")
    }
