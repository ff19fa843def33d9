"""Check of references by name to bodies and joints, also those in elements with other faults.

A name counts as known if it may be that of an element with a fault of its own, which is reported
already: a record under a misspelt tag, or one whose name is missing.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import chain
from typing import cast

from msahl.check.names import unresolved
from msahl.deck.faults import KINDS, Element, Faults, attribute, collapsed, text
from msahl.deck.values import INERTIAL_BASIS, Reader
from msahl.records import record

ENDS = ("parent", "child")
BODIES = ("system/*/*/parent/name", "system/*/*/child/name", "system/*/*/body")
"""Elements that name a body; any element may have a ``basis`` as well."""
JOINTS = ("system/*/*/first", "system/*/*/second", "system/*/*/joint")
"""Elements that name a joint."""
ROTATING = ("force", "moment", "acceleration", "marker")
"""Elements whose ``basis`` rotates with its body; others take it as it stands at t = 0."""


@record
class Reference:
    """A ``name`` in some ``role`` of ``owner``, and the element ``at`` which it is given."""

    owner: Element
    at: Element
    role: str
    name: str


def check_references(root: Element, tags: Collection[str], reader: Reader) -> None:
    """Add a fault for every name of a body or joint that no element has; ``tags`` are those of all
    records of a deck: bodies, joints, motions and loads."""
    context = reader.context
    for kind, group, names, references, places in (
        ("body", "bodies", context.bodies(), _to_bodies(root, reader.faults), BODIES),
        ("joint", "joints", list(context.kinds), _to_joints(root, reader.faults), JOINTS),
    ):
        known = {"", *names}
        if known.issuperset(_names_at(root, places)):
            continue
        unknown = [r for r in references if r.name not in known]
        for r in unknown:
            reader.faults.doubt(r.at)
        if unknown:
            unknown = _without_cause(root, unknown, group, tags)
        for r in unknown:
            reader.faults.add(r.owner, unresolved(r.role, r.name, kind, names), r.at)


def plain_names(root: Element, path: str, faults: Faults) -> list[str] | None:
    """Return the names of the elements at a path, without looking at each of these; None if not
    all of them have one of the same kind, an element or an attribute, or if there are faults."""
    for place in ("name/text()", "@name") if faults.none else ():
        names = cast(list[str], root.xpath(f"{path}/{place}", smart_strings=False))
        if len(names) == root.xpath(f"count({path})"):
            return list(map(collapsed, names))
    return None


def _names_at(root: Element, paths: Sequence[str]) -> set[str]:
    """Return the texts of all elements at the ``paths`` and of all attributes ``basis``."""
    # XPath is evaluated by libxml2, and ``iterfind`` by Python.
    wanted = [f"{path}/text()" for path in paths]
    if paths is BODIES:
        wanted.append("system/descendant::*/@basis")
    found = (cast(list[str], root.xpath(path, smart_strings=False)) for path in wanted)
    texts = set(chain.from_iterable(found))
    return set(map(collapsed, texts))


def _to_bodies(root: Element, faults: Faults) -> Iterator[Reference]:
    """Yield all references to bodies except those in a place where none belongs."""
    for end, label in _places(root, BODIES, faults):
        if end.tag not in ENDS:
            yield Reference(end, label, str(label.tag), text(label))
        elif not faults.own(end) and (owner := end.getparent()) is not None:
            yield Reference(owner, label, str(end.tag), text(label))
    for element in root.iterfind("system//*[@basis]"):
        given = attribute(element, "basis")
        if not faults.own(element) and (given != INERTIAL_BASIS or _rotates(element)):
            yield Reference(element, element, "basis", given)


def _rotates(element: Element) -> bool:
    """Return whether the axes that ``basis`` names are those of a body during the motion."""
    owner = element.getparent()
    of_load = element.tag == "direction" and owner is not None and owner.tag == "distributed"
    return of_load or element.tag in ROTATING


def _to_joints(root: Element, faults: Faults) -> Iterator[Reference]:
    """Yield all references to joints except those in a place where none belongs."""
    for owner, label in _places(root, JOINTS, faults):
        yield Reference(owner, label, str(label.tag), text(label))


def _places(
    root: Element, paths: Sequence[str], faults: Faults
) -> Iterator[tuple[Element, Element]]:
    """Yield (parent, element) for the elements at the ``paths`` that are free of faults."""
    for label in chain.from_iterable(map(root.iterfind, paths)):
        holder = label.getparent()
        if holder is not None and faults.sound(label):
            yield holder, label


def _without_cause(
    root: Element, unknown: list[Reference], group: str, tags: Collection[str]
) -> list[Reference]:
    """Return those ``unknown`` references that cannot mean an element with a fault."""
    elsewhere = _names_elsewhere(root, tags)
    unknown = [r for r in unknown if r.name not in elsewhere]
    # Records without a name may be meant by as many names, whichever these are.
    return unknown if len({r.name for r in unknown}) > _nameless(root, group) else []


def _names_elsewhere(root: Element, tags: Collection[str]) -> set[str]:
    """Return names of elements that are no record, as of a misspelt tag or in a wrong place."""
    return {
        text(label)
        for label in root.iter("name")
        if (owner := label.getparent()) is not None
        and owner.tag not in ENDS
        and not _is_record(owner, tags)
    }


def _is_record(element: Element, tags: Collection[str]) -> bool:
    """Return whether an element has a known tag and is in one of the system's groups."""
    group = element.getparent()
    return group is not None and group.tag in KINDS and element.tag in tags


def _nameless(root: Element, group: str) -> float:
    """Return how many records of a group have no name that can be read; infinity if the group is
    missing and something else is in its place."""
    if not _has_place(root, group):
        return math.inf
    return sum(not text(record.find("name")) for record in root.iterfind(f"system/{group}/*"))


def is_complete(root: Element, group: str, tags: Collection[str]) -> bool:
    """Return whether the records of a group are in place, and all of them of known ``tags``."""
    return _has_place(root, group) and all(
        record.tag in tags for record in root.iterfind(f"system/{group}/*")
    )


def _has_place(root: Element, group: str) -> bool:
    """Return whether a group is there, or nothing that may be meant by it."""
    system = root.find("system")
    if system is None:
        return False
    return system.find(group) is not None or all(c.tag in (*KINDS, "gravity") for c in system)
