"""Primitive ``coincide``: a point of body b stays at a point of body a (bodies may be ground).

    g     = (x_b + r_b) - (x_a + r_a)                           (3,) [m], inertial axes
    force = lam on b at the point, -lam on a                     lam (3,) [N], mean over the step
    T_b   = mean(r_b) x lam,  T_a = -mean(r_a) x lam            [N m] about the mass centres

r = R s is the arm from the mass centre to the point. With the mean arms (r0 + r1)/2 the work over
the step is lam . (g1 - g0) exactly, so a closed joint does none, whatever h.

The unknown is lam dt2/m with 1/m = 1/m_a + 1/m_b, a length. The violation is summed by increments,
g1 = g0 + (u_b + dr_b) - (u_a + dr_a), so it carries round-off of the step's displacement, not of
the distance from the origin; g0 is what the last solution left over.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import rotation_change
from msahl.algebra.vector import (
    add,
    at,
    axpy,
    cross,
    put,
    scale,
    skew,
    skew_product,
    sub,
)
from msahl.formulations.absolute.equations import moment_factor, push
from msahl.formulations.absolute.frames import (
    Frames,
    FramesWorkspace,
    displacement,
    end_tangent,
    mean,
    point_arm,
    point_velocity,
    rotation_increment,
    tangent,
)
from msahl.jit.kernel import kernel


class Coincide(NamedTuple):
    """The group of all pairs of coinciding points."""

    a: np.ndarray  # (k,) parent bodies
    b: np.ndarray  # (k,) child bodies
    s_a: np.ndarray  # (k, 3) from the mass centre of a (ground: the origin), axes of a [m]
    s_b: np.ndarray  # (k, 3) likewise of b [m]
    mass: np.ndarray  # (k,) m, the mass that scales the multiplier [kg]
    row: np.ndarray  # (k,) node of the multiplier and of the equation
    moment_by_rotation: np.ndarray  # (k, 2) starts of the blocks of a and b
    moment_by_force: np.ndarray  # (k, 2)
    constraint_by_rotation: np.ndarray  # (k, 2)


class CoincideWorkspace(NamedTuple):
    """Arms at the start of the step in inertial axes (k, 3) [m], and the violation left there."""

    r_a: np.ndarray
    r_b: np.ndarray
    violation: np.ndarray


@kernel
def prepare(group: Coincide, R: np.ndarray, start: CoincideWorkspace) -> None:
    """Carry the arms into inertial axes."""
    for k in range(group.a.size):
        put(start.r_a, k, point_arm(R, group.a[k], at(group.s_a, k)))
        put(start.r_b, k, point_arm(R, group.b[k], at(group.s_b, k)))


@kernel
def add_force(
    group: Coincide, start: CoincideWorkspace, frames: Frames, Z: np.ndarray, F: np.ndarray
) -> None:
    """Add the joint forces by mass at one configuration to the rows of the frames; ``Z`` holds the
    multipliers by mass.
    """
    for k in range(group.a.size):
        a, b = group.a[k], group.b[k]
        force = scale(group.mass[k], at(Z, group.row[k]))
        push(frames, 1.0, F, a, scale(-1.0, force), cross(force, at(start.r_a, k)))
        push(frames, 1.0, F, b, force, cross(at(start.r_b, k), force))


@kernel
def add_derivatives(
    group: Coincide, start: CoincideWorkspace, frames: Frames, Z: np.ndarray, values: np.ndarray
) -> None:
    """Set the derivatives at one configuration: of ``add_force`` by the multipliers, and of the
    violation by the rotations; add those of ``add_force`` by the rotations.
    """
    for k in range(group.a.size):
        force = scale(group.mass[k], at(Z, group.row[k]))
        for side in range(2):
            b = group.a[k] if side == 0 else group.b[k]
            r = at(start.r_a, k) if side == 0 else at(start.r_b, k)
            sign = -1.0 if side == 0 else 1.0
            arm = skew(r)
            T = tangent(frames, b, r)
            lever = skew_product(force, T)
            c = moment_factor(frames, sign, b)
            for i in range(3):
                for j in range(3):
                    ij = 3 * i + j
                    values[group.constraint_by_rotation[k, side] + ij] = -sign * T[i][j]
                    values[group.moment_by_force[k, side] + ij] = c * group.mass[k] * arm[i][j]
                    values[group.moment_by_rotation[k, side] + ij] += c * lever[i][j]


@kernel
def residual(
    group: Coincide,
    start: CoincideWorkspace,
    frames: Frames,
    dt2: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Take the mean joint forces over a step of the midpoint element from the frames' equations,
    and set those of the violation; the unknowns in ``Z`` are dt2 times the multipliers by mass.
    """
    for k in range(group.a.size):
        a, b = group.a[k], group.b[k]
        force = scale(group.mass[k] / dt2, at(Z, group.row[k]))
        r_a, r_b = at(start.r_a, k), at(start.r_b, k)
        dr_a = rotation_change(rotation_increment(frames, Z, a), r_a)
        dr_b = rotation_change(rotation_increment(frames, Z, b), r_b)
        push(frames, -dt2, F, a, scale(-1.0, force), cross(force, axpy(0.5, dr_a, r_a)))
        push(frames, -dt2, F, b, force, cross(axpy(0.5, dr_b, r_b), force))
        moved = sub(add(displacement(frames, Z, b), dr_b), add(displacement(frames, Z, a), dr_a))
        put(F, group.row[k], add(at(start.violation, k), moved))


