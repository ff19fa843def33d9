"""Concentrated load: a force and a moment with constant components, acting at a point of a body.

At one configuration and one time t, in inertial axes,

    F = c(t) R_f f                        force at the point [N]
    M = c(t) R_m m + r x F                moment about the mass centre G [N m]
    P = F . (v + W x r) + c R_m m . W     power [W]

f, m        constant components in the axes of some body or of the ground [N, N m]
R_f, R_m    rotation matrices of these axes; they are constant for the ground
r           arm from G to the point of application, fixed in the body [m]
c           1, a law of time, or an expression u(y, s) of signals and auxiliary states
            (``elements.signals``)
v, W        velocity of G [m/s], angular velocity [rad/s]

Discrete gradient over a step of size h of the midpoint element, with the displacement u of G, the
rotation increment Q and the mean of both ends of each vector in place of the vector itself:

    F = C mean(R_f f),   M = C mean(R_m m) + mean(r) x F
    work = F . (u + dr) + C mean(R_m m) . Q                exactly the energy the body gains

C is the exact mean of the law over the step, so the impulse is right at any step size. A
collocation scheme sums the load at its nodes c_i with weights b_i. Its factors are the C_i with

    sum_i b_i C_i p(c_i) = integral over [0, 1] of c(t + h x) p(x) dx      p of degree < s

The midpoint element also keeps the law's first moment, C_1 = integral of (1/2 - x) c(t + h x). It
displaces a free body by h^2 C_1 f/m more than h times the mean of its velocities at both ends. With
joints, this offset d is the solution of (``schemes.midpoint.load_moments``)

    M d = h^2 C_1 (f, m + r x f) - G^T mu ,   G d = 0 ;      u = h (v0 + v1)/2 + d ,  likewise Q

The work of the loads is then less by M (v1 - v0) . d/h, which again is exactly what the bodies
gain.

An expression is evaluated once in a step of the midpoint element, at the means, so such a load does
the work of one with the constant factor C = u. Its derivative has one more part: the load with the
factor 1 times du/dz. These loads are a group of their own, whose factors are the last results of
the signals. Source: the concentrated load of Hainge 2010, section 2.3.1; the discrete form is ours.
"""

from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.functions import Laws, evaluate, moments
from msahl.algebra.rotation import rotation_change
from msahl.algebra.vector import (
    Matrix,
    Vector,
    add,
    at,
    cross,
    dot,
    put,
    scale,
    skew_product,
)
from msahl.elements.constraints.products import Q_A, U_A
from msahl.formulations.absolute.equations import add_block, force_factor, moment_factor, push
from msahl.formulations.absolute.frames import (
    Frames,
    FramesWorkspace,
    direction,
    displacement_node,
    end_tangent,
    mean,
    point_arm,
    point_velocity,
    rotation_increment,
    tangent,
)
from msahl.jit.kernel import kernel, optional


class ConcentratedLoads(NamedTuple):
    """The group of all concentrated loads by laws of time, or of those by expressions."""

    frame: np.ndarray  # (k,)
    s: np.ndarray  # (k, 3) point from the mass centre, axes of the body [m]
    f: np.ndarray  # (k, 3) in the axes of body f_axes [N]
    f_axes: np.ndarray  # (k,)
    m: np.ndarray  # (k, 3) in the axes of body m_axes [N m]
    m_axes: np.ndarray  # (k,)
    law: np.ndarray  # (k,) factor in time, or -1
    force_by_rotation: np.ndarray  # (k,) start of the block by the rotation of f_axes
    moment_by_rotation: np.ndarray  # (k, 3) by the rotations of the body, of f_axes and of m_axes
    column: np.ndarray  # (k,) of the table of work


class ConcentratedWorkspace(NamedTuple):
    """Arm, force and moment at one configuration, multiplied by the factors; inertial axes."""

    r: np.ndarray  # (k, 3) [m]
    f: np.ndarray  # (k, 3) [N]
    m: np.ndarray  # (k, 3) [N m]
    factor: np.ndarray  # (k,) c, or C over a step or at a node
    first: np.ndarray  # (k,) C_1
    unit_f: np.ndarray  # (k, 3) f with the factor 1, where it has a first moment or an expression
    unit_m: np.ndarray  # (k, 3) likewise m + r x f


