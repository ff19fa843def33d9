"""Coordinates between a point of frame B and a planar curve of frame A: its distance and its slip.

    CURVE       q = d(m_1, m_2)      signed distance of the point (m_1, m_2) from the curve [m]
    CURVE_SLIP  dq = t . (dm_1, dm_2) - r dth,  dth = mean(c) ds - mean(s) dc
                no position law: slip along the curve of a pin of radius r [m] about that point,
                t = (-n_2, n_1), s = m_3 and c = m_4 sine and cosine of B's angle about the normal
                of the curve's plane; r = 0 and the first two products only, of a point

m_1 and m_2 are along two axes of A. What is on the left of the curve, as its segments go, is solid;
n is the normal of length 1 away from it at the foot, the nearest point of the curve. Then

    d = n . (m - p)      d_m = n      d_mm = k t t^T,   k = kappa/(1 + kappa d),  1/d at a corner

with the foot p and the curvature kappa of the curve there, positive where it is convex. Over a step

    w = integral over [0, 1] of n(m + xi dm)      by a Gauss quadrature, and where that differs from
    w + (change of d - w . dm) dm/|dm|^2          the change by more than round-off, this

so w . dm is the change. Source of the latter: Gonzalez, Time integration and discrete Hamiltonian
systems, J. Nonlinear Sci. 6 (1996).

The second derivative jumps where the foot passes from one stretch to the next: a stretch is a line,
an arc, all pieces of one polynomial or a corner. A kink is a function that is continuous along the
curve and zero there: the way to the nearest end of the stretch, with signs that alternate.

A segment is, by its numbers,

    LINE    p, t, low, high      p + u t, u from low to high: infinite where an open curve ends
    ARC     C, e, R, a, s        C + R e rotated by up to a either way; s = 1 where it is convex
    PIECE   p, p', p''/2, p'''/6, h     a cubic polynomial of u from 0 to h
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.jit.kernel import apart, kernel, optional

LINE, ARC, PIECE = range(3)
CURVE, CURVE_SLIP = 5, 6
"""Kinds of coordinate, after those of ``coordinate_kinds``."""
ROUND_OFF = 1e-15
"""Difference of a change and its quadrature, over the size of what is known, that is round-off."""
BEYOND = 1e-12
"""Distance past the end of a segment, over that from its foot, that is round-off."""
ITERATIONS = 60
"""More than bisection needs for all digits of a foot."""

Foot = tuple[float, float, float, float]
"""d, n_1, n_2 and k."""
Place = tuple[float, float, float, float, float, float, float]
"""Foot p_1, p_2, tangent t_1, t_2, curvature; 0, or -1 or 1 if it is the start or the end of the
segment and the point is past it; and how far along the segment it is: u, or the angle from e."""

Weights = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Weights, slopes and curves of all coordinates, as their workspace has them."""


class Curves(NamedTuple):
    """The curves of all coordinates, segment by segment."""

    first: np.ndarray  # (q + 1,) first segment of each coordinate; of most there are none
    kind: np.ndarray  # (s,)
    numbers: np.ndarray  # (s, 9) see above
    middle: np.ndarray  # (s, 2) of a circle around the segment
    reach: np.ndarray  # (s,) its radius [m]
    beside: np.ndarray  # (s, 2) what of its stretch is before a piece and after it, in u
    corner: np.ndarray  # (s, 2) angles of those at its start and end [rad]; 0 if it is smooth
    sign: np.ndarray  # (s,) of the kink; twice that where one is in the middle of the stretch


def subset(group: Curves | None, used: np.ndarray) -> Curves | None:
    """Return the curves of the ``used`` coordinates (n,); None if these have none."""
    if group is None:
        return None
    counts = np.diff(group.first)[used]
    if not counts.any():
        return None
    kept = np.concatenate([np.arange(group.first[q], group.first[q + 1]) for q in used])
    segments = (array[kept] for array in group[1:])
    return Curves(np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), *segments)


@kernel
def _on_line(numbers: np.ndarray, s: int, x: float, y: float) -> Place:
    p, q, t, v = numbers[s, 0], numbers[s, 1], numbers[s, 2], numbers[s, 3]
    u, end = t * (x - p) + v * (y - q), 0.0
    near = BEYOND * abs(v * (x - p) - t * (y - q))
    if u < numbers[s, 4]:
        end, u = -1.0 if u < numbers[s, 4] - near else 0.0, numbers[s, 4]
    elif u > numbers[s, 5]:
        end, u = 1.0 if u > numbers[s, 5] + near else 0.0, numbers[s, 5]
    return p + u * t, q + u * v, t, v, 0.0, end, u


