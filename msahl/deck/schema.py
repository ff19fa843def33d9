"""The schema and the two libraries that validate by it, libxml2 and xmlschema.

libxml2 validates a deck in 2 ms. ``xmlschema`` takes half a second to import and to read the
schema, but its components say what a good message needs. So a run asks libxml2; only if that
objects, ``diagnosis`` says by xmlschema's components what is wrong and what would be right.
``msahl check`` has xmlschema validate what libxml2 accepts, too. A test holds the two to the same
judgement.
"""

from functools import cache
from typing import TYPE_CHECKING, cast

from lxml import etree

from msahl.deck.diagnosis import add_faults
from msahl.deck.faults import Element, Faults
from msahl.deck.parse import parse_with_comments
from msahl.resources import folder

if TYPE_CHECKING:
    from xmlschema import XMLSchema10

SCHEMA_NAME = "msaHLData.xsd"

MANY = 50_000
"""Elements that xmlschema validates in a second or two; a larger deck only libxml2 validates."""


def schema_bytes() -> bytes:
    """The schema."""
    return folder("schemas").joinpath(SCHEMA_NAME).read_bytes()


@cache
def built(schema: bytes) -> "XMLSchema10":
    """The schema as xmlschema's components, built once for all decks."""
    from xmlschema import XMLSchema10

    return XMLSchema10(schema.decode())


def check_schema(root: Element, faults: Faults, thorough: bool = False) -> None:
    """Add every departure of the tree ``root`` from the schema to ``faults``.

    ``thorough`` validates a tree that libxml2 accepts by xmlschema, too.
    """
    source = schema_bytes()
    refused = objection(root, source)
    if refused:
        add_faults(root, built(source).elements["data"], faults)
        if faults.sound(root):  # the two disagree: libxml2's judgement stands
            faults.add(root, f"not valid: {refused}")
    elif thorough and cast(float, root.xpath("count(//*)")) <= MANY:
        for error in built(source).iter_errors(root):
            faults.add(cast(Element, error.elem), f"not valid: {error.reason}")


def objection(root: Element, schema: bytes) -> str:
    """The first thing libxml2 finds wrong with a tree; empty if it is valid.

    The tree is validated as it is parsed anew: of a tree in memory lxml would note the path of each
    error, which takes time with the square of the number of siblings.
    """
    judge = etree.XMLSchema(parse_with_comments(schema))
    try:
        etree.fromstring(etree.tostring(root), etree.XMLParser(schema=judge, no_network=True))
    except etree.XMLSyntaxError as error:
        return str(error.msg)
    return ""
