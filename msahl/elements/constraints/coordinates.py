"""Quantities: one number between two bodies, made of a few measures (see ``joints.measure``).

    PLAIN   q = m_1
    RADIUS  q = sqrt(m_1^2 + m_2^2 (+ m_3^2))       a distance, across an axis or in space [m]
    ANGLE   q = atan2(m_1, m_2)                      counted over all its turns [rad]
    ROUND   q = m_1 - r sqrt(1 - m_2^2)              height of a disk's rim above a plane [m]
    SKEW    q = ((D.D - L^2) (1 - s^2) - a^2 - b^2 + 2 s a b) / (2 L)
            gap of two crossed cylinders, times the square of the sine between them: D = m_1..m_3,
            a = m_4 and b = m_5 along the axes, s = m_6 their cosine [m]

Each kind gives weights w with  dq = sum w_i dm_i  over the step, exactly, the derivative of q by
the end values, and the derivative of w by them; everything else follows by the chain rule. With the
unit force of the measures, sum w_i (f, t)_i is the force that a multiplier of q exerts: a discrete
gradient (Gonzalez, Time integration and discrete Hamiltonian systems, J. Nonlinear Sci. 6 (1996)).
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import ZERO, Vector, add, at, axpy, scale, sub
from msahl.elements.constraints import products
from msahl.elements.constraints.products import (
    PARTS,
    Q_A,
    Q_B,
    U_A,
    U_B,
    Products,
    ProductsWorkspace,
)
from msahl.elements.frames import Frames, displacement_node, rotation_node
from msahl.jit.kernel import kernel

PLAIN, RADIUS, ANGLE, ROUND, SKEW = range(5)
MOST = 6
"""Most measures of one quantity."""
BLUR = 2e-3
"""Part of a size that stands for its round-off among the sizes that a residual is judged by: 1e-12
of them counts as solved (``solve.outcome``), which is 2e-15 of the size, about eight round-offs."""
SMALL_TURN = 1e-4
"""tan of the angle below which series replace quotients; their error is its fourth power."""


class Coordinates(NamedTuple):
    """All quantities, one row each, and their measures."""

    products: Products
    kind: np.ndarray  # (q,)
    first: np.ndarray  # (q + 1,) first measure of each
    radius: np.ndarray  # (q,) r of a ROUND, L of a SKEW [m]
    block: np.ndarray  # (q, 16) starts of the blocks of its bodies' four parts by four parts


class CoordinatesWorkspace(NamedTuple):
    """Values at the start of the step, and what the equations at some Z have computed."""

    products: ProductsWorkspace
    value: np.ndarray  # (q,) an angle's is counted on by the state
    change: np.ndarray  # (q,)
    weights: np.ndarray  # (q, MOST) w
    slopes: np.ndarray  # (q, MOST) derivative of q by the measures' end values
    curves: np.ndarray  # (q, MOST, MOST) derivative of w by the measures' end values
    force: np.ndarray  # (q, 4, 3) unit force on the four parts: -f, t_A, f, t_B
    slope: np.ndarray  # (q, 4, 3) derivative of the change by the four parts' unknowns
    load: np.ndarray  # (q,) force or moment along q, gathered from all that act on it
    size: np.ndarray  # (q,) of the loads' largest terms, which may cancel
    term_size: np.ndarray  # (nodes,) largest such term, or round-off of a law, in a node's rows [m]


@kernel
def prepare(
    group: Coordinates, x: np.ndarray, R: np.ndarray, angle: np.ndarray, start: CoordinatesWorkspace
) -> None:
    """Evaluate measures and quantities at the start; ``angle`` (q,) as counted so far."""
    products.prepare(group.products, x, R, start.products)
    for q in range(group.kind.size):
        start.value[q] = value(group, start, angle[q], q)


@kernel
def value(group: Coordinates, start: CoordinatesWorkspace, angle: float, q: int) -> float:
    """The quantity from its measures' values at the start; an angle is the one counted."""
    m, k = start.products.value, group.first[q]
    if group.kind[q] == ANGLE:
        return angle
    if group.kind[q] == RADIUS:
        square = 0.0
        for i in range(k, group.first[q + 1]):
            square += m[i] ** 2
        return math.sqrt(square)
    if group.kind[q] == ROUND:
        return m[k] - group.radius[q] * math.sqrt(max(0.0, 1.0 - m[k + 1] ** 2))
    if group.kind[q] == SKEW:
        return skew_gap(m, k, group.radius[q])
    return m[k]


