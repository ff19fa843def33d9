"""Forces along coordinates: a distance, an angle, a displacement; by any law of ``msahl.laws``.

At one configuration

    load = -(T(q) + c q_dot + R(q_dot, N))              [N, or N m along an angle]
    d load/dq = -dT/dq ,   d load/d q_dot = -c - dR/dq_dot
    V(q) = integral of T from q_free to q               elastic energy [J]
    P = -(c q_dot + R) q_dot                            power of damper and resistance [W]

q          coordinate, counted from an origin: 0, or its value at t = 0 [m or rad]
T, R       tension and resistance by the law; a table may take the tension's place
c          damping of a linear damper [N s/m, or N m s/rad]
q_free     where the potential is zero [m or rad]
N          magnitude of the reaction force of a joint [N], or of the law's own tension, to which the
           resistance is proportional then: dR/dq = R/T dT/dq

Discrete gradient over a step of size h from q0 to q1 = q0 + dq of the midpoint element:

    load = -(V(q1) - V(q0))/dq - c dq/h - R(dq/h) ,   work -(c dq/h + R) dq

The quotient gives the bodies exactly what the elastic energy loses. It is that of the law, or, for
a law that does not give it, computed from the potential; where that would cancel, as dq is small,
it is the mean of T by Gauss's formula, which is exact to round-off there. A decaying scheme
subtracts chi/2 k (dq - s) in addition, where s is the smoothed change of q, as it does with the
bodies' velocities (``formulations.absolute.rigid_body``); k of a table is its steepest rise there.

Over a step the mean of T takes its place. The N of a joint is extrapolated from the last two steps,
which is second-order accurate, and all else is implicit. The derivatives omit the change of that N.

The load acts through the coordinate's unit force: a two-point spring pulls along its line, a
torsional one acts about its axis. Source: Gonzalez, Time integration and discrete Hamiltonian
systems, J. Nonlinear Sci. 6 (1996), for the quotient.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws, evaluate, mean
from msahl.elements.constraints.coordinate_jacobians import add_damper, add_spring
from msahl.elements.constraints.coordinate_kinds import (
    ANGLE,
    ROUND_OFF_FACTOR,
    Coordinates,
    CoordinatesWorkspace,
    Derivatives,
)
from msahl.elements.constraints.coordinates import extent
from msahl.elements.constraints.equations import SAME
from msahl.elements.constraints.scalar import ScalarWorkspace
from msahl.formulations.absolute.frames import Frames, FramesWorkspace
from msahl.jit.kernel import choice, kernel
from msahl.laws.law import no_mean_tension
from msahl.laws.registry import COORDINATE_LAWS

NODES, WEIGHTS = (tuple(of.tolist()) for of in np.polynomial.legendre.leggauss(4))
"""Gauss's formula: exact for polynomials of degree 7."""
SHORT = 0.1
"""Change of q over its distance from q_free up to which the formula is used: its error is the
eighth power of this over 10^9, and the quotient of larger changes loses one digit."""
NO_JOINT, OWN_TENSION = -1, -2
"""In place of the joint whose reaction is N: no N, and the law's own tension."""


class AlongForces(NamedTuple):
    """The group of all forces along coordinates, springs first; units are those of q."""

    law: np.ndarray  # (s,) number in ``COORDINATE_LAWS``
    coordinate: np.ndarray  # (s,)
    constants: np.ndarray  # (s, p) numbers of the law
    closed: np.ndarray  # (s,) whether the law gives the mean of its tension
    damping: np.ndarray  # (s,) c of a linear damper
    origin: np.ndarray  # (s,) from where q counts
    free: np.ndarray  # (s,) q_free
    table: np.ndarray  # (s,) law T(q) in place of the tension, or -1
    decay: np.ndarray  # (s,) chi/2 k
    joint: np.ndarray  # (s,) whose reaction is N, or as above
    width: np.ndarray  # (s,) rate within which the resistance rises, or 0
    column: np.ndarray  # (s,) of the table of work
    energy_column: np.ndarray  # (s,) of elastic energy, behind the columns of work, or -1
    unknown: np.ndarray  # (s,) whether its load is an unknown of the step (``compliance``)


