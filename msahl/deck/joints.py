"""Joints: elements -> records, and whether their points meet at t = 0."""

import math
import sys

from msahl.deck.faults import Element, text
from msahl.deck.values import INERTIAL, Reader
from msahl.joints.spherical import Spherical
from msahl.vector import ZERO, Vector, add, sub

GAP = 1e-6
"""Largest gap of a joint at t = 0, in parts of its longest arm: decks are typed with 6-7 digits."""

ROUND_OFF = 64 * sys.float_info.epsilon
"""Gap that is always forgiven, in parts of the points' distance from the inertial origin."""


def read_spherical(element: Element, reader: Reader) -> Spherical:
    """Record of a ``<spherical>``; each point in its own body's axes."""
    parent, parent_point = _end(element, "parent", reader)
    child, child_point = _end(element, "child", reader)
    reaction = element.find("initialConditions/reaction")
    if reaction is not None:  # only a first guess, of which nothing but its faults is used
        reader.components(reaction)
        reader.basis(reaction)
    joint = Spherical(text(element.find("name")), parent, child, parent_point, child_point)
    _check_ends(element, joint, reader)
    if reader.faults.sound(element):
        _check_gap(element, joint, reader)
    return joint


def _end(joint: Element, role: str, reader: Reader) -> tuple[str, Vector]:
    """Name of the parent or child, and its joint point [m] in its own axes."""
    end = joint.find(role)
    assert end is not None  # the schema requires it
    label = end.find("name")
    name = text(label)
    if not reader.known(joint, name, role, at=label):
        return name, ZERO
    return name, reader.vector(end.find("position"), own=name, wanted=name)


def _check_ends(element: Element, joint: Spherical, reader: Reader) -> None:
    """A joint holds two different bodies, at least one of which can move."""
    if joint.parent == joint.child:
        message = f"parent and child are both '{joint.parent}'; a joint holds two different bodies"
        reader.faults.add(element, message)
    elif {joint.parent, joint.child} <= set(reader.grounds):
        message = f"'{joint.parent}' and '{joint.child}' are both grounds; name a body that moves"
        reader.faults.add(element, message)


def _check_gap(element: Element, joint: Spherical, reader: Reader) -> None:
    """The two points coincide at t = 0, as far as a typed deck can say so."""
    if not {joint.parent, joint.child} <= reader.origins.keys():
        return  # a body with faults of its own
    here = _placed(joint.parent, joint.parent_point, reader)
    there = _placed(joint.child, joint.child_point, reader)
    gap = math.dist(here, there)
    arm = max(math.hypot(*joint.parent_point), math.hypot(*joint.child_point))
    reach = max(math.hypot(*here), math.hypot(*there))
    if gap > max(GAP * arm, ROUND_OFF * reach):
        message = (
            f"open by {gap:.4g} m at t = 0: its point is at {_shown(here)} m on parent "
            f"'{joint.parent}' but at {_shown(there)} m on child '{joint.child}' (inertial axes); "
            f"move the child by {_shown(sub(here, there))} m"
        )
        reader.faults.add(element, message)


def _placed(body: str, point: Vector, reader: Reader) -> Vector:
    """A point of a body from the inertial origin, inertial axes [m]."""
    return add(reader.origins[body], reader.turned(point, body, INERTIAL))


def _shown(a: Vector) -> str:
    return f"({a[0]:.9g}, {a[1]:.9g}, {a[2]:.9g})"
