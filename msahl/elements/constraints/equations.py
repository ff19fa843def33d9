"""Scalar constraint equations between coordinates, of joints, couplings and prescribed motions.

    c_1 q_1 + c_2 S(q_2) = offset + law(t)      S the identity, or a function the deck gives (a cam)

Each equation has one multiplier lam: its loads along q_1, q_2 are lam c_1 and lam c_2 S' (over a
step the quotient dS/dq_2), so the work of its forces over a step is exactly
lam (change of the law): zero for a joint, the work of the motor for a prescribed motion.

An equation is multiplied by ``scale``, a length for one in radians and 1 for one in metres, so that
equation and unknown, lam dt2/(m scale), are lengths like all others.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws, evaluate, extent
from msahl.elements.constraints.coordinate_jacobians import add_spring, rate_gradient
from msahl.elements.constraints.coordinate_kinds import (
    ROUND_OFF_FACTOR,
    Coordinates,
    CoordinatesWorkspace,
    Derivatives,
)
from msahl.elements.constraints.coordinates import coordinate_acceleration, row_factor
from msahl.elements.constraints.products import PARTS
from msahl.formulations.absolute.frames import Frames, FramesWorkspace, first_multiplier
from msahl.jit.kernel import apart, kernel

SAME = 1e-7
"""Change of a coordinate [m or rad] below which a quotient becomes a derivative."""


class ConstraintEquations(NamedTuple):
    """All equations; -1 stands for no second coordinate, no function, no law."""

    place: (
        np.ndarray
    )  # (r, 2) of multiplier and equation: which of the multipliers' nodes, and its slot
    coordinate: np.ndarray  # (r, 2) the first is never -1
    coefficient: np.ndarray  # (r, 2)
    function: np.ndarray  # (r,) the law S
    law: np.ndarray  # (r,) of time
    offset: np.ndarray  # (r,) constant part of the right-hand side
    holonomic: np.ndarray  # (r,) whether it constrains positions, not rates alone
    mass: np.ndarray  # (r,) [kg]
    scale: np.ndarray  # (r,) [m] or 1
    force_block: np.ndarray  # (r, 2, 4) starts of the blocks of each coordinate's parts by the node
    constraint_block: np.ndarray  # (r, 2, 4) and of the node by the parts


@apart
def coefficients(
    rows: ConstraintEquations, laws: Laws, start: CoordinatesWorkspace, r: int, side: int
) -> tuple[float, float, float, float]:
    """Return of one side: its change, the coefficients of load and slope, the derivative of the
    first of these by the end value.
    """
    q, c = rows.coordinate[r, side], rows.coefficient[r, side]
    change = start.change[q]
    if side == 0 or rows.function[r] < 0:
        return c * change, c, c, 0.0
    q0 = start.value[q]
    if abs(change) < SAME:
        _, slope, curve = evaluate(laws, rows.function[r], q0 + 0.5 * change)
        return c * slope * change, c * slope, c * slope, 0.5 * c * curve
    value0, _, _ = evaluate(laws, rows.function[r], q0)
    value1, slope1, _ = evaluate(laws, rows.function[r], q0 + change)
    mean = (value1 - value0) / change
    return c * (value1 - value0), c * mean, c * slope1, c * (slope1 - mean) / change


@kernel
def law_change(rows: ConstraintEquations, laws: Laws, r: int, t: float, h: float) -> float:
    """Return the change of the right-hand side over the step from ``t``."""
    if rows.law[r] < 0:
        return 0.0
    return evaluate(laws, rows.law[r], t + h)[0] - evaluate(laws, rows.law[r], t)[0]


@kernel
def law_round_off(
    rows: ConstraintEquations, laws: Laws, start: CoordinatesWorkspace, r: int, t: float, h: float
) -> float:
    """Return the size [m] that the round-off of an equation's laws counts as: the equation has
    differences of their values.
    """
    size, q = 0.0, rows.coordinate[r, 1]
    if rows.law[r] >= 0 and h != 0.0:
        size = max(extent(laws, rows.law[r], t), extent(laws, rows.law[r], t + h))
    if rows.function[r] >= 0 and abs(start.change[q]) >= SAME:
        size += abs(rows.coefficient[r, 1]) * extent(laws, rows.function[r], start.value[q])
    return ROUND_OFF_FACTOR * rows.scale[r] * size


@kernel
def multiplier(rows: ConstraintEquations, frames: Frames, Z: np.ndarray, r: int) -> float:
    """Return lam [N, or N m for an equation in radians], where ``Z`` holds multipliers by mass. The
    unknowns of a step are dt2 times these.
    """
    node = first_multiplier(frames) + rows.place[r, 0]
    return Z[node, rows.place[r, 1]] * rows.mass[r] * rows.scale[r]


@kernel
def add_load(
    rows: ConstraintEquations, laws: Laws, start: CoordinatesWorkspace, r: int, lam: float
) -> None:
    """Add the multiplier ``lam`` of equation ``r`` to the loads along its coordinates."""
    for side in range(2):
        q = rows.coordinate[r, side]
        if q >= 0:
            _, c, _, _ = coefficients(rows, laws, start, r, side)
            start.load[q] += lam * c
            start.size[q] += abs(lam * c)


@kernel
def add_loads(
    rows: ConstraintEquations,
    laws: Laws,
    start: CoordinatesWorkspace,
    frames: Frames,
    Z: np.ndarray,
) -> None:
    """Add the multipliers, in ``Z`` by mass, to the coordinates' loads at one configuration."""
    for r in range(rows.function.size):
        add_load(rows, laws, start, r, multiplier(rows, frames, Z, r))