LAWS = list(COORDINATE_LAWS.values())
law_tension = choice(__name__, "law_tension", [law.tension for law in LAWS])
law_potential = choice(__name__, "law_potential", [law.potential for law in LAWS])
law_mean = choice(__name__, "law_mean", [law.mean_tension or no_mean_tension for law in LAWS])
law_resistance = choice(__name__, "law_resistance", [law.resistance for law in LAWS])


@kernel
def elongation(group: AlongForces, start: CoordinatesWorkspace, s: int) -> float:
    """Return q of force ``s`` at the configuration of ``start``, counted from the origin."""
    return start.value[group.coordinate[s]] - group.origin[s]


@kernel
def tension(group: AlongForces, laws: Laws, s: int, q: float) -> tuple[float, float]:
    """Return T(q) and dT/dq."""
    if group.table[s] < 0:
        return law_tension(group.law[s], group.constants[s], q, group.free[s])
    value, slope, _ = evaluate(laws, group.table[s], q)
    return value, slope


@kernel
def potential(group: AlongForces, laws: Laws, s: int, q: float) -> float:
    """Return the elastic energy V(q) [J]."""
    free = group.free[s]
    if group.table[s] >= 0:
        return mean(laws, group.table[s], free, q - free) * (q - free)
    return law_potential(group.law[s], group.constants[s], q, free)


@kernel
def pressing_force(group: AlongForces, reactions: np.ndarray, s: int, T: float) -> float:
    """Return N by the joints' ``reactions`` (j, 6) or by ``T``; 0 for a law that does not depend on
    it.
    """
    joint = group.joint[s]
    if joint < 0:
        return abs(T) if joint == OWN_TENSION else 0.0
    square = reactions[joint, 0] ** 2 + reactions[joint, 1] ** 2 + reactions[joint, 2] ** 2
    return math.sqrt(square)


@kernel
def resistance(
    group: AlongForces, reactions: np.ndarray, s: int, rate: float, T: float
) -> tuple[float, float]:
    """Return R at a ``rate`` under the joints' ``reactions`` (j, 6) and the tension ``T``, and
    dR/dq_dot.
    """
    N = pressing_force(group, reactions, s, T)
    return law_resistance(group.law[s], group.constants[s], rate, N)


@kernel
def by_place(group: AlongForces, s: int, R: float, T: float, slope: float) -> float:
    """Return the derivative of a resistance ``R`` by what T has the derivative ``slope`` by."""
    return R / T * slope if group.joint[s] == OWN_TENSION and T != 0.0 else 0.0


@kernel
def add_load(
    group: AlongForces,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    rate: np.ndarray,
    reactions: np.ndarray,
) -> None:
    """Add the forces at the coordinates' rates ``rate`` (q,) to the coordinates' loads, but for
    those whose loads are unknowns.

    Forces by reactions do not count among the sizes of loads: each is a fraction of a reaction,
    whose size counts.
    """
    for s in range(group.coordinate.size):
        if group.unknown[s]:
            continue
        q = group.coordinate[s]
        T, slope = tension(group, laws, s, elongation(group, start, s))
        R, _ = resistance(group, reactions, s, rate[q], T)
        lag = group.damping[s] * rate[q] + R
        start.load[q] -= T + lag
        if group.joint[s] < 0:
            unsure = ROUND_OFF_FACTOR * abs(0.5 * slope) * extent(coords, start, q)
            start.size[q] += abs(T) + abs(lag) + unsure


