"""Safe parser of decks: bytes -> XML tree, without access to any other file or address.

A document type declaration is refused before anything in it is read, since entities can only expand
or fetch. Comments are dropped; size, depth and text length are bounded.
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import cast
from xml.parsers import expat

from lxml import etree

from msahl.deck.faults import Element, Faults, line_of
from msahl.input_files import open_input

DECK, PART = "data", "part"
"""Tags of the root of a deck, and of a file that decks include."""

MAX_BYTES = 256 * 2**20
"""Largest deck read, in bytes: some hundred thousand bodies."""

MOST_ATTRIBUTES = 16
"""Attributes accepted in an element. None needs more than four, and parsing time grows with their
square."""

_UTF_8 = re.compile(
    rb"(\xef\xbb\xbf)?(<\?xml\s[^>]*encoding\s*=\s*[\"']utf-8[\"']|\s*<[!\w])", re.I
)

_XSI = "{http://www.w3.org/2001/XMLSchema-instance}"
_LOCATIONS = ("schemaLocation", "noNamespaceSchemaLocation")
_NO_DTD = (
    "a document type declaration (<!DOCTYPE ...>, <!ENTITY ...>) is not accepted in a deck; "
    "delete it and write the values out"
)


def read_bytes(path: Path, faults: Faults) -> bytes:
    """Return the file's bytes; raise ``DeckError`` if it cannot be read, is empty or too large."""
    try:
        with open_input(path) as stream:
            data = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        faults.stop(f"cannot be read: {reason}; give the path of a deck")
    if not data.strip():
        faults.stop("the file is empty; 'msahl new' writes a deck to start from")
    if len(data) > MAX_BYTES:
        faults.stop(f"larger than {MAX_BYTES // 2**20} MiB, the largest deck accepted")
    return data


def parse_valid(data: bytes, schema: etree.XMLSchema, blanks: bool = True) -> Element | None:
    """Return the root without comments of a deck that libxml2 finds valid while it parses it; None
    for one that has to be parsed and validated step by step, to find its faults or their absence.
    Without ``blanks`` between its elements a tree takes two thirds of the memory.
    """
    # In other encodings the words below may look different.
    if not _UTF_8.match(data) or b"xmlns" in data or b"<!DOCTYPE" in data:
        return None
    try:
        root = etree.fromstring(data, _parser(keep_comments=False, schema=schema, blanks=blanks))
    except etree.XMLSyntaxError:
        return None
    return root if root.tag == DECK else None


def may_have_braces(data: bytes) -> bool:
    """Return whether braces may stand in a deck, as such or as numbers of characters."""
    return b"{" in data or b"&#" in data or not _UTF_8.match(data)


def is_plain(root: Element, data: bytes, settings: Sequence[str]) -> bool:
    """Return whether the deck of these bytes has nothing to expand (see ``msahl.deck.expand``)."""
    tags = {child.tag for child in root}
    expands = settings or may_have_braces(data) or tags & {"parameters", "includes"}
    if b"<elasticBody" in data:
        return False  # its file has numbers
    # Readers put the names of nodes into the tree of a deck with beams.
    return not (expands or (b"<beam" in data and root.find("system/bodies/beam") is not None))


def parse(
    data: bytes,
    faults: Faults,
    tag: str | tuple[str, ...] = DECK,
    attributes: int = MOST_ATTRIBUTES,
) -> Element:
    """Return the root without comments; raise ``DeckError`` unless its tag is ``tag``, or one of
    several of foreign files. Elements have up to so many ``attributes``."""
    line = _doctype_line(data)
    if line:
        faults.stop(_NO_DTD, line)
    try:
        root = etree.fromstring(data, _parser(keep_comments=False))
    except etree.XMLSyntaxError as error:
        reason = (error.msg or "no element found").split(", line ")[0]
        faults.stop(f"not well-formed XML: {reason}", error.lineno or 1)
    # The search above cannot read every encoding that this parser can.
    if root.getroottree().docinfo.internalDTD is not None:
        faults.stop(_NO_DTD, 1)
    if root.tag != tag and root.tag not in (tag if isinstance(tag, tuple) else ()):
        faults.stop(_wrong_root(str(root.tag), tag), line_of(root))
    for element in _found(root, f"//*[count(@*) > {attributes}]"):
        faults.stop(f"<{element.tag}> has {len(element.attrib)} attributes", line_of(element))
    _drop_instance_attributes(root, faults)
    return root


def _wrong_root(found: str, tag: str | tuple[str, ...]) -> str:
    """Return the message for a root element that is none of those expected."""
    what = {DECK: "deck", PART: "part"}
    other = f" (that of a {what[found]})" if found in what else ""
    if isinstance(tag, tuple):
        expected = " or ".join(f"<{one}>" for one in tag)
        return f"the root element is <{found}>{other}; expected {expected}"
    return f"the root element is <{found}>{other}; a {what[tag]}'s is <{tag}>"


def parse_with_comments(data: bytes) -> Element:
    """Return the root of a deck that ``parse`` has accepted, with its comments."""
    return etree.fromstring(data, _parser(keep_comments=True))


def _parser(
    keep_comments: bool, schema: etree.XMLSchema | None = None, blanks: bool = True
) -> etree.XMLParser:
    """Return a parser that expands no entity, loads no DTD, uses no network and bounds memory."""
    return etree.XMLParser(
        resolve_entities=False,
        load_dtd=False,
        dtd_validation=False,
        no_network=True,
        huge_tree=False,
        remove_comments=not keep_comments,
        remove_pis=not keep_comments,
        remove_blank_text=not blanks,
        schema=schema,
    )


class _Enough(Exception):  # noqa: N818 - ends a search, no error
    """Ends the search for a document type declaration."""


def _doctype_line(data: bytes) -> int:
    """Return the line of the document type declaration, 0 without one; read only up to the root."""
    parser = expat.ParserCreate()
    found = 0

    def on_doctype(*_: object) -> None:
        nonlocal found
        found = parser.CurrentLineNumber
        raise _Enough

    def on_root(*_: object) -> None:
        raise _Enough

    parser.StartDoctypeDeclHandler = on_doctype
    parser.StartElementHandler = on_root
    # The parser that builds the tree reports what is not well-formed.
    with suppress(_Enough, expat.ExpatError, ValueError, LookupError):
        parser.Parse(data, True)
    return found


def _found(root: Element, path: str) -> list[Element]:
    """Return the elements at an XPath, found by libxml2."""
    return cast(list[Element], root.xpath(path, namespaces={"xsi": _XSI[1:-1]}))


def _drop_instance_attributes(root: Element, faults: Faults) -> None:
    """Drop every ``xsi:`` attribute: a schema named by the deck is ignored, never opened; others
    (``xsi:type``, ``xsi:nil``) would change the meaning of our own schema and are faults."""
    for element in _found(root, "//*[@xsi:*]"):
        for name in [str(key) for key in element.attrib if str(key).startswith(_XSI)]:
            del element.attrib[name]
            word = name.removeprefix(_XSI)
            if word not in _LOCATIONS:
                faults.add(element, f"xsi:{word} has no meaning in a deck; delete it")