NEGLIGIBLE = 1e-15
"""First moment of a law, relative to its mean, that is round-off."""


def new_workspace(group: ConcentratedLoads | None) -> Any:
    """Return the arrays that ``prepare`` and ``over_step`` fill; None without group."""
    if group is None:
        return None
    k = group.frame.size
    return ConcentratedWorkspace(
        *(np.zeros((k, 3)) for _ in range(3)),
        *(np.zeros(k) for _ in range(2)),
        *(np.zeros((k, 3)) for _ in range(2)),
    )


@kernel
def at_time(group: ConcentratedLoads, laws: Laws, t: float, factor: np.ndarray) -> None:
    """Set the factors (k,) to the laws' values at the time ``t``."""
    for k in range(group.frame.size):
        factor[k] = 1.0 if group.law[k] < 0 else evaluate(laws, group.law[k], t)[0]


@kernel
def over_step(
    group: ConcentratedLoads,
    laws: Laws,
    t: float,
    h: float,
    R: np.ndarray,
    start: ConcentratedWorkspace,
) -> bool:
    """Prepare a step of the midpoint element; return whether a law has a first moment over it."""
    moved = False
    for k in range(group.frame.size):
        start.factor[k], start.first[k] = 1.0, 0.0
        if group.law[k] >= 0:
            values = moments(laws, group.law[k], t, h)
            start.factor[k] = values[0]
            if abs(values[1]) > NEGLIGIBLE * abs(values[0]):
                start.first[k] = -0.5 * values[1]
                moved = True
    prepare(group, start.factor, R, start)
    if moved:
        set_units(group, start, R)
    return moved


@optional()
def by_expressions(
    group: ConcentratedLoads, start: ConcentratedWorkspace, result: np.ndarray, R: np.ndarray
) -> None:
    """Prepare loads by expressions, whose factors are the last of the signals' results."""
    for k in range(group.frame.size):
        start.factor[k] = result[result.size - group.frame.size + k]
    prepare(group, start.factor, R, start)


@optional()
def set_units(group: ConcentratedLoads, start: ConcentratedWorkspace, R: np.ndarray) -> None:
    """Set the prepared loads with the factor 1."""
    for k in range(group.frame.size):
        f = direction(R, group.f_axes[k], at(group.f, k))
        m = direction(R, group.m_axes[k], at(group.m, k))
        put(start.unit_f, k, f)
        put(start.unit_m, k, moment(at(start.r, k), f, m))


@optional()
def set_mean_units(
    group: ConcentratedLoads,
    start: ConcentratedWorkspace,
    frames: Frames,
    R: np.ndarray,
    Z: np.ndarray,
) -> None:
    """Set the mean loads over a step of the midpoint element with the factor 1, likewise."""
    for k in range(group.frame.size):
        f_axes, m_axes = group.f_axes[k], group.m_axes[k]
        f = mean(frames, Z, f_axes, direction(R, f_axes, at(group.f, k)))
        m = mean(frames, Z, m_axes, direction(R, m_axes, at(group.m, k)))
        r = mean(frames, Z, group.frame[k], at(start.r, k))
        put(start.unit_f, k, f)
        put(start.unit_m, k, moment(r, f, m))


@optional()
def set_rows(
    group: ConcentratedLoads,
    start: ConcentratedWorkspace,
    frames: Frames,
    factor: float,
    k: int,
    row: np.ndarray,
) -> None:
    """Set ``row`` (4, 3) to what a factor of 1 of load ``k`` adds to the equations of its body:
    ``factor`` times the load by mass; k < 0: nothing.
    """
    if k >= 0:
        b = group.frame[k]
        put(row, U_A, scale(force_factor(frames, factor, b), at(start.unit_f, k)))
        put(row, Q_A, scale(moment_factor(frames, factor, b), at(start.unit_m, k)))