@kernel
def skew_gap(m: np.ndarray, k: int, L: float) -> float:
    """The SKEW quantity of the measures ``m`` from number ``k`` on."""
    square = m[k] ** 2 + m[k + 1] ** 2 + m[k + 2] ** 2 - L * L
    a, b, s = m[k + 3], m[k + 4], m[k + 5]
    return (square * (1.0 - s * s) - a * a - b * b + 2.0 * s * a * b) / (2.0 * L)


@kernel
def evaluate(
    group: Coordinates, start: CoordinatesWorkspace, frames: Frames, Z: np.ndarray
) -> None:
    """Fill changes, weights and unit forces at ``Z``, and clear the loads and their sizes."""
    for node in range(start.term_size.size):
        start.term_size[node] = 0.0
    m = start.products
    products.evaluate(group.products, m, frames, Z)
    for q in range(group.kind.size):
        start.load[q] = start.size[q] = 0.0
        _weigh(group, start, q)
        first = group.first[q]
        for i in range(3):
            f, t_a, t_b = 0.0, 0.0, 0.0
            for k in range(first, group.first[q + 1]):
                w = start.weights[q, k - first]
                f += w * m.f[k, i]
                t_a += w * m.t_a[k, i]
                t_b += w * m.t_b[k, i]
            start.force[q, U_A, i] = -f
            start.force[q, Q_A, i] = t_a
            start.force[q, U_B, i] = f
            start.force[q, Q_B, i] = t_b


@kernel
def differentiate(
    group: Coordinates, start: CoordinatesWorkspace, frames: Frames, Z: np.ndarray
) -> None:
    """Fill the derivatives of the changes by the unknowns at ``Z``, after ``evaluate``."""
    for q in range(group.kind.size):
        first = group.first[q]
        for part in range(PARTS):
            for i in range(3):
                start.slope[q, part, i] = 0.0
        for k in range(first, group.first[q + 1]):
            j_u, j_a, j_b = products.end_gradient(group.products, start.products, frames, Z, k)
            c = start.slopes[q, k - first]
            for i in range(3):
                start.slope[q, U_A, i] -= c * j_u[i]
                start.slope[q, Q_A, i] += c * j_a[i]
                start.slope[q, U_B, i] += c * j_u[i]
                start.slope[q, Q_B, i] += c * j_b[i]


@kernel
def push(
    group: Coordinates, start: CoordinatesWorkspace, frames: Frames, factor: float, F: np.ndarray
) -> None:
    """Add ``factor`` times the gathered loads by mass to the rows of the bodies."""
    for q in range(group.kind.size):
        for part in range(PARTS):
            c = row_factor(group, frames, factor, q, part)
            node = part_node(group, frames, q, part)
            for i in range(3):
                arm = c * start.force[q, part, i]
                F[node, i] += arm * start.load[q]
                start.term_size[node] = max(start.term_size[node], abs(arm) * start.size[q])


@kernel
def extent(group: Coordinates, start: CoordinatesWorkspace, q: int) -> float:
    """Size [m, or 1 for an angle] of what the quantity is computed from at the start: it is known
    no better than the last digit of that.
    """
    if group.kind[q] == ANGLE:
        return max(1.0, abs(start.value[q]))
    m, largest = start.products, 0.0
    for k in range(group.first[q], group.first[q + 1]):
        for i in range(3):
            largest = max(largest, abs(m.D[k, i]), abs(m.r_a[k, i]), abs(m.r_b[k, i]))
    return largest


