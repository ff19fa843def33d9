"""Frames: places with a position, an orientation, a velocity and an angular velocity.

Joints, forces and mass elements attach to frames. A rigid body carries one frame, at its mass
centre; the last frame is the ground, which never moves. Over a step a frame has two unknowns of
three components each, and two equations of three components each:

    u       displacement of its origin, inertial axes [m]              force equations
    l Q     l times its rotation increment Q, inertial axes [m]        moment equations

    l       length of the frame, which makes a rotation a displacement [m]
    m       mass of the frame, by which its equations are divided [kg]

The node map says where they stand: node k holds the unknowns and equations 3 k, 3 k + 1, 3 k + 2.
The nodes of the frames come first, those of the multipliers after them.

Force equations are divided by m and moment equations by m l (``equations``). The ground has
1/m = 0: what acts on it has no effect on its equations, so no element asks whether a frame is the
ground.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import matrix, rotation_change, rotation_tangent
from msahl.algebra.vector import (
    ZERO,
    Matrix,
    Vector,
    add,
    at,
    axpy,
    cross,
    matrix_at,
    multiple,
    put,
    put_matrix,
    scale,
    skew,
    skew_product,
    sub,
    times,
)
from msahl.jit.kernel import kernel

NODES = 2
"""Nodes of a frame: one for its displacement, one for its rotation."""


class Frames(NamedTuple):
    """All frames; the ground is the last one."""

    displacement: np.ndarray  # (f,) node of u and of the force equations
    rotation: np.ndarray  # (f,) node of l Q and of the moment equations
    of_node: np.ndarray  # (2 f,) frame of each of these nodes
    rotates: np.ndarray  # (2 f,) whether the node is one of a rotation
    owner: np.ndarray  # (f,) number of the rigid body that carries it; -1 for the ground
    inverse_mass: np.ndarray  # (f,) 1/m; 0 for the ground [1/kg]
    length: np.ndarray  # (f,) l [m]
    exponential: bool  # whether psi Q, and not Q itself, is h times the mean W (``rigid_body``)
    ballistic: np.ndarray  # (f,) whether nothing but gravity acts on it
    moves: np.ndarray  # (2, 3) 0 for components of u and v, of Q and W, that are always zero, or 1


class FramesWorkspace(NamedTuple):
    """The frames' motion at the start of the step, inertial axes (f, 3)."""

    R: np.ndarray  # (f, 3, 3) frame to inertial axes
    v: np.ndarray  # velocity of the origin [m/s]
    W: np.ndarray  # angular velocity [rad/s]
    v_go: np.ndarray  # velocity over the step if no force acted [m/s]
    W_go: np.ndarray  # likewise the angular velocity [rad/s]
    v_offset: np.ndarray  # part of v_go due to the loads' first moments, d/h [m/s]
    W_offset: np.ndarray  # likewise of W_go [rad/s]


@kernel
def frame_count(frames: Frames) -> int:
    """Number of frames, the ground included."""
    return frames.length.size


@kernel
def moving_count(frames: Frames) -> int:
    """Number of frames that can move; these are the first ones."""
    return frames.length.size - 1


@kernel
def ground_of(frames: Frames) -> int:
    """Index of the ground."""
    return frames.length.size - 1


@kernel
def first_multiplier(frames: Frames) -> int:
    """Number of the first node that holds multipliers."""
    return NODES * frames.length.size


@kernel
def displacement_node(frames: Frames, f: int) -> int:
    """Node of the displacement u of frame ``f`` and of its force equations."""
    node: int = frames.displacement[f]
    return node


@kernel
def rotation_node(frames: Frames, f: int) -> int:
    """Node of l Q of frame ``f`` and of its moment equations."""
    node: int = frames.rotation[f]
    return node


@kernel
def displacement(frames: Frames, Z: np.ndarray, f: int) -> Vector:
    """Displacement u [m] of frame ``f`` in the unknowns ``Z``."""
    return at(Z, displacement_node(frames, f))


@kernel
def rotation_increment(frames: Frames, Z: np.ndarray, f: int) -> Vector:
    """Rotation increment Q of frame ``f`` in the unknowns ``Z``, which hold l Q."""
    return scale(1.0 / frames.length[f], at(Z, rotation_node(frames, f)))


