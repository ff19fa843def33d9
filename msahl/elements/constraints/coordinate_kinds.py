"""Kinds of coordinate: one number between two frames, as a function of a few scalar products.

    PLAIN   q = m_1
    RADIUS  q = sqrt(m_1^2 + m_2^2 (+ m_3^2))       a distance, across an axis or in space [m]; of
            a box, each m is what of its product is beyond half of the size: |p| - h with p's sign
    ANGLE   q = atan2(m_1, m_2)                      counted over all its revolutions [rad]
    ROUND   q = m_1 - r sqrt(1 - m_2^2)              height of a disk's rim above a plane [m]
    SKEW    q = ((D.D - L^2) (1 - s^2) - a^2 - b^2 + 2 s a b) / (2 L)
            distance of two crossed cylinders less L, times the square of the sine between their
            axes: D = m_1..m_3, a = m_4 and b = m_5 along the axes, s = m_6 their cosine [m]
    CURVE, CURVE_SLIP   distance of a point from a planar curve, and slip along it: see ``curves``
    SEGMENTS   distance of the middle lines of two capsules: see ``segments``

The m_i are the scalar products of ``products``. Each kind gives weights w with  dq = sum w_i dm_i
over the step, exactly, the derivative of q by the products' end values, and the derivative of w by
them; everything else follows by the chain rule. With the unit forces of the products, sum w_i
(f, t)_i is the force that a multiplier of q exerts: a discrete gradient. Source: Gonzalez, Time
integration and discrete Hamiltonian systems, J. Nonlinear Sci. 6 (1996).
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.elements.constraints import curves, segments
from msahl.elements.constraints.curves import CURVE, Curves
from msahl.elements.constraints.products import SLIDE, Products, ProductsWorkspace
from msahl.elements.constraints.segments import SEGMENTS
from msahl.jit.kernel import apart, kernel, optional

PLAIN, RADIUS, ANGLE, ROUND, SKEW = range(5)
MOST = 6
"""Most scalar products of one coordinate."""
ROUND_OFF_FACTOR = 2e-3
"""Factor by which a size stands for its own round-off among the terms that a residual is compared
with: 1e-12 of these counts as solved, which is 2e-15 of the size, about eight machine epsilons."""
SMALL_TANGENT = 1e-4
"""tan of the angle below which series replace quotients; their error is its fourth power."""


class Coordinates(NamedTuple):
    """All coordinates, and their scalar products."""

    products: Products
    kind: np.ndarray  # (q,)
    first: np.ndarray  # (q + 1,) first product of each
    coordinate: np.ndarray  # (m,) of each product
    radius: np.ndarray  # (q,) r of a ROUND or a CURVE_SLIP, L of a SKEW [m]
    block: np.ndarray  # (q, 16) starts of the blocks of its four parts by four parts
    curves: Curves | None
    ends: np.ndarray | None  # (q, 2) half lengths of a SEGMENTS, else 0 [m]
    of_contacts: np.ndarray  # (q,) whether nothing but contacts acts along it
    idle: np.ndarray  # (q,) and these are open; changes during a run


class CoordinatesWorkspace(NamedTuple):
    """Values at the start of the step, and what the equations at some Z have computed."""

    products: ProductsWorkspace
    value: np.ndarray  # (q,) an angle is the one counted by the state
    change: np.ndarray  # (q,)
    weights: np.ndarray  # (q, MOST) w
    slopes: np.ndarray  # (q, MOST) derivative of q by the products' end values
    curves: np.ndarray  # (q, MOST, MOST) derivative of w by the products' end values
    force: np.ndarray  # (q, 4, 3) unit force on the four parts: -f, t_A, f, t_B
    slope: np.ndarray  # (q, 4, 3) derivative of the change by the four parts' unknowns
    load: np.ndarray  # (q,) force or moment along q, gathered from all that act on it
    size: np.ndarray  # (q,) of the loads' largest terms, which may cancel
    term_size: np.ndarray  # (nodes,) largest such term, or round-off of a law, in a node's rows [m]
    partial: np.ndarray  # (1,) whether values along which nothing acts are omitted


class Derivatives(NamedTuple):
    """Block values of the Jacobian at one configuration, and what is needed to compute them."""

    by_place: np.ndarray  # (9 m,) derivatives by displacements and by lengths times rotations
    by_rate: np.ndarray  # (9 m,) derivatives by the rates of these
    scratch: np.ndarray  # (9 m,)
    still: np.ndarray  # (nodes, 3) unknowns of a step without motion: displacements are zero


@kernel
def value(group: Coordinates, start: CoordinatesWorkspace, angle: float, q: int) -> float:
    """Return a coordinate at the start from its products; an angle is the one counted."""
    m, k = start.products.value, group.first[q]
    if group.kind[q] == ANGLE:
        return angle
    if group.kind[q] == RADIUS:
        square = 0.0
        for i in range(k, group.first[q + 1]):
            square += beyond(m[i], half_size(group.products, i)) ** 2
        return math.sqrt(square)
    if group.kind[q] == ROUND:
        return m[k] - group.radius[q] * math.sqrt(max(0.0, 1.0 - m[k + 1] ** 2))
    if group.kind[q] == SKEW:
        return skew_distance(m, k, group.radius[q])
    if group.kind[q] == CURVE:
        return curves.value(group.curves, q, m[k], m[k + 1])
    if group.kind[q] == SEGMENTS:
        return segments.value(group.ends, q, m, k)
    return m[k]


@kernel
def half_size(products: Products, k: int) -> float:
    """Half of the size of a box along the product of number ``k`` [m]; 0 of all others."""
    half: float = products.e[k, 0] if products.kind[k] == SLIDE else 0.0
    return half


@kernel
def beyond(p: float, half: float) -> float:
    """What of ``p`` is beyond -half and half."""
    if half == 0.0:
        return p
    return max(p - half, 0.0) + min(p + half, 0.0)


@kernel
def share_beyond(p: float, dp: float, half: float) -> tuple[float, float]:
    """Return the quotient of the changes of what is beyond and of ``p`` over a step from there, and
    its derivative by the end of ``p``.
    """
    if half == 0.0 or (min(p, p + dp) > half) or (max(p, p + dp) < -half):
        return 1.0, 0.0  # a quotient would be round-off over round-off where dp is small
    if max(abs(p), abs(p + dp)) <= half:
        return 0.0, 0.0
    end = 1.0 if abs(p + dp) > half else 0.0
    share = (beyond(p + dp, half) - beyond(p, half)) / dp
    return share, (end - share) / dp


def from_boxes(group: Coordinates) -> np.ndarray:
    """(q,) which coordinates are distances from boxes."""
    sized = (group.products.kind == SLIDE) & (group.products.e[:, 0] > 0.0)
    found: np.ndarray = np.diff(np.concatenate([[0], np.cumsum(sized)])[group.first]) > 0
    return found & (group.kind == RADIUS)


@kernel
def kink_of_box(group: Coordinates, start: CoordinatesWorkspace, q: int) -> float:
    """Return the kink of a distance from a box [m]: it is zero where a product is at an end of the
    box, and changes its sign there.
    """
    least, sign = math.inf, 1.0
    for i in range(group.first[q], group.first[q + 1]):
        half = half_size(group.products, i)
        if half > 0.0:
            outside = abs(start.products.value[i]) - half
            least = min(least, abs(outside))
            sign = sign if outside > 0.0 else -sign
    return sign * least


@kernel
def skew_distance(m: np.ndarray, k: int, L: float) -> float:
    """Return the SKEW coordinate of the products ``m`` from number ``k`` on."""
    square = m[k] ** 2 + m[k + 1] ** 2 + m[k + 2] ** 2 - L * L
    a, b, s = m[k + 3], m[k + 4], m[k + 5]
    return (square * (1.0 - s * s) - a * a - b * b + 2.0 * s * a * b) / (2.0 * L)


@apart
def weigh(group: Coordinates, start: CoordinatesWorkspace, q: int) -> None:
    """Set change, weights and their derivatives from the products."""
    kind = group.kind[q]
    if kind == PLAIN:
        start.change[q] = start.products.change[group.first[q]]
        start.weights[q, 0] = 1.0
        start.slopes[q, 0] = 1.0
    elif kind == RADIUS:
        _weigh_radius(group, start, q)
    elif kind == ANGLE:
        _weigh_angle(group, start, q)
    elif kind == ROUND:
        _weigh_round(group, start, q)
    elif kind == SKEW:
        _weigh_skew(group, start, q)
    elif kind == SEGMENTS:
        m, out = start.products, (start.weights, start.slopes, start.curves)
        given = ((m.value, m.change), group.first[q], start.value[q], out)
        start.change[q] = segments.weigh(group.ends, q, *given)
    else:
        weigh_along_curve(group.curves, group, start, q)


@optional()
def weigh_along_curve(
    given: Curves, group: Coordinates, start: CoordinatesWorkspace, q: int
) -> None:
    """Likewise of a distance from a curve, or a slip along it."""
    first, last = group.first[q], group.first[q + 1]
    m, dm = start.products.value, start.products.change
    out = (start.weights, start.slopes, start.curves)
    if group.kind[q] == CURVE:
        begin, step = (m[first], m[first + 1]), (dm[first], dm[first + 1])
        start.change[q] = curves.weigh(given, q, begin, step, start.value[q], out)
    else:
        parts = (m[first:last], dm[first:last])
        start.change[q] = curves.weigh_slip(given, q, group.radius[q], *parts, out)


@kernel
def _weigh_radius(group: Coordinates, start: CoordinatesWorkspace, q: int) -> None:
    """d sqrt(s) = ds / (sqrt(s0) + sqrt(s1)),  ds = sum (m0 + m1) dm."""
    first, n = group.first[q], group.first[q + 1] - group.first[q]
    m0, dm = start.products.value, start.products.change
    square0, square1, change = 0.0, 0.0, 0.0
    for i in range(n):
        half = half_size(group.products, first + i)
        begin, end = beyond(m0[first + i], half), beyond(m0[first + i] + dm[first + i], half)
        share, _ = share_beyond(m0[first + i], dm[first + i], half)
        square0 += begin**2
        square1 += end**2
        change += (begin + end) * (share * dm[first + i])
    end_radius = math.sqrt(square1)
    both = math.sqrt(square0) + end_radius
    start.change[q] = change / both
    for i in range(n):
        half = half_size(group.products, first + i)
        begin, end = beyond(m0[first + i], half), beyond(m0[first + i] + dm[first + i], half)
        share, _ = share_beyond(m0[first + i], dm[first + i], half)
        start.weights[q, i] = (begin + end) / both * share
        start.slopes[q, i] = end / end_radius
    for i in range(n):
        for j in range(n):
            start.curves[q, i, j] = -start.weights[q, i] * start.slopes[q, j] / both
        half = half_size(group.products, first + i)
        begin, end = beyond(m0[first + i], half), beyond(m0[first + i] + dm[first + i], half)
        share, bend = share_beyond(m0[first + i], dm[first + i], half)
        at_end = 1.0 if half == 0.0 or end != 0.0 else 0.0
        start.curves[q, i, i] += (share * at_end + (begin + end) * bend) / both


@kernel
def _weigh_angle(group: Coordinates, start: CoordinatesWorkspace, q: int) -> None:
    """With X = c0 s1 - s0 c1 and Y = c0 c1 + s0 s1: dq = atan2(X, Y), X = mean(c) ds - mean(s) dc.

    So the weights are k mean(c) and -k mean(s) with k = dq / X. X is computed from the changes: as
    a difference of products it would have the round-off of 1 rad.
    """
    first = group.first[q]
    s0, c0 = start.products.value[first], start.products.value[first + 1]
    ds, dc = start.products.change[first], start.products.change[first + 1]
    s1, c1 = s0 + ds, c0 + dc
    X, Y = c0 * ds - s0 * dc, c0 * c1 + s0 * s1
    change = math.atan2(X, Y)
    square = s1 * s1 + c1 * c1
    slope_s, slope_c = c1 / square, -s1 / square
    t = X / Y if Y != 0.0 else math.inf
    if Y > 0.0 and abs(t) < SMALL_TANGENT:
        g, g_t = 1.0 - t * t / 3.0, -2.0 * t / 3.0
        k = g / Y
        k_s = (g_t * (c0 - t * s0) / Y - g * s0 / Y) / Y
        k_c = (g_t * (-s0 - t * c0) / Y - g * c0 / Y) / Y
    else:
        k = change / X
        k_s, k_c = (slope_s - k * c0) / X, (slope_c + k * s0) / X
    c, s = 0.5 * (c0 + c1), 0.5 * (s0 + s1)
    start.change[q] = change
    start.weights[q, 0], start.weights[q, 1] = k * c, -k * s
    start.slopes[q, 0], start.slopes[q, 1] = slope_s, slope_c
    start.curves[q, 0, 0], start.curves[q, 0, 1] = c * k_s, c * k_c + 0.5 * k
    start.curves[q, 1, 0], start.curves[q, 1, 1] = -s * k_s - 0.5 * k, -s * k_c


@kernel
def _weigh_round(group: Coordinates, start: CoordinatesWorkspace, q: int) -> None:
    """d sqrt(1 - m^2) = -(m0 + m1) dm / (sqrt(1 - m0^2) + sqrt(1 - m1^2))."""
    first = group.first[q]
    m0, r = start.products.value[first + 1], group.radius[q]
    dm = start.products.change[first + 1]
    m1 = m0 + dm
    root0, root1 = math.sqrt(max(0.0, 1.0 - m0 * m0)), math.sqrt(max(0.0, 1.0 - m1 * m1))
    both = root0 + root1
    w = r * (m0 + m1) / both
    start.change[q] = start.products.change[first] + w * dm
    start.weights[q, 0], start.weights[q, 1] = 1.0, w
    start.slopes[q, 0], start.slopes[q, 1] = 1.0, r * m1 / root1
    for i in range(2):
        for j in range(2):
            start.curves[q, i, j] = 0.0
    start.curves[q, 1, 1] = (r + w * m1 / root1) / both


@kernel
def _weigh_skew(group: Coordinates, start: CoordinatesWorkspace, q: int) -> None:
    """A polynomial: every product changes by the sum of means times changes.

    With E = D.D - L^2 and c = 1 - s^2:  d(E c) = mean(E) dc + mean(c) dE,  dc = -2 mean(s) ds, ...
    """
    k, L = group.first[q], group.radius[q]
    m0, dm = start.products.value, start.products.change
    c = 1.0 / (2.0 * L)
    a, b, s = m0[k + 3] + 0.5 * dm[k + 3], m0[k + 4] + 0.5 * dm[k + 4], m0[k + 5] + 0.5 * dm[k + 5]
    a1, b1, s1 = m0[k + 3] + dm[k + 3], m0[k + 4] + dm[k + 4], m0[k + 5] + dm[k + 5]
    E0, E1 = -L * L, -L * L
    for i in range(3):
        E0 += m0[k + i] ** 2
        E1 += (m0[k + i] + dm[k + i]) ** 2
    E, sine0, sine1 = 0.5 * (E0 + E1), 1.0 - m0[k + 5] ** 2, 1.0 - s1 * s1
    sine, ab = 0.5 * (sine0 + sine1), 0.5 * (m0[k + 3] * m0[k + 4] + a1 * b1)
    for i in range(MOST):
        for j in range(MOST):
            start.curves[q, i, j] = 0.0
    for i in range(3):
        x, x1 = m0[k + i] + 0.5 * dm[k + i], m0[k + i] + dm[k + i]
        start.weights[q, i] = 2.0 * c * sine * x
        start.slopes[q, i] = 2.0 * c * sine1 * x1
        start.curves[q, i, i] = c * sine
        start.curves[q, i, 5] = -2.0 * c * x * s1
        start.curves[q, 5, i] = -2.0 * c * s * x1
    start.weights[q, 3], start.slopes[q, 3] = 2.0 * c * (s * b - a), 2.0 * c * (s1 * b1 - a1)
    start.weights[q, 4], start.slopes[q, 4] = 2.0 * c * (s * a - b), 2.0 * c * (s1 * a1 - b1)
    start.weights[q, 5] = 2.0 * c * (ab - s * E)
    start.slopes[q, 5] = 2.0 * c * (a1 * b1 - s1 * E1)
    start.curves[q, 3, 3] = start.curves[q, 4, 4] = -c
    start.curves[q, 3, 4] = start.curves[q, 4, 3] = c * s
    start.curves[q, 3, 5], start.curves[q, 4, 5] = c * b, c * a
    start.curves[q, 5, 3], start.curves[q, 5, 4] = c * b1, c * a1
    start.curves[q, 5, 5] = -c * E
    start.change[q] = 0.0
    for i in range(MOST):
        start.change[q] += start.weights[q, i] * dm[k + i]
