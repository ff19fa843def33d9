"""Scalar constraint equations between coordinates, of joints, couplings and prescribed motions.

    c_1 q_1 + c_2 S(q_2) = offset + law(t)      S the identity, or a function the deck gives (a cam)

Each equation has one multiplier lam: its loads along q_1, q_2 are lam c_1 and lam c_2 S' (over a
step the quotient dS/dq_2), so the work of its forces over a step is exactly
lam (change of the law): zero for a joint, the work of the motor for a prescribed motion.

Here is one equation; ``scalar`` goes through all of them. How equation and multiplier are scaled is
in ``formulations.absolute.multipliers``.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws, evaluate, extent
from msahl.elements.constraints.coordinate_kinds import ROUND_OFF_FACTOR, CoordinatesWorkspace
from msahl.jit.kernel import apart, kernel

SAME = 1e-7
"""Change of a coordinate [m or rad] below which a quotient becomes a derivative."""


class ConstraintEquations(NamedTuple):
    """All equations; -1 stands for no second coordinate, no function, no law."""

    place: np.ndarray  # (r, 2) of multiplier and equation: the multipliers' node, and its slot
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


def is_active(rows: ConstraintEquations) -> np.ndarray:
    """(r,) which equations constrain anything: those of open contacts have coefficients 0, and are
    satisfied by any motion.
    """
    active: np.ndarray = rows.coefficient[:, 0] != 0.0
    return active


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
