"""Reader of cams and followers: profile -> lift of the follower over the cam's angle.

A cam rotated by theta about its axis presents the follower's direction of sliding at the angle
phi_0 - theta of its own frame, phi_0 being that at t = 0. The lift is the follower's distance from
the axis less that at t = 0, over one revolution; ``msahl.deck.cam_profile`` computes it.
"""

import math

import numpy as np

from msahl.algebra.functions import Law
from msahl.algebra.vector import Vector, cross, dot, sub
from msahl.check.context import INERTIAL
from msahl.check.ends import ROUNDING
from msahl.check.laws import closed, law_findings
from msahl.deck.cam_profile import INTERVALS, lift
from msahl.deck.faults import Element, text
from msahl.deck.signals import read_table_of_numbers
from msahl.deck.values import Reader
from msahl.model.joints import Joint

RIGHT_ANGLE = 1e-6
"""Largest cosine between the cam's axis and the follower's direction of sliding."""

IN_LINE = 1e-6
"""Accepted distance of the line on which a roller slides from the cam's axis, as a share of the
profile's size."""

FEWEST = 4
"""Smallest number of points of a profile."""

NO_LIFT = Law("constant", (0.0,))
"""Stands for a lift with faults."""


def read_given_lift(element: Element, reader: Reader) -> Law | None:
    """Return the lift that a ``<camFollower>`` gives as a table; None if it has a profile. Faults
    for both, and for neither."""
    given = element.find("lift")
    others = [tag for tag in ("profile", "follower") if element.find(tag) is not None]
    if given is None:
        for tag in ("profile", "follower"):
            if tag not in others:
                reader.faults.add(element, f"<{tag}> is missing; add it to <camFollower>")
        return None if len(others) == 2 else NO_LIFT
    if others:
        reader.faults.add(element, f"<lift> is given beside <{others[0]}>; keep one")
        return NO_LIFT
    law = read_table_of_numbers(given, reader, "periodic", ("rad", "m"))
    assert isinstance(law, Law)  # the schema has no second variable
    reader.add(given, law_findings(law))
    return closed(law)


def read_lift(element: Element, cam: Joint, follower: Joint, reader: Reader) -> Law:
    """Return the lift [m] over the cam's angle [rad] of a ``<camFollower>``, zero at t = 0."""
    roller = text(element.find("follower")) == "roller"
    radius = _radius(element, roller, reader)
    points = _points(element, reader)
    direction = _direction(element, cam, follower, reader)
    if not reader.faults.sound(element):
        return NO_LIFT
    if roller:
        _check_in_line(element, cam, follower, float(np.abs(points).max()), reader)
    start = _angle(cam, direction, reader)
    angles = start - np.linspace(0.0, 2.0 * math.pi, INTERVALS + 1)
    distance, complaint = lift(points, angles, radius if roller else None)
    if complaint:
        reader.faults.add(element, complaint)
    if not reader.faults.sound(element):
        return NO_LIFT
    distance[-1] = distance[0]
    rise = distance - distance[0]
    return Law("periodic", (*(start - angles).tolist(), *rise.tolist()))


def _radius(element: Element, roller: bool, reader: Reader) -> float:
    """Return the radius of the roller [m]."""
    place = element.find("rollerRadius")
    radius = reader.number(place, "length")
    if roller and place is None:
        reader.faults.add(element, "<rollerRadius> is missing; a roller needs it")
    elif not roller and place is not None:
        reader.faults.add(place, "a flat follower has no roller; delete <rollerRadius>")
    elif place is not None and radius <= 0.0 and reader.faults.sound(place):
        reader.faults.add(place, f"it is {radius:g} m; it must be greater than zero")
    return radius


def _points(element: Element, reader: Reader) -> np.ndarray:
    """Return the points of the profile [m] (n, 2), counter-clockwise, the first not repeated."""
    profile = element.find("profile")
    assert profile is not None  # the schema requires it
    points = np.array([reader.numbers(point, ("x", "y"), "length") for point in profile])
    if len(points) > 1 and math.dist(points[0], points[-1]) <= ROUNDING * np.abs(points).max():
        points = points[:-1]
    if len(points) < FEWEST:
        message = f"a profile needs {FEWEST} points or more; it has {len(points)}"
        reader.faults.add(profile, message)
        return points
    steps = _angles_between(points)
    one_way = bool(np.all(steps > 0.0) or np.all(steps < 0.0))
    if not one_way or abs(steps.sum()) > 3.0 * math.pi:
        message = (
            "its points must go once round the cam's axis (x = y = 0), each further round than the "
            "one before; put them in order"
        )
        reader.faults.add(profile, message)
    return points if steps.sum() > 0.0 else points[::-1]


def _angles_between(points: np.ndarray) -> np.ndarray:
    """Return the angle about the origin from each point to the next, in (-pi, pi)."""
    x, y = points.T
    x1, y1 = np.roll(points, -1, axis=0).T
    return np.asarray(np.arctan2(x * y1 - y * x1, x * x1 + y * y1))


def _axes(cam: Joint, follower: Joint, reader: Reader) -> tuple[Vector, Vector]:
    """Return the cam's axis and the follower's direction of sliding, inertial axes."""
    axis = reader.context.rotated(cam.parent_axes[2], cam.parent, INERTIAL)
    return axis, reader.context.rotated(follower.parent_axes[2], follower.parent, INERTIAL)


def _direction(element: Element, cam: Joint, follower: Joint, reader: Reader) -> Vector:
    """Return the follower's direction of sliding, which is at a right angle to the cam's axis."""
    axis, direction = _axes(cam, follower, reader)
    cosine = dot(axis, direction)
    if abs(cosine) > RIGHT_ANGLE:
        angle = math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
        message = (
            f"the axis of '{follower.name}' is at {angle:.7g} deg to the axis of '{cam.name}' and "
            "must be at 90 deg; rotate one"
        )
        reader.faults.add(element, message)
    parents = {cam.parent, follower.parent}
    if len(parents) > 1 and not parents <= reader.context.grounds.keys():
        message = (
            f"'{cam.name}' and '{follower.name}' must have one parent, on which the cam rotates "
            f"and the follower slides; they have '{cam.parent}' and '{follower.parent}'"
        )
        reader.faults.add(element, message)
    return direction


def _check_in_line(
    element: Element, cam: Joint, follower: Joint, size: float, reader: Reader
) -> None:
    """Add a fault unless the line on which a roller's centre slides meets the cam's axis."""
    axis, direction = _axes(cam, follower, reader)
    here = reader.context.point(cam.parent, cam.parent_point)
    there = reader.context.point(follower.parent, follower.parent_point)
    offset = dot(cross(axis, direction), sub(there, here))
    if abs(offset) > IN_LINE * size:
        message = (
            f"the axis of '{follower.name}' passes the axis of '{cam.name}' at a distance of "
            f"{abs(offset):.4g} m; a roller's must pass through it"
        )
        reader.faults.add(element, message)


def _angle(cam: Joint, direction: Vector, reader: Reader) -> float:
    """Return the angle of ``direction`` in the cam's frame at t = 0 [rad]."""
    rotated = reader.context.rotated
    x, y = (rotated(axis, cam.child, INERTIAL) for axis in cam.child_axes[:2])
    return math.atan2(dot(direction, y), dot(direction, x))