@kernel
def _on_arc(numbers: np.ndarray, s: int, x: float, y: float) -> Place:
    X, Y = x - numbers[s, 0], y - numbers[s, 1]
    e, f, R = numbers[s, 2], numbers[s, 3], numbers[s, 4]
    half, sign = numbers[s, 5], numbers[s, 6]
    length, end = math.hypot(X, Y), 0.0
    angle = math.atan2(e * Y - f * X, e * X + f * Y) if length > 0.0 else 0.0
    if length == 0.0 or abs(angle) > half:
        end = math.copysign(sign, angle * sign) if abs(angle) > half + BEYOND else 0.0
        angle = min(max(angle, -half), half)
        c, d = math.cos(angle), math.sin(angle)
        X, Y, length = e * c - f * d, f * c + e * d, 1.0
    X, Y = X / length, Y / length
    p, q = numbers[s, 0] + R * X, numbers[s, 1] + R * Y
    return p, q, -sign * Y, sign * X, sign / R, end, angle


@kernel
def _along_piece(
    numbers: np.ndarray, s: int, u: float, x: float, y: float
) -> tuple[float, float, float, float, float, float, float, float]:
    """Return p - (x, y) and the first two derivatives of p, and (p - (x, y)) . p' with its rate."""
    a = numbers[s]
    X = a[0] - x + u * (a[2] + u * (a[4] + u * a[6]))
    Y = a[1] - y + u * (a[3] + u * (a[5] + u * a[7]))
    X1, Y1 = a[2] + u * (2.0 * a[4] + 3.0 * u * a[6]), a[3] + u * (2.0 * a[5] + 3.0 * u * a[7])
    X2, Y2 = 2.0 * a[4] + 6.0 * u * a[6], 2.0 * a[5] + 6.0 * u * a[7]
    return X, Y, X1, Y1, X2, Y2, X * X1 + Y * Y1, X1 * X1 + Y1 * Y1 + X * X2 + Y * Y2


@kernel
def _foot_of_piece(
    numbers: np.ndarray, s: int, ends: tuple[float, float], x: float, y: float
) -> float:
    """Return u where (p - (x, y)) . p', less and greater than zero at the ``ends``, is zero: by
    Newton's method, kept between those.
    """
    low, high, u = 0.0, numbers[s, 8], numbers[s, 8] * ends[0] / (ends[0] - ends[1])
    for _ in range(ITERATIONS):
        found = _along_piece(numbers, s, u, x, y)
        if found[6] < 0.0:
            low = u
        else:
            high = u
        new = u - found[6] / found[7] if found[7] > 0.0 else low - 1.0
        if not low <= new <= high:
            new = 0.5 * (low + high)
        if abs(new - u) <= ROUND_OFF * numbers[s, 8]:
            return new
        u = new
    return u


@kernel
def _on_piece(numbers: np.ndarray, s: int, x: float, y: float) -> Place:
    h, end = numbers[s, 8], 0.0
    first, last = _along_piece(numbers, s, 0.0, x, y), _along_piece(numbers, s, h, x, y)
    if first[6] < 0.0 < last[6]:
        u = _foot_of_piece(numbers, s, (first[6], last[6]), x, y)
    else:
        # One end is the nearest place, or both are nearer than what is between.
        at_start = first[6] >= 0.0
        if at_start and last[6] <= 0.0:
            at_start = math.hypot(first[0], first[1]) <= math.hypot(last[0], last[1])
        u, there = (0.0, first) if at_start else (h, last)
        past = abs(there[6]) / math.hypot(there[2], there[3])
        if past > BEYOND * math.hypot(there[0], there[1]):
            end = -1.0 if at_start else 1.0
    X, Y, X1, Y1, X2, Y2, _, _ = _along_piece(numbers, s, u, x, y)
    speed = math.hypot(X1, Y1)
    kappa = (X1 * Y2 - Y1 * X2) / speed**3
    return x + X, y + Y, X1 / speed, Y1 / speed, kappa, end, u


