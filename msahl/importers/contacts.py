"""Contacts of an import: stops of joints, and shapes of bodies on planes of the ground.

A contact must not overlap at t = 0. Whether it does is known once the coordinates of the joints
have placed the bodies of the deck; one that does is not carried over.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from msahl.algebra.rotation_arrays import plain_vector
from msahl.check.contacts import overlap_findings
from msahl.check.context import Context, context_of
from msahl.check.directions import clean
from msahl.check.joint_fit import JointAtStart
from msahl.deck.faults import Element
from msahl.importers.bodies import Parts
from msahl.importers.made import Along, Made
from msahl.importers.options import ALL, NONE, ImportOptions
from msahl.importers.reading import Log
from msahl.importers.robot import Robot, Touch
from msahl.joints.coordinates import angle_offset
from msahl.joints.named_coordinates import joint_coordinate
from msahl.model import Joint, JointLimit, Model, PlaneContact

ELSEWHERE = "start elsewhere, by --at or --key"
RIGID = "MuJoCo's limits and contacts are soft; here they are rigid"
OF_URDF = "limit"
"""Tag of limits that are not soft."""
ROUNDING = 1e-9
"""A coordinate [rad, m] outside its range by less is at the end of it: the digits of a file."""


class Candidate(NamedTuple):
    """A contact, the ``element`` that it comes from, and the coordinate if it is a stop."""

    contact: JointLimit | PlaneContact
    element: Element
    along: Along | None = None


def omit_unwanted(robot: Robot, options: ImportOptions, log: Log) -> None:
    """Take those stops and contacts out of a robot that are not wanted."""
    words = f"--contacts {options.contacts} omits it:"
    axes = [axis for link in robot.links.values() for axis in link.axes]
    axes += [closure.axis for closure in robot.closures if closure.axis is not None]
    for axis in axes if options.contacts == NONE else ():
        if axis.limit is not None:
            log.lost(axis.limit, f"{words} the joint moves beyond its limits")
            axis.limit = axis.lower = axis.upper = None
    if options.contacts != ALL:
        for touch in robot.touches:
            log.lost(touch.element, f"{words} the shape moves through planes")
        robot.touches = []


def candidates(robot: Robot, parts: Parts, made: Made, restitution: float) -> list[Candidate]:
    """Return the contacts of a robot, whether they overlap or not."""
    stops = [
        _stop(place, made, restitution)
        for place in made.along.values()
        if place.axis.limit is not None
    ]
    touches = [_touches(touch, parts, made, restitution) for touch in robot.touches]
    return [*stops, *(one for several in touches for one in several)]


def _stop(place: Along, made: Made, restitution: float) -> Candidate:
    axis = place.axis
    name = made.names.unique(f"{axis.name} limit")
    along = place.joint, place.coordinate, axis.lower, axis.upper
    assert axis.limit is not None
    return Candidate(JointLimit(name, *along, restitution), axis.limit, place)


def _touches(touch: Touch, parts: Parts, made: Made, restitution: float) -> Iterator[Candidate]:
    """Yield a contact for each point of a shape."""
    parent, outer = parts.places[touch.base]
    child, inner = parts.places[touch.link]
    plane = outer.after(touch.plane)
    for number, point in enumerate(touch.points, start=1):
        ending = f".{number}" if len(touch.points) > 1 else ""
        contact = PlaneContact(
            name=made.names.unique(f"{touch.name}{ending}"),
            parent=parent,
            child=child,
            parent_point=plain_vector(plane.p),
            child_point=plain_vector(inner.p + inner.R @ point),
            normal=clean(plain_vector(plane.R[:, 2])),
            radius=touch.radius,
            restitution=restitution,
            friction=touch.friction,
        )
        yield Candidate(contact, touch.element)


def apart(
    found: Sequence[Candidate], model: Model, log: Log
) -> Iterator[JointLimit | PlaneContact]:
    """Yield the contacts that do not overlap where a ``model`` has its bodies at t = 0; the others
    are noted."""
    context = context_of(model)
    joints = {joint.name: joint for joint in model.joints}
    for contact, element, along in found:
        if along is not None and isinstance(contact, JointLimit):
            value = _coordinate(joints[contact.joint], contact.coordinate, context)
            contact = _counted(contact, value - along.axis.value)
            words = _outside(contact, value)
        else:
            words = "".join(finding.message for finding in overlap_findings(contact, context))
            words = words.partition(" at t = 0")[0]
        if words:
            log.lost(element, f"{words} at t = 0, so this contact is omitted; {ELSEWHERE}")
            continue
        if element.tag != OF_URDF:
            log.changed(element, RIGID)
        yield contact


def _coordinate(joint: Joint, name: str, context: Context) -> float:
    """Return a coordinate at t = 0, an angle within half a revolution of zero, as runs count it."""
    start, coordinate = JointAtStart(joint, context), joint_coordinate(joint, name)
    values = [start.product(product) for product in coordinate.products]
    if name == "angle":
        return math.remainder(math.atan2(*values) + angle_offset(joint), math.tau)
    return values[0]


def _counted(limit: JointLimit, difference: float) -> JointLimit:
    """Return a limit whose angles count as runs count them, whose value at t = 0 has this
    ``difference`` [rad] to that of the file: revolutions, and rounding errors."""
    revolutions = round(difference / math.tau) if limit.coordinate == "angle" else 0
    if not revolutions or limit.lower is None or limit.upper is None:
        return limit
    shift = revolutions * math.tau
    return replace(limit, lower=limit.lower + shift, upper=limit.upper + shift)


def _outside(limit: JointLimit, value: float) -> str:
    """Return by how much a coordinate is outside its range, "" if it is not."""
    assert limit.lower is not None
    assert limit.upper is not None
    distance = max(limit.lower - value, value - limit.upper)
    if distance <= ROUNDING:
        return ""
    unit = "rad" if limit.coordinate == "angle" else "m"
    return f"the joint is {distance:.4g} {unit} outside its range"
