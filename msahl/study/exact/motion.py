"""One body, free or on one joint to the ground, and its motion in time."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from msahl.algebra.rotation import matrix
from msahl.model import Joint, Load, Model
from msahl.model.bodies import RigidBody
from msahl.study.start import first_state

SAME = 1e-12
"""Part by which two numbers of a deck may differ and still be meant to be one: round-off of turning
vectors into other axes is a few 1e-16."""


@dataclass(frozen=True)
class Scene:
    """A body at t = 0 as its runs start, inertial axes; ``pivot`` is the fixed point or None.

    ``joint`` is the one it is held by, if any; a spherical one is the pivot.
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
        """Inertia about the mass centre, inertial axes [kg m^2]."""
        J: np.ndarray = self.R @ np.array(self.body.inertia) @ self.R.T
        return J

    @property
    def arm(self) -> np.ndarray:
        """From the fixed point to the mass centre, inertial axes [m]."""
        assert self.pivot is not None
        arm: np.ndarray = self.x - self.pivot
        return arm


class Motion(NamedTuple):
    """What a body does at m times, inertial axes."""

    x: np.ndarray  # (m, 3) mass centre [m]
    R: np.ndarray  # (m, 3, 3)
    v: np.ndarray  # (m, 3) of the mass centre [m/s]
    W: np.ndarray  # (m, 3) [rad/s]
    a: np.ndarray  # (m, 3) of the mass centre [m/s^2]
    load: np.ndarray | None = None  # (m, 3) force on it that is neither weight nor the joint's [N]


class Form(Protocol):
    """A closed form."""

    @property
    def words(self) -> str:
        """What it is."""

    def motion(self, t: np.ndarray) -> Motion:
        """The body at the times ``t`` (m,)."""


def read_scene(model: Model) -> Scene | None:
    """The scene of a model of one body, free or on one joint; else None."""
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
    return Scene(body, gravity, pivot, x, R, v, R @ state.w[0], joint, model.loads)


def about_pivot(scene: Scene, R: np.ndarray, W: np.ndarray) -> Motion:
    """The motion of a body on a fixed point, of its orientations and spins; R (m, 3, 3)."""
    m, g = scene.body.mass, scene.gravity
    r = np.einsum("mij,j->mi", R, scene.R.T @ scene.arm)
    J = np.einsum("mij,jk,mlk->mil", R, np.array(scene.body.inertia), R)
    square = np.einsum("mi,mi->m", r, r)[:, None, None]
    J = J + m * (square * np.eye(3) - r[:, :, None] * r[:, None, :])
    spin = np.einsum("mij,mj->mi", J, W)
    moment = np.cross(r, m * g) - np.cross(W, spin)
    alpha = np.linalg.solve(J, moment[:, :, None])[:, :, 0]
    v = np.cross(W, r)
    a = np.cross(alpha, r) + np.cross(W, v)
    return Motion(scene.pivot + r, R, v, W, a)


def publish(body: RigidBody, motion: Motion) -> np.ndarray:
    """(m, 12) the columns of ``states.csv``."""
    R, r = motion.R, np.array(body.r_BG)
    turn = Rotation.from_matrix(R).as_quat(canonical=True)
    p = 4.0 * turn[:, :3] / (1.0 + turn[:, 3:])
    w = np.einsum("mji,mj->mi", R, motion.W)
    v_G = np.einsum("mji,mj->mi", R, motion.v)
    return np.hstack([motion.x - R @ r, p, v_G - np.cross(w, r), w])


def about(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(m, 3, 3) turns by ``angle`` (m,) about the unit vector ``axis``."""
    K = np.cross(np.eye(3), axis)
    half = np.sin(0.5 * angle)[:, None, None]
    return np.asarray(np.eye(3) + np.sin(angle)[:, None, None] * K + 2.0 * half**2 * (K @ K))


def parallel(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two vectors are parallel (or one is zero) up to round-off."""
    size = np.linalg.norm(a) * np.linalg.norm(b)
    return bool(np.linalg.norm(np.cross(a, b)) <= SAME * size)
