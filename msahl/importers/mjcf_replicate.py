"""Elements ``<replicate>`` of MJCF: what they contain, several times.

Copy number i stands in a frame with i times the angles of ``euler``, moved from the one before by
``offset`` in the axes of that. Names in it end with ``sep`` and i, in as many digits as the number
of copies has; what refers to one of them from outside is copied as well, with the same ending. Of
nested ones the innermost is copied first. Source: MuJoCo, XML reference, replicate; what several
angles make, and the order of copies, as its version 4.0 has them.
"""

from collections.abc import Mapping
from copy import deepcopy

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.mjcf_settings import Settings, orientation
from msahl.importers.reading import Log, numbers

KINDS = {"freejoint": "joint"}
"""Kinds of elements by tags, where these differ."""
REFERENCES: Mapping[str, str] = {
    "joint": "joint", "jointinparent": "joint", "joint1": "joint", "joint2": "joint",
    "body": "body", "body1": "body", "body2": "body",
    "geom1": "geom", "geom2": "geom",
    "site": "site", "site1": "site", "site2": "site", "refsite": "site", "cranksite": "site",
    "slidersite": "site",
}  # fmt: skip
"""Attributes that refer to an element, and its kind."""
SECTIONS = ("contact", "equality", "actuator", "sensor")
MOST_ELEMENTS = 100_000
"""Elements of a file with all copies."""


def expand_replicates(root: Element, settings: Settings, log: Log) -> None:
    """Replace every ``<replicate>`` in the tree by its copies."""
    for element in reversed(list(root.iter("replicate"))):
        for child in element:
            if child.tag in ("joint", "freejoint", "inertial"):
                log.fault(child, "it cannot be copied alone; put it into a body in <replicate>")
        count = attribute(element, "count")
        if not (count.isascii() and count.isdigit() and int(count[:9]) > 0):
            log.fault(element, f"count '{count[:20]}': expected how many copies there are")
            continue
        size = sum(1 for _ in element.iter())
        if int(count[:9]) * size + sum(1 for _ in root.iter()) > MOST_ELEMENTS:
            log.stop(element, f"with all copies the file has more than {MOST_ELEMENTS} elements")
        _expand(element, int(count), root, settings, log)
    log.raise_if_any()


def _expand(element: Element, count: int, root: Element, settings: Settings, log: Log) -> None:
    """Replace a ``<replicate>`` by its copies, each in a frame."""
    offset = np.array(numbers(element, "offset", log))
    angles = np.array(numbers(element, "euler", log))
    p = np.zeros(3)
    names = {(_kind_of(e), attribute(e, "name")) for e in element.iter() if "name" in e.attrib}
    endings = [f"{attribute(element, 'sep')}{i:0{len(str(count))}d}" for i in range(count)]
    frames = []
    for i, ending in enumerate(endings):
        frame = _copy(element, log)
        for name in list(frame.attrib):
            if name != "childclass":
                del frame.attrib[name]
        frame.tag = "frame"
        frame.set("pos", _text(p))
        frame.set("euler", _text(i * angles))
        p = p + orientation(frame, settings, log) @ offset
        for inside in frame.iter():
            if inside is not frame and "name" in inside.attrib:
                inside.set("name", f"{attribute(inside, 'name')}{ending}")
        frames.append(frame)
    holder = element.getparent()
    assert holder is not None
    at = holder.index(element)
    holder[at : at + 1] = frames
    _copy_references(root, names, endings, log)


def _copy_references(
    root: Element, names: set[tuple[str, str]], endings: list[str], log: Log
) -> None:
    """Replace elements that refer to one of the ``names`` by copies at the end of their section."""
    for section in [s for s in root if s.tag in SECTIONS]:
        found = {
            element: [a for a, kind in REFERENCES.items() if (kind, element.get(a)) in names]
            for element in section
        }
        referring = {element: names_ for element, names_ in found.items() if names_}
        for ending in endings:
            for element, attributes in referring.items():
                copy = _copy(element, log)
                for name in (*attributes, *(["name"] if "name" in copy.attrib else [])):
                    copy.set(name, f"{attribute(copy, name)}{ending}")
                section.append(copy)
        for element in referring:
            section.remove(element)


def _copy(element: Element, log: Log) -> Element:
    """Return a copy of an element whose parts stand in the same files."""
    copy = deepcopy(element)
    copy.tail = None
    file = log.file_of(element)
    for old, new in zip(element.iter(), copy.iter(), strict=True):
        if old in log.origins:
            log.origins[new] = log.origins[old]
    if file != log.file:
        log.origins.setdefault(copy, file)
    return copy


def _kind_of(element: Element) -> str:
    """Return the kind of an element, by which names are unique."""
    return KINDS.get(str(element.tag), str(element.tag))


def _text(values: np.ndarray) -> str:
    return " ".join(map(repr, values.tolist()))