@apart
def place(group: Curves, s: int, x: float, y: float) -> Place:
    """Return the nearest place of a segment to a point."""
    if group.kind[s] == LINE:
        return _on_line(group.numbers, s, x, y)
    if group.kind[s] == ARC:
        return _on_arc(group.numbers, s, x, y)
    return _on_piece(group.numbers, s, x, y)


@apart
def nearest(group: Curves, q: int, x: float, y: float) -> tuple[int, float, Place]:
    """Return the segment of the curve of coordinate ``q`` that is nearest to a point, its distance
    and the place there.
    """
    least, which, found = math.inf, -1, (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    for s in range(group.first[q], group.first[q + 1]):
        away = math.hypot(x - group.middle[s, 0], y - group.middle[s, 1]) - group.reach[s]
        if away > least:
            continue
        other = place(group, s, x, y)
        distance = math.hypot(x - other[0], y - other[1])
        # Near the joint of two segments both have the foot, but for round-off, and the point may be
        # past the end of one of them: it is at a corner only if it is past those of both.
        past, even = abs(other[5]) - abs(found[5]), ROUND_OFF * (abs(x) + abs(y) + distance)
        nearer = distance < least - even or (past == 0.0 and distance < least)
        if nearer or (past < 0.0 and distance <= least + even):
            least, which, found = distance, s, other
    return which, least, found


@kernel
def corner_at(group: Curves, s: int, end: float) -> float:
    """Return the angle of the corner at an end -1 or 1 of a segment [rad], 0 where it is smooth or
    for 0.
    """
    if end == 0.0:
        return 0.0
    angle: float = group.corner[s, 0 if end < 0.0 else 1]
    return angle


@kernel
def foot(group: Curves, q: int, x: float, y: float) -> Foot:
    """Return distance, normal and curvature of the lines of equal distance at a point."""
    s, distance, found = nearest(group, q, x, y)
    X, Y, kappa = x - found[0], y - found[1], found[4]
    if corner_at(group, s, found[5]) != 0.0 and distance > 0.0:
        return distance, X / distance, Y / distance, 1.0 / distance
    d = X * found[3] - Y * found[2]
    return d, found[3], -found[2], kappa / (1.0 + kappa * d)


@optional(0.0)
def kink(group: Curves, q: int, x: float, y: float) -> float:
    """Return the kink of coordinate ``q`` at a point [m or rad]."""
    s, _, found = nearest(group, q, x, y)
    sign, u, total = group.sign[s], found[6], corner_at(group, s, found[5])
    if total != 0.0:
        X, Y, t, v = x - found[0], y - found[1], found[2], found[3]
        angle = abs(math.atan2(X * t + Y * v, X * v - Y * t))
        if found[5] > 0.0 and abs(sign) == 2.0:
            sign = -sign
        return -math.copysign(min(angle, total - angle), sign)
    if group.kind[s] == LINE:
        before, after = u - group.numbers[s, 4], group.numbers[s, 5] - u
    elif group.kind[s] == ARC:
        R, half = group.numbers[s, 4], group.numbers[s, 5]
        along = group.numbers[s, 6] * u
        before, after = R * (half + along), R * (half - along)
    else:
        before, after = group.beside[s, 0] + u, group.beside[s, 1] + group.numbers[s, 8] - u
    if abs(sign) < 2.0:
        return sign * min(before, after)
    middle = 0.5 * (after - before)
    return 0.5 * sign * (min(before, middle) if before < after else -min(after, -middle))


@optional(0.0)
def value(group: Curves, q: int, x: float, y: float) -> float:
    """Return the signed distance of a point from the curve of coordinate ``q``."""
    return foot(group, q, x, y)[0]


@kernel
def _add_gauss_point(
    group: Curves,
    q: int,
    begin: tuple[float, float],
    step: tuple[float, float],
    node: tuple[float, float],
    weights: np.ndarray,
    curves: np.ndarray,
) -> None:
    xi, weight = node
    _, n_1, n_2, k = foot(group, q, begin[0] + xi * step[0], begin[1] + xi * step[1])
    weights[q, 0] += weight * n_1
    weights[q, 1] += weight * n_2
    c = weight * xi * k
    curves[q, 0, 0] += c * n_2 * n_2
    curves[q, 0, 1] -= c * n_1 * n_2
    curves[q, 1, 0] -= c * n_1 * n_2
    curves[q, 1, 1] += c * n_1 * n_1


@optional(0.0)
def weigh(
    group: Curves,
    q: int,
    begin: tuple[float, float],
    step: tuple[float, float],
    before: float,
    out: Weights,
) -> float:
    """Set weights and their derivatives of the distance over a ``step`` from where it is
    ``before``, and return its change.
    """
    weights, slopes, curves = out
    for i in range(2):
        weights[q, i] = 0.0
        for j in range(2):
            curves[q, i, j] = 0.0
    dx, dy = step
    square = dx * dx + dy * dy
    if square == 0.0:
        _add_gauss_point(group, q, begin, step, (0.0, 1.0), weights, curves)
        slopes[q, 0], slopes[q, 1] = weights[q, 0], weights[q, 1]
        _, n_1, n_2, k = foot(group, q, begin[0], begin[1])
        curves[q, 0, 0], curves[q, 1, 1] = 0.5 * k * n_2 * n_2, 0.5 * k * n_1 * n_1
        curves[q, 0, 1] = curves[q, 1, 0] = -0.5 * k * n_1 * n_2
        return 0.0
    away = 0.5 * math.sqrt(0.6)
    _add_gauss_point(group, q, begin, step, (0.5 - away, 5.0 / 18.0), weights, curves)
    _add_gauss_point(group, q, begin, step, (0.5, 8.0 / 18.0), weights, curves)
    _add_gauss_point(group, q, begin, step, (0.5 + away, 5.0 / 18.0), weights, curves)
    after, n_1, n_2, _ = foot(group, q, begin[0] + dx, begin[1] + dy)
    slopes[q, 0], slopes[q, 1] = n_1, n_2
    mean = weights[q, 0] * dx + weights[q, 1] * dy
    left = after - before - mean
    size = abs(after) + abs(before) + abs(begin[0]) + abs(begin[1])
    if abs(left) <= ROUND_OFF * size:
        return mean
    by_x = n_1 - weights[q, 0] - curves[q, 0, 0] * dx - curves[q, 1, 0] * dy
    by_y = n_2 - weights[q, 1] - curves[q, 0, 1] * dx - curves[q, 1, 1] * dy
    share = left / square
    weights[q, 0] += share * dx
    weights[q, 1] += share * dy
    curves[q, 0, 0] += (by_x * dx + left) / square - 2.0 * share * dx * dx / square
    curves[q, 0, 1] += by_y * dx / square - 2.0 * share * dx * dy / square
    curves[q, 1, 0] += by_x * dy / square - 2.0 * share * dx * dy / square
    curves[q, 1, 1] += (by_y * dy + left) / square - 2.0 * share * dy * dy / square
    return mean + left


@optional(0.0)
def weigh_slip(
    group: Curves,
    q: int,
    radius: float,
    begin: np.ndarray,
    step: np.ndarray,
    out: Weights,
) -> float:
    """Set weights and their derivatives of the slip over a ``step`` of its products (2 or 4,), and
    return the slip.
    """
    weights, slopes, curves = out
    count = begin.size
    for i in range(count):
        for j in range(count):
            curves[q, i, j] = 0.0
    dx, dy = step[0], step[1]
    _, n_1, n_2, k = foot(group, q, begin[0] + 0.5 * dx, begin[1] + 0.5 * dy)
    weights[q, 0], weights[q, 1] = -n_2, n_1
    # t changes by -n k (t . dm) along a displacement dm of the middle, half of that of the end.
    curves[q, 0, 0], curves[q, 0, 1] = 0.5 * k * n_1 * n_2, -0.5 * k * n_1 * n_1
    curves[q, 1, 0], curves[q, 1, 1] = 0.5 * k * n_2 * n_2, -0.5 * k * n_1 * n_2
    if count > 2:
        weights[q, 2] = -radius * (begin[3] + 0.5 * step[3])
        weights[q, 3] = radius * (begin[2] + 0.5 * step[2])
        curves[q, 2, 3], curves[q, 3, 2] = -0.5 * radius, 0.5 * radius
    total = 0.0
    for j in range(count):
        slopes[q, j] = weights[q, j]
        for i in range(count):
            slopes[q, j] += curves[q, i, j] * step[i]
        total += weights[q, j] * step[j]
    return total