@kernel
def at_nodes(
    group: ConcentratedLoads,
    laws: Laws,
    t: float,
    h: float,
    from_moments: np.ndarray,
    factor: np.ndarray,
) -> None:
    """Set the factors (s, k) at the nodes of a collocation step; ``from_moments`` (s, s) are the
    weights of the laws' moments in them.
    """
    for k in range(group.frame.size):
        values = (1.0, 0.0, 0.0, 0.0, 0.0)
        if group.law[k] >= 0:
            values = moments(laws, group.law[k], t, h)
        for i in range(factor.shape[0]):
            factor[i, k] = 0.0
            for j in range(factor.shape[0]):
                factor[i, k] += from_moments[i, j] * values[j]


@kernel
def prepare(
    group: ConcentratedLoads, factor: np.ndarray, R: np.ndarray, start: ConcentratedWorkspace
) -> None:
    """Set arm, force and moment in inertial axes, multiplied by the factors (k,)."""
    for k in range(group.frame.size):
        c = factor[k]
        put(start.r, k, point_arm(R, group.frame[k], at(group.s, k)))
        put(start.f, k, scale(c, direction(R, group.f_axes[k], at(group.f, k))))
        put(start.m, k, scale(c, direction(R, group.m_axes[k], at(group.m, k))))


@kernel
def moment(r: Vector, f: Vector, m: Vector) -> Vector:
    """Return the moment about G of the force ``f`` at the arm ``r`` and of the moment ``m``."""
    return add(cross(r, f), m)


@optional()
def add_force(
    group: ConcentratedLoads, start: ConcentratedWorkspace, frames: Frames, F: np.ndarray
) -> None:
    """Add the loads by mass to the rows of their bodies."""
    for k in range(group.frame.size):
        r, f, m = at(start.r, k), at(start.f, k), at(start.m, k)
        push(frames, 1.0, F, group.frame[k], f, moment(r, f, m))


@optional()
def add_derivatives(
    group: ConcentratedLoads, start: ConcentratedWorkspace, frames: Frames, by_place: np.ndarray
) -> None:
    """Add the derivatives of the loads by mass by the rotations; rates do not change them."""
    for k in range(group.frame.size):
        b = group.frame[k]
        by_arm = tangent(frames, b, at(start.r, k))
        by_force = tangent(frames, group.f_axes[k], at(start.f, k))
        by_moment = tangent(frames, group.m_axes[k], at(start.m, k))
        acting = (at(start.r, k), at(start.f, k))
        _add_slopes(group, frames, k, 1.0, acting, (by_arm, by_force, by_moment), by_place)


@kernel
def _add_slopes(
    group: ConcentratedLoads,
    frames: Frames,
    k: int,
    factor: float,
    acting: tuple[Vector, Vector],
    tangents: tuple[Matrix, Matrix, Matrix],
    values: np.ndarray,
) -> None:
    """Add ``factor`` times the derivatives of force and moment of load ``k``, of which arm and
    force are ``acting``. Arm, force and moment change with the rotations by minus ``tangents``.
    """
    (r, f), (of_arm, of_force, of_moment) = acting, tangents
    c = moment_factor(frames, factor, group.frame[k])
    places = group.moment_by_rotation
    add_block(
        values,
        group.force_by_rotation[k],
        -force_factor(frames, factor, group.frame[k]),
        of_force,
    )
    add_block(values, places[k, 0], c, skew_product(f, of_arm))
    add_block(values, places[k, 1], -c, skew_product(r, of_force))
    add_block(values, places[k, 2], -c, of_moment)


@optional()
def add_power(
    group: ConcentratedLoads,
    start: ConcentratedWorkspace,
    motion: FramesWorkspace,
    dt: float,
    total: np.ndarray,
) -> None:
    """Add ``dt`` times the power [W] of each load to its column of ``total`` [J]."""
    for k in range(group.frame.size):
        b = group.frame[k]
        W = at(motion.W, b)
        V = point_velocity(motion, b, at(start.r, k))
        power = dot(at(start.f, k), V) + dot(at(start.m, k), W)
        total[group.column[k]] += power * dt


