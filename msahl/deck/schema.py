"""Validation of decks against the schema, by two libraries: libxml2 and xmlschema.

libxml2 validates a deck in 2 ms. ``xmlschema`` takes half a second to import and to read the
schema, but its components contain what a good message needs. So a run validates with libxml2; only
if that finds a fault, ``diagnosis`` words what is wrong and what would be right, from xmlschema's
components. ``msahl check`` also validates with xmlschema what libxml2 accepts. A test compares the
two.
"""

from functools import cache
from typing import TYPE_CHECKING, cast

from lxml import etree

from msahl.deck.faults import Element, Faults
from msahl.deck.parse import parse_with_comments
from msahl.resources import folder

if TYPE_CHECKING:
    from xmlschema import XMLSchema10

SCHEMA_NAME = "msaHLData.xsd"

MANY = 50_000
"""Elements that xmlschema validates in a second or two; only libxml2 validates a larger deck."""


def schema_bytes() -> bytes:
    """Return the schema."""
    return folder("schemas").joinpath(SCHEMA_NAME).read_bytes()


@cache
def built(schema: bytes) -> "XMLSchema10":
    """Return the schema as xmlschema's components, built once for all decks."""
    from xmlschema import XMLSchema10

    return XMLSchema10(schema.decode())


def check_schema(root: Element, faults: Faults, thorough: bool = False) -> None:
    """Add every departure of the tree ``root`` from the schema to ``faults``.

    With ``thorough`` xmlschema also validates a tree that libxml2 accepts.
    """
    source = schema_bytes()
    refused = objection(root, source)
    if refused:
        from msahl.deck.diagnosis import add_faults

        add_faults(root, built(source).elements[str(root.tag)], faults)
        if faults.sound(root):  # if the two disagree, libxml2 decides
            faults.add(root, f"not valid: {refused}")
    elif thorough and cast(float, root.xpath("count(//*)")) <= MANY:
        for error in built(source).iter_errors(root):
            faults.add(cast(Element, error.elem), f"not valid: {error.reason}")


@cache
def validator(schema: bytes) -> etree.XMLSchema:
    """Return the schema as libxml2's validator."""
    return etree.XMLSchema(parse_with_comments(schema))


def objection(root: Element, schema: bytes) -> str:
    """Return the first fault that libxml2 finds in a tree; empty if it is valid.

    The tree is validated while it is parsed again: for a tree in memory lxml computes the path of
    each error, in a time that grows with the square of the number of siblings.
    """
    parser = etree.XMLParser(schema=validator(schema), no_network=True)
    try:
        etree.fromstring(etree.tostring(root), parser)
    except etree.XMLSyntaxError as error:
        return str(error.msg)
    return ""
