"""Joints: elements -> records. What each kind takes stands in ``msahl.joints``, with its law."""

import math

from msahl.algebra.vector import IDENTITY, Matrix, cross, dot, sub
from msahl.deck.ends import Ends, carried, is_placed, own_frame, read_ends, shared_frame
from msahl.deck.faults import Element, text
from msahl.deck.fit import complaints
from msahl.deck.frames import turned_round
from msahl.deck.values import Reader
from msahl.joints.joint import Kind
from msahl.joints.registry import KINDS
from msahl.model.joints import Joint

Frames = tuple[Matrix, Matrix]


def read_joint(element: Element, reader: Reader) -> Joint:
    """Record of a joint of any kind; each point and frame in its own body's axes."""
    kind = KINDS[str(element.tag)]
    ends = read_ends(element, reader)
    reaction = element.find("initialConditions/reaction")
    if reaction is not None:  # only a first guess, of which nothing but its faults is used
        reader.components(reaction)
        reader.basis(reaction)
    _check_parent(element, kind, ends, reader)
    parent_axes, child_axes = _frames(element, kind, ends, reader)
    joint = Joint(
        name=text(element.find("name")),
        kind=kind.name,
        parent=ends.parent,
        child=ends.child,
        parent_point=ends.parent_point,
        child_point=ends.child_point,
        parent_axes=carried(parent_axes, ends.parent, reader),
        child_axes=carried(child_axes, ends.child, reader),
        parameters=_parameters(element, kind, reader),
    )
    if is_placed(element, ends, reader):
        for message in complaints(joint, ends, reader):
            reader.faults.add(element, message)
    if reader.faults.sound(element):
        reader.joints[joint.name] = joint
    return joint


def _check_parent(element: Element, kind: Kind, ends: Ends, reader: Reader) -> None:
    if kind.on_ground and ends.parent in reader.axes and ends.parent not in reader.grounds:
        message = f"the parent of a {element.tag} is a ground; '{ends.parent}' is a body"
        reader.faults.add(element, message, element.find("parent/name"))


def _parameters(element: Element, kind: Kind, reader: Reader) -> tuple[tuple[str, float], ...]:
    """Every parameter of the kind by name [SI]; what may be left out has its default."""
    values = []
    for name, quantity, default, bound in kind.parameters:
        place = element.find(name)
        value = reader.number(place, quantity)
        if place is None and default is not None:
            value = default
        elif value <= bound and place is not None and reader.faults.sound(place):
            reader.faults.add(place, f"it is {value:g}; it must be greater than {bound:g}")
        values.append((name, value))
    return tuple(values)


def _frames(element: Element, kind: Kind, ends: Ends, reader: Reader) -> Frames:
    """Frames of parent and child, inertial axes at t = 0."""
    if kind.axes == 0:
        return IDENTITY, IDENTITY
    if kind.axes == 1:
        shared = shared_frame(element, reader)
        if shared is None and reader.faults.sound(element):
            message = "<axis> is missing; add it to <parent> or <child>, <axis><z>1</z></axis> say"
            reader.faults.add(element, message)
        return shared or IDENTITY, shared or IDENTITY
    parent, child = own_frame(element, "parent", reader), own_frame(element, "child", reader)
    if parent is None or child is None:
        return IDENTITY, IDENTITY
    if kind.faces and is_placed(element, ends, reader):
        return parent, _facing(parent, child, ends, reader)
    return parent, child


def _facing(parent: Matrix, child: Matrix, ends: Ends, reader: Reader) -> Matrix:
    """The child's frame, turned round if its axis b has D . (a x b) < 0: the two face alike."""
    here = reader.placed(ends.parent, ends.parent_point)
    there = reader.placed(ends.child, ends.child_point)
    volume = dot(sub(there, here), cross(parent[2], child[2]))
    return turned_round(child) if math.copysign(1.0, volume) < 0.0 else child