@optional()
def mean_residual(
    group: ConcentratedLoads,
    start: ConcentratedWorkspace,
    frames: Frames,
    factor: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Add ``factor`` times the mean loads by mass to the rows of their bodies."""
    for k in range(group.frame.size):
        b = group.frame[k]
        r = mean(frames, Z, b, at(start.r, k))
        f = mean(frames, Z, group.f_axes[k], at(start.f, k))
        m = mean(frames, Z, group.m_axes[k], at(start.m, k))
        push(frames, factor, F, b, f, moment(r, f, m))


@optional()
def mean_jacobian(
    group: ConcentratedLoads,
    start: ConcentratedWorkspace,
    frames: Frames,
    factor: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of ``mean_residual`` by the rotation increments."""
    for k in range(group.frame.size):
        b, axes_f, axes_m = group.frame[k], group.f_axes[k], group.m_axes[k]
        r = mean(frames, Z, b, at(start.r, k))
        f = mean(frames, Z, axes_f, at(start.f, k))
        by_arm = end_tangent(frames, Z, b, at(start.r, k))
        by_force = end_tangent(frames, Z, axes_f, at(start.f, k))
        by_moment = end_tangent(frames, Z, axes_m, at(start.m, k))
        # The mean moves by half as much as the end.
        tangents = (by_arm, by_force, by_moment)
        _add_slopes(group, frames, k, 0.5 * factor, (r, f), tangents, values)


@optional()
def mean_work(
    group: ConcentratedLoads,
    start: ConcentratedWorkspace,
    frames: Frames,
    Z: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work [J] of each mean load over the step to its column of ``total``."""
    for k in range(group.frame.size):
        b = group.frame[k]
        Q = rotation_increment(frames, Z, b)
        f = mean(frames, Z, group.f_axes[k], at(start.f, k))
        m = mean(frames, Z, group.m_axes[k], at(start.m, k))
        moved = add(at(Z, displacement_node(frames, b)), rotation_change(Q, at(start.r, k)))
        total[group.column[k]] += dot(f, moved) + dot(m, Q)


@kernel
def has_first(start: ConcentratedWorkspace) -> bool:
    """Return whether a law has a first moment over the step."""
    largest = 0.0
    for k in range(start.first.size):
        largest = max(largest, abs(start.first[k]))
    return largest > 0.0


@kernel
def add_first(
    group: ConcentratedLoads, start: ConcentratedWorkspace, frames: Frames, F: np.ndarray
) -> None:
    """Add the first moments of the loads by mass to the rows of their bodies."""
    for k in range(group.frame.size):
        c = start.first[k]
        f, m = scale(c, at(start.unit_f, k)), scale(c, at(start.unit_m, k))
        push(frames, 1.0, F, group.frame[k], f, m)


@kernel
def work_of_first(
    group: ConcentratedLoads,
    start: ConcentratedWorkspace,
    h: float,
    a: np.ndarray,
    alpha: np.ndarray,
    deficit: float,
    total: np.ndarray,
) -> None:
    """Add the work [J] of the first moments over a step with the accelerations ``a`` and ``alpha``
    (n+1, 3) to the columns of their loads.

    Their sum is ``-lost``. The part that goes through joints is shared out by the laws' moments.
    """
    size, rest = 0.0, -deficit
    for k in range(group.frame.size):
        b, c = group.frame[k], start.first[k]
        f, m = scale(c, at(start.unit_f, k)), scale(c, at(start.unit_m, k))
        work_done = -h * h * (dot(at(a, b), f) + dot(at(alpha, b), m))
        total[group.column[k]] += work_done
        rest -= work_done
        size += abs(start.first[k])
    for k in range(group.frame.size):
        total[group.column[k]] += rest * abs(start.first[k]) / size
