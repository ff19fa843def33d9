"""Spring and damper along a coordinate: a distance, an angle, a displacement.

At one configuration

    load = -(T(q) + c q_dot)                            [N, or N m along an angle]
    T(q) = T_0 + k (q - q_free)  or a table
    d load/dq = -dT/dq ,   d load/d q_dot = -c
    V(q) = integral of T from q_free to q               elastic energy [J]
    P = -c q_dot^2                                      power of the damper [W]

q          coordinate, counted from an origin: 0, or its value at t = 0 [m or rad]
k, c, T_0  stiffness, damping, preload [N/m, N s/m, N; or N m/rad, N m s/rad, N m]
q_free     where the tension is the preload [m or rad]

Discrete gradient over a step of size h from q0 to q1 = q0 + dq of the midpoint element:

    load = -(V(q1) - V(q0))/dq - c dq/h ,   work of the damper -c dq^2/h

The quotient gives the bodies exactly what the elastic energy loses. A decaying scheme subtracts
chi/2 k (dq - s) in addition, where s is the smoothed change of q, as it does with the bodies'
velocities (``elements.rigid_body``); k of a table is its steepest rise there.

The load acts through the coordinate's unit force: a two-point spring pulls along its line, a
torsional one acts about its axis. Source: Gonzalez, Time integration and discrete Hamiltonian
systems, J. Nonlinear Sci. 6 (1996), for the quotient.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws, evaluate, mean
from msahl.elements.constraints.coordinate_jacobians import add_damper, add_spring
from msahl.elements.constraints.coordinate_kinds import (
    ROUND_OFF_FACTOR,
    Coordinates,
    CoordinatesWorkspace,
    Derivatives,
)
from msahl.elements.constraints.coordinates import extent
from msahl.elements.constraints.equations import SAME
from msahl.elements.frames import Frames, FramesWorkspace
from msahl.jit.kernel import kernel


class Springs(NamedTuple):
    """The group of all springs with their dampers; units are those of the coordinate."""

    coordinate: np.ndarray  # (s,)
    stiffness: np.ndarray  # (s,) k
    damping: np.ndarray  # (s,) c
    origin: np.ndarray  # (s,) from where q counts
    free: np.ndarray  # (s,) q_free
    preload: np.ndarray  # (s,) T_0
    table: np.ndarray  # (s,) law T(q) in place of preload and k, or -1
    decay: np.ndarray  # (s,) chi/2 k
    column: np.ndarray  # (s,) of the table of work
    energy_column: np.ndarray  # (s,) of the springs' energies, behind the columns of work
    unknown: np.ndarray  # (s,) whether its load is an unknown of the step (``compliance``)


@kernel
def elongation(group: Springs, start: CoordinatesWorkspace, s: int) -> float:
    """Return q of spring ``s`` at the configuration of ``start``, counted from the origin."""
    return start.value[group.coordinate[s]] - group.origin[s]


@kernel
def tension(group: Springs, laws: Laws, s: int, q: float) -> tuple[float, float]:
    """Return T(q) and dT/dq."""
    if group.table[s] < 0:
        k = group.stiffness[s]
        return group.preload[s] + k * (q - group.free[s]), k
    value, slope, _ = evaluate(laws, group.table[s], q)
    return value, slope


@kernel
def potential(group: Springs, laws: Laws, s: int, q: float) -> float:
    """Return the elastic energy V(q) [J]."""
    free = group.free[s]
    if group.table[s] >= 0:
        return mean(laws, group.table[s], free, q - free) * (q - free)
    return tension(group, laws, s, 0.5 * (free + q))[0] * (q - free)


@kernel
def add_load(
    group: Springs,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    rate: np.ndarray,
) -> None:
    """Add springs and dampers at the coordinates' rates ``rate`` (q,) to the coordinates' loads,
    but for those whose loads are unknowns.
    """
    for s in range(group.coordinate.size):
        if group.unknown[s]:
            continue
        q = group.coordinate[s]
        T, slope = tension(group, laws, s, elongation(group, start, s))
        start.load[q] -= T + group.damping[s] * rate[q]
        unsure = ROUND_OFF_FACTOR * abs(0.5 * slope) * extent(coords, start, q)
        start.size[q] += abs(T) + abs(group.damping[s] * rate[q]) + unsure


@kernel
def add_derivatives(
    group: Springs,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Add the derivatives of ``add_load`` by mass by the places and by the rates."""
    for s in range(group.coordinate.size):
        if not group.unknown[s]:
            add_derivative(group, laws, s, coords, start, frames, motion, out)


