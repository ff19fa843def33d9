"""Bodies and joints that are alike, read in columns (see ``deck.columns``).

What is returned are the records, and None for each element that has to be read by itself: those of
which there are few alike, that are unusual, or that may have a fault.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import IDENTITY, ZERO, Matrix
from msahl.check.bodies import plainly_possible
from msahl.check.context import Context
from msahl.check.ends import ends_findings, frame_findings, plainly_together
from msahl.deck.bodies import given_body
from msahl.deck.columns import LEAST, Column, ColumnReader, Unusual, columns, records, rows
from msahl.deck.ends import SIDES, carried, read_ends
from msahl.deck.faults import Element
from msahl.deck.values import Reader
from msahl.joints.joint import Coincide, Kind
from msahl.joints.registry import KINDS
from msahl.model.bodies import RigidBody
from msahl.model.joints import Joint

UNKNOWN = (np.nan, np.nan, np.nan)


class Part(NamedTuple):
    """Elements that are alike, their indices and their reader."""

    column: Column
    indices: list[int]
    reader: ColumnReader


class BodiesAlike:
    """The ``<rigidBody>`` elements that are alike."""

    def __init__(self, elements: Sequence[Element], reader: Reader) -> None:
        self._elements, self._reader = elements, reader
        self._parts = list(_parts(elements, {"rigidBody"}, reader))

    def axes(self) -> list[Matrix | None]:
        """Return the axes of the bodies as they stand at t = 0."""
        return self._read(_axes)

    def records(self) -> list[RigidBody | None]:
        """Return the records of the bodies, once the axes of all bodies are known."""
        if self._reader.starts or self._reader.unplaced:
            return [None] * len(self._elements)
        return self._read(_bodies)

    def _read(self, read: Callable[[Column, ColumnReader], Iterable[Any]]) -> list[Any]:
        return _each(self._elements, self._parts if self._reader.faults.none else (), read)


def joints_alike(elements: Sequence[Element], reader: Reader) -> list[Joint | None]:
    """Return the records of joints whose only equations are that two points coincide."""
    tags = {name for name, kind in KINDS.items() if _only_coincides(kind)}
    return _each(elements, _parts(elements, tags, reader), _joints)


def _parts(elements: Sequence[Element], tags: Collection[str], reader: Reader) -> Iterator[Part]:
    """Yield what is alike of the elements with one of the ``tags``; nothing if there are faults,
    since these may be in what an element refers to."""
    indices = [index for index, element in enumerate(elements) if element.tag in tags]
    if not reader.faults.none or len(indices) < LEAST:
        return
    for column, within in columns([elements[i] for i in indices]):
        own = ColumnReader.beside(reader, len(within))
        yield Part(column, [indices[i] for i in within], own)


def _each(
    elements: Sequence[Element],
    parts: Iterable[Part],
    read: Callable[[Column, ColumnReader], Iterable[Any]],
) -> list[Any]:
    """Return what is read of each element, None for those that are read by themselves."""
    found: list[Any] = [None] * len(elements)
    for column, indices, reader in parts:
        try:
            values = read(column, reader)
        except Unusual:
            continue
        for index, value, doubtful in zip(indices, values, reader.doubtful.tolist(), strict=True):
            if not doubtful:
                found[index] = value
    return found


def _axes(column: Column, reader: ColumnReader) -> list[Matrix]:
    P = reader.orientation(cast(Element, column))
    return [IDENTITY] * reader.size if P is ZERO else list(map(matrix, P))


def _bodies(column: Column, reader: ColumnReader) -> list[RigidBody]:
    columns, entries = given_body(cast(Element, column), reader)
    bodies: list[RigidBody] = records(columns, reader.size)
    masses = np.array([body.mass for body in bodies])
    J = np.array([body.inertia for body in bodies])
    scale = np.abs(np.array(rows(entries, reader.size))).max(axis=1)
    reader.doubt(~plainly_possible(masses, J, scale))
    return bodies


def _joints(column: Column, reader: ColumnReader) -> list[Joint]:
    ends = [column.find(side) for side in SIDES]
    parts = {child.tag for end in ends if end for child in end} | {child.tag for child in column}
    if not parts <= {"name", "position", *SIDES}:
        raise Unusual
    given = read_ends(cast(Element, column), reader)
    joint = Joint(
        name=reader.name(column),
        kind=column.tag,
        parent=given.parent,
        child=given.child,
        parent_point=given.parent_point,
        child_point=given.child_point,
        parent_axes=_frames(given.parent, reader),
        child_axes=_frames(given.child, reader),
    )
    joints: list[Joint] = records(joint, reader.size)
    context = reader.context
    reader.doubt(np.array([any(ends_findings(joint, context)) for joint in joints]))
    if not context.project:
        reader.doubt(~_together(joints, context))
    return joints


def _frames(bodies: Any, reader: ColumnReader) -> Any:
    """Return the axes of bodies as the frames of joints that have none of their own."""
    known: dict[Matrix, Matrix] = {}
    found = []
    for index, body in enumerate(bodies):
        axes = reader.context.axes.get(body, IDENTITY)
        if axes not in known:
            known[axes] = carried(IDENTITY, body, reader.context)
            reader.doubtful[index] |= any(frame_findings(known[axes], ""))
        found.append(known[axes])
    return found


def _together(joints: Sequence[Joint], context: Context) -> np.ndarray:
    """Return which joints have their points together at t = 0 beyond doubt, (n,) bool."""
    ends = []
    for side in SIDES:
        bodies = [getattr(joint, side) for joint in joints]
        points = np.array([getattr(joint, f"{side}_point") for joint in joints])
        axes = np.array([context.axes[body] for body in bodies])
        origins = np.array([context.origins.get(body, UNKNOWN) for body in bodies])
        ends.append((origins + np.einsum("nij,nj->ni", axes, points), points))
    (here, s), (there, t) = ends
    longest = np.maximum(np.linalg.norm(s, axis=1), np.linalg.norm(t, axis=1))
    return plainly_together(here, there, longest)


def _only_coincides(kind: Kind) -> bool:
    if kind.axes or kind.parameters or kind.on_ground:
        return False
    return kind.equations(Joint("", kind.name, "", "", ZERO, ZERO)) == [Coincide()]
