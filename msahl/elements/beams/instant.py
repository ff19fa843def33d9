"""Beams at one configuration: strains, energy, equations of the index-1 problem.

elastic:   C lam = -(eps + tau d(eps)/dt)         rigid:   d^2(eps)/dt^2 = 0
"""

import numpy as np

from msahl.algebra.vector import (
    ZERO,
    Vector,
    add,
    at,
    axpy,
    combine,
    cross,
    dot,
    matrix_at,
    sub,
)
from msahl.elements.beams.group import (
    BEND_Q,
    COMPONENTS,
    STRETCH_Q,
    STRETCH_U,
    Beams,
    BeamsWorkspace,
)
from msahl.elements.beams.rows import own_compliance, row_scale
from msahl.elements.beams.strain import NONE, Point, bending, nodes_of, set_configuration, strain_at
from msahl.formulations.absolute.frames import Frames, FramesWorkspace, first_multiplier
from msahl.jit.kernel import apart, kernel, optional


@optional()
def prepare(group: Beams, x: np.ndarray, R: np.ndarray, start: BeamsWorkspace) -> None:
    """Evaluate directors and slopes in a configuration."""
    set_configuration(group, x, R, start)


@optional()
def set_strains(group: Beams, start: BeamsWorkspace) -> None:
    """Set the state's strains to those of the prepared configuration."""
    for g in range(group.element.size):
        gamma, kappa = strain_at(group, start, g)
        for i in range(3):
            start.strain[g, i] = gamma[i]
            start.strain[g, 3 + i] = kappa[i]


@optional(0.0)
def energy(group: Beams, start: BeamsWorkspace) -> float:
    """Return the elastic energy [J] of all beams."""
    total = 0.0
    for g in range(group.element.size):
        total += _energy_at(group, start, g)
    return total


@kernel
def _energy_at(group: Beams, start: BeamsWorkspace, g: int) -> float:
    total = 0.0
    for i in range(COMPONENTS):
        for j in range(COMPONENTS):
            total += start.strain[g, i] * group.stiffness[g, i, j] * start.strain[g, j]
    return 0.5 * group.weight[g] * total


@optional()
def publish_energy(group: Beams, start: BeamsWorkspace, table: np.ndarray, row: int) -> None:
    """Set the last columns of ``table`` to the elastic energies [J] of the beams."""
    first = table.shape[1] - group.column.size
    for b in range(group.column.size):
        table[row, first + b] = 0.0
    for g in range(group.element.size):
        table[row, first + group.beam[g]] += _energy_at(group, start, g)


