"""The schema and the two that read it.

Both ``xmlschema`` and libxml2 judge by the same schema. libxml2 needs 2 ms; ``xmlschema`` a quarter
of a second to load and build, and its errors carry what a good message needs. So a run asks libxml2
and turns to ``xmlschema`` if it objects; ``msahl check`` asks both. A test holds the two to the
same verdict. The words take time for every element: of a deck with many, libxml2's own must do.
"""

from typing import Any, cast

from lxml import etree

from msahl.deck.faults import Element, Faults
from msahl.deck.parse import parse_with_comments
from msahl.resources import folder

SCHEMA_NAME = "msaHLData.xsd"

MANY = 50_000
"""Elements of which ``xmlschema`` takes some seconds."""


def schema_bytes() -> bytes:
    """The schema."""
    return folder("schemas").joinpath(SCHEMA_NAME).read_bytes()


def check_schema(root: Element, faults: Faults, thorough: bool) -> None:
    """Add every departure of the tree ``root`` from the schema to ``faults``."""
    source = schema_bytes()
    judge = etree.XMLSchema(parse_with_comments(source))
    valid = judge.validate(root.getroottree())
    many = cast(float, root.xpath("count(//*)")) > MANY
    if valid and (many or not thorough):
        return
    if many:
        log: Any = judge.error_log
        for error in log:
            faults.add_line(root, error.line, error.message)
        faults.raise_if_any()
    from msahl.deck.diagnosis import add_faults

    add_faults(root, source, faults)
    if not valid and faults.sound(
        root
    ):  # the two disagree: the verdict stands, in the first one's words
        faults.add(root, f"not valid: {judge.error_log}")
