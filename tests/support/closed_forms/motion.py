"""Describe a single body, free or on one joint to the ground, and its motion in time."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from msahl.algebra.rotation import matrix
from msahl.model import Joint, Load, Model
from msahl.model.bodies import RigidBody
from msahl.study.dynamics import first_state

SAME = 1e-12
"""Relative difference up to which two numbers of a deck are taken as equal: rounding errors of
rotating vectors into other axes are a few 1e-16."""


@dataclass(frozen=True)
class SingleBody:
    """A body in its initial state, inertial axes.

    ``joint`` connects it to the ground, if there is one. ``pivot`` is the fixed point if the joint
    is spherical, else None.
    """

    body: RigidBody
    gravity: np.ndarray
    pivot: np.ndarray | None
    x: np.ndarray  # mass centre [m]
    R: np.ndarray  # body to inertial axes
    v: np.ndarray  # of the mass centre [m/s]
    W: np.ndarray  # [rad/s]
    joint: Joint | None = None
    loads: tuple[Load, ...] = ()

    @property
    def J(self) -> np.ndarray:
        """Return the inertia about the mass centre, inertial axes [kg m^2]."""
        J: np.ndarray = self.R @ np.array(self.body.inertia) @ self.R.T
        return J

    @property
    def arm(self) -> np.ndarray:
        """Return the vector from the fixed point to the mass centre, inertial axes [m]."""
        assert self.pivot is not None
        arm: np.ndarray = self.x - self.pivot
        return arm


class Motion(NamedTuple):
    """Position, orientation, velocities and acceleration of a body at m times, inertial axes."""

    x: np.ndarray  # (m, 3) mass centre [m]
    R: np.ndarray  # (m, 3, 3)
    v: np.ndarray  # (m, 3) of the mass centre [m/s]
    W: np.ndarray  # (m, 3) [rad/s]
    a: np.ndarray  # (m, 3) of the mass centre [m/s^2]
    load: np.ndarray | None = None  # (m, 3) force on it that is neither weight nor the joint's [N]


class Form(Protocol):
    """A closed form."""

    @property
    def description(self) -> str:
        """Return its name and the functions it needs, for the report."""

    def motion(self, t: np.ndarray) -> Motion:
        """Return the motion at the times ``t`` (m,)."""


def read_single_body(model: Model) -> SingleBody | None:
    """Return the body of a model with one body, free or on one joint; None for other models."""
    others = (model.couplings, model.motions)
    if len(model.bodies) != 1 or len(model.joints) > 1 or any(others):
        return None
    joint = model.joints[0] if model.joints else None
    body = model.bodies[0]
    _, state = first_state(model)
    R = np.array(matrix(tuple(state.p[0])))
    pivot = None
    if joint is not None and joint.kind == "spherical":
        on_ground = joint.child_point if joint.parent == body.name else joint.parent_point
        pivot = np.array(on_ground)
    gravity = np.array(model.gravity, dtype=float)
    x, v = state.x[0].copy(), state.v[0].copy()
    return SingleBody(body, gravity, pivot, x, R, v, R @ state.w[0], joint, model.loads)


def about_pivot(single: SingleBody, R: np.ndarray, W: np.ndarray) -> Motion:
    """Return the motion of a body on a fixed point from its orientations R (m, 3, 3) and angular
    velocities W (m, 3)."""
    m, g = single.body.mass, single.gravity
    r = np.einsum("mij,j->mi", R, single.R.T @ single.arm)
    J = np.einsum("mij,jk,mlk->mil", R, np.array(single.body.inertia), R)
    square = np.einsum("mi,mi->m", r, r)[:, None, None]
    J = J + m * (square * np.eye(3) - r[:, :, None] * r[:, None, :])
    momentum = np.einsum("mij,mj->mi", J, W)
    moment = np.cross(r, m * g) - np.cross(W, momentum)
    alpha = np.linalg.solve(J, moment[:, :, None])[:, :, 0]
    v = np.cross(W, r)
    a = np.cross(alpha, r) + np.cross(W, v)
    return Motion(single.pivot + r, R, v, W, a)


def publish(body: RigidBody, motion: Motion) -> np.ndarray:
    """Return the columns of ``states.csv`` (m, 12)."""
    R, r = motion.R, np.array(body.r_BG)
    quaternion = Rotation.from_matrix(R).as_quat(canonical=True)
    p = 4.0 * quaternion[:, :3] / (1.0 + quaternion[:, 3:])
    w = np.einsum("mji,mj->mi", R, motion.W)
    v_G = np.einsum("mji,mj->mi", R, motion.v)
    return np.hstack([motion.x - R @ r, p, v_G - np.cross(w, r), w])


def about(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (m, 3, 3) by ``angle`` (m,) about the unit vector ``axis``."""
    K = np.cross(np.eye(3), axis)
    half = np.sin(0.5 * angle)[:, None, None]
    return np.asarray(np.eye(3) + np.sin(angle)[:, None, None] * K + 2.0 * half**2 * (K @ K))


def parallel(a: np.ndarray, b: np.ndarray) -> bool:
    """Return whether two vectors are parallel (or one is zero) up to rounding errors."""
    size = np.linalg.norm(a) * np.linalg.norm(b)
    return bool(np.linalg.norm(np.cross(a, b)) <= SAME * size)
