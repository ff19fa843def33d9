"""What the schema declares of an element of a deck: types of text and attributes, and units.

Read from the schema's own text, without ``xmlschema``, which takes half a second to import. Only
decks with expressions, parts or changed numbers need it.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import cast

from lxml import etree

from msahl.deck.faults import Element
from msahl.deck.parse import parse_with_comments
from msahl.deck.schema import schema_bytes
from msahl.deck.units import UNITS
from msahl.records import record

XS = "{http://www.w3.org/2001/XMLSchema}"

FRACTION = "fraction"
NUMBERS = frozenset(("number", FRACTION))
"""Simple types of numbers, which may be expressions in braces."""
NAME, EXPRESSION = "name", "expression"
"""Simple types of names of elements, and of laws of the motion."""


@record
class Content:
    """What an element may contain: text of a simple type ("": no text), the words that its
    ``units`` may be, the simple types of its attributes, and the declarations of its children."""

    text: str
    units: tuple[str, ...]
    attributes: Mapping[str, str]
    children: Mapping[str, Element]

    @property
    def is_number(self) -> bool:
        """Whether the text is a number."""
        return self.text in NUMBERS

    @property
    def quantities(self) -> tuple[str, ...]:
        """The physical quantities that the units belong to."""
        words = set(self.units)
        return tuple(name for name, factors in UNITS.items() if words and words >= factors.keys())


NOTHING = Content("", (), {}, {})


class Types:
    """The declarations of a schema."""

    def __init__(self, schema: bytes) -> None:
        self._root = parse_with_comments(schema)
        self._types = {
            str(node.get("name")): node
            for node in self._root
            if node.tag in (f"{XS}complexType", f"{XS}simpleType", f"{XS}attributeGroup")
        }
        self._contents: dict[Element, Content] = {}
        self._known: dict[tuple[str, ...], Content] = {}

    def content(self, element: Element) -> Content:
        """Return what is declared of an element, by the tags from the root of its tree to it."""
        path = (*(str(e.tag) for e in element.iterancestors()),)[::-1]
        return self._at((*path, str(element.tag)))

    def _at(self, path: tuple[str, ...]) -> Content:
        found = self._known.get(path)
        if found is None:
            declaration: Element | None
            if len(path) == 1:
                declaration = self._root.find(f"{XS}element[@name='{path[0]}']")
            else:
                declaration = self._at(path[:-1]).children.get(path[-1])
            found = NOTHING if declaration is None else self._declared(declaration)
            self._known[path] = found
        return found

    def _declared(self, declaration: Element) -> Content:
        """Return the content of a declared element."""
        found = self._contents.get(declaration)
        if found is None:
            name = declaration.get("type")
            node = self._types.get(name or "")
            if name is None:
                node = next(declaration.iterchildren(f"{XS}complexType", f"{XS}simpleType"), None)
            if node is None or node.tag == f"{XS}simpleType":
                found = Content(name or "", (), {}, {})
            else:
                found = self._complex(node)
            self._contents[declaration] = found
        return found

    def _complex(self, node: Element) -> Content:
        """Return the content of a complex type, with that of the complex type it extends."""
        parts = list(self._parts(node))
        bases = [str(p.get("base")) for p in parts if p.tag == f"{XS}extension"]
        extended = self._types.get(bases[0]) if bases else None
        inherited = NOTHING
        if extended is not None and extended.tag == f"{XS}complexType":
            inherited = self._complex(extended)
        attributes = dict(inherited.attributes) | {
            str(part.get("name")): part.get("type") or ""
            for part in parts
            if part.tag == f"{XS}attribute"
        }
        units = self._types.get(attributes.get("units", ""))
        found = units.iter(f"{XS}enumeration") if units is not None else ()
        return Content(
            text=inherited.text or "".join(bases),
            units=tuple(str(word.get("value")) for word in found),
            attributes=attributes,
            children=dict(inherited.children)
            | {str(p.get("name")): p for p in parts if p.tag == f"{XS}element"},
        )

    def _parts(self, node: Element) -> Iterator[Element]:
        """Yield all elements and attributes that a complex type declares, and its base type."""
        for child in node.iterchildren(etree.Element):
            if child.tag == f"{XS}attributeGroup":
                yield from self._parts(self._types[str(child.get("ref"))])
            elif child.tag in (f"{XS}element", f"{XS}attribute"):
                yield child
            else:
                if child.tag == f"{XS}extension":
                    yield child
                yield from self._parts(child)


@cache
def types() -> Types:
    """Return the declarations of the deck's schema."""
    return Types(schema_bytes())


def with_text(root: Element, sign: str) -> list[Element]:
    """Return all elements with a ``sign`` in their text or in an attribute."""
    path = f"//*[text()[contains(., '{sign}')] or @*[contains(., '{sign}')]]"
    return cast(list[Element], root.xpath(path))