@kernel
def put_rotation(frames: Frames, Z: np.ndarray, f: int, Q: Vector) -> None:
    """Set the unknowns l Q of frame ``f`` in ``Z`` to those of the rotation ``Q``."""
    put(Z, rotation_node(frames, f), scale(frames.length[f], Q))


@kernel
def point_arm(R: np.ndarray, f: int, s: Vector) -> Vector:
    """Vector from the origin of frame ``f`` to its point ``s`` (axes of the frame), inertial axes
    [m]; ``R`` (f, 3, 3) are the frames' orientations.
    """
    return times(matrix_at(R, f), s)


@kernel
def direction(R: np.ndarray, f: int, e: Vector) -> Vector:
    """A vector ``e`` in the axes of frame ``f``, carried into inertial axes, likewise."""
    return times(matrix_at(R, f), e)


@kernel
def point_velocity(motion: FramesWorkspace, f: int, r: Vector) -> Vector:
    """Velocity of the point of frame ``f`` with the arm r (``point_arm``), inertial axes [m/s]."""
    return add(at(motion.v, f), cross(at(motion.W, f), r))


@kernel
def restrict(frames: Frames, kind: int, a: Vector) -> Vector:
    """A displacement or velocity ``a`` (``kind`` 0), or one of rotation (1), without the components
    that a planar system does not have.

    These are not solved for. Their round-off would be multiplied by the extrapolation from each
    step to the next, so they are set to exactly zero.
    """
    moves = frames.moves
    return (moves[kind, 0] * a[0], moves[kind, 1] * a[1], moves[kind, 2] * a[2])


@kernel
def mean(frames: Frames, Z: np.ndarray, f: int, a: Vector) -> Vector:
    """Mean over the step of a vector fixed in frame ``f`` that is ``a`` at the start."""
    return axpy(0.5, rotation_change(rotation_increment(frames, Z, f), a), a)


@kernel
def tangent(frames: Frames, f: int, a: Vector) -> Matrix:
    """Matrix T with da = -T d(l theta), of a vector ``a`` fixed in frame ``f``."""
    return multiple(1.0 / frames.length[f], skew(a))


@kernel
def end_tangent(frames: Frames, Z: np.ndarray, f: int, a: Vector) -> Matrix:
    """Matrix T with d(R(Q) a) = -T d(l Q)."""
    Q = rotation_increment(frames, Z, f)
    T = skew_product(add(a, rotation_change(Q, a)), rotation_tangent(Q))
    c = 1.0 / frames.length[f]
    return multiple(c, T)


@kernel
def prepare(
    frames: Frames,
    p: np.ndarray,
    v: np.ndarray,
    w: np.ndarray,
    v_rise: np.ndarray,
    w_rise: np.ndarray,
    chi: float,
    start: FramesWorkspace,
) -> None:
    """Carry the velocities of the accepted state into inertial axes."""
    for f in range(frame_count(frames)):
        R = matrix(at(p, f))
        put_matrix(start.R, f, R)
        put(start.v, f, restrict(frames, 0, at(v, f)))
        put(start.W, f, restrict(frames, 1, times(R, at(w, f))))
        put(start.v_go, f, at(start.v, f))
        put(start.W_go, f, at(start.W, f))
        if chi > 0.0:
            v_go = axpy(-0.5 * chi, at(v_rise, f), at(v, f))
            w_go = axpy(-0.5 * chi, at(w_rise, f), at(w, f))
            put(start.v_go, f, restrict(frames, 0, v_go))
            put(start.W_go, f, restrict(frames, 1, times(R, w_go)))
        put(start.v_offset, f, ZERO)
        put(start.W_offset, f, ZERO)


@kernel
def offset(start: FramesWorkspace, f: int, dv: Vector, dW: Vector) -> None:
    """Set the part of the velocities v_go, W_go of frame ``f`` that is due to the loads' first
    moments.
    """
    put(start.v_go, f, add(at(start.v_go, f), sub(dv, at(start.v_offset, f))))
    put(start.W_go, f, add(at(start.W_go, f), sub(dW, at(start.W_offset, f))))
    put(start.v_offset, f, dv)
    put(start.W_offset, f, dW)
