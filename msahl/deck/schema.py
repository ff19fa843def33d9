"""The schema and the two that read it.

libxml2 judges a deck in milliseconds. Only if it objects, ``diagnosis`` says by the same schema
what is wrong and what would be right. A test holds the two to the same judgement.
"""

from lxml import etree

from msahl.deck.diagnosis import add_faults
from msahl.deck.faults import Element, Faults
from msahl.deck.parse import parse_with_comments
from msahl.deck.rules import build_rules
from msahl.resources import folder

SCHEMA_NAME = "msaHLData.xsd"


def schema_bytes() -> bytes:
    """The schema."""
    return folder("schemas").joinpath(SCHEMA_NAME).read_bytes()


def check_schema(root: Element, faults: Faults) -> None:
    """Add every departure of the tree ``root`` from the schema to ``faults``."""
    source = schema_bytes()
    refused = objection(root, source)
    if not refused:
        return
    add_faults(root, build_rules(source, "data"), faults)
    if faults.sound(root):  # the two disagree: libxml2's judgement stands
        faults.add(root, f"not valid: {refused}")


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
