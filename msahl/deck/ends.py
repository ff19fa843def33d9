"""The two ends of a joint, spring or bushing: whose they are, where, and along what."""

import math
import sys
from dataclasses import dataclass

from msahl.algebra.vector import ZERO, Matrix, Vector, dot, sub
from msahl.deck.faults import Element, shown, text
from msahl.deck.frames import PARALLEL, clean, frame, sine
from msahl.deck.values import INERTIAL, Reader

GAP = 1e-6
"""Largest gap at t = 0, in parts of the longest arm: decks are typed with 6-7 digits."""

ROUND_OFF = 64 * sys.float_info.epsilon
"""Gap that is always forgiven, in parts of the points' distance from the inertial origin."""

SIDES = ("parent", "child")


@dataclass(frozen=True, slots=True)
class Ends:
    """Names of parent and child, and each one's point [m] in its own axes."""

    parent: str
    child: str
    parent_point: Vector
    child_point: Vector

    def arm(self) -> float:
        """The longer of the two points [m]."""
        return max(math.hypot(*self.parent_point), math.hypot(*self.child_point))


def read_ends(element: Element, reader: Reader) -> Ends:
    """Parent and child: two different bodies, at least one of which can move."""
    (parent, parent_point), (child, child_point) = (_end(element, side, reader) for side in SIDES)
    if parent == child:
        message = f"parent and child are both '{parent}'; name two different bodies"
        reader.faults.add(element, message)
    elif {parent, child} <= reader.grounds.keys():
        message = f"'{parent}' and '{child}' are both grounds; name a body that moves"
        reader.faults.add(element, message)
    return Ends(parent, child, parent_point, child_point)


def _end(element: Element, side: str, reader: Reader) -> tuple[str, Vector]:
    end = element.find(side)
    assert end is not None  # the schema requires it
    name = text(end.find("name"))
    if name not in reader.axes:
        return name, ZERO
    return name, reader.vector(end.find("position"), own=name, wanted=name)


def is_placed(element: Element, ends: Ends, reader: Reader) -> bool:
    """Neither the element nor the place of its bodies has a fault, so that it can be judged."""
    placed = {ends.parent, ends.child} <= reader.origins.keys()
    return placed and reader.faults.sound(element)


def tolerance(ends: Ends, arm: float, reader: Reader) -> float:
    """Gap between the two points that is forgiven [m]."""
    here = reader.placed(ends.parent, ends.parent_point)
    there = reader.placed(ends.child, ends.child_point)
    return max(GAP * arm, ROUND_OFF * max(math.hypot(*here), math.hypot(*there), reader.dt2[0]))


def open_by(ends: Ends, reader: Reader) -> str:
    """Why the two points are not one at t = 0; "" if they are, as far as a deck can say so."""
    here = reader.placed(ends.parent, ends.parent_point)
    there = reader.placed(ends.child, ends.child_point)
    violation = math.dist(here, there)
    if violation <= tolerance(ends, ends.arm(), reader):
        return ""
    return (
        f"open by {violation:.4g} m at t = 0: its point is at {shown(here)} m on parent "
        f"'{ends.parent}' but at {shown(there)} m on child '{ends.child}' (inertial axes); "
        f"move the child by {shown(sub(here, there))} m"
    )


def own_frame(element: Element, side: str, reader: Reader) -> Matrix | None:
    """Frame of one end by its own axis and reference, inertial axes; None without sound axis."""
    axis = side_direction(element, side, "axis", reader)
    reference = side_direction(element, side, "reference", reader)
    return _checked_frame(element, axis, reference, reader)


def shared_frame(element: Element, reader: Reader) -> Matrix | None:
    """Frame of both ends by the axis (and reference) that one of them gives, inertial axes.

    If both give an axis, they must agree. None without sound axis.
    """
    given = [side_direction(element, side, "axis", reader) for side in SIDES]
    parent, child = given
    if parent is not None and child is not None and reader.faults.sound(element):
        _check_agreement(element, parent, child, reader)
    references = [side_direction(element, side, "reference", reader) for side in SIDES]
    if None not in references:
        reader.faults.add(element, "<reference> is given on both sides; keep one")
    axis = parent or child
    return _checked_frame(element, axis, references[0] or references[1], reader)


def side_direction(element: Element, side: str, tag: str, reader: Reader) -> Vector | None:
    """Direction ``tag`` of one end, inertial axes; its basis is that end's body."""
    own = text(element.find(f"{side}/name"))
    if own not in reader.axes:
        return None
    return reader.direction(element.find(f"{side}/{tag}"), own)


def carried(axes: Matrix, body: str, reader: Reader) -> Matrix:
    """A frame's rows from the inertial axes into those of ``body``."""
    if body not in reader.axes:
        return axes
    x, y, z = (clean(reader.turned(row, INERTIAL, body)) for row in axes)
    return (x, y, z)


def _checked_frame(
    element: Element, axis: Vector | None, reference: Vector | None, reader: Reader
) -> Matrix | None:
    if axis is None:
        return None
    if reference is not None and sine(axis, reference) < PARALLEL:
        message = "<reference> is parallel to the axis; give another direction, or leave it out"
        reader.faults.add(element, message)
        reference = None
    return frame(axis, reference)


def _check_agreement(element: Element, parent: Vector, child: Vector, reader: Reader) -> None:
    """The axis of the child is that of the parent at t = 0."""
    if sine(parent, child) > PARALLEL or dot(parent, child) < 0.0:
        message = (
            f"the axis is {shown(parent)} on the parent but {shown(child)} on the child (inertial "
            "axes, t = 0); give it on one side only, or turn one"
        )
        reader.faults.add(element, message)
