"""Concentrated load: a constant force at a point of a body, and a constant moment.

    F = mean(R_f f),  M = mean(R_m m),  T = mean(r) x F + M        mean: half of both ends' sum
    work over the step = F . (u + dr) + M . Q                        exactly what the body gains

f and m have constant components in the axes of some body (or the ground: then R is constant), and
turn with it; a law of time, taken at the middle of the step, may multiply both. r is the arm from
the mass centre to the point of application. Source: the concentrated load of Hainge 2010, section
2.3.1; the discrete form is ours.
"""

from typing import NamedTuple

import numpy as np

from msahl.bodies.rigid import Bodies, end_tangent, mean, push, turn_of
from msahl.kernel import kernel
from msahl.law import Laws, evaluate
from msahl.rotation import turn_change
from msahl.vector import (
    add,
    at,
    cross,
    dot,
    matrix_at,
    product,
    put,
    scale,
    skew,
    sub,
    times,
)


class ConcentratedLoads(NamedTuple):
    """The group of all concentrated loads."""

    body: np.ndarray  # (k,)
    s: np.ndarray  # (k, 3) point from the mass centre, axes of the body [m]
    f: np.ndarray  # (k, 3) in the axes of body f_axes [N]
    f_axes: np.ndarray  # (k,)
    m: np.ndarray  # (k, 3) in the axes of body m_axes [N m]
    m_axes: np.ndarray  # (k,)
    law: np.ndarray  # (k,) factor in time, or -1
    force_by_turn: np.ndarray  # (k,) start of the block by the turn of f_axes
    moment_by_turn: np.ndarray  # (k, 3) by the turns of the body, of f_axes and of m_axes


class ConcentratedStart(NamedTuple):
    """Arm at the start of the step, and force and moment with the directions they have there and
    the size they have over the step; inertial axes, (k, 3)."""

    r: np.ndarray
    f: np.ndarray
    m: np.ndarray


@kernel
def prepare(
    group: ConcentratedLoads, laws: Laws, t: float, R: np.ndarray, start: ConcentratedStart
) -> None:
    """Carry arm, force and moment into inertial axes; their size is that of time ``t``."""
    for k in range(group.body.size):
        c = 1.0 if group.law[k] < 0 else evaluate(laws, group.law[k], t)[0]
        put(start.r, k, times(matrix_at(R, group.body[k]), at(group.s, k)))
        put(start.f, k, scale(c, times(matrix_at(R, group.f_axes[k]), at(group.f, k))))
        put(start.m, k, scale(c, times(matrix_at(R, group.m_axes[k]), at(group.m, k))))


@kernel
def residual(
    group: ConcentratedLoads,
    start: ConcentratedStart,
    bodies: Bodies,
    reach: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Take the loads from the rows of their bodies."""
    for k in range(group.body.size):
        b = group.body[k]
        r = mean(bodies, Z, b, at(start.r, k))
        f = mean(bodies, Z, group.f_axes[k], at(start.f, k))
        m = mean(bodies, Z, group.m_axes[k], at(start.m, k))
        push(bodies, reach, F, b, f, add(cross(r, f), m))


@kernel
def jacobian(
    group: ConcentratedLoads,
    start: ConcentratedStart,
    bodies: Bodies,
    reach: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the mean force and moment by the turns."""
    for k in range(group.body.size):
        b, axes_f, axes_m = group.body[k], group.f_axes[k], group.m_axes[k]
        r = mean(bodies, Z, b, at(start.r, k))
        f = mean(bodies, Z, axes_f, at(start.f, k))
        by_arm = product(skew(f), end_tangent(bodies, Z, b, at(start.r, k)))
        by_force = end_tangent(bodies, Z, axes_f, at(start.f, k))
        by_lever = product(skew(r), by_force)
        by_moment = end_tangent(bodies, Z, axes_m, at(start.m, k))
        # The mean moves by half of the end, and push takes c F from the rows: + c/2.
        c = 0.5 * reach * bodies.inverse_mass[b]
        c_turn = c / bodies.length[b]
        for i in range(3):
            for j in range(3):
                values[group.force_by_turn[k] + 3 * i + j] += c * by_force[i][j]
                values[group.moment_by_turn[k, 0] + 3 * i + j] -= c_turn * by_arm[i][j]
                values[group.moment_by_turn[k, 1] + 3 * i + j] += c_turn * by_lever[i][j]
                values[group.moment_by_turn[k, 2] + 3 * i + j] += c_turn * by_moment[i][j]


@kernel
def work(
    group: ConcentratedLoads,
    start: ConcentratedStart,
    bodies: Bodies,
    Z: np.ndarray,
    column: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work [J] of each load over the step to its ``column`` of ``total``."""
    for k in range(group.body.size):
        b = group.body[k]
        Q = turn_of(bodies, Z, b)
        f = mean(bodies, Z, group.f_axes[k], at(start.f, k))
        m = mean(bodies, Z, group.m_axes[k], at(start.m, k))
        moved = add(at(Z, 2 * b), turn_change(Q, at(start.r, k)))
        total[column[k]] += dot(f, moved) + dot(m, Q)


@kernel
def free_acceleration(
    group: ConcentratedLoads, start: ConcentratedStart, bodies: Bodies, F: np.ndarray
) -> None:
    """Add the loads to the rows of their bodies."""
    for k in range(group.body.size):
        f = at(start.f, k)
        # reach = 1: rows of the acceleration problem; push takes, so the signs turn.
        moment = sub(cross(f, at(start.r, k)), at(start.m, k))
        push(bodies, 1.0, F, group.body[k], scale(-1.0, f), moment)


@kernel
def free_work(
    group: ConcentratedLoads,
    start: ConcentratedStart,
    v: np.ndarray,
    W: np.ndarray,
    dt: float,
    column: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work [J] at these velocities over a time ``dt`` to its ``column`` of ``total``."""
    for k in range(group.body.size):
        b = group.body[k]
        V = add(at(v, b), cross(at(W, b), at(start.r, k)))
        power = dot(at(start.f, k), V) + dot(at(start.m, k), at(W, b))
        total[column[k]] += power * dt
