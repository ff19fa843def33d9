"""Derivatives of the forces along coordinates by the places and by the rates of the frames.

The force of a load along a coordinate is load * unit force. Its derivative has up to three parts:
that of the load by the coordinate (``add_spring``), that of the load by its rate (``add_damper``),
and that of the unit force itself (``stiffness``), which the chain rule gives from the scalar
products and from the weights of the kind.
"""

import numpy as np

from msahl.algebra.vector import ZERO, Vector, add, at, axpy, scale, sub
from msahl.elements.constraints import products, surfaces
from msahl.elements.constraints.coordinate_kinds import (
    PLAIN,
    Coordinates,
    CoordinatesWorkspace,
    Derivatives,
)
from msahl.elements.constraints.coordinates import row_factor
from msahl.elements.constraints.products import PARTS, Q_A, Q_B, SURFACE, U_A, U_B
from msahl.formulations.absolute.frames import Frames, FramesWorkspace
from msahl.jit.kernel import apart, kernel


@apart
def stiffness(
    group: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    factor: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add ``factor`` times the derivative of the unit forces by mass, times the gathered loads,
    after ``evaluate`` and ``differentiate`` at the same ``Z``.
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
        _add_unit_force_derivatives(group, start, frames, Z, q, c, values)


@apart
def _add_unit_force_derivatives(
    group: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    Z: np.ndarray,
    q: int,
    c: tuple[float, float, float, float],
    values: np.ndarray,
) -> None:
    """Add the derivative of a coordinate's unit force, each part times its ``c``."""
    first = group.first[q]
    for k in range(first, group.first[q + 1]):
        w = start.weights[q, k - first]
        if w != 0.0:
            c_w = (w * c[0], w * c[1], w * c[2], w * c[3])
            _add_product(group, start, frames, Z, (q, k), c_w, values)
    if group.kind[q] != PLAIN:
        _add_weight_derivatives(group, start, q, c, values)


@kernel
def _add_product(
    group: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    Z: np.ndarray,
    numbers: tuple[int, int],
    c: tuple[float, float, float, float],
    values: np.ndarray,
) -> None:
    """Add the derivative of a product's unit force, each part times its ``c``; ``numbers`` are
    those of the coordinate and the product.
    """
    own, m, (q, k) = group.products, start.products, numbers
    if own.kind[k] == SURFACE:
        surfaces.stiffness(own.surfaces, own, m, frames, Z, k, group.block[q], c, values)
    else:
        products.stiffness(own, m, frames, Z, k, group.block, q, c, values)


@apart
def rate_gradient(
    group: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    q: int,
    out: Derivatives,
) -> tuple[Vector, Vector, Vector, Vector]:
    """Return half the derivative of a coordinate's rate by the places of its four parts.

    A rate is the unit force times the velocities, so it is the stiffness times them. Call it after
    ``evaluate`` and ``differentiate`` at rest.
    """
    scratch, v, W = out.scratch, motion.v, motion.W
    for block in group.block[q]:
        if block > 0:
            for e in range(block, block + 9):
                scratch[e] = 0.0
    _add_unit_force_derivatives(group, start, frames, out.still, q, (1.0, 1.0, 1.0, 1.0), scratch)
    k = group.first[q]
    a, b = group.products.a[k], group.products.b[k]
    speed = (at(v, a), at(W, a), at(v, b), at(W, b))
    return (
        _times_velocities(group, q, U_A, speed, scratch),
        _times_velocities(group, q, Q_A, speed, scratch),
        _times_velocities(group, q, U_B, speed, scratch),
        _times_velocities(group, q, Q_B, speed, scratch),
    )


@kernel
def _times_velocities(
    group: Coordinates,
    q: int,
    column: int,
    speed: tuple[Vector, Vector, Vector, Vector],
    scratch: np.ndarray,
) -> Vector:
    """Return the velocities times the blocks of one column."""
    total = ZERO
    for row in range(PARTS):
        e = group.block[q, PARTS * row + column]
        if e > 0:
            for j in range(3):
                line = (scratch[e + 3 * j], scratch[e + 3 * j + 1], scratch[e + 3 * j + 2])
                total = axpy(speed[row][j], line, total)
    return total


@kernel
def _add_weight_derivatives(
    group: Coordinates,
    start: CoordinatesWorkspace,
    q: int,
    c: tuple[float, float, float, float],
    values: np.ndarray,
) -> None:
    """Add the derivative that comes from the weights: force_i (dw_i/dm_j) slope_j."""
    first, last = group.first[q], group.first[q + 1]
    m = start.products
    for other in range(first, last):
        j_u = at(m.j_u, other)
        row = (scale(-1.0, j_u), at(m.j_a, other), j_u, at(m.j_b, other))
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


@apart
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


@apart
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
    motion: FramesWorkspace,
    q: int,
    slope: float,
    out: Derivatives,
) -> None:
    """Add the derivatives, by the places and by the rates, of a load by mass whose derivative by
    the rate of q is ``slope``.
    """
    if slope == 0.0:
        return
    add_spring(group, start, frames, 1.0, q, slope, out.by_rate)
    # rate_gradient gives half of the derivative.
    c = (
        slope * row_factor(group, frames, 2.0, q, U_A),
        slope * row_factor(group, frames, 2.0, q, Q_A),
        slope * row_factor(group, frames, 2.0, q, U_B),
        slope * row_factor(group, frames, 2.0, q, Q_B),
    )
    f = start.force[q]
    force = (at(f, U_A), at(f, Q_A), at(f, U_B), at(f, Q_B))
    row = rate_gradient(group, start, frames, motion, q, out)
    add_outer(out.by_place, group.block, q, c, force, row)
