"""Quadratic drag on a point of a body, against its velocity relative to the inertial axes.

At one configuration

    F = -c |V| V                  force at the point [N]
    M = r x F                     moment about the mass centre G [N m]
    V = v + W x r                 velocity of the point [m/s]
    dF/dV = -c (|V| 1 + V V^T/|V|)
    P = F . V                     power [W]

c     drag coefficient [N s^2/m^2]
r     arm from G to the point, fixed in the body, inertial axes [m]
v, W  velocity of G [m/s], angular velocity [rad/s]

Discrete form over a step of size h of the midpoint element: V = (u + dr)/h, the mean velocity of
the point, and mean(r) in place of r. The work is F . (u + dr). Source: the law of Newton's drag in
any textbook; the discrete form is ours.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import rotation_change
from msahl.algebra.vector import (
    IDENTITY,
    Matrix,
    Vector,
    add,
    at,
    cross,
    dot,
    matrix_at,
    multiple,
    product,
    put,
    scale,
    skew,
    skew_product,
    times,
)
from msahl.elements.constraints.products import add_block
from msahl.elements.frames import (
    Frames,
    FramesWorkspace,
    add_force_by_mass,
    displacement_node,
    end_tangent,
    mean,
    push,
    rotation_increment,
)
from msahl.jit.kernel import kernel


class Drags(NamedTuple):
    """The group of all drags."""

    frame: np.ndarray  # (d,)
    s: np.ndarray  # (d, 3) point from the mass centre, axes of the body [m]
    coefficient: np.ndarray  # (d,) c
    block: np.ndarray  # (d, 4) starts of (u, u), (u, Q), (Q, u), (Q, Q) of the body
    column: np.ndarray  # (d,) of the table of work


@kernel
def force(c: float, V: Vector) -> Vector:
    """Return F at the velocity V."""
    return scale(-c * math.sqrt(dot(V, V)), V)


@kernel
def force_slope(c: float, V: Vector) -> Matrix:
    """Return dF/dV at the velocity V."""
    speed = math.sqrt(dot(V, V))
    if speed == 0.0:
        return ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    rows = (
        add(scale(speed, IDENTITY[0]), scale(V[0] / speed, V)),
        add(scale(speed, IDENTITY[1]), scale(V[1] / speed, V)),
        add(scale(speed, IDENTITY[2]), scale(V[2] / speed, V)),
    )
    return multiple(-c, rows)


@kernel
def prepare(group: Drags, R: np.ndarray, arm: np.ndarray) -> None:
    """Set the arms r (d, 3) in inertial axes."""
    for k in range(group.frame.size):
        put(arm, k, times(matrix_at(R, group.frame[k]), at(group.s, k)))


@kernel
def velocity(group: Drags, arm: np.ndarray, motion: FramesWorkspace, k: int) -> Vector:
    """Return the velocity V of the point at one configuration."""
    b = group.frame[k]
    return add(at(motion.v, b), cross(at(motion.W, b), at(arm, k)))


@kernel
def add_force(
    group: Drags, arm: np.ndarray, frames: Frames, motion: FramesWorkspace, F: np.ndarray
) -> None:
    """Add the drags by mass to the rows of their bodies."""
    for k in range(group.frame.size):
        f = force(group.coefficient[k], velocity(group, arm, motion, k))
        add_force_by_mass(frames, F, group.frame[k], f, cross(at(arm, k), f))


@kernel
def add_derivatives(
    group: Drags,
    arm: np.ndarray,
    frames: Frames,
    motion: FramesWorkspace,
    by_place: np.ndarray,
    by_rate: np.ndarray,
) -> None:
    """Add the derivatives of the drags by mass by the places and by the rates."""
    for k in range(group.frame.size):
        b = group.frame[k]
        length, r = frames.length[b], skew(at(arm, k))
        V = velocity(group, arm, motion, k)
        by_V, f = force_slope(group.coefficient[k], V), skew(force(group.coefficient[k], V))
        c = frames.inverse_mass[b]
        by_W, lever = product(by_V, r), product(r, by_V)
        add_block(by_rate, group.block[k, 0], c, by_V)
        add_block(by_rate, group.block[k, 1], -c / length, by_W)
        add_block(by_rate, group.block[k, 2], c / length, lever)
        add_block(by_rate, group.block[k, 3], -c / length**2, product(r, by_W))
        by_arm = product(by_V, skew_product(at(motion.W, b), r))
        add_block(by_place, group.block[k, 1], -c / length, by_arm)
        add_block(by_place, group.block[k, 3], -c / length**2, product(r, by_arm))
        add_block(by_place, group.block[k, 3], c / length**2, product(f, r))


@kernel
def add_power(
    group: Drags,
    arm: np.ndarray,
    motion: FramesWorkspace,
    dt: float,
    total: np.ndarray,
) -> None:
    """Add ``dt`` times the power [W] of each drag to its column of ``total`` [J]."""
    for k in range(group.frame.size):
        V = velocity(group, arm, motion, k)
        total[group.column[k]] += dot(force(group.coefficient[k], V), V) * dt


@kernel
def displacement(group: Drags, arm: np.ndarray, frames: Frames, Z: np.ndarray, k: int) -> Vector:
    """Return the displacement u + dr of the point over the step."""
    b = group.frame[k]
    return add(
        at(Z, displacement_node(frames, b)),
        rotation_change(rotation_increment(frames, Z, b), at(arm, k)),
    )


@kernel
def mean_residual(
    group: Drags,
    arm: np.ndarray,
    frames: Frames,
    h: float,
    dt2: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Subtract the mean drags from the equations of their bodies."""
    for k in range(group.frame.size):
        b = group.frame[k]
        f = force(group.coefficient[k], scale(1.0 / h, displacement(group, arm, frames, Z, k)))
        push(frames, dt2, F, b, f, cross(mean(frames, Z, b, at(arm, k)), f))


@kernel
def mean_jacobian(
    group: Drags,
    arm: np.ndarray,
    frames: Frames,
    h: float,
    dt2: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of ``mean_residual`` by the unknowns."""
    for k in range(group.frame.size):
        b = group.frame[k]
        V = scale(1.0 / h, displacement(group, arm, frames, Z, k))
        by_V = force_slope(group.coefficient[k], V)
        T = end_tangent(frames, Z, b, at(arm, k))
        r = skew(mean(frames, Z, b, at(arm, k)))
        by_Q = product(by_V, T)
        c = dt2 * frames.inverse_mass[b]
        c_rotation = c / frames.length[b]
        lever = skew_product(force(group.coefficient[k], V), T)
        add_block(values, group.block[k, 0], -c / h, by_V)
        add_block(values, group.block[k, 1], c / h, by_Q)
        add_block(values, group.block[k, 2], -c_rotation / h, product(r, by_V))
        add_block(values, group.block[k, 3], c_rotation / h, product(r, by_Q))
        add_block(values, group.block[k, 3], -0.5 * c_rotation, lever)


@kernel
def mean_work(
    group: Drags, arm: np.ndarray, frames: Frames, h: float, Z: np.ndarray, total: np.ndarray
) -> None:
    """Add the work [J] of each mean drag over the step to its column of ``total``."""
    for k in range(group.frame.size):
        moved = displacement(group, arm, frames, Z, k)
        f = force(group.coefficient[k], scale(1.0 / h, moved))
        total[group.column[k]] += dot(f, moved)
