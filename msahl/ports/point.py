"""Forces at points of bodies by laws ``F = load(c, V)`` of the point's velocity (``msahl.laws``).

At one configuration

    V = v + W x r                 velocity of the point [m/s]
    M = r x F                     moment about the mass centre G [N m]
    P = F . V                     power [W]

r     arm from G to the point, fixed in the body, inertial axes [m]
v, W  velocity of G [m/s], angular velocity [rad/s]

Over a step of size h of the midpoint element: V = (u + dr)/h, the mean velocity of the point, and
mean(r) in place of r. The work is F . (u + dr).
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import rotation_change
from msahl.algebra.vector import (
    Matrix,
    Vector,
    add,
    at,
    cross,
    dot,
    product,
    put,
    scale,
    skew,
    skew_product,
)
from msahl.elements.constraints.products import add_block
from msahl.elements.frames import (
    Frames,
    FramesWorkspace,
    add_force_by_mass,
    displacement_node,
    end_tangent,
    mean,
    point_arm,
    point_velocity,
    push,
    rotation_increment,
)
from msahl.jit.kernel import choice, kernel, optional
from msahl.laws.registry import POINT_LAWS


class PointForces(NamedTuple):
    """The group of all forces at points."""

    law: np.ndarray  # (k,) number in ``POINT_LAWS``
    frame: np.ndarray  # (k,)
    s: np.ndarray  # (k, 3) point from the mass centre, axes of the body [m]
    constants: np.ndarray  # (k, p) numbers c of the law
    block: np.ndarray  # (k, 4) starts of (u, u), (u, Q), (Q, u), (Q, Q) of the body
    column: np.ndarray  # (k,) of the table of work


load = choice(__name__, "load", [law.load for law in POINT_LAWS.values()])
slope = choice(__name__, "slope", [law.slope for law in POINT_LAWS.values()])


def new_arms(group: PointForces | None) -> np.ndarray:
    """Return the array that ``prepare`` fills."""
    return np.zeros((0, 3)) if group is None else np.zeros_like(group.s)


@kernel
def load_of(group: PointForces, k: int, V: Vector) -> Vector:
    """Return force ``k`` at the velocity ``V`` of its point."""
    return load(group.law[k], group.constants[k], V)


@kernel
def slope_of(group: PointForces, k: int, V: Vector) -> Matrix:
    """Return the derivative of force ``k`` by the velocity ``V``."""
    return slope(group.law[k], group.constants[k], V)


@optional()
def prepare(group: PointForces, R: np.ndarray, arm: np.ndarray) -> None:
    """Set the arms r (k, 3) in inertial axes."""
    for k in range(group.frame.size):
        put(arm, k, point_arm(R, group.frame[k], at(group.s, k)))


@kernel
def velocity(group: PointForces, arm: np.ndarray, motion: FramesWorkspace, k: int) -> Vector:
    """Return the velocity V of the point at one configuration."""
    return point_velocity(motion, group.frame[k], at(arm, k))


@optional()
def add_force(
    group: PointForces, arm: np.ndarray, frames: Frames, motion: FramesWorkspace, F: np.ndarray
) -> None:
    """Add the forces by mass to the rows of their bodies."""
    for k in range(group.frame.size):
        f = load_of(group, k, velocity(group, arm, motion, k))
        add_force_by_mass(frames, F, group.frame[k], f, cross(at(arm, k), f))


@optional()
def add_derivatives(
    group: PointForces,
    arm: np.ndarray,
    frames: Frames,
    motion: FramesWorkspace,
    by_place: np.ndarray,
    by_rate: np.ndarray,
) -> None:
    """Add the derivatives of the forces by mass by the places and by the rates."""
    for k in range(group.frame.size):
        b = group.frame[k]
        length, r = frames.length[b], skew(at(arm, k))
        V = velocity(group, arm, motion, k)
        by_V, f = slope_of(group, k, V), skew(load_of(group, k, V))
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


@optional()
def add_power(
    group: PointForces,
    arm: np.ndarray,
    motion: FramesWorkspace,
    dt: float,
    total: np.ndarray,
) -> None:
    """Add ``dt`` times the power [W] of each force to its column of ``total`` [J]."""
    for k in range(group.frame.size):
        V = velocity(group, arm, motion, k)
        total[group.column[k]] += dot(load_of(group, k, V), V) * dt


@kernel
def displacement(
    group: PointForces, arm: np.ndarray, frames: Frames, Z: np.ndarray, k: int
) -> Vector:
    """Return the displacement u + dr of the point over the step."""
    b = group.frame[k]
    return add(
        at(Z, displacement_node(frames, b)),
        rotation_change(rotation_increment(frames, Z, b), at(arm, k)),
    )


@optional()
def mean_residual(
    group: PointForces,
    arm: np.ndarray,
    frames: Frames,
    h: float,
    dt2: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Subtract the mean forces from the equations of their bodies."""
    for k in range(group.frame.size):
        b = group.frame[k]
        f = load_of(group, k, scale(1.0 / h, displacement(group, arm, frames, Z, k)))
        push(frames, dt2, F, b, f, cross(mean(frames, Z, b, at(arm, k)), f))


@optional()
def mean_jacobian(
    group: PointForces,
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
        by_V = slope_of(group, k, V)
        T = end_tangent(frames, Z, b, at(arm, k))
        r = skew(mean(frames, Z, b, at(arm, k)))
        by_Q = product(by_V, T)
        c = dt2 * frames.inverse_mass[b]
        c_rotation = c / frames.length[b]
        lever = skew_product(load_of(group, k, V), T)
        add_block(values, group.block[k, 0], -c / h, by_V)
        add_block(values, group.block[k, 1], c / h, by_Q)
        add_block(values, group.block[k, 2], -c_rotation / h, product(r, by_V))
        add_block(values, group.block[k, 3], c_rotation / h, product(r, by_Q))
        add_block(values, group.block[k, 3], -0.5 * c_rotation, lever)


@optional()
def mean_work(
    group: PointForces, arm: np.ndarray, frames: Frames, h: float, Z: np.ndarray, total: np.ndarray
) -> None:
    """Add the work [J] of each mean force over the step to its column of ``total``."""
    for k in range(group.frame.size):
        moved = displacement(group, arm, frames, Z, k)
        f = load_of(group, k, scale(1.0 / h, moved))
        total[group.column[k]] += dot(f, moved)
