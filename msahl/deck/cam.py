"""Cam and follower: a closed planar profile -> the follower's lift over the cam's angle.

The profile is a periodic cubic spline p(u) through the deck's points, over their chord length, in
the x, y of the cam's joint frame (which turns with the cam), counter-clockwise. With the outward
normal n and the curvature k of p, seen from the cam's axis,

    flat     a face across the follower's way touches where n is the way's direction;
             distance of the face from the axis: p . n                        (support function)
    roller   of radius r: its centre runs on the pitch curve p + r n; distance of the centre from
             the axis in the way's direction: |p + r n|

A cam turned by theta about its axis shows the way's direction at the angle phi_0 - theta of its
own frame, phi_0 being that at t = 0. The lift is the distance less that at t = 0, over a turn.
Source: Shigley and Uicker, Theory of Machines and Mechanisms, on the layout of cams; the spline and
its limits are ours.
"""

import math

import numpy as np

from msahl.algebra.functions import Law
from msahl.algebra.vector import Vector, cross, dot, sub
from msahl.deck.ends import ROUND_OFF
from msahl.deck.faults import Element, text
from msahl.deck.values import INERTIAL, Reader
from msahl.model.joints import Joint

INTERVALS = 720
"""Of the lift's table over a turn; a cubic spline through it adds 1e-11 of the lift."""

RIGHT_ANGLE = 1e-6
"""Largest cosine between the cam's axis and the follower's way."""

IN_LINE = 1e-6
"""Distance of a roller's way from the cam's axis that is forgiven, in parts of the profile."""

FEWEST = 4
"""Points of a profile."""

Curve = tuple[np.ndarray, np.ndarray, np.ndarray]
"""A profile and its first and second derivatives by u, each (n, 2)."""


def read_lift(element: Element, cam: Joint, follower: Joint, reader: Reader) -> Law:
    """The lift [m] over the cam's angle [rad] of a ``<camFollower>``, zero at t = 0."""
    nothing = Law("constant", (0.0,))
    roller = text(element.find("follower")) == "roller"
    radius = _radius(element, roller, reader)
    points = _points(element, reader)
    direction = _direction(element, cam, follower, reader)
    if not reader.faults.sound(element):
        return nothing
    if roller:
        _check_in_line(element, cam, follower, float(np.abs(points).max()), reader)
    start = _angle(cam, direction, reader)
    angles = start - np.linspace(0.0, 2.0 * math.pi, INTERVALS + 1)
    distance, complaint = lift(points, angles, radius if roller else None)
    if complaint:
        reader.faults.add(element, complaint)
    if not reader.faults.sound(element):
        return nothing
    distance[-1] = distance[0]
    rise = distance - distance[0]
    return Law("periodic", (*(start - angles).tolist(), *rise.tolist()))


def _radius(element: Element, roller: bool, reader: Reader) -> float:
    """Radius of the roller [m]."""
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
    """Points of the profile [m] (n, 2), counter-clockwise, the first not repeated."""
    profile = element.find("profile")
    assert profile is not None  # the schema requires it
    points = np.array([reader.numbers(point, ("x", "y"), "length") for point in profile])
    if len(points) > 1 and math.dist(points[0], points[-1]) <= ROUND_OFF * np.abs(points).max():
        points = points[:-1]
    if len(points) < FEWEST:
        message = f"a profile needs {FEWEST} points or more; it has {len(points)}"
        reader.faults.add(profile, message)
        return points
    steps = _turns(points)
    one_way = bool(np.all(steps > 0.0) or np.all(steps < 0.0))
    if not one_way or abs(steps.sum()) > 3.0 * math.pi:
        message = (
            "its points must go once round the cam's axis (x = y = 0), each further round than the "
            "one before; put them in order"
        )
        reader.faults.add(profile, message)
    return points if steps.sum() > 0.0 else points[::-1]


def _turns(points: np.ndarray) -> np.ndarray:
    """Angle about the origin from each point to the next, in (-pi, pi)."""
    x, y = points.T
    x1, y1 = np.roll(points, -1, axis=0).T
    return np.asarray(np.arctan2(x * y1 - y * x1, x * x1 + y * y1))


def _direction(element: Element, cam: Joint, follower: Joint, reader: Reader) -> Vector:
    """Of the follower's way, inertial axes; at a right angle to the cam's axis."""
    axis = reader.turned(cam.parent_axes[2], cam.parent, INERTIAL)
    way = reader.turned(follower.parent_axes[2], follower.parent, INERTIAL)
    cosine = dot(axis, way)
    if abs(cosine) > RIGHT_ANGLE:
        angle = math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
        message = (
            f"the way of '{follower.name}' is at {angle:.7g} deg to the axis of '{cam.name}' and "
            "must be at a right angle; turn one"
        )
        reader.faults.add(element, message)
    same = cam.parent == follower.parent or {cam.parent, follower.parent} <= reader.grounds.keys()
    if not same:
        message = (
            f"'{cam.name}' and '{follower.name}' must have one parent, against which the cam turns "
            f"and the follower slides; they have '{cam.parent}' and '{follower.parent}'"
        )
        reader.faults.add(element, message)
    return way


