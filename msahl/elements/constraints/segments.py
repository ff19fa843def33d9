"""Distance of two segments, the middle lines of capsules, fixed in the frames A and B.

    q = |D + w e - u a|,  u and w from the middles to the nearest points, along the axes a and e
    q^2 = D.D + G(p, q_e, s),   p = D.a,  q_e = D.e,  s = a.e
    G = min u^2 + w^2 - 2 u p + 2 w q_e - 2 u w s        over |u| <= L_a, |w| <= L_b
    G' = (-2 u, 2 w, -2 u w)

by the products m_1 to m_3, which are D, and m_4 to m_6, here m. Over a step

    dq = (2 mean(D) . dD + g . dm)/(q_0 + q_1)

with g the integral of G' along the straight way from m_0 to m_1, by three points of Gauss; where
g . dm differs from the change of G by more than round-off, (dG - g . dm) M dm/(dm . M dm) is added,
M = diag(1, 1, (L_a + L_b)^2): so the work is exact. The forces of D are along its mean, so that
both bodies are pushed at one point.

The second derivative jumps where u or w come to an end or leave it. A kink is a function that is
continuous and zero there. Where the axes are parallel, side by side, the nearest points are not
unique, and even the first derivative jumps.
"""

import math

import numpy as np

from msahl.algebra.vector import Vector
from msahl.jit.kernel import kernel, optional

SEGMENTS = 7
"""Kind of coordinate, after those of ``coordinate_kinds`` and ``curves``."""
ROUND_OFF = 1e-15
"""Difference of a change and its quadrature, over the size of what is known, that is round-off."""
LEAST_SINE = 1e-15
"""Square of the sine between the axes that takes the place of smaller ones in derivatives."""
PARALLEL = 1e-7
"""Sine between two axes that are parallel: the root of round-off of their cosine, and some."""
AWAY = 0.5 * math.sqrt(0.6)
"""Distance of the outer points of the quadrature from the middle of a step."""

Feet = tuple[float, float, bool, bool]
"""u and w, and which of them are at an end."""


@kernel
def within(x: float, half: float) -> float:
    """Return the number from -half to half that is nearest to ``x``."""
    return min(max(x, -half), half)


@kernel
def feet(half: tuple[float, float], m: Vector) -> Feet:
    """Return the places of the nearest points of two segments of these ``half`` lengths [m], by
    ``m`` = (p, q_e, s).
    """
    (a, b), (p, q, s) = half, m
    square = 1.0 - s * s
    free = (p - s * q) / square if square > 0.0 else 0.0
    u = within(free, a)
    pull = s * u - q
    w = within(pull, b)
    if w != pull:
        free = p + s * w
        u = within(free, a)
    return u, w, u != free, w != pull


@kernel
def feet_change(m: Vector, at: Feet, dm: Vector) -> tuple[float, float]:
    """Return the derivatives of u and w along ``dm``."""
    u, w, u_ends, w_ends = at
    by_u, by_w, s = dm[0] + w * dm[2], u * dm[2] - dm[1], m[2]
    if u_ends and w_ends:
        return 0.0, 0.0
    if u_ends:
        return 0.0, by_w
    if w_ends:
        return by_u, 0.0
    square = max(1.0 - s * s, LEAST_SINE)
    return (by_u + s * by_w) / square, (by_w + s * by_u) / square


@kernel
def below(half: tuple[float, float], m: Vector) -> float:
    """Return G."""
    u, w, _, _ = feet(half, m)
    return u * u + w * w - 2.0 * u * m[0] + 2.0 * w * m[1] - 2.0 * u * w * m[2]


@kernel
def half_lengths(ends: np.ndarray, q: int) -> tuple[float, float]:
    """Return L_a and L_b of coordinate ``q`` [m]."""
    return ends[q, 0], ends[q, 1]


@kernel
def last_three(m: np.ndarray, k: int) -> Vector:
    """Return (p, q_e, s) of the products from number ``k`` on."""
    return m[k + 3], m[k + 4], m[k + 5]


def side_by_side(half: tuple[float, float], m: Vector) -> bool:
    """Return whether the nearest points of two segments are not unique: they are parallel, and
    some length of one is beside the other.
    """
    p, _, s = m
    overlap = half[0] + half[1] - abs(p)
    return 1.0 - s * s <= PARALLEL * PARALLEL and overlap > PARALLEL * (half[0] + half[1])


def cross(half: tuple[float, float], m: Vector, dm: Vector) -> bool:
    """Return whether the nearest points of the lines of two segments are on these, and stay there
    as m changes at the rates ``dm``; those of parallel ones are not.
    """
    p, q, s = m
    square = 1.0 - s * s
    if square <= PARALLEL * PARALLEL:
        return False
    u, w = (p - s * q) / square, (s * p - q) / square
    du, dw = feet_change(m, (u, w, False, False), dm)
    return _stays(u, du, half[0]) and _stays(w, dw, half[1])


def _stays(x: float, rate: float, half: float) -> bool:
    """Return whether ``x`` is from -half to half, and is not about to leave at an end."""
    if abs(abs(x) - half) <= PARALLEL * half:
        return x * rate <= 0.0
    return abs(x) < half


@optional(0.0)
def value(ends: np.ndarray, q: int, m: np.ndarray, k: int) -> float:
    """Return the distance of coordinate ``q``, by its products ``m`` from number ``k`` on."""
    square = m[k] ** 2 + m[k + 1] ** 2 + m[k + 2] ** 2
    return math.sqrt(max(0.0, square + below(half_lengths(ends, q), last_three(m, k))))


