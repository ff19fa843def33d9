"""Quadratic drag on a point of a body, against its velocity relative to the inertial axes.

F = -c |V| V ,   V = (u + dr)/h      mean velocity of the point, c [N s^2/m^2]
work over the step = F . (u + dr)
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import turn_change
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
    times,
)
from msahl.elements.constraints.products import add_block
from msahl.elements.frames import (
    Frames,
    displacement_node,
    end_tangent,
    mean,
    push,
    rotation_increment,
)
from msahl.jit.kernel import kernel


class Drags(NamedTuple):
    """All drags."""

    body: np.ndarray  # (d,)
    s: np.ndarray  # (d, 3) point from the mass centre, axes of the body [m]
    coefficient: np.ndarray  # (d,) c
    block: np.ndarray  # (d, 4) starts of (u, u), (u, Q), (Q, u), (Q, Q) of the body


@kernel
def prepare(drags: Drags, R: np.ndarray, arm: np.ndarray) -> None:
    """Carry the arms into inertial axes (d, 3)."""
    for k in range(drags.body.size):
        put(arm, k, times(matrix_at(R, drags.body[k]), at(drags.s, k)))


@kernel
def displacement(drags: Drags, arm: np.ndarray, frames: Frames, Z: np.ndarray, k: int) -> Vector:
    """Displacement of the point over the step."""
    b = drags.body[k]
    return add(
        at(Z, displacement_node(frames, b)),
        turn_change(rotation_increment(frames, Z, b), at(arm, k)),
    )


@kernel
def drag(c: float, V: Vector) -> Vector:
    """Force at the velocity V."""
    return scale(-c * math.sqrt(dot(V, V)), V)


@kernel
def residual(
    drags: Drags,
    arm: np.ndarray,
    frames: Frames,
    h: float,
    dt2: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Take the drags from the rows of their bodies."""
    for k in range(drags.body.size):
        b = drags.body[k]
        f = drag(drags.coefficient[k], scale(1.0 / h, displacement(drags, arm, frames, Z, k)))
        push(frames, dt2, F, b, f, cross(mean(frames, Z, b, at(arm, k)), f))


@kernel
def drag_slope(c: float, V: Vector) -> Matrix:
    """Derivative of the force by the velocity."""
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
def jacobian(
    drags: Drags,
    arm: np.ndarray,
    frames: Frames,
    h: float,
    dt2: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives."""
    for k in range(drags.body.size):
        b = drags.body[k]
        V = scale(1.0 / h, displacement(drags, arm, frames, Z, k))
        by_V = drag_slope(drags.coefficient[k], V)
        T = end_tangent(frames, Z, b, at(arm, k))
        r = skew(mean(frames, Z, b, at(arm, k)))
        by_Q = product(by_V, T)
        c = dt2 * frames.inverse_mass[b]
        c_turn = c / frames.length[b]
        lever = product(skew(drag(drags.coefficient[k], V)), T)
        add_block(values, drags.block[k, 0], -c / h, by_V)
        add_block(values, drags.block[k, 1], c / h, by_Q)
        add_block(values, drags.block[k, 2], -c_turn / h, product(r, by_V))
        add_block(values, drags.block[k, 3], c_turn / h, product(r, by_Q))
        add_block(values, drags.block[k, 3], -0.5 * c_turn, lever)


@kernel
def free_acceleration(
    drags: Drags, arm: np.ndarray, frames: Frames, v: np.ndarray, W: np.ndarray, F: np.ndarray
) -> None:
    """Add the drags at the start to the rows of their bodies."""
    for k in range(drags.body.size):
        b = drags.body[k]
        f = drag(drags.coefficient[k], add(at(v, b), cross(at(W, b), at(arm, k))))
        push(frames, 1.0, F, b, scale(-1.0, f), cross(f, at(arm, k)))


@kernel
def work(
    drags: Drags,
    arm: np.ndarray,
    frames: Frames,
    h: float,
    Z: np.ndarray,
    column: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work [J] over the step to its ``column`` of ``total``."""
    for k in range(drags.body.size):
        moved = displacement(drags, arm, frames, Z, k)
        total[column[k]] += dot(drag(drags.coefficient[k], scale(1.0 / h, moved)), moved)


@kernel
def free_jacobian(
    drags: Drags,
    arm: np.ndarray,
    frames: Frames,
    v: np.ndarray,
    W: np.ndarray,
    by_place: np.ndarray,
    by_rate: np.ndarray,
) -> None:
    """Add half the derivative of ``free_acceleration`` by the places, all of it by the rates."""
    for k in range(drags.body.size):
        b = drags.body[k]
        length, r = frames.length[b], skew(at(arm, k))
        V = add(at(v, b), cross(at(W, b), at(arm, k)))
        by_V, f = drag_slope(drags.coefficient[k], V), skew(drag(drags.coefficient[k], V))
        c = frames.inverse_mass[b]
        by_W, lever = product(by_V, r), product(r, by_V)
        add_block(by_rate, drags.block[k, 0], c, by_V)
        add_block(by_rate, drags.block[k, 1], -c / length, by_W)
        add_block(by_rate, drags.block[k, 2], c / length, lever)
        add_block(by_rate, drags.block[k, 3], -c / length**2, product(r, by_W))
        by_arm = product(by_V, product(skew(at(W, b)), r))
        add_block(by_place, drags.block[k, 1], -0.5 * c / length, by_arm)
        add_block(by_place, drags.block[k, 3], -0.5 * c / length**2, product(r, by_arm))
        add_block(by_place, drags.block[k, 3], 0.5 * c / length**2, product(f, r))


@kernel
def free_work(
    drags: Drags,
    arm: np.ndarray,
    v: np.ndarray,
    W: np.ndarray,
    dt: float,
    column: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work [J] at these velocities over a time ``dt`` to its ``column`` of ``total``."""
    for k in range(drags.body.size):
        V = add(at(v, drags.body[k]), cross(at(W, drags.body[k]), at(arm, k)))
        total[column[k]] += dot(drag(drags.coefficient[k], V), V) * dt
