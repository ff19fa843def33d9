"""Segments of planar curves: lines, arcs and the polynomials of splines, as kernels take them.

A spline is cubic over the length of its polygon. It has the direction of a line or an arc beside
it, the same one at both ends if it is a closed curve by itself, and else no jump of the third
derivative at its last points but one. Its polynomials are cut where they bend by more than
``BEND``, so that each has one nearest place to any point within its radius of curvature.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from msahl.elements.constraints.curves import ARC, LINE, PIECE, Curves
from msahl.model.curves import SPLINE, STRAIGHT, Curve, CurvePart, Point
from msahl.records import record

BEND = 0.1
"""Most by which a polynomial bends [rad]: a tenth is small, and makes few of them."""
SMOOTH = 1e-6
"""Angle of two segments [rad] that is that of the digits a deck omits."""
STRAIGHTEST = 1e-12
"""Distance of the middle of an arc from its chord, over the chord, of a line."""


class NoCurve(ValueError):  # noqa: N818 - an outcome
    """Why numbers make no curve; the argument is a sentence."""


@record
class Segment:
    """A segment with its ``numbers``, as in ``elements.constraints.curves``, in a circle about
    ``middle`` of the radius ``reach`` [m], both ends and the directions there. ``hollow`` is its
    smallest radius of curvature on the side that is free [m]; ``beside`` what of its polynomial is
    before it and after it."""

    kind: int
    numbers: tuple[float, ...]
    middle: Point
    reach: float
    ends: tuple[Point, Point]
    directions: tuple[Point, Point]
    hollow: float = math.inf
    beside: tuple[float, float] = (0.0, 0.0)


def curves_of(found: Sequence[Curve | None]) -> Curves | None:
    """Return the segments of all coordinates' curves as arrays, None if there are none. Raises
    ``NoCurve``.
    """
    if not any(found):
        return None
    segments = [[] if curve is None else segments_of(curve) for curve in found]
    every = [segment for own in segments for segment in own]
    kinks = [
        _kinks(own, curve.closed)
        for own, curve in zip(segments, found, strict=True)
        if curve is not None
    ]
    return Curves(
        first=np.concatenate([[0], np.cumsum([len(own) for own in segments])]).astype(np.int64),
        kind=np.array([segment.kind for segment in every]),
        numbers=np.array([segment.numbers for segment in every]),
        middle=np.array([segment.middle for segment in every]),
        reach=np.array([segment.reach for segment in every]),
        beside=np.array([segment.beside for segment in every]),
        corner=np.concatenate([angles for angles, _ in kinks]),
        sign=np.concatenate([sign for _, sign in kinks]),
    )


def _kinks(segments: list[Segment], closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles of the corners at both ends (s, 2) and the signs of kinks (s,), which
    change from stretch to stretch: from a line or arc to a corner and to the next one, so twice.
    """
    count = len(segments)
    angles, sign = np.zeros((count, 2)), np.ones(count)
    for k in range(count if closed else count - 1):
        one, other = segments[k], segments[(k + 1) % count]
        angle = _bend(one, other)
        if abs(angle) > SMOOTH:
            angles[k, 1] = angles[(k + 1) % count, 0] = angle
        changes = abs(angle) <= SMOOTH and one.beside[1] == 0.0
        if k + 1 < count:
            sign[k + 1] = -sign[k] if changes else sign[k]
        elif (sign[k] != sign[0]) != changes:
            # An odd number of changes: one more, in the middle of the first stretch.
            own = 1 + next((i for i, segment in enumerate(segments) if segment.beside[1] == 0.0), 0)
            sign[own:] *= -1.0
            sign[:own] *= 2.0
    return angles, sign


def _bend(one: Segment, other: Segment) -> float:
    """Return the angle by which a curve bends from one segment to the next [rad]."""
    (a, b), (c, d) = one.directions[1], other.directions[0]
    return math.atan2(a * d - b * c, a * c + b * d)


def segments_of(curve: Curve) -> list[Segment]:
    """Return the segments of a curve, in order. Raises ``NoCurve``."""
    parts, start = [*curve.parts], curve.start
    if not parts:
        raise NoCurve("it has one point only; give two or more")
    last = parts[-1].points[-1]
    size = max(math.hypot(*point) for part in parts for point in (start, *part.points))
    if curve.closed and not _is_ring(curve) and math.dist(last, start) > STRAIGHTEST * size:
        parts.append(CurvePart(STRAIGHT, (start,)))
    found = _parts(curve, parts)
    return found if curve.closed else [_ray(found[0], 0), *found, _ray(found[-1], 1)]


