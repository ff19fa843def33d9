"""Repair of decks: impossible inertia tensors are replaced by the nearest possible ones."""

import numpy as np

from msahl.check.bodies import ENTRIES, TENSOR, impossible
from msahl.check.possible_inertia import nearest_possible
from msahl.deck.bodies import read_rigid_body
from msahl.deck.elements import number
from msahl.deck.faults import Element, Faults, text
from msahl.deck.includes import unit_system_of
from msahl.deck.parse import parse, parse_with_comments
from msahl.deck.source import Source
from msahl.deck.values import Reader
from msahl.deck.write import document_bytes


def repaired(source: Source) -> tuple[bytes, list[str]]:
    """Return the text of a deck with the nearest possible tensors in place of impossible ones, and
    the names of the bodies that were changed. Bodies whose numbers are expressions, and those of
    parts, stay. Raises ``DeckError`` for a deck that is not well-formed.
    """
    parse(source.data, Faults(str(source.path)))
    root = parse_with_comments(source.data)
    names = [
        text(body.find("name"))
        for body in root.iterfind("system/bodies/rigidBody")
        if _repair(body, unit_system_of(root))
    ]
    return document_bytes(root), names


def _repair(body: Element, unit_system: str) -> bool:
    """Replace the tensor of a body if it is impossible; return whether it was."""
    moi = body.find("moi")
    try:
        found = read_rigid_body(body, Reader(unit_system, Faults("")))
    except ValueError:  # an expression, or no number
        return False
    J = np.array(found.inertia)
    if (
        moi is None
        or not np.isfinite(J).all()
        or found.mass <= 0.0
        or not impossible(found.inertia)
    ):
        return False
    tail = moi.tail
    moi.clear()
    moi.tail = tail
    for tag, value in zip(TENSOR, nearest_possible(J, found.mass)[ENTRIES], strict=True):
        number(moi, tag, float(value), "inertia")
    return True