@optional()
def write_resultants(group: Beams, force: np.ndarray, table: np.ndarray, row: int) -> None:
    """Set a ``row`` of ``table`` to the stress resultants, of the multipliers ``force`` (k, 3)."""
    for g in range(group.element.size):
        for i in range(COMPONENTS):
            table[row, COMPONENTS * g + i] = force[group.place[g] + i // 3, i % 3]


@apart
def motion_at(
    group: Beams, start: BeamsWorkspace, v: np.ndarray, W: np.ndarray, g: int
) -> tuple[Point, Point]:
    """Return the rates of d_i, d_i' and r' at Gauss point ``g``, and their second derivatives at
    zero accelerations of the nodes.
    """
    d1, b1, r1, d2, b2, r2 = NONE, NONE, ZERO, NONE, NONE, ZERO
    first, count = nodes_of(group, g)
    for a in range(count):
        m = group.node[first + a]
        f = group.frame[m]
        N, slope, w = group.value[g, a], group.slope[g, a], at(W, f)
        d = matrix_at(start.d, m)
        rate = (cross(w, d[0]), cross(w, d[1]), cross(w, d[2]))
        second = (cross(w, rate[0]), cross(w, rate[1]), cross(w, rate[2]))
        d1, b1 = combine(N, rate, d1), combine(slope, rate, b1)
        d2, b2 = combine(N, second, d2), combine(slope, second, b2)
        swept = cross(w, at(start.arm, m))
        r1 = axpy(slope, add(at(v, f), swept), r1)
        r2 = axpy(slope, cross(w, swept), r2)
    return (d1, b1, r1), (d2, b2, r2)


@kernel
def strain_rates(at_point: Point, first: Point) -> tuple[Vector, Vector]:
    """Return the rates of Gamma and kappa."""
    d, b, r = at_point
    d1, b1, r1 = first
    gamma = (
        dot(d1[0], sub(r, d[0])) + dot(d[0], r1),
        dot(d1[1], r) + dot(d[1], r1),
        dot(d1[2], r) + dot(d[2], r1),
    )
    return gamma, add(bending(d1, b), bending(d, b1))


@kernel
def _strain_accelerations(at_point: Point, first: Point, second: Point) -> tuple[Vector, Vector]:
    """Return the second derivatives of Gamma and kappa."""
    gamma, kappa = strain_rates(at_point, second)
    d1, b1, r1 = first
    twice = (2.0 * dot(d1[0], r1) - dot(d1[0], d1[0]), 2.0 * dot(d1[1], r1), 2.0 * dot(d1[2], r1))
    return add(gamma, twice), axpy(2.0, bending(d1, b1), kappa)


@kernel
def point_at(start: BeamsWorkspace, g: int) -> Point:
    """Return d_i, d_i' and r' of the configuration at Gauss point ``g``."""
    return matrix_at(start.director, g), matrix_at(start.d_slope, g), at(start.r_slope, g)


@optional()
def free_acceleration(
    group: Beams, start: BeamsWorkspace, frames: Frames, motion: FramesWorkspace, F: np.ndarray
) -> None:
    """Set the equations of the index-1 problem: of elastic strains minus these, with their damping,
    of rigid ones minus the second derivatives at zero accelerations.
    """
    for g in range(group.element.size):
        here, node = point_at(start, g), first_multiplier(frames) + group.place[g]
        first, second = motion_at(group, start, motion.v, motion.W, g)
        rate, acceleration = strain_rates(here, first), _strain_accelerations(here, first, second)
        for i in range(COMPONENTS):
            k, c = i % 3, row_scale(group, g, i)
            if group.rigid[g, i]:
                F[node + i // 3, k] = -c * acceleration[i // 3][k]
            else:
                strain = start.strain[g, i] + group.damping[g, i] * rate[i // 3][k]
                F[node + i // 3, k] = -c * strain / own_compliance(group, g, i, i)


@optional()
def observe(
    group: Beams,
    start: BeamsWorkspace,
    motion: FramesWorkspace,
    violation: np.ndarray,
    violation_rate: np.ndarray,
) -> None:
    """Set violations [m or rad] and their rates (k, 3), times w J: those of rigid strains, which
    are to be zero, and zeros for elastic ones, whose equations determine resultants.
    """
    for g in range(group.element.size):
        here, place = point_at(start, g), group.place[g]
        first, _ = motion_at(group, start, motion.v, motion.W, g)
        rate, strain = strain_rates(here, first), strain_at(group, start, g)
        for i in range(COMPONENTS):
            c = group.weight[g] if group.rigid[g, i] else 0.0
            violation[place + i // 3, i % 3] = c * strain[i // 3][i % 3]
            violation_rate[place + i // 3, i % 3] = c * rate[i // 3][i % 3]


@optional()
def in_metres(group: Beams, violation: np.ndarray, violation_rate: np.ndarray) -> None:
    """Multiply violations in radians by a length, so that all are in metres."""
    for g in range(group.element.size):
        for i in range(3):
            violation[group.place[g] + 1, i] *= group.length[g]
            violation_rate[group.place[g] + 1, i] *= group.length[g]


def determine_resultants(group: Beams | None, values: np.ndarray) -> None:
    """Replace the equations of elastic strains in the block ``values`` by those of the index-1
    problem, where they determine the resultants, whatever the accelerations.
    """
    if group is None:
        return
    for g, i in zip(*np.nonzero(~group.rigid), strict=True):
        slots = 3 * (i % 3) + np.arange(3)
        own = (group.load_block[g, :, STRETCH_U : STRETCH_Q + 1], group.load_block[g, :, BEND_Q:])[
            i // 3
        ]
        values[own.reshape(-1, 1) + slots] = 0.0
        for j in range(COMPONENTS):
            place = group.compliance_block[g, i // 3, j // 3] + 3 * (i % 3) + j % 3
            values[place] = own_compliance(group, g, i, j) / own_compliance(group, g, i, i)
    values[:9] = 0.0  # what belongs to the ground


@optional()
def add_power(
    group: Beams, start: BeamsWorkspace, motion: FramesWorkspace, dt: float, work: np.ndarray
) -> None:
    """Add ``dt`` times the power [W] of the damping of each beam to its column of ``work`` [J]."""
    for g in range(group.element.size):
        column = group.column[group.beam[g]]
        if column < 0:
            continue
        rate = strain_rates(point_at(start, g), motion_at(group, start, motion.v, motion.W, g)[0])
        for i in range(COMPONENTS):
            for j in range(COMPONENTS):
                lag = group.damping[g, j] * rate[j // 3][j % 3]
                power = rate[i // 3][i % 3] * group.stiffness[g, i, j] * lag
                work[column] -= group.weight[g] * power * dt