@kernel
def add_derivative(
    group: Springs,
    laws: Laws,
    s: int,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Add the derivatives of the load of spring ``s`` by mass by the places and by the rates."""
    q = group.coordinate[s]
    _, slope = tension(group, laws, s, elongation(group, start, s))
    add_spring(coords, start, frames, 1.0, q, -slope, out.by_place)
    add_damper(coords, start, frames, motion, q, -group.damping[s], out)


@kernel
def add_power(group: Springs, rate: np.ndarray, dt: float, total: np.ndarray) -> None:
    """Add ``dt`` times the power [W] of each damper to its column of ``total`` [J]."""
    for s in range(group.coordinate.size):
        total[group.column[s]] -= group.damping[s] * rate[group.coordinate[s]] ** 2 * dt


@kernel
def mean_tension(group: Springs, laws: Laws, s: int, q0: float, dq: float) -> tuple[float, float]:
    """Return (V(q0 + dq) - V(q0))/dq and its derivative by dq."""
    if group.table[s] < 0:
        T, slope = tension(group, laws, s, q0 + 0.5 * dq)
        return T, 0.5 * slope
    value = mean(laws, group.table[s], q0, dq)
    end, slope = tension(group, laws, s, q0 + dq)
    return value, 0.5 * slope if abs(dq) < SAME else (end - value) / dq


@kernel
def add_mean_load(
    group: Springs,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    stretch: np.ndarray,
    h: float,
) -> None:
    """Add the mean loads over the step to the coordinates' loads; ``stretch`` (s,) is s of each."""
    for s in range(group.coordinate.size):
        if group.unknown[s]:
            continue
        q = group.coordinate[s]
        dq = start.change[q]
        T, slope = mean_tension(group, laws, s, elongation(group, start, s), dq)
        lag = group.damping[s] * dq / h + group.decay[s] * (dq - stretch[s])
        start.load[q] -= T + lag
        # A tension whose mean vanishes can be large at both ends, and that of a stiff spring is no
        # more accurate than its length.
        unsure = ROUND_OFF_FACTOR * abs(slope) * extent(coords, start, q)
        start.size[q] += abs(T) + abs(slope * dq) + abs(lag) + unsure


@kernel
def mean_jacobian(
    group: Springs,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    step: tuple[float, float],
    values: np.ndarray,
) -> None:
    """Add the derivatives of the mean loads over the ``step`` (h, dt2) by the unknowns."""
    h, dt2 = step
    for s in range(group.coordinate.size):
        if group.unknown[s]:
            continue
        q = group.coordinate[s]
        _, slope = mean_tension(group, laws, s, elongation(group, start, s), start.change[q])
        slope = -slope - group.damping[s] / h - group.decay[s]
        add_spring(coords, start, frames, -dt2, q, slope, values)


@kernel
def mean_work(group: Springs, start: CoordinatesWorkspace, h: float, total: np.ndarray) -> None:
    """Add the work [J] of each damper over the step to its column of ``total``."""
    for s in range(group.coordinate.size):
        dq = start.change[group.coordinate[s]]
        total[group.column[s]] -= group.damping[s] * dq * dq / h


@kernel
def smooth(group: Springs, start: CoordinatesWorkspace, pole: float, stretch: np.ndarray) -> float:
    """Advance the smoothed changes ``stretch`` (s,) of a decaying scheme by the accepted step;
    return the energy [J] that the scheme took from the springs.
    """
    loss = 0.0
    for s in range(group.coordinate.size):
        dq = start.change[group.coordinate[s]]
        loss += group.decay[s] * (dq - stretch[s]) * dq
        stretch[s] = pole * stretch[s] + (1.0 - pole) * dq
    return loss


@kernel
def energy(group: Springs, laws: Laws, start: CoordinatesWorkspace, out: np.ndarray) -> float:
    """Set ``out`` (s,) to each spring's elastic energy [J]; return their sum."""
    total = 0.0
    for s in range(group.coordinate.size):
        out[s] = potential(group, laws, s, elongation(group, start, s))
        total += out[s]
    return total