@optional(0.0)
def kink(ends: np.ndarray, q: int, m: np.ndarray, k: int) -> float:
    """Return the kink of coordinate ``q`` [m]."""
    half, (p, q_e, s) = half_lengths(ends, q), last_three(m, k)
    u, w, u_ends, w_ends = feet(half, (p, q_e, s))
    least = min(abs(half[0] - abs(p + s * w)), abs(half[1] - abs(s * u - q_e)))
    return least if u_ends == w_ends else -least


@kernel
def _add_gauss_point(
    half: tuple[float, float],
    places: tuple[Vector, Vector],
    node: tuple[float, float],
    q: int,
    weights: np.ndarray,
    curves: np.ndarray,
) -> None:
    """Add the share of one point to g, among the weights, and to its derivative by the end of m."""
    (m, dm), (xi, weight) = places, node
    here = (m[0] + xi * dm[0], m[1] + xi * dm[1], m[2] + xi * dm[2])
    at = feet(half, here)
    u, w, c = at[0], at[1], 2.0 * weight * xi
    weights[q, 3] -= 2.0 * weight * u
    weights[q, 4] += 2.0 * weight * w
    weights[q, 5] -= 2.0 * weight * u * w
    for j in range(3):
        along = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        du, dw = feet_change(here, at, along)
        curves[q, 3, 3 + j] -= c * du
        curves[q, 4, 3 + j] += c * dw
        curves[q, 5, 3 + j] -= c * (u * dw + w * du)


@kernel
def _close(
    half: tuple[float, float],
    places: tuple[Vector, Vector],
    q: int,
    weights: np.ndarray,
    curves: np.ndarray,
) -> float:
    """Let g . dm be the change of G, and return it."""
    m, dm = places
    end = (m[0] + dm[0], m[1] + dm[1], m[2] + dm[2])
    before, after, size = below(half, m), below(half, end), half[0] + half[1]
    mean = weights[q, 3] * dm[0] + weights[q, 4] * dm[1] + weights[q, 5] * dm[2]
    left = after - before - mean
    known = size * size + m[0] ** 2 + m[1] ** 2 + end[0] ** 2 + end[1] ** 2
    if abs(left) <= ROUND_OFF * known:
        return mean
    u, w, _, _ = feet(half, end)
    metric = (dm[0], dm[1], size * size * dm[2])
    square = dm[0] * metric[0] + dm[1] * metric[1] + dm[2] * metric[2]
    by_end = (
        -2.0 * u - _by_end(q, 0, dm, weights, curves),
        2.0 * w - _by_end(q, 1, dm, weights, curves),
        -2.0 * u * w - _by_end(q, 2, dm, weights, curves),
    )
    share = left / square
    for i in range(3):
        weights[q, 3 + i] += share * metric[i]
        for j in range(3):
            by = by_end[j] - 2.0 * share * metric[j]
            curves[q, 3 + i, 3 + j] += metric[i] * by / square
        curves[q, 3 + i, 3 + i] += share * (size * size if i == 2 else 1.0)
    return mean + left


@kernel
def _by_end(q: int, j: int, dm: Vector, weights: np.ndarray, curves: np.ndarray) -> float:
    """Return the derivative of g . dm by the end of the product of number ``j`` of m."""
    total: float = weights[q, 3 + j]
    for i in range(3):
        total += curves[q, 3 + i, 3 + j] * dm[i]
    return total


@optional(0.0)
def weigh(
    ends: np.ndarray,
    q: int,
    products: tuple[np.ndarray, np.ndarray],
    k: int,
    before: float,
    out: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> float:
    """Set weights, slopes and curves (``out``) of the distance over a step from where it is
    ``before``, and return its change; ``products`` are values and changes from number ``k`` on.
    """
    (m0, dm0), (weights, slopes, curves) = products, out
    half, m, dm = half_lengths(ends, q), last_three(m0, k), last_three(dm0, k)
    for i in range(6):
        weights[q, i] = 0.0
        for j in range(6):
            curves[q, i, j] = 0.0
    _add_gauss_point(half, (m, dm), (0.5 - AWAY, 5.0 / 18.0), q, weights, curves)
    _add_gauss_point(half, (m, dm), (0.5, 8.0 / 18.0), q, weights, curves)
    _add_gauss_point(half, (m, dm), (0.5 + AWAY, 5.0 / 18.0), q, weights, curves)
    change, square = _close(half, (m, dm), q, weights, curves), 0.0
    for i in range(3):
        weights[q, i] = 2.0 * m0[k + i] + dm0[k + i]
        curves[q, i, i] = 1.0
        change += weights[q, i] * dm0[k + i]
        square += (m0[k + i] + dm0[k + i]) ** 2
    end = (m[0] + dm[0], m[1] + dm[1], m[2] + dm[2])
    last = math.sqrt(square + below(half, end))
    both = before + last
    for i in range(3):
        slopes[q, i] = (m0[k + i] + dm0[k + i]) / last
    u, w, _, _ = feet(half, end)
    slopes[q, 3], slopes[q, 4], slopes[q, 5] = -u / last, w / last, -u * w / last
    for i in range(6):
        weights[q, i] /= both
        for j in range(6):
            curves[q, i, j] = (curves[q, i, j] - weights[q, i] * slopes[q, j]) / both
    return change / both