@kernel
def row_factor(group: Coordinates, frames: Frames, factor: float, q: int, part: int) -> float:
    """Return what a unit force on a ``part`` adds to its rows: ``factor`` by mass, where ``factor``
    is 1 at one configuration and -dt2 over a step of the midpoint element.
    """
    first = group.first[q]
    body = group.products.a[first] if part < U_B else group.products.b[first]
    c = factor * frames.inverse_mass[body]
    return c if part % 2 == U_A else c / frames.length[body]


@kernel
def part_node(group: Coordinates, frames: Frames, q: int, part: int) -> int:
    """Node of a ``part``'s unknowns and rows."""
    first = group.first[q]
    body = group.products.a[first] if part < U_B else group.products.b[first]
    is_displacement = part % 2 == U_A
    return displacement_node(frames, body) if is_displacement else rotation_node(frames, body)


@kernel
def stiffness(
    group: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    factor: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add ``factor`` times the derivative of the unit forces by mass, times the gathered loads,
    after ``evaluate``.
    """
    for q in range(group.kind.size):
        load = start.load[q]
        if load == 0.0:
            continue
        c = (
            load * row_factor(group, frames, factor, q, U_A),
            load * row_factor(group, frames, factor, q, Q_A),
            load * row_factor(group, frames, factor, q, U_B),
            load * row_factor(group, frames, factor, q, Q_B),
        )
        _stiffen(group, start, frames, Z, q, c, values)


@kernel
def _stiffen(
    group: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    Z: np.ndarray,
    q: int,
    c: tuple[float, float, float, float],
    values: np.ndarray,
) -> None:
    """Add the derivative of a quantity's unit force, each part times its ``c``."""
    first = group.first[q]
    for k in range(first, group.first[q + 1]):
        w = start.weights[q, k - first]
        if w != 0.0:
            c_w = (w * c[0], w * c[1], w * c[2], w * c[3])
            products.stiffness(
                group.products, start.products, frames, Z, k, group.block, q, c_w, values
            )
    if group.kind[q] != PLAIN:
        _curve(group, start, frames, Z, q, c, values)


@kernel
def rate_gradient(
    group: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    v: np.ndarray,
    W: np.ndarray,
    Z: np.ndarray,
    q: int,
    room: np.ndarray,
) -> tuple[Vector, Vector, Vector, Vector]:
    """Half the derivative of a quantity's rate by the places of the four parts at given velocities.

    A rate is the unit force times the velocities, so it is the stiffness times them. Wants
    ``evaluate`` at rest; ``room`` holds block values.
    """
    for block in group.block[q]:
        if block > 0:
            for e in range(block, block + 9):
                room[e] = 0.0
    _stiffen(group, start, frames, Z, q, (1.0, 1.0, 1.0, 1.0), room)
    k = group.first[q]
    a, b = group.products.a[k], group.products.b[k]
    speed = (at(v, a), at(W, a), at(v, b), at(W, b))
    return (
        _contract(group, q, U_A, speed, room),
        _contract(group, q, Q_A, speed, room),
        _contract(group, q, U_B, speed, room),
        _contract(group, q, Q_B, speed, room),
    )


@kernel
def _contract(
    group: Coordinates,
    q: int,
    column: int,
    speed: tuple[Vector, Vector, Vector, Vector],
    room: np.ndarray,
) -> Vector:
    """The velocities times the blocks of one column."""
    total = ZERO
    for row in range(PARTS):
        e = group.block[q, PARTS * row + column]
        if e > 0:
            for j in range(3):
                line = (room[e + 3 * j], room[e + 3 * j + 1], room[e + 3 * j + 2])
                total = axpy(speed[row][j], line, total)
    return total


@kernel
def _curve(
    group: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    Z: np.ndarray,
    q: int,
    c: tuple[float, float, float, float],
    values: np.ndarray,
) -> None:
    """Add the part of the stiffness that comes from the weights: force_i (dw_i/dm_j) slope_j."""
    first, last = group.first[q], group.first[q + 1]
    m = start.products
    for other in range(first, last):
        j_u, j_a, j_b = products.end_gradient(group.products, m, frames, Z, other)
        row = (scale(-1.0, j_u), j_a, j_u, j_b)
        force = (ZERO, ZERO, ZERO, ZERO)
        for k in range(first, last):
            d = start.curves[q, k - first, other - first]
            f = scale(d, at(m.f, k))
            force = (
                sub(force[0], f),
                axpy(d, at(m.t_a, k), force[1]),
                add(force[2], f),
                axpy(d, at(m.t_b, k), force[3]),
            )
        add_outer(values, group.block, q, c, force, row)


@kernel
def add_outer(
    values: np.ndarray,
    block: np.ndarray,
    q: int,
    c: tuple[float, float, float, float],
    force: tuple[Vector, Vector, Vector, Vector],
    row: tuple[Vector, Vector, Vector, Vector],
) -> None:
    """Add c_p force_p (x) row_r to the block of every pair of parts p, r."""
    for p in range(PARTS):
        for r in range(PARTS):
            start = block[q, 4 * p + r]
            if start > 0:
                for i in range(3):
                    for j in range(3):
                        values[start + 3 * i + j] += c[p] * force[p][i] * row[r][j]


@kernel
def add_spring(
    group: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    factor: float,
    q: int,
    slope: float,
    values: np.ndarray,
) -> None:
    """Add ``factor`` times the derivative of a load by mass whose derivative by q's end value is
    ``slope``.
    """
    force, row = start.force, start.slope
    for p in range(PARTS):
        c = slope * row_factor(group, frames, factor, q, p)
        for r in range(PARTS):
            at_block = group.block[q, 4 * p + r]
            if at_block > 0:
                for i in range(3):
                    for j in range(3):
                        values[at_block + 3 * i + j] += c * force[q, p, i] * row[q, r, j]


@kernel
def add_damper(
    group: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    v: np.ndarray,
    W: np.ndarray,
    Z: np.ndarray,
    q: int,
    slope: float,
    room: np.ndarray,
    by_place: np.ndarray,
    by_rate: np.ndarray,
) -> None:
    """Add the derivatives, by the places and by the rates, of a load by mass whose derivative by
    the rate of q is ``slope``; ``room`` holds block values.
    """
    if slope == 0.0:
        return
    add_spring(group, start, frames, 1.0, q, slope, by_rate)
    # rate_gradient gives half of the derivative.
    c = (
        slope * row_factor(group, frames, 2.0, q, U_A),
        slope * row_factor(group, frames, 2.0, q, Q_A),
        slope * row_factor(group, frames, 2.0, q, U_B),
        slope * row_factor(group, frames, 2.0, q, Q_B),
    )
    f = start.force[q]
    force = (at(f, U_A), at(f, Q_A), at(f, U_B), at(f, Q_B))
    row = rate_gradient(group, start, frames, v, W, Z, q, room)
    add_outer(by_place, group.block, q, c, force, row)


@kernel
def _weigh(group: Coordinates, start: CoordinatesWorkspace, q: int) -> None:
    """Set change, weights and their derivatives from the measures."""
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
    else:
        _weigh_skew(group, start, q)


@kernel
def _weigh_radius(group: Coordinates, start: CoordinatesWorkspace, q: int) -> None:
    """d sqrt(s) = ds / (sqrt(s0) + sqrt(s1)),  ds = sum (m0 + m1) dm."""
    first, n = group.first[q], group.first[q + 1] - group.first[q]
    m0, dm = start.products.value, start.products.change
    square0, square1, change = 0.0, 0.0, 0.0
    for i in range(n):
        end = m0[first + i] + dm[first + i]
        square0 += m0[first + i] ** 2
        square1 += end**2
        change += (m0[first + i] + end) * dm[first + i]
    end_radius = math.sqrt(square1)
    both = math.sqrt(square0) + end_radius
    start.change[q] = change / both
    for i in range(n):
        end = m0[first + i] + dm[first + i]
        start.weights[q, i] = (m0[first + i] + end) / both
        start.slopes[q, i] = end / end_radius
    for i in range(n):
        for j in range(n):
            start.curves[q, i, j] = -start.weights[q, i] * start.slopes[q, j] / both
        start.curves[q, i, i] += 1.0 / both


@kernel
def _weigh_angle(group: Coordinates, start: CoordinatesWorkspace, q: int) -> None:
    """With X = c0 s1 - s0 c1 and Y = c0 c1 + s0 s1: dq = atan2(X, Y), X = mean(c) ds - mean(s) dc.

    So the weights are k mean(c) and -k mean(s) with k = dq / X. X is computed from the changes: as
    a difference of products it would have the round-off of a whole radian.
    """
    first = group.first[q]
    s0, c0 = start.products.value[first], start.products.value[first + 1]
    ds, dc = start.products.change[first], start.products.change[first + 1]
    s1, c1 = s0 + ds, c0 + dc
    X, Y = c0 * ds - s0 * dc, c0 * c1 + s0 * s1
    turn = math.atan2(X, Y)
    square = s1 * s1 + c1 * c1
    slope_s, slope_c = c1 / square, -s1 / square
    t = X / Y if Y != 0.0 else math.inf
    if Y > 0.0 and abs(t) < SMALL_TURN:
        g, g_t = 1.0 - t * t / 3.0, -2.0 * t / 3.0
        k = g / Y
        k_s = (g_t * (c0 - t * s0) / Y - g * s0 / Y) / Y
        k_c = (g_t * (-s0 - t * c0) / Y - g * c0 / Y) / Y
    else:
        k = turn / X
        k_s, k_c = (slope_s - k * c0) / X, (slope_c + k * s0) / X
    c, s = 0.5 * (c0 + c1), 0.5 * (s0 + s1)
    start.change[q] = turn
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


@kernel
def slopes(group: Coordinates, start: CoordinatesWorkspace) -> None:
    """Set slopes and curves to those of the start itself, as for a step without motion."""
    for k in range(group.products.kind.size):
        start.products.change[k] = 0.0
    for q in range(group.kind.size):
        _weigh(group, start, q)


@kernel
def count_rotations(group: Coordinates, start: CoordinatesWorkspace, angle: np.ndarray) -> None:
    """Bring the counted angles (q,) to the start's, less than half a turn away."""
    for q in range(group.kind.size):
        if group.kind[q] == ANGLE:
            first = group.first[q]
            m = start.products.value
            change = math.atan2(m[first], m[first + 1]) - angle[q]
            angle[q] += change - 2.0 * math.pi * round(change / (2.0 * math.pi))
            start.value[q] = angle[q]


@kernel
def rates(
    group: Coordinates, start: CoordinatesWorkspace, v: np.ndarray, W: np.ndarray, rate: np.ndarray
) -> None:
    """Set ``rate`` (q,) to the quantities' rates at the start; wants its ``slopes``."""
    for q in range(group.kind.size):
        first = group.first[q]
        rate[q] = 0.0
        for k in range(first, group.first[q + 1]):
            m_rate, _ = products.free_acceleration(group.products, start.products, v, W, k)
            rate[q] += start.slopes[q, k - first] * m_rate


@kernel
def coordinate_acceleration(
    group: Coordinates, start: CoordinatesWorkspace, v: np.ndarray, W: np.ndarray, q: int
) -> float:
    """Second derivative of a quantity at zero accelerations; wants ``evaluate`` at rest."""
    first, last = group.first[q], group.first[q + 1]
    total = 0.0
    for k in range(first, last):
        rate, second = products.free_acceleration(group.products, start.products, v, W, k)
        total += start.slopes[q, k - first] * second
        if group.kind[q] == PLAIN:
            continue
        for i in range(first, last):
            other, _ = products.free_acceleration(group.products, start.products, v, W, i)
            total += 2.0 * start.curves[q, k - first, i - first] * rate * other
    return total