def _is_ring(curve: Curve) -> bool:
    """Return whether a curve is one closed spline."""
    return curve.closed and len(curve.parts) == 1 and curve.parts[0].kind == SPLINE


def _parts(curve: Curve, parts: list[CurvePart]) -> list[Segment]:
    """Return the segments of all parts; splines are last, as they take the directions beside."""
    starts = [curve.start, *(part.points[-1] for part in parts)]
    found: list[list[Segment]] = [
        []
        if part.kind == SPLINE
        else [_line(here, part) if part.kind == STRAIGHT else _arc(here, part)]
        for part, here in zip(parts, starts, strict=False)
    ]
    for k, part in enumerate(parts):
        if part.kind != SPLINE:
            continue
        before, after = found[k - 1] if k or curve.closed else [], found[(k + 1) % len(parts)]
        if k + 1 == len(parts) and not curve.closed:
            after = []
        tangents = (
            before[-1].directions[1] if before else None,
            after[0].directions[0] if after else None,
        )
        found[k] = _spline((starts[k], *part.points), tangents, _is_ring(curve))
    return [segment for own in found for segment in own]


def corners(segments: list[Segment], closed: bool) -> list[tuple[Point, float]]:
    """Return the corners between segments, each with the angle [rad] by which the curve bends
    there: greater than zero where it is convex.
    """
    pairs = [*pairwise(segments), *([(segments[-1], segments[0])] if closed else [])]
    found = []
    for one, other in pairs:
        angle = _bend(one, other)
        if abs(angle) > SMOOTH:
            found.append((other.ends[0], angle))
    return found


def _line(here: Point, part: CurvePart) -> Segment:
    end = part.points[0]
    length = math.dist(here, end)
    if length == 0.0:
        raise NoCurve(f"the point {_shown(here)} is given twice in a row; give it once")
    t = ((end[0] - here[0]) / length, (end[1] - here[1]) / length)
    middle = (0.5 * (here[0] + end[0]), 0.5 * (here[1] + end[1]))
    return Segment(LINE, _filled(*here, *t, 0.0, length), middle, 0.5 * length, (here, end), (t, t))


def _ray(segment: Segment, end: int) -> Segment:
    """Return the straight line on which an open curve goes on at one of its ends."""
    p, t = segment.ends[end], segment.directions[end]
    low, high = ((-math.inf, 0.0), (0.0, math.inf))[end]
    return Segment(LINE, _filled(*p, *t, low, high), p, math.inf, (p, p), (t, t))


def _arc(here: Point, part: CurvePart) -> Segment:
    """Return the arc of the circle through three points."""
    through, end = part.points
    (x, y), (X, Y) = ((p[0] - here[0], p[1] - here[1]) for p in (through, end))
    area, chord = x * Y - y * X, math.hypot(X, Y)
    if abs(area) <= STRAIGHTEST * chord * math.hypot(x, y) or chord == 0.0:
        raise NoCurve(f"the points of the arc from {_shown(here)} are on a line; give a line")
    a, b = x * x + y * y, X * X + Y * Y
    cx, cy = (a * Y - b * y) / (2.0 * area), (b * x - a * X) / (2.0 * area)
    centre, R, sign = (here[0] + cx, here[1] + cy), math.hypot(cx, cy), math.copysign(1.0, area)
    first, last = math.atan2(-cy, -cx), math.atan2(Y - cy, X - cx)
    angle = math.remainder(sign * (last - first) - math.pi, 2.0 * math.pi) + math.pi
    half, between = 0.5 * angle, first + 0.5 * sign * angle
    e = (math.cos(between), math.sin(between))
    ends = [(math.cos(q), math.sin(q)) for q in (first, first + sign * angle)]
    t_0, t_1 = ((-sign * s, sign * c) for c, s in ends)
    numbers, hollow = _filled(*centre, *e, R, half, sign), R if sign < 0.0 else math.inf
    return Segment(ARC, numbers, centre, R, (here, end), (t_0, t_1), hollow)


