"""Concentrated load: a constant force at a point of a body, and a constant moment.

    F = c mean(R_f f),  M = c mean(R_m m),  T = mean(r) x F + M    mean: half of both ends' sum
    work over the step = F . (u + dr) + M . Q                        exactly what the body gains

f and m have constant components in the axes of some body (or the ground: then R is constant), and
turn with it; a law of time may multiply both. r is the arm from the mass centre to the point of
application. Source: the concentrated load of Hainge 2010, section 2.3.1; the discrete form is ours.

The factor c is the exact mean of the law over the step, so its impulse is right at any step.
Schemes of higher degree sum the load at nodes c_i with weights b_i; its factors there are the L_i

    sum_i b_i L_i p(c_i) = integral over [0, 1] of law(t + h x) p(x) dx      p of degree < s

At the lowest order the law's first moment, c_1 = integral of (1/2 - x) law(t + h x), is kept as
well. By it a free body is displaced by h^2 c_1 f/m more than h times the mean of its velocities at
both ends. With joints that offset d is the solution of (``solve.offset``)

    M d = h^2 c_1 (f, m + r x f) - G^T mu ,   G d = 0 ;      u = h (v0 + v1)/2 + d ,  likewise Q

The work of the loads is then less by M (v1 - v0) . d/h, and again exactly what the bodies gain.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws, evaluate, moments
from msahl.algebra.rotation import turn_change
from msahl.algebra.vector import (
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
from msahl.elements.frames import (
    Frames,
    FramesWorkspace,
    displacement_node,
    end_tangent,
    mean,
    push,
    rotation_increment,
)
from msahl.jit.kernel import kernel


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
    the size they have over the step or at a time; inertial axes."""

    r: np.ndarray  # (k, 3)
    f: np.ndarray  # (k, 3)
    m: np.ndarray  # (k, 3)
    factor: np.ndarray  # (k,) the laws' c
    first: np.ndarray  # (k,) the laws' c_1
    first_f: np.ndarray  # (k, 3) c_1 f
    first_m: np.ndarray  # (k, 3) c_1 (m + r x f)


NEGLIGIBLE = 1e-15
"""First moment of a law, relative to its mean, that is round-off."""


@kernel
def at_time(group: ConcentratedLoads, laws: Laws, t: float, factor: np.ndarray) -> None:
    """Set the factors (k,) to those of the time ``t``."""
    for k in range(group.body.size):
        factor[k] = 1.0 if group.law[k] < 0 else evaluate(laws, group.law[k], t)[0]


@kernel
def over_step(
    group: ConcentratedLoads,
    laws: Laws,
    t: float,
    h: float,
    R: np.ndarray,
    start: ConcentratedStart,
) -> bool:
    """Prepare for a step of the lowest order; whether a law has a first moment over it."""
    moved = False
    for k in range(group.body.size):
        start.factor[k], start.first[k] = 1.0, 0.0
        if group.law[k] >= 0:
            values = moments(laws, group.law[k], t, h)
            start.factor[k] = values[0]
            if abs(values[1]) > NEGLIGIBLE * abs(values[0]):
                start.first[k] = -0.5 * values[1]
                moved = True
    prepare(group, start.factor, R, start)
    if moved:
        for k in range(group.body.size):
            f = times(matrix_at(R, group.f_axes[k]), at(group.f, k))
            m = times(matrix_at(R, group.m_axes[k]), at(group.m, k))
            put(start.first_f, k, scale(start.first[k], f))
            put(start.first_m, k, scale(start.first[k], add(cross(at(start.r, k), f), m)))
    return moved


@kernel
def at_nodes(
    group: ConcentratedLoads,
    laws: Laws,
    t: float,
    h: float,
    from_moments: np.ndarray,
    factor: np.ndarray,
) -> None:
    """Set the factors (s, k) at the nodes of a step; ``from_moments`` (s, s) has them from the
    laws' moments.
    """
    for k in range(group.body.size):
        values = (1.0, 0.0, 0.0, 0.0, 0.0)
        if group.law[k] >= 0:
            values = moments(laws, group.law[k], t, h)
        for i in range(factor.shape[0]):
            factor[i, k] = 0.0
            for j in range(factor.shape[0]):
                factor[i, k] += from_moments[i, j] * values[j]


