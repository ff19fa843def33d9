"""Where a load acts on a body."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from msahl.algebra.vector import Vector
from msahl.model import Coupling, Joint, MarkerActuator, Model


class Place(NamedTuple):
    """An element acts on ``body`` where the ``point`` [m] of ``owner`` is, from the B of that, in
    its axes."""

    body: str
    owner: str
    point: Vector


def places_of(model: Model, element: Any) -> Iterator[Place]:
    """Yield where an ``element`` acts on bodies and grounds. A joint, and what acts along its
    coordinate, acts on both bodies where the child's point is.
    """
    joints = {joint.name: joint for joint in model.joints}
    if isinstance(element, Joint):
        for name in (element.child, element.parent):
            yield Place(name, element.child, element.child_point)
    elif isinstance(element, Coupling):
        for name in (element.first, element.second):
            yield from places_of(model, joints[name])
    elif isinstance(element, MarkerActuator):
        markers = {marker.name: marker for marker in model.markers}
        for name in (element.start, element.end):
            body = markers[name].body
            yield Place(body, body, markers[name].point)
    elif hasattr(element, "joint"):
        yield from places_of(model, joints[element.joint])
    elif hasattr(element, "body"):
        yield Place(element.body, element.body, element.point)
    else:
        yield Place(element.parent, element.parent, element.parent_point)
        yield Place(element.child, element.child, element.child_point)
