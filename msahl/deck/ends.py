"""Reader of the two ends of a joint, spring or bushing: bodies, points and axes."""

from msahl.algebra.many import hypot
from msahl.algebra.vector import IDENTITY, ZERO, Matrix, Vector, dot
from msahl.check.context import INERTIAL, Context
from msahl.check.directions import (
    PARALLEL,
    clean,
    crossed_references,
    frame,
    shared_references,
    sine,
)
from msahl.check.ends import is_placed as known_places
from msahl.check.faults import shown
from msahl.deck.faults import Element, text
from msahl.deck.values import Reader
from msahl.records import record

SIDES = ("parent", "child")
REFERENCE_PARALLEL = "<reference> is parallel to the axis; give another direction, or delete it"


@record
class Ends:
    """Names of parent and child, and each one's point [m] in its own axes."""

    parent: str
    child: str
    parent_point: Vector
    child_point: Vector


def read_ends(element: Element, reader: Reader) -> Ends:
    """Return parent and child with their points."""
    (parent, parent_point), (child, child_point) = (_end(element, side, reader) for side in SIDES)
    return Ends(parent, child, parent_point, child_point)


def _end(element: Element, side: str, reader: Reader) -> tuple[str, Vector]:
    end = element.find(side)
    assert end is not None  # the schema requires it
    name = reader.name(end)
    if not reader.is_known(name):
        return name, ZERO
    return name, reader.vector(end.find("position"), own=name, wanted=name)


def is_placed(element: Element, ends: Ends, reader: Reader) -> bool:
    """Return whether neither the element nor the places of its bodies have a fault."""
    return known_places(ends, reader.context) and reader.faults.sound(element)


def given_frames(element: Element, reader: Reader) -> tuple[Matrix, Matrix] | None:
    """Return the frames that both sides give as such, each in its own body's axes; None if neither
    does."""
    places = [element.find(f"{side}/frame") for side in SIDES]
    if places == [None, None]:
        return None
    for place, other in zip(places, reversed(SIDES), strict=True):
        beside = None if place is None else place.getparent()
        if place is None:
            reader.faults.add(element, f"<frame> is given on the {other} only; give both or none")
        elif beside is not None and beside.find("axis") is not None:
            reader.faults.add(element, "<axis> is given beside <frame>; keep one")
    parent, child = (IDENTITY if place is None else reader.frame(place) for place in places)
    return parent, child


def own_frame(element: Element, side: str, reader: Reader) -> Matrix | None:
    """Return the frame of one end by its axis and reference, inertial axes; None without axis."""
    axis = side_direction(element, side, "axis", reader)
    reference = side_direction(element, side, "reference", reader)
    return _checked_frame(element, axis, reference, reader)


def shared_frame(element: Element, reader: Reader, two_references: bool = False) -> Matrix | None:
    """Return the frame of both ends by the axis (and reference) that one gives, inertial axes.

    If both give an axis, the two must agree; with ``two_references`` both may give a reference,
    and the frame is by the parent's. None without an axis free of faults.
    """
    given = [side_direction(element, side, "axis", reader) for side in SIDES]
    parent, child = given
    if parent is not None and child is not None and reader.faults.sound(element):
        _check_agreement(element, parent, child, reader)
    references = [side_direction(element, side, "reference", reader) for side in SIDES]
    if None not in references and not two_references:
        reader.faults.add(element, "<reference> is given on both sides; keep one")
    axis = parent or child
    return _checked_frame(element, axis, references[0] or references[1], reader)


def own_references(
    element: Element, axes: tuple[Vector, Vector], crossed: bool, reader: Reader
) -> tuple[Vector, Vector] | None:
    """Return the directions of parent and child from which the joint's coordinates count, each in
    its own axes, as its ``axes`` are; None if a reference is parallel to its axis.
    """
    complete = crossed_references if crossed else shared_references
    if all(element.find(f"{side}/reference") is None for side in SIDES):
        return complete(*axes, None, None)
    given = []
    for side, axis in zip(SIDES, axes, strict=True):
        reference = side_direction(element, side, "reference", reader)
        body = text(element.find(f"{side}/name"))
        if reference is not None:
            reference = reader.context.rotated(reference, INERTIAL, body)
            if sine(axis, reference) < PARALLEL:
                reader.faults.add(element, REFERENCE_PARALLEL)
                return None
        given.append(reference)
    return complete(*axes, *given)


def explicit_references(
    element: Element, frames: tuple[Matrix, Matrix], ends: Ends, reader: Reader
) -> tuple[Vector | None, Vector | None]:
    """Return the directions of parent and child from which coordinates count, beside the frames
    that both give; None where none is given: the frame's x."""
    found: list[Vector | None] = []
    for side, axes, body in zip(SIDES, frames, (ends.parent, ends.child), strict=True):
        place, given = element.find(f"{side}/reference"), None
        if place is not None and body in reader.context.axes:
            given = reader.vector(place, own=body, wanted=body)
            if sine(axes[2], given) < PARALLEL * hypot(*given) or not any(given):
                reader.faults.add(element, REFERENCE_PARALLEL)
                given = None
        found.append(given)
    return found[0], found[1]


def side_direction(element: Element, side: str, tag: str, reader: Reader) -> Vector | None:
    """Return the direction ``tag`` of one end, inertial axes; its basis is that end's body."""
    body = text(element.find(f"{side}/name"))
    if body not in reader.context.axes:
        return None
    return reader.direction(element.find(f"{side}/{tag}"), body)


def carried(axes: Matrix, body: str, context: Context) -> Matrix:
    """Return a frame's rows, given in inertial axes, in the axes of ``body``."""
    own = context.axes.get(body)
    if own is None:
        return axes
    if axes == IDENTITY:  # whose rows in the axes of the body are the rows of its matrix
        return (clean(own[0]), clean(own[1]), clean(own[2])) if own != IDENTITY else IDENTITY
    x, y, z = (clean(context.rotated(row, INERTIAL, body)) for row in axes)
    return (x, y, z)


def _checked_frame(
    element: Element, axis: Vector | None, reference: Vector | None, reader: Reader
) -> Matrix | None:
    if axis is None:
        return None
    if reference is not None and sine(axis, reference) < PARALLEL:
        reader.faults.add(element, REFERENCE_PARALLEL)
        reference = None
    return frame(axis, reference)


def _check_agreement(element: Element, parent: Vector, child: Vector, reader: Reader) -> None:
    """Add a fault unless the axes of parent and child are one direction at t = 0."""
    if sine(parent, child) > PARALLEL or dot(parent, child) < 0.0:
        message = (
            f"the axis is {shown(parent)} on the parent but {shown(child)} on the child (inertial "
            "axes, t = 0); give it on one side only, or rotate one"
        )
        reader.faults.add(element, message)