@kernel
def add_derivatives(
    group: AlongForces,
    laws: Laws,
    coords: Coordinates,
    place: ScalarWorkspace,
    reactions: np.ndarray,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Add the derivatives of ``add_load`` by mass by the places and by the rates."""
    start = place.coordinates
    for s in range(group.coordinate.size):
        if group.unknown[s]:
            continue
        rate = place.rate[group.coordinate[s]]
        T, slope = tension(group, laws, s, elongation(group, start, s))
        R, by_rate = resistance(group, reactions, s, rate, T)
        lag = by_place(group, s, R, T, slope), by_rate
        add_derivative(group, laws, s, coords, start, frames, motion, lag, out)


@kernel
def add_derivative(
    group: AlongForces,
    laws: Laws,
    s: int,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    lag: tuple[float, float],
    out: Derivatives,
) -> None:
    """Add the derivatives of the load of force ``s`` by mass by the places and by the rates; those
    of its resistance, by the coordinate and its rate, are ``lag``.
    """
    q = group.coordinate[s]
    _, slope = tension(group, laws, s, elongation(group, start, s))
    if slope != 0.0:
        add_spring(coords, start, frames, 1.0, q, -slope - lag[0], out.by_place)
    add_damper(coords, start, frames, motion, q, -group.damping[s] - lag[1], out)


@kernel
def add_power(
    group: AlongForces,
    laws: Laws,
    place: ScalarWorkspace,
    reactions: np.ndarray,
    dt: float,
    total: np.ndarray,
) -> None:
    """Add ``dt`` times the power [W] of each damper and resistance to its column of ``total``."""
    for s in range(group.coordinate.size):
        q_dot = place.rate[group.coordinate[s]]
        T = 0.0
        if group.joint[s] == OWN_TENSION:
            T, _ = tension(group, laws, s, elongation(group, place.coordinates, s))
        R, _ = resistance(group, reactions, s, q_dot, T)
        total[group.column[s]] -= group.damping[s] * q_dot**2 * dt + R * q_dot * dt


@kernel
def derived_mean(group: AlongForces, s: int, q0: float, dq: float) -> tuple[float, float]:
    """Return (V(q0 + dq) - V(q0))/dq and its derivative by dq, by tension and potential alone."""
    law, c, free = group.law[s], group.constants[s], group.free[s]
    if abs(dq) > SHORT * abs(q0 - free):
        change = law_potential(law, c, q0 + dq, free) - law_potential(law, c, q0, free)
        value = change / dq
        return value, (law_tension(law, c, q0 + dq, free)[0] - value) / dq
    value, slope = 0.0, 0.0
    for i in range(len(NODES)):
        part = 0.5 + 0.5 * NODES[i]
        T, by_q = law_tension(law, c, q0 + part * dq, free)
        value += 0.5 * WEIGHTS[i] * T
        slope += 0.5 * WEIGHTS[i] * part * by_q
    return value, slope


@kernel
def mean_tension(
    group: AlongForces, laws: Laws, s: int, q0: float, dq: float
) -> tuple[float, float]:
    """Return (V(q0 + dq) - V(q0))/dq and its derivative by dq."""
    if group.table[s] < 0:
        if group.closed[s]:
            return law_mean(group.law[s], group.constants[s], q0, dq, group.free[s])
        return derived_mean(group, s, q0, dq)
    value = mean(laws, group.table[s], q0, dq)
    end, slope = tension(group, laws, s, q0 + dq)
    return value, 0.5 * slope if abs(dq) < SAME else (end - value) / dq


@kernel
def add_mean_load(
    group: AlongForces,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    stretch: np.ndarray,
    reactions: np.ndarray,
    h: float,
) -> None:
    """Add the mean loads over the step, under the extrapolated ``reactions``, to the coordinates'
    loads; ``stretch`` (s,) is s of each.
    """
    for s in range(group.coordinate.size):
        if group.unknown[s]:
            continue
        q = group.coordinate[s]
        dq = start.change[q]
        T, slope = mean_tension(group, laws, s, elongation(group, start, s), dq)
        lag = group.damping[s] * dq / h + group.decay[s] * (dq - stretch[s])
        lag += resistance(group, reactions, s, dq / h, T)[0]
        start.load[q] -= T + lag
        # A tension whose mean vanishes can be large at both ends, and that of a stiff spring is no
        # more accurate than its length.
        unsure = ROUND_OFF_FACTOR * abs(slope) * extent(coords, start, q)
        start.size[q] += abs(T) + abs(slope * dq) + abs(lag) + unsure


@kernel
def mean_jacobian(
    group: AlongForces,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    reactions: np.ndarray,
    frames: Frames,
    step: tuple[float, float],
    values: np.ndarray,
) -> None:
    """Add the derivatives of the mean loads by the unknowns; ``step`` is (h, factor)."""
    h, factor = step
    for s in range(group.coordinate.size):
        if group.unknown[s]:
            continue
        q = group.coordinate[s]
        dq = start.change[q]
        T, slope = mean_tension(group, laws, s, elongation(group, start, s), dq)
        R, by_rate = resistance(group, reactions, s, dq / h, T)
        slope += by_place(group, s, R, T, slope)
        slope = -slope - group.damping[s] / h - group.decay[s] - by_rate / h
        add_spring(coords, start, frames, factor, q, slope, values)


@kernel
def mean_work(
    group: AlongForces,
    laws: Laws,
    reactions: np.ndarray,
    start: CoordinatesWorkspace,
    h: float,
    total: np.ndarray,
) -> None:
    """Add the work [J] of each damper and resistance over the step to its column of ``total``."""
    for s in range(group.coordinate.size):
        dq, T = start.change[group.coordinate[s]], 0.0
        if group.joint[s] == OWN_TENSION:
            T, _ = mean_tension(group, laws, s, elongation(group, start, s), dq)
        R, _ = resistance(group, reactions, s, dq / h, T)
        total[group.column[s]] -= group.damping[s] * dq * dq / h + R * dq


@kernel
def smooth(
    group: AlongForces, start: CoordinatesWorkspace, pole: float, stretch: np.ndarray
) -> float:
    """Advance the smoothed changes ``stretch`` (s,) of a decaying scheme by the accepted step;
    return the energy [J] that the scheme took from the forces.
    """
    loss = 0.0
    for s in range(group.coordinate.size):
        dq = start.change[group.coordinate[s]]
        loss += group.decay[s] * (dq - stretch[s]) * dq
        stretch[s] = pole * stretch[s] + (1.0 - pole) * dq
    return loss


@kernel
def energy(group: AlongForces, laws: Laws, start: CoordinatesWorkspace, out: np.ndarray) -> float:
    """Set ``out`` (s,) to each force's elastic energy [J]; return their sum."""
    total = 0.0
    for s in range(group.coordinate.size):
        out[s] = potential(group, laws, s, elongation(group, start, s))
        total += out[s]
    return total


@kernel
def presses_itself(group: AlongForces) -> bool:
    """Return whether there is a compliant contact."""
    found = False
    for s in range(group.joint.size):
        found = found or group.joint[s] == OWN_TENSION
    return found


@kernel
def publish_loads(
    group: AlongForces, laws: Laws, place: ScalarWorkspace, table: np.ndarray, row: int
) -> None:
    """Write the loads [N or N m] of compliant contacts to the last columns of a ``row``."""
    column = table.shape[1]
    for s in range(group.joint.size - 1, -1, -1):
        if group.joint[s] == OWN_TENSION:
            column -= 1
            T, _ = tension(group, laws, s, elongation(group, place.coordinates, s))
            rate = place.rate[group.coordinate[s]]
            R, _ = law_resistance(group.law[s], group.constants[s], rate, abs(T))
            table[row, column] = 0.0 - T - R


@kernel
def by_reactions(group: AlongForces) -> bool:
    """Return whether a force depends on the joints' reactions."""
    found = False
    for s in range(group.joint.size):
        found = found or group.joint[s] >= 0
    return found


def unresolved_speed(
    group: AlongForces,
    coords: Coordinates,
    frames: Frames,
    reactions: np.ndarray,
    h: float,
) -> float:
    """Return half the largest width w [m/s] that a resistance under the ``reactions`` (j, 6) passes
    within one step ``h``; 0 if it passes none.
    """
    worst = 0.0
    for s in np.flatnonzero(group.width):
        q = group.coordinate[s]
        first = coords.first[q]
        pair = [coords.products.a[first], coords.products.b[first]]
        moving = [b for b in pair if frames.inverse_mass[b] > 0.0]
        angular = coords.kind[q] == ANGLE
        length = float(frames.length[moving].max()) if angular else 1.0
        limit, _ = resistance(group, reactions, int(s), math.inf, 0.0)
        change = h * limit * frames.inverse_mass[moving].max() / length**2
        if change > group.width[s]:
            worst = max(worst, 0.5 * float(group.width[s]) * length)
    return worst