@kernel
def prepare(
    group: ConcentratedLoads, factor: np.ndarray, R: np.ndarray, start: ConcentratedStart
) -> None:
    """Carry arm, force and moment into inertial axes, in the size that the factors (k,) give."""
    for k in range(group.body.size):
        c = factor[k]
        put(start.r, k, times(matrix_at(R, group.body[k]), at(group.s, k)))
        put(start.f, k, scale(c, times(matrix_at(R, group.f_axes[k]), at(group.f, k))))
        put(start.m, k, scale(c, times(matrix_at(R, group.m_axes[k]), at(group.m, k))))


@kernel
def residual(
    group: ConcentratedLoads,
    start: ConcentratedStart,
    frames: Frames,
    dt2: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Take the loads from the rows of their bodies."""
    for k in range(group.body.size):
        b = group.body[k]
        r = mean(frames, Z, b, at(start.r, k))
        f = mean(frames, Z, group.f_axes[k], at(start.f, k))
        m = mean(frames, Z, group.m_axes[k], at(start.m, k))
        push(frames, dt2, F, b, f, add(cross(r, f), m))


@kernel
def jacobian(
    group: ConcentratedLoads,
    start: ConcentratedStart,
    frames: Frames,
    dt2: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the mean force and moment by the turns."""
    for k in range(group.body.size):
        b, axes_f, axes_m = group.body[k], group.f_axes[k], group.m_axes[k]
        r = mean(frames, Z, b, at(start.r, k))
        f = mean(frames, Z, axes_f, at(start.f, k))
        by_arm = product(skew(f), end_tangent(frames, Z, b, at(start.r, k)))
        by_force = end_tangent(frames, Z, axes_f, at(start.f, k))
        by_lever = product(skew(r), by_force)
        by_moment = end_tangent(frames, Z, axes_m, at(start.m, k))
        # The mean moves by half of the end, and push takes c F from the rows: + c/2.
        c = 0.5 * dt2 * frames.inverse_mass[b]
        c_turn = c / frames.length[b]
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
    frames: Frames,
    Z: np.ndarray,
    column: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work [J] of each load over the step to its ``column`` of ``total``."""
    for k in range(group.body.size):
        b = group.body[k]
        Q = rotation_increment(frames, Z, b)
        f = mean(frames, Z, group.f_axes[k], at(start.f, k))
        m = mean(frames, Z, group.m_axes[k], at(start.m, k))
        moved = add(at(Z, displacement_node(frames, b)), turn_change(Q, at(start.r, k)))
        total[column[k]] += dot(f, moved) + dot(m, Q)


@kernel
def has_first(start: ConcentratedStart) -> bool:
    """Whether a law has a first moment over the step."""
    largest = 0.0
    for k in range(start.first.size):
        largest = max(largest, abs(start.first[k]))
    return largest > 0.0


@kernel
def enter_first(
    group: ConcentratedLoads, start: ConcentratedStart, frames: Frames, k: int, F: np.ndarray
) -> None:
    """Enter what load ``k`` has as first moment in the rows of its body: an acceleration."""
    # reach = 1: rows of the acceleration problem; push takes, so the signs turn.
    f, m = scale(-1.0, at(start.first_f, k)), scale(-1.0, at(start.first_m, k))
    push(frames, 1.0, F, group.body[k], f, m)


@kernel
def work_of_first(
    group: ConcentratedLoads,
    start: ConcentratedStart,
    frames: FramesWorkspace,
    h: float,
    a: np.ndarray,
    alpha: np.ndarray,
    lost: float,
    column: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work [J] that the first moments do over a step with the accelerations ``a`` and
    ``alpha`` (n+1, 3) to the ``column`` of their loads. The sum is ``-lost``: what of it goes
    through joints is shared out by the laws' moments.
    """
    size, rest = 0.0, -lost
    for k in range(group.body.size):
        b = group.body[k]
        own = (
            -h * h * (dot(at(a, b), at(start.first_f, k)) + dot(at(alpha, b), at(start.first_m, k)))
        )
        total[column[k]] += own
        rest -= own
        size += abs(start.first[k])
    for k in range(group.body.size):
        total[column[k]] += rest * abs(start.first[k]) / size


@kernel
def free_acceleration(
    group: ConcentratedLoads, start: ConcentratedStart, frames: Frames, F: np.ndarray
) -> None:
    """Add the loads to the rows of their bodies."""
    for k in range(group.body.size):
        f = at(start.f, k)
        # reach = 1: rows of the acceleration problem; push takes, so the signs turn.
        moment = sub(cross(f, at(start.r, k)), at(start.m, k))
        push(frames, 1.0, F, group.body[k], scale(-1.0, f), moment)


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