@kernel
def set_violation(
    rows: ConstraintEquations,
    laws: Laws,
    start: CoordinatesWorkspace,
    frames: Frames,
    violation: np.ndarray,
    interval: tuple[float, float],
    F: np.ndarray,
) -> None:
    """Set the equations to the ``violation`` (k, 3) and its change over the ``interval`` (t, h)."""
    t, h = interval
    for r in range(rows.function.size):
        node, slot = rows.place[r, 0], rows.place[r, 1]
        total = -law_change(rows, laws, r, t, h)
        for side in range(2):
            if rows.coordinate[r, side] >= 0:
                change, _, _, _ = coefficients(rows, laws, start, r, side)
                total += change
        node += first_multiplier(frames)
        F[node, slot] = violation[rows.place[r, 0], slot] + rows.scale[r] * total
        start.term_size[node] = max(
            start.term_size[node], law_round_off(rows, laws, start, r, t, h)
        )


@kernel
def residual(
    rows: ConstraintEquations,
    laws: Laws,
    start: CoordinatesWorkspace,
    frames: Frames,
    violation: np.ndarray,
    t: float,
    h: float,
    dt2: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the equations; add the multipliers, in ``Z`` times dt2 by mass, to the loads."""
    for r in range(rows.function.size):
        add_load(rows, laws, start, r, multiplier(rows, frames, Z, r) / dt2)
    set_violation(rows, laws, start, frames, violation, (t, h), F)


@kernel
def jacobian(
    rows: ConstraintEquations,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    dt2: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of ``residual``, after ``coordinates.evaluate`` and ``differentiate``."""
    _add_blocks(rows, laws, coords, start, frames, -dt2, values)
    for r in range(rows.function.size):
        if rows.function[r] >= 0:
            lam = multiplier(rows, frames, Z, r) / dt2
            curve = coefficients(rows, laws, start, r, 1)[3]
            add_spring(coords, start, frames, -dt2, rows.coordinate[r, 1], lam * curve, values)


@kernel
def add_derivatives(
    rows: ConstraintEquations,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives at one configuration: of ``add_loads`` by mass by the places and by the
    multipliers by mass, and of the equations by the places.
    """
    _add_blocks(rows, laws, coords, start, frames, 1.0, values)
    for r in range(rows.function.size):
        if rows.function[r] >= 0:
            lam = multiplier(rows, frames, Z, r)
            # Over a step the coefficient changes by half as much as it does at the end.
            curve = 2.0 * coefficients(rows, laws, start, r, 1)[3]
            add_spring(coords, start, frames, 1.0, rows.coordinate[r, 1], lam * curve, values)


@kernel
def _add_blocks(
    rows: ConstraintEquations,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    factor: float,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the equations by the places, and ``factor`` times those of the
    accelerations by the multipliers' unknowns, which are |factor| times the multipliers by mass.
    """
    for r in range(rows.function.size):
        slot, by_unknown = rows.place[r, 1], rows.mass[r] * rows.scale[r] / abs(factor)
        for side in range(2):
            q = rows.coordinate[r, side]
            if q < 0:
                continue
            _, c, slope, _ = coefficients(rows, laws, start, r, side)
            for part in range(PARTS):
                down, right = rows.force_block[r, side, part], rows.constraint_block[r, side, part]
                if down <= 0:
                    continue
                by_lam = c * by_unknown * row_factor(coords, frames, factor, q, part)
                for i in range(3):
                    values[down + 3 * i + slot] += by_lam * start.force[q, part, i]
                    values[right + 3 * slot + i] += rows.scale[r] * slope * start.slope[q, part, i]


@kernel
def observe(
    rows: ConstraintEquations,
    laws: Laws,
    start: CoordinatesWorkspace,
    rate: np.ndarray,
    t: float,
    violation: np.ndarray,
    violation_rate: np.ndarray,
) -> None:
    """Set ``violation`` [m or rad] and ``violation_rate`` (k, 3), by the equations' places.

    ``rate`` (q,) are the coordinates' rates. An equation between rates has no violation.
    """
    for r in range(rows.function.size):
        total, total_rate = -rows.offset[r], 0.0
        if rows.law[r] >= 0:
            value, slope, _ = evaluate(laws, rows.law[r], t)
            total, total_rate = total - value, -slope
        for side in range(2):
            q = rows.coordinate[r, side]
            if q >= 0:
                value, slope = start.value[q], 1.0
                if side == 1 and rows.function[r] >= 0:
                    value, slope, _ = evaluate(laws, rows.function[r], value)
                total += rows.coefficient[r, side] * value
                total_rate += rows.coefficient[r, side] * slope * rate[q]
        node, slot = rows.place[r, 0], rows.place[r, 1]
        violation[node, slot] = total if rows.holonomic[r] else 0.0
        violation_rate[node, slot] = total_rate


def left_side(rows: ConstraintEquations, laws: Laws, start: CoordinatesWorkspace, r: int) -> float:
    """Return the left-hand side at t = 0 less the law there: the offset without violation."""
    total = 0.0
    for side, q in enumerate(rows.coordinate[r]):
        if q >= 0:
            value = start.value[q]
            if side == 1 and rows.function[r] >= 0:
                value = evaluate(laws, rows.function[r], value)[0]
            total += rows.coefficient[r, side] * value
    return float(total - (evaluate(laws, rows.law[r], 0.0)[0] if rows.law[r] >= 0 else 0.0))


@kernel
def law_rate(rows: ConstraintEquations, laws: Laws, r: int, t: float) -> float:
    """Return the rate of the law of time of an equation."""
    return evaluate(laws, rows.law[r], t)[1]


@kernel
def free_acceleration(
    rows: ConstraintEquations,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    rate: np.ndarray,
    v: np.ndarray,
    W: np.ndarray,
    t: float,
    F: np.ndarray,
) -> None:
    """Set the equations to minus their second derivative at zero accelerations; ``rate`` (q,).

    ``coordinates.evaluate`` comes first, with unknowns 0: ``curves`` are then half of the second
    derivatives.
    """
    first = first_multiplier(frames)
    for r in range(rows.function.size):
        total = 0.0
        if rows.law[r] >= 0:
            total = -evaluate(laws, rows.law[r], t)[2]
        for side in range(2):
            q = rows.coordinate[r, side]
            if q < 0:
                continue
            second = coordinate_acceleration(coords, start, v, W, q)
            if side == 1 and rows.function[r] >= 0:
                _, slope, curve = evaluate(laws, rows.function[r], start.value[q])
                second = slope * second + curve * rate[q] ** 2
            total += rows.coefficient[r, side] * second
        F[first + rows.place[r, 0], rows.place[r, 1]] = -rows.scale[r] * total


@kernel
def work(
    rows: ConstraintEquations,
    laws: Laws,
    frames: Frames,
    t: float,
    h: float,
    dt2: float,
    Z: np.ndarray,
    column: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work of prescribed motions [J] over the step to their ``column`` of ``total``."""
    for r in range(rows.function.size):
        if rows.law[r] >= 0:
            lam = multiplier(rows, frames, Z, r) / dt2
            total[column[r]] += lam * law_change(rows, laws, r, t, h)


@kernel
def motion_work(
    rows: ConstraintEquations,
    laws: Laws,
    frames: Frames,
    t: float,
    dt: float,
    Z: np.ndarray,
    column: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work of prescribed motions [J] over a time ``dt`` at their rates at ``t``; the
    unknowns ``Z`` are the multipliers over their mass and scale.
    """
    for r in range(rows.function.size):
        if rows.law[r] >= 0:
            lam = multiplier(rows, frames, Z, r)
            total[column[r]] += lam * law_rate(rows, laws, r, t) * dt


@kernel
def set_rate_equations(
    rows: ConstraintEquations, rate: np.ndarray, first: int, h: float, F: np.ndarray
) -> None:
    """Set the equations between rates to ``h`` times their values, with ``rate`` (q,)."""
    for r in range(rows.function.size):
        if not rows.holonomic[r]:
            c = h * rows.scale[r] * rows.coefficient[r, 0]
            F[first + rows.place[r, 0], rows.place[r, 1]] = c * rate[rows.coordinate[r, 0]]


@kernel
def add_rate_derivatives(
    rows: ConstraintEquations,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Add the derivatives of ``set_rate_equations`` over h by the places and by the rates."""
    for r in range(rows.function.size):
        if not rows.holonomic[r]:
            c, q, slot = (
                rows.scale[r] * rows.coefficient[r, 0],
                rows.coordinate[r, 0],
                rows.place[r, 1],
            )
            half = rate_gradient(coords, start, frames, motion, q, out)
            for part in range(PARTS):
                right = rows.constraint_block[r, 0, part]
                if right > 0:
                    for i in range(3):
                        out.by_rate[right + 3 * slot + i] += c * start.slope[q, part, i]
                        out.by_place[right + 3 * slot + i] += 2.0 * c * half[part][i]
