"""Records of an elastic body: its frame, and the rigid bodies that follow it by the amplitudes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, from_axis_angle, matrix
from msahl.algebra.vector import ZERO, Matrix, Vector
from msahl.model.bodies import RigidBody
from msahl.model.elastic import AXES, ElasticBody, Follower, Rows
from msahl.reduction.body import ReducedBody
from msahl.reduction.particles import Masses, Particles, particles

SMALL = 1e-4
"""Rotation [rad] below which series replace quotients; their error is its fourth power."""


class Part(NamedTuple):
    """A rigid body of an elastic one, see ``Follower``; arrays (3,), (3, q), (3, q)."""

    name: str
    mass: float
    inertia: float  # about all axes [kg m^2]
    place: np.ndarray
    shape: np.ndarray
    rotation: np.ndarray


class Parts(NamedTuple):
    """All bodies of an elastic one: the frame first, then those that carry amplitudes."""

    bodies: tuple[Part, ...]
    stiffness: np.ndarray  # (q,) [N/m]
    damping: np.ndarray  # (q,) [N s/m]


class Start(NamedTuple):
    """Place and motion of the frame at its point B, as in ``RigidBody``; amplitudes (q,) [m] and
    their rates [m/s]."""

    position: Vector
    orientation: Vector
    velocity: Vector
    angular_velocity: Vector
    amplitude: np.ndarray
    rate: np.ndarray


def parts_of(name: str, body: ReducedBody) -> Parts:
    """Return the bodies of a reduced one, with names that begin with ``name``."""
    found, q = particles(body), body.eigenvalues.size
    last = [min(AXES * k + AXES, q) for k in range(found.amplitudes.mass.size)]
    carriers = [f"{name}.modes {AXES * k + 1} to {end}" for k, end in enumerate(last)]
    nodes = [f"{name}.{node}" for node in body.interface_names]
    points = [f"{name}.mass {k + 1}" for k in range(found.points.mass.size)]
    groups = (
        ([name], found.frame),
        (carriers, found.amplitudes),
        (nodes, found.nodes),
        (points, found.points),
    )
    bodies = [part for names, masses in groups for part in _parts(names, masses, body.centre)]
    return Parts(tuple(bodies), body.eigenvalues * found.scale**2, _damping(body, found))


def _parts(names: Sequence[str], masses: Masses, centre: np.ndarray) -> list[Part]:
    each = zip(names, masses.mass, masses.inertia, strict=True)
    return [
        Part(one, float(m), float(J), centre + masses.place[k], masses.shape[k], masses.rotation[k])
        for k, (one, m, J) in enumerate(each)
    ]


def _damping(body: ReducedBody, found: Particles) -> np.ndarray:
    """Return the damping (q,) by amplitudes."""
    result: np.ndarray = np.diag(body.damping) * found.scale**2
    return result


def build_elastic_body(parts: Parts, start: Start) -> tuple[ElasticBody, tuple[RigidBody, ...]]:
    """Return the records of an elastic body and of its rigid bodies at the ``start``."""
    frame, *followers = parts.bodies
    body = ElasticBody(
        frame.name,
        tuple(
            Follower(p.name, _vector(p.place), _rows(p.shape), _rows(p.rotation)) for p in followers
        ),
        tuple(parts.stiffness.tolist()),
        tuple(parts.damping.tolist()),
    )
    first = RigidBody(
        *(frame.name, frame.mass, _vector(frame.place), _sphere(frame.inertia)),
        *start[:4],
    )
    return body, (first, *(_follower(part, start) for part in followers))


def _follower(part: Part, start: Start) -> RigidBody:
    """Return a body where the frame and the amplitudes place it, with their velocities."""
    R, w = np.array(matrix(start.orientation)), np.array(start.angular_velocity)
    place = part.place + part.shape @ start.amplitude
    speed = np.array(start.velocity) + np.cross(w, place) + part.shape @ start.rate
    q, q_dot = _rotation(part.rotation @ start.amplitude, part.rotation @ start.rate)
    angle = float(np.linalg.norm(q))
    own = from_axis_angle(_vector(q), angle) if angle > 0.0 else ZERO
    A = np.array(matrix(own)).T
    return RigidBody(
        name=part.name,
        mass=part.mass,
        r_BG=ZERO,
        inertia=_sphere(part.inertia),
        position=_vector(np.array(start.position) + R @ place),
        orientation=compose(start.orientation, own) if angle > 0.0 else start.orientation,
        velocity=_vector(A @ speed),
        angular_velocity=_vector(A @ (w + _spin(q, q_dot))),
    )


def _rotation(theta: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation vector whose sine along its axis is ``theta``, and its rate."""
    s = float(np.linalg.norm(theta))
    if s < SMALL:
        return theta * (1.0 + s * s / 6.0), rate * (1.0 + s * s / 6.0) + theta * (
            theta @ rate / 3.0
        )
    factor = np.arcsin(s) / s
    slope = (1.0 / np.sqrt(1.0 - s * s) - factor) / s
    return factor * theta, factor * rate + slope * theta * (theta @ rate) / s


def _spin(q: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the angular velocity of a rotation vector ``q``, in the axes that it starts from."""
    s = float(np.linalg.norm(q))
    a = 0.5 if s < SMALL else (1.0 - np.cos(s)) / (s * s)
    b = 1.0 / 6.0 if s < SMALL else (s - np.sin(s)) / s**3
    result: np.ndarray = rate + a * np.cross(q, rate) + b * np.cross(q, np.cross(q, rate))
    return result


def _vector(a: np.ndarray) -> Vector:
    x, y, z = map(float, a)
    return (x, y, z)


def _rows(a: np.ndarray) -> Rows:
    x, y, z = (tuple(row.tolist()) for row in a)
    return (x, y, z)


def _sphere(J: float) -> Matrix:
    return ((J, 0.0, 0.0), (0.0, J, 0.0), (0.0, 0.0, J))