@kernel
def set_violations(
    group: Coincide, start: CoincideWorkspace, frames: Frames, Z: np.ndarray, F: np.ndarray
) -> None:
    """Set the constraint equations to the violations at the end of the step [m]."""
    for k in range(group.a.size):
        a, b = group.a[k], group.b[k]
        dr_a = rotation_change(rotation_increment(frames, Z, a), at(start.r_a, k))
        dr_b = rotation_change(rotation_increment(frames, Z, b), at(start.r_b, k))
        moved = sub(add(displacement(frames, Z, b), dr_b), add(displacement(frames, Z, a), dr_a))
        put(F, group.row[k], add(at(start.violation, k), moved))


@kernel
def jacobian(
    group: Coincide,
    start: CoincideWorkspace,
    frames: Frames,
    dt2: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives that depend on the rotations and on the force."""
    for k in range(group.a.size):
        force = scale(group.mass[k] / dt2, at(Z, group.row[k]))
        for side in range(2):
            b = group.a[k] if side == 0 else group.b[k]
            r0 = at(start.r_a, k) if side == 0 else at(start.r_b, k)
            sign = -1.0 if side == 0 else 1.0
            T = end_tangent(frames, Z, b, r0)
            arm = skew(mean(frames, Z, b, r0))
            lever = skew_product(force, T)
            c = moment_factor(frames, sign, b)
            for i in range(3):
                for j in range(3):
                    ij = 3 * i + j
                    values[group.constraint_by_rotation[k, side] + ij] = -sign * T[i][j]
                    values[group.moment_by_force[k, side] + ij] = -c * group.mass[k] * arm[i][j]
                    values[group.moment_by_rotation[k, side] + ij] -= 0.5 * dt2 * c * lever[i][j]


@kernel
def violation(group: Coincide, start: CoincideWorkspace, x: np.ndarray, out: np.ndarray) -> None:
    """Set ``out`` (k, 3) to child point minus parent point [m], from absolute positions."""
    for k in range(group.a.size):
        P_a = add(at(x, group.a[k]), at(start.r_a, k))
        P_b = add(at(x, group.b[k]), at(start.r_b, k))
        put(out, k, sub(P_b, P_a))


@kernel
def violation_rate(
    group: Coincide, start: CoincideWorkspace, frames: FramesWorkspace, out: np.ndarray
) -> None:
    """Set ``out`` (k, 3) to the velocity [m/s] of child point relative to parent point."""
    for k in range(group.a.size):
        a, b = group.a[k], group.b[k]
        v_a = point_velocity(frames, a, at(start.r_a, k))
        v_b = point_velocity(frames, b, at(start.r_b, k))
        put(out, k, sub(v_b, v_a))


@kernel
def free_acceleration(
    group: Coincide, start: CoincideWorkspace, W: np.ndarray, F: np.ndarray
) -> None:
    """Set the constraint equations to minus the violations' second derivatives [m/s^2] at zero
    accelerations of the frames.
    """
    for k in range(group.a.size):
        W_a, W_b = at(W, group.a[k]), at(W, group.b[k])
        centripetal_a = cross(W_a, cross(W_a, at(start.r_a, k)))
        centripetal_b = cross(W_b, cross(W_b, at(start.r_b, k)))
        put(F, group.row[k], sub(centripetal_a, centripetal_b))