def _spline(
    points: tuple[Point, ...], tangents: tuple[Point | None, Point | None], ring: bool
) -> list[Segment]:
    # Half a second to import: only models with splines pay.
    from scipy.interpolate import CubicSpline

    if ring and points[-1] != points[0]:
        points = (*points, points[0])
    along = np.concatenate([[0.0], np.cumsum([math.dist(*pair) for pair in pairwise(points)])])
    if (np.diff(along) <= 0.0).any():
        raise NoCurve("two neighbouring points of a spline are one; give each once")
    if ring and len(points) < 5:
        raise NoCurve("a closed spline needs four points or more")
    ends = ["not-a-knot" if t is None else (1, np.array(t)) for t in tangents]
    spline = CubicSpline(along, np.array(points), bc_type="periodic" if ring else tuple(ends))
    pieces = zip(pairwise(along), np.moveaxis(spline.c, 1, 0)[:, ::-1], strict=True)
    return [piece for (a, b), c in pieces for piece in _pieces(c, float(b - a))]


def _pieces(c: np.ndarray, h: float) -> list[Segment]:
    """Return a polynomial with the coefficients (4, 2) cut into parts that bend little."""
    u = np.linspace(0.0, h, 65)[:, None]
    d = c[1] + u * (2.0 * c[2] + 3.0 * u * c[3])
    if not (np.hypot(*d.T) > 0.0).all():
        raise NoCurve("the spline has a cusp; give its points closer together there")
    bend = float(np.abs(np.diff(np.unwrap(np.arctan2(d[:, 1], d[:, 0])))).sum())
    cuts = np.linspace(0.0, h, 1 + max(1, math.ceil(bend / BEND)))
    return [_piece(c, float(a), float(b - a), float(h - b)) for a, b in pairwise(cuts)]


def _piece(c: np.ndarray, a: float, h: float, rest: float) -> Segment:
    own = np.array(
        [
            c[0] + a * (c[1] + a * (c[2] + a * c[3])),
            c[1] + a * (2.0 * c[2] + 3.0 * a * c[3]),
            c[2] + 3.0 * a * c[3],
            c[3],
        ]
    )
    u = np.linspace(0.0, h, 17)[:, None]
    p = own[0] + u * (own[1] + u * (own[2] + u * own[3]))
    d, second = own[1] + u * (2.0 * own[2] + 3.0 * u * own[3]), 2.0 * own[2] + 6.0 * u * own[3]
    speed = np.hypot(*d.T)
    kappa = (d[:, 0] * second[:, 1] - d[:, 1] * second[:, 0]) / speed**3
    t = d / speed[:, None]
    middle = 0.5 * (p[0] + p[-1])
    # Between two of the samples the curve is within half of their distance of one of them.
    reach = float(np.hypot(*(p - middle).T).max() + 0.5 * h / 16 * speed.max() * (1.0 + BEND))
    ends, directions = ((_pair(v[0]), _pair(v[-1])) for v in (p, t))
    hollow = -1.0 / float(kappa.min()) if kappa.min() < 0.0 else math.inf
    numbers = (*map(float, own.reshape(-1)), h)
    return Segment(PIECE, numbers, _pair(middle), reach, ends, directions, hollow, (a, rest))


def outline(segments: list[Segment]) -> list[Point]:
    """Return points of a curve [m] for pictures; of what goes on without end, its beginning."""
    points = [segments[0].ends[0]]
    for segment in segments:
        if segment.kind == ARC:
            cx, cy, e, f, R, half, sign = segment.numbers[:7]
            count = 1 + math.ceil(2.0 * half / BEND)
            middle = math.atan2(f, e)
            angles = [middle + sign * half * (2.0 * k / count - 1.0) for k in range(1, count)]
            points += [(cx + R * math.cos(q), cy + R * math.sin(q)) for q in angles]
        points.append(segment.ends[1])
    return points


def _filled(*numbers: float) -> tuple[float, ...]:
    """Return nine numbers."""
    return (*numbers, *(9 - len(numbers)) * (0.0,))


def _pair(v: np.ndarray) -> Point:
    return float(v[0]), float(v[1])


def _shown(point: Point) -> str:
    return f"({point[0]:.7g}, {point[1]:.7g}) m"
