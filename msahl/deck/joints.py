"""Reader of joints: elements -> records. What each kind takes is in ``msahl.joints``."""

import math

from msahl.algebra.vector import IDENTITY, Matrix, Vector, cross, dot, sub
from msahl.check.directions import PARALLEL, facing_back
from msahl.check.ends import points
from msahl.check.joint_fit import fit_findings, twist_findings
from msahl.check.joints import joint_findings
from msahl.deck.ends import (
    SIDES,
    Ends,
    carried,
    explicit_references,
    given_frames,
    is_placed,
    own_frame,
    own_references,
    read_ends,
    shared_frame,
)
from msahl.deck.faults import Element, text
from msahl.deck.joint_start import has_references, read_joint_start, read_parameters
from msahl.deck.values import Reader
from msahl.joints.coordinates import is_angle
from msahl.joints.joint import Kind
from msahl.joints.registry import KINDS
from msahl.model.joints import Joint

Frames = tuple[Matrix, Matrix]


def read_joint(element: Element, reader: Reader) -> Joint:
    """Return the record of a joint of any kind; each point and frame in its own body's axes."""
    kind = KINDS[str(element.tag)]
    ends = read_ends(element, reader)
    reaction = element.find("initialConditions/reaction")
    if reaction is not None:  # read for its faults only: the reaction is computed
        reader.components(reaction)
        reader.basis(reaction)
    explicit = given_frames(element, reader)
    if explicit is None:
        here, there = _frames(element, kind, ends, reader)
        frames = (
            carried(here, ends.parent, reader.context),
            carried(there, ends.child, reader.context),
        )
        references = _references(element, kind, (frames[0][2], frames[1][2]), reader)
    else:
        frames, references = explicit, explicit_references(element, explicit, ends, reader)
    joint = Joint(
        name=text(element.find("name")),
        kind=kind.name,
        parent=ends.parent,
        child=ends.child,
        parent_point=ends.parent_point,
        child_point=ends.child_point,
        parent_axes=frames[0],
        child_axes=frames[1],
        parameters=read_parameters(element, kind, reader),
        parent_reference=references[0],
        child_reference=references[1],
    )
    if element.find("initialConditions") is not None:
        read_joint_start(element, joint, reader)
    reader.add(element, joint_findings(joint, reader.context))
    if is_placed(element, ends, reader):
        reader.add(element, fit_findings(joint, reader.context))
        if explicit is not None and reader.faults.sound(element):
            reader.add(element, twist_findings(joint, reader.context))
    if reader.faults.sound(element):
        reader.joints[joint.name] = joint
    return joint


def _frames(element: Element, kind: Kind, ends: Ends, reader: Reader) -> Frames:
    """Return the frames of parent and child, inertial axes at t = 0."""
    if kind.axes == 0:
        return IDENTITY, IDENTITY
    if kind.axes == 1:
        shared = shared_frame(element, reader, has_references(kind))
        if shared is None and reader.faults.sound(element):
            message = (
                "<axis> is missing; add it to <parent> or <child>, for example "
                "<axis><z>1</z></axis>"
            )
            reader.faults.add(element, message)
        return shared or IDENTITY, shared or IDENTITY
    for side in SIDES:
        end = element.find(side)
        if end is not None and end.find("axis") is None:
            reader.faults.add(end, f"<axis> is missing; add it to <{side}>")
    parent, child = own_frame(element, "parent", reader), own_frame(element, "child", reader)
    if parent is None or child is None:
        return IDENTITY, IDENTITY
    if kind.faces and is_placed(element, ends, reader):
        return parent, _facing(parent, child, ends, reader)
    return parent, child


def _references(
    element: Element, kind: Kind, axes: tuple[Vector, Vector], reader: Reader
) -> tuple[Vector | None, Vector | None]:
    """Return the directions from which the joint's coordinates count, own axes; None: no such."""
    if not has_references(kind) or not reader.faults.sound(element):
        return None, None
    found = own_references(element, axes, kind.axes == 2, reader)
    if found is not None and not any(map(is_angle, kind.pose or ())):
        _check_fixed_angle(element, axes[0], found, reader)
    return found or (None, None)


def _check_fixed_angle(
    element: Element, axis: Vector, references: tuple[Vector, Vector], reader: Reader
) -> None:
    """Add a fault if both references of a joint without rotation are given and not parallel."""
    ends = [element.find(side) for side in SIDES]
    if any(end is None or end.find("reference") is None for end in ends):
        return
    if text(element.find("name")) in reader.context.released:
        return
    parent, child = (text(end.find("name")) for end in ends if end is not None)
    x = reader.context.rotated(references[1], child, parent)
    degrees = math.degrees(math.atan2(dot(cross(references[0], x), axis), dot(references[0], x)))
    if abs(degrees) > math.degrees(PARALLEL) and not reader.context.project:
        message = (
            f"its references are at {degrees:.7g} deg at t = 0 and must be parallel, since the "
            "joint does not rotate; rotate the child, or give one reference"
        )
        reader.faults.add(element, message)


def _facing(parent: Matrix, child: Matrix, ends: Ends, reader: Reader) -> Matrix:
    """Return the child's frame, reversed if its axis b has D . (a x b) < 0: the two face alike."""
    here, there = points(ends, reader.context)
    volume = dot(sub(there, here), cross(parent[2], child[2]))
    return facing_back(child) if math.copysign(1.0, volume) < 0.0 else child
