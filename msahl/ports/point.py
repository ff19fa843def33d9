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
    combine,
    cross,
    dot,
    multiple,
    product,
    put,
    scale,
    skew,
    skew_product,
)
from msahl.formulations.absolute.equations import add_slope, push
from msahl.formulations.absolute.frames import (
    Frames,
    FramesWorkspace,
    displacement_node,
    end_tangent,
    mean,
    point_arm,
    point_velocity,
    rotation_increment,
    tangent,
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


@kernel
def nodes(group: PointForces, k: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return where the blocks of force ``k`` start: by u, in the force and the moment equations of
    its body, and by l Q.
    """
    block = group.block
    return (block[k, 0], block[k, 2]), (block[k, 1], block[k, 3])


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
        push(frames, 1.0, F, group.frame[k], f, cross(at(arm, k), f))


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
        b, r = group.frame[k], skew(at(arm, k))
        V, T = velocity(group, arm, motion, k), tangent(frames, b, at(arm, k))
        by_V, lever = slope_of(group, k, V), skew_product(load_of(group, k, V), T)
        by_u, by_Q = nodes(group, k)
        by_W = multiple(-1.0, product(by_V, T))
        add_slope(frames, 1.0, by_rate, b, by_u, by_V, product(r, by_V))
        add_slope(frames, 1.0, by_rate, b, by_Q, by_W, product(r, by_W))
        by_arm = product(by_V, skew_product(scale(-1.0, at(motion.W, b)), T))
        add_slope(frames, 1.0, by_place, b, by_Q, by_arm, combine(1.0, product(r, by_arm), lever))


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
    factor: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Add ``factor`` times the mean forces by mass to the rows of their bodies."""
    for k in range(group.frame.size):
        b = group.frame[k]
        f = load_of(group, k, scale(1.0 / h, displacement(group, arm, frames, Z, k)))
        push(frames, factor, F, b, f, cross(mean(frames, Z, b, at(arm, k)), f))


@optional()
def mean_jacobian(
    group: PointForces,
    arm: np.ndarray,
    frames: Frames,
    h: float,
    factor: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of ``mean_residual`` by the unknowns."""
    for k in range(group.frame.size):
        b = group.frame[k]
        V = scale(1.0 / h, displacement(group, arm, frames, Z, k))
        T = end_tangent(frames, Z, b, at(arm, k))
        r = skew(mean(frames, Z, b, at(arm, k)))
        by_V, lever = slope_of(group, k, V), skew_product(load_of(group, k, V), T)
        by_u, by_Q = nodes(group, k)
        by_end = multiple(1.0 / h, by_V)
        by_rotation = multiple(-1.0, product(by_end, T))
        add_slope(frames, factor, values, b, by_u, by_end, product(r, by_end))
        of_moment = combine(0.5, lever, product(r, by_rotation))
        add_slope(frames, factor, values, b, by_Q, by_rotation, of_moment)


@optional()
def mean_work(
    group: PointForces, arm: np.ndarray, frames: Frames, h: float, Z: np.ndarray, total: np.ndarray
) -> None:
    """Add the work [J] of each mean force over the step to its column of ``total``."""
    for k in range(group.frame.size):
        moved = displacement(group, arm, frames, Z, k)
        f = load_of(group, k, scale(1.0 / h, moved))
        total[group.column[k]] += dot(f, moved)
