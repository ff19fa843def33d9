"""Spring-damper along a quantity: a length, an angle, a slide.

    load  = -T,   T = preload + k (q - q_free)  or a table T(q),   plus  c dq/dt
    over a step:  -(V(q1) - V(q0)) / (q1 - q0) - c (q1 - q0)/h ,   dV/dq = T

The quotient gives the bodies exactly what the elastic energy loses; the damper takes c (dq/h)^2 h.
A decaying scheme adds  chi/2 k (dq - s),  s the smoothed change of q, to T, as it does to the
bodies' velocities (``bodies.rigid``); k of a table is its steepest rise.
The load acts through the quantity's own unit force, so a two-point spring pulls along its line, a
torsional one turns about its axis.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws, evaluate, mean
from msahl.elements.constraints.coordinates import (
    BLUR,
    Quantities,
    QuantityStart,
    add_damper,
    add_spring,
    extent,
)
from msahl.elements.constraints.equations import SAME
from msahl.elements.frames import Frames
from msahl.jit.kernel import kernel


class Springs(NamedTuple):
    """All spring-dampers; units are those of the quantity: N, m or N m, rad."""

    quantity: np.ndarray  # (s,)
    stiffness: np.ndarray  # (s,) k
    damping: np.ndarray  # (s,) c
    origin: np.ndarray  # (s,) from where q counts: 0, or its value at t = 0
    free: np.ndarray  # (s,) q_free, where the tension is the preload
    preload: np.ndarray  # (s,)
    table: np.ndarray  # (s,) law T(q) in place of preload and k, or -1
    decay: np.ndarray  # (s,) chi/2 k


@kernel
def potential_change(springs: Springs, laws: Laws, s: int, q0: float, q1: float) -> float:
    """V(q1) - V(q0) [J], for q counted from the origin."""
    if springs.table[s] >= 0:
        return mean(laws, springs.table[s], q0, q1 - q0) * (q1 - q0)
    stretch = 0.5 * (q0 + q1) - springs.free[s]
    return (springs.preload[s] + springs.stiffness[s] * stretch) * (q1 - q0)


@kernel
def potential(springs: Springs, laws: Laws, s: int, q: float) -> float:
    """Elastic energy [J], zero at q_free."""
    return potential_change(springs, laws, s, springs.free[s], q)


@kernel
def tension(springs: Springs, laws: Laws, s: int, q0: float, dq: float) -> tuple[float, float]:
    """Elastic T over a change from q0 by ``dq``, and its derivative by the end."""
    if springs.table[s] < 0:
        k = springs.stiffness[s]
        return springs.preload[s] + k * (q0 + 0.5 * dq - springs.free[s]), 0.5 * k
    value = mean(laws, springs.table[s], q0, dq)
    end, slope, _ = evaluate(laws, springs.table[s], q0 + dq)
    return value, 0.5 * slope if abs(dq) < SAME else (end - value) / dq


@kernel
def residual(
    springs: Springs,
    laws: Laws,
    quantities: Quantities,
    start: QuantityStart,
    stretch: np.ndarray,
    h: float,
) -> None:
    """Add the springs to the loads of their quantities; ``stretch`` (s,) is s of each."""
    for s in range(springs.quantity.size):
        q = springs.quantity[s]
        dq = start.change[q]
        T, slope = tension(springs, laws, s, start.value[q] - springs.origin[s], dq)
        lag = springs.damping[s] * dq / h + springs.decay[s] * (dq - stretch[s])
        start.load[q] -= T + lag
        # A tension that vanishes in the mean is large at both ends, and a stiff spring's is known
        # no better than its length.
        unsure = BLUR * abs(slope) * extent(quantities, start, q)
        start.size[q] += abs(T) + abs(slope * dq) + abs(lag) + unsure


@kernel
def jacobian(
    springs: Springs,
    laws: Laws,
    quantities: Quantities,
    start: QuantityStart,
    frames: Frames,
    h: float,
    dt2: float,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the loads."""
    for s in range(springs.quantity.size):
        q = springs.quantity[s]
        q0 = start.value[q] - springs.origin[s]
        _, slope = tension(springs, laws, s, q0, start.change[q])
        slope = -slope - springs.damping[s] / h - springs.decay[s]
        add_spring(quantities, start, frames, dt2, q, slope, values)


@kernel
def free_load(
    springs: Springs,
    laws: Laws,
    quantities: Quantities,
    start: QuantityStart,
    rate: np.ndarray,
) -> None:
    """Add the springs at the start, with the quantities' rates there, to the loads."""
    for s in range(springs.quantity.size):
        q = springs.quantity[s]
        T, half = tension(springs, laws, s, start.value[q] - springs.origin[s], 0.0)
        start.load[q] -= T + springs.damping[s] * rate[q]
        unsure = BLUR * abs(half) * extent(quantities, start, q)
        start.size[q] += abs(T) + abs(springs.damping[s] * rate[q]) + unsure


@kernel
def free_jacobian(
    springs: Springs,
    laws: Laws,
    quantities: Quantities,
    start: QuantityStart,
    frames: Frames,
    v: np.ndarray,
    W: np.ndarray,
    Z: np.ndarray,
    room: np.ndarray,
    by_place: np.ndarray,
    by_rate: np.ndarray,
) -> None:
    """Add half the derivative of ``free_load`` by the places, and all of it by the rates."""
    for s in range(springs.quantity.size):
        q = springs.quantity[s]
        _, half = tension(springs, laws, s, start.value[q] - springs.origin[s], 0.0)
        add_spring(quantities, start, frames, -1.0, q, -half, by_place)
        slope = -springs.damping[s]
        add_damper(quantities, start, frames, v, W, Z, q, slope, room, by_place, by_rate)


@kernel
def free_work(
    springs: Springs, rate: np.ndarray, dt: float, column: np.ndarray, total: np.ndarray
) -> None:
    """Add the dampers' work [J] at these rates over a time ``dt`` to their ``column``."""
    for s in range(springs.quantity.size):
        total[column[s]] -= springs.damping[s] * rate[springs.quantity[s]] ** 2 * dt


@kernel
def work(
    springs: Springs, start: QuantityStart, h: float, column: np.ndarray, total: np.ndarray
) -> None:
    """Add the dampers' work [J] over the step to their ``column`` of ``total``."""
    for s in range(springs.quantity.size):
        dq = start.change[springs.quantity[s]]
        total[column[s]] -= springs.damping[s] * dq * dq / h


@kernel
def smooth(springs: Springs, start: QuantityStart, pole: float, stretch: np.ndarray) -> float:
    """Take the changes of the springs' quantities into the smoothed ones; the energy lost [J]."""
    loss = 0.0
    for s in range(springs.quantity.size):
        dq = start.change[springs.quantity[s]]
        loss += springs.decay[s] * (dq - stretch[s]) * dq
        stretch[s] = pole * stretch[s] + (1.0 - pole) * dq
    return loss


@kernel
def energy(springs: Springs, laws: Laws, start: QuantityStart, out: np.ndarray) -> float:
    """Set ``out`` (s,) to each spring's elastic energy at the start; their sum [J]."""
    total = 0.0
    for s in range(springs.quantity.size):
        q = start.value[springs.quantity[s]] - springs.origin[s]
        out[s] = potential(springs, laws, s, q)
        total += out[s]
    return total