def _check_in_line(
    element: Element, cam: Joint, follower: Joint, size: float, reader: Reader
) -> None:
    """The way of a roller's centre passes through the cam's axis."""
    axis = reader.turned(cam.parent_axes[2], cam.parent, INERTIAL)
    way = reader.turned(follower.parent_axes[2], follower.parent, INERTIAL)
    here = reader.placed(cam.parent, cam.parent_point)
    there = reader.placed(follower.parent, follower.parent_point)
    offset = dot(cross(axis, way), sub(there, here))
    if abs(offset) > IN_LINE * size:
        message = (
            f"the way of '{follower.name}' passes the axis of '{cam.name}' at {abs(offset):.4g} m; "
            "a roller's must pass through it"
        )
        reader.faults.add(element, message)


def _angle(cam: Joint, direction: Vector, reader: Reader) -> float:
    """Of ``direction`` in the cam's frame at t = 0 [rad]."""
    x, y = (reader.turned(axis, cam.child, INERTIAL) for axis in cam.child_axes[:2])
    return math.atan2(dot(direction, y), dot(direction, x))


def lift(points: np.ndarray, angles: np.ndarray, radius: float | None) -> tuple[np.ndarray, str]:
    """Distance of the follower from the axis in the directions ``angles`` of the cam's frame, and
    why it is none; ``radius`` None: a flat follower."""
    u, spline = _spline(points)
    curve = _at(spline, u)
    speed, curvature = _shape(curve)
    if radius is None:
        if curvature.min() <= 0.0:
            return angles, "a flat follower needs a convex profile; this one is hollow somewhere"
        shown = np.unwrap(_normal_angle(curve))
    else:
        if (1.0 + radius * curvature).min() <= 0.0:
            return angles, (
                f"a roller of {radius:g} m does not fit the hollow of radius "
                f"{-1.0 / curvature.min():.4g} m; give a smaller one"
            )
        shown = np.unwrap(_polar_angle(_pitch(curve, radius)))
        if np.diff(shown).min() <= 0.0:
            return angles, "the profile is too steep for the roller to follow; give it more round"
    # Where on the profile each direction is: by interpolation, then by Newton's method.
    turns = np.floor((angles - shown[0]) / (2.0 * math.pi))
    inside = angles - 2.0 * math.pi * turns
    place = np.interp(inside, shown, u)
    for _ in range(4):
        curve = _at(spline, place)
        speed, curvature = _shape(curve)
        if radius is None:
            angle, rate = _normal_angle(curve), speed * curvature
        else:
            pitch = _pitch(curve, radius)
            angle = _polar_angle(pitch)
            along = curve[1] * (1.0 + radius * curvature)[:, None]
            rate = (pitch[:, 0] * along[:, 1] - pitch[:, 1] * along[:, 0]) / (pitch**2).sum(1)
        beyond = np.remainder(angle - inside + math.pi, 2.0 * math.pi) - math.pi
        place = place - beyond / rate
    curve = _at(spline, place)
    if radius is None:
        return np.asarray((curve[0] * _normal(curve)).sum(1)), ""
    return np.hypot(*_pitch(curve, radius).T), ""


def _spline(points: np.ndarray):  # type: ignore[no-untyped-def]
    """Sample places u, closed, and the periodic spline through the points over chord length."""
    # Half a second to import: only decks with cams pay.
    from scipy.interpolate import CubicSpline

    closed = np.vstack([points, points[:1]])
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    fine = np.linspace(0.0, chord[-1], max(INTERVALS, 8 * len(points)) + 1)
    return fine, CubicSpline(chord, closed, bc_type="periodic")


def _at(spline, u: np.ndarray) -> Curve:  # type: ignore[no-untyped-def]
    return spline(u), spline(u, 1), spline(u, 2)


def _shape(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Speed |dp/du| and curvature, positive where convex."""
    _, first, second = curve
    speed = np.hypot(*first.T)
    return speed, (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3


def _normal(curve: Curve) -> np.ndarray:
    """Outward unit normals of a counter-clockwise curve."""
    x, y = curve[1].T / np.hypot(*curve[1].T)
    return np.stack([y, -x], axis=1)


def _pitch(curve: Curve, radius: float) -> np.ndarray:
    """Centres of the roller."""
    return np.asarray(curve[0] + radius * _normal(curve))


def _normal_angle(curve: Curve) -> np.ndarray:
    x, y = _normal(curve).T
    return np.asarray(np.arctan2(y, x))


def _polar_angle(points: np.ndarray) -> np.ndarray:
    return np.asarray(np.arctan2(points[:, 1], points[:, 0]))
