"""Lift of a follower on a closed planar cam profile, as a function of direction.

The profile is a periodic cubic spline p(u) through the deck's points, over their chord length, in
the x, y of the cam's joint frame (fixed in the cam), counter-clockwise. With the outward normal n
and the curvature k of p, seen from the cam's axis,

    flat     a face at a right angle to the follower's axis touches where n is along that axis;
             distance of the face from the cam's axis: p . n                  (support function)
    roller   of radius r: its centre runs on the pitch curve p + r n; distance of the centre from
             the cam's axis, in the direction in which the follower slides: |p + r n|

Source: Shigley and Uicker, Theory of Machines and Mechanisms, on the layout of cams; the spline and
its limits are ours.
"""

import math

import numpy as np

INTERVALS = 720
"""Intervals of the lift's table over one revolution; a cubic spline through it has an error of
1e-11 of the lift."""

NEWTON = 4
"""Newton iterations to find the point of the profile for a direction, from an interpolation."""

Curve = tuple[np.ndarray, np.ndarray, np.ndarray]
"""A profile and its first and second derivatives by u, each (n, 2)."""


def lift(points: np.ndarray, angles: np.ndarray, radius: float | None) -> tuple[np.ndarray, str]:
    """Return the distance of the follower from the axis in the directions ``angles`` of the cam's
    frame, and why there is none ("" if there is); ``radius`` None: a flat follower."""
    if not (np.diff(_chord(points)) > 0.0).all():
        return angles, "two neighbouring points of the profile are one; give each once"
    u, spline = _spline(points)
    curve = _at(spline, u)
    seen, complaint = _directions(curve, radius)
    if complaint:
        return angles, complaint
    place = _places(spline, u, seen, angles, radius)
    curve = _at(spline, place)
    if radius is None:
        return np.asarray((curve[0] * _normal(curve)).sum(1)), ""
    return np.hypot(*_pitch(curve, radius).T), ""


def _directions(curve: Curve, radius: float | None) -> tuple[np.ndarray, str]:
    """Return the direction in which each sample touches, increasing, or why there is none."""
    _, curvature = _shape(curve)
    if radius is None:
        if curvature.min() <= 0.0:
            return curvature, "a flat follower needs a convex profile; this one is hollow somewhere"
        return np.unwrap(_normal_angle(curve)), ""
    if (1.0 + radius * curvature).min() <= 0.0:
        return curvature, (
            f"a roller of {radius:g} m does not fit the hollow of radius "
            f"{-1.0 / curvature.min():.4g} m; give a smaller one"
        )
    seen = np.unwrap(_polar_angle(_pitch(curve, radius)))
    if np.diff(seen).min() <= 0.0:
        return seen, "the profile is too steep for the roller to follow; give a rounder one"
    return seen, ""


def _places(  # type: ignore[no-untyped-def]
    spline, u: np.ndarray, seen: np.ndarray, angles: np.ndarray, radius: float | None
) -> np.ndarray:
    """Return u where the follower touches for each direction: interpolation, then Newton."""
    revolutions = np.floor((angles - seen[0]) / (2.0 * math.pi))
    inside = angles - 2.0 * math.pi * revolutions
    place = np.interp(inside, seen, u)
    for _ in range(NEWTON):
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
    return place


def _spline(points: np.ndarray):  # type: ignore[no-untyped-def]
    """Return samples u and the periodic spline through the points over chord length."""
    # The import takes half a second, so only decks with cams do it.
    from scipy.interpolate import CubicSpline

    chord = _chord(points)
    fine = np.linspace(0.0, chord[-1], max(INTERVALS, 8 * len(points)) + 1)
    return fine, CubicSpline(chord, np.vstack([points, points[:1]]), bc_type="periodic")


def _chord(points: np.ndarray) -> np.ndarray:
    """Return the length of the polygon up to each of the points, and up to the first again."""
    sides = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    return np.concatenate([[0.0], np.cumsum(sides)])


def _at(spline, u: np.ndarray) -> Curve:  # type: ignore[no-untyped-def]
    return spline(u), spline(u, 1), spline(u, 2)


def _shape(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Return the speed |dp/du| and the curvature, positive where convex."""
    _, first, second = curve
    speed = np.hypot(*first.T)
    return speed, (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3


def _normal(curve: Curve) -> np.ndarray:
    """Return the outward unit normals of a counter-clockwise curve."""
    x, y = curve[1].T / np.hypot(*curve[1].T)
    return np.stack([y, -x], axis=1)


def _pitch(curve: Curve, radius: float) -> np.ndarray:
    """Return the centres of the roller."""
    return np.asarray(curve[0] + radius * _normal(curve))


def _normal_angle(curve: Curve) -> np.ndarray:
    x, y = _normal(curve).T
    return np.asarray(np.arctan2(y, x))


def _polar_angle(points: np.ndarray) -> np.ndarray:
    return np.asarray(np.arctan2(points[:, 1], points[:, 0]))
