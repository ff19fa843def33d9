"""The text of the deck of an import: bodies are placed by the coordinates of their joints."""

import numpy as np
from lxml import etree

from msahl.algebra.rotation_arrays import plain_vector
from msahl.algebra.vector import Vector
from msahl.deck.elements import child, deck_bytes, lay_out, number, vector
from msahl.deck.faults import Element
from msahl.deck.joint_start import QUANTITIES
from msahl.deck.write_model import write_deck
from msahl.importers.build import Built
from msahl.importers.joints import Start
from msahl.joints.registry import KINDS
from msahl.printable import printable

COMMENT = "{kind} {name}, imported from {file} by msahl import.\n\n  {words}\n"
PLACED = "The initialConditions of joints place the bodies and set them in motion."


def deck_text(built: Built, kind: str, file: str) -> bytes:
    """Return the deck of a model whose joints have starts, made of a ``file`` of a ``kind``."""
    root = etree.fromstring(write_deck(built.model))
    for element in root.iterfind("system/joints/*"):
        name = element.find("name")
        start = built.starts.get("" if name is None else name.text or "")
        if start is not None:
            _use_references(element)
            _add_start(element, start)
    strip(root)
    lay_out(root)
    words = COMMENT.format(
        kind=kind, name=built.model.simulation.title, file=printable(file), words=PLACED
    )
    return deck_bytes(root, f"\n  {in_comment(words)}")


def _use_references(element: Element) -> None:
    """Give a joint axis and reference of each end in place of its frame, from which coordinates do
    not count: frames have to be parallel where the bodies are placed."""
    for frame in element.findall("*/frame"):
        x, _, z = np.array((frame.text or "").split(), dtype=float).reshape(3, 3)
        end = frame.getparent()
        assert end is not None
        end.remove(frame)
        if not KINDS[str(element.tag)].axes:
            continue
        for reference in end.findall("reference"):
            end.remove(reference)
        vector(end, "axis", plain_vector(z))
        vector(end, "reference", plain_vector(x))


def strip(root: Element) -> None:
    """Remove the white space between elements."""
    for element in root.iter():
        if len(element):
            element.text = None
        element.tail = None


def in_comment(words: str) -> str:
    """Return text as a comment of XML may hold it, in which two hyphens would be its end."""
    return words.replace("--", "- -").replace("--", "- -")


def _add_start(element: Element, start: Start) -> None:
    """Add the coordinates of a joint at t = 0, and those rates that are not zero."""
    holder = child(element, "initialConditions")
    for name, value in start.values.items():
        number(holder, name, value, QUANTITIES[name.rstrip("12")][0])
        if start.approximate:
            holder[-1].set("approximate", "true")
    if start.P is not None:
        _add_orientation(holder, start.P, start.approximate)
        vector(holder, "angularVelocity", start.w)
    for name, value in start.rates.items():
        number(holder, name, value, QUANTITIES[name.removesuffix("Rate").rstrip("12")][1])
    if not len(holder):
        element.remove(holder)


def _add_orientation(holder: Element, P: Vector, approximate: bool) -> None:
    orientation = child(holder, "orientation", approximate="true" if approximate else "")
    for tag, value in zip(("P1", "P2", "P3"), P, strict=True):
        number(orientation, tag, value)
