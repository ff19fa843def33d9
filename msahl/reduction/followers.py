"""Records of an elastic body: its frame, and the rigid bodies that follow it by the amplitudes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, from_axis_angle, matrix
from msahl.algebra.vector import ZERO, Matrix, Vector
from msahl.model.bodies import RigidBody
from msahl.model.elastic import AXES, ElasticBody, Follower, Rows, Square
from msahl.reduction.body import ReducedBody
from msahl.reduction.particles import Masses, Particles, particles
from msahl.reduction.squares import no_squares, second_order, squares_of

SMALL = 1e-4
"""Rotation [rad] below which series replace quotients; their error is its fourth power."""


class Part(NamedTuple):
    """A rigid body of an elastic one, see ``Follower``; arrays (3,), (3, q + l), (3, q + l) by q
    amplitudes and l squares."""

    name: str
    mass: float
    inertia: float  # about all axes [kg m^2]
    place: np.ndarray
    shape: np.ndarray
    rotation: np.ndarray
    is_node: bool = False


class Parts(NamedTuple):
    """All bodies of an elastic one: the frame first, then those that carry amplitudes, squares, and
    sums of amplitudes that are squared; ``squares`` as in ``ElasticBody``."""

    bodies: tuple[Part, ...]
    stiffness: np.ndarray  # (q,) [N/m]
    damping: np.ndarray  # (q,) [N s/m]
    squares: tuple[Square, ...] = ()


class Start(NamedTuple):
    """Place and motion of the frame at its point B, as in ``RigidBody``; amplitudes (q,) [m] and
    their rates [m/s]."""

    position: Vector
    orientation: Vector
    velocity: Vector
    angular_velocity: Vector
    amplitude: np.ndarray
    rate: np.ndarray


def parts_of(name: str, body: ReducedBody, stiffening: bool = False) -> Parts:
    """Return the bodies of a reduced one, with names that begin with ``name``; with the geometric
    stiffening that the body has, or without."""
    q, given = body.eigenvalues.size, body.stiffening if stiffening else None
    squares = no_squares(q) if given is None else squares_of(given, body)
    count = len(squares.pairs)
    found = particles(body, squares.sums, count)
    groups = [
        ([name], found.frame),
        (_numbered(f"{name}.modes", q), found.amplitudes),
        (_numbered(f"{name}.squares", count), found.squares),
        (_numbered(f"{name}.sums", len(squares.sums)), found.sums),
        ([f"{name}.{node}" for node in body.interface_names], found.nodes),
        ([f"{name}.mass {k + 1}" for k in range(found.points.mass.size)], found.points),
    ]
    seconds = [np.zeros((*one.shape.shape[:2], count)) for _, one in groups]
    rotated = [np.zeros_like(one) for one in seconds]
    seconds[2] = np.eye(3 * seconds[2].shape[0])[:, :count].reshape(seconds[2].shape)
    numbers: tuple[Square, ...] = ()
    if given is not None:
        seconds[4], rotated[4], seconds[5], factor = second_order(
            given, body.invariants.inertia_curve, found, squares.pairs
        )
        numbers = tuple(map(Square, squares.arguments, factor.tolist()))
    bodies = [
        part._replace(is_node=one is found.nodes)
        for (names, one), *more in zip(groups, seconds, rotated, strict=True)
        for part in _parts(names, one, more, body.centre)
    ]
    scaled = body.eigenvalues * found.scale**2
    return Parts(tuple(bodies), scaled, _damping(body, found), numbers)


def _numbered(name: str, count: int) -> list[str]:
    """Return names of bodies that carry three of so many numbers each."""
    firsts = range(1, count + 1, AXES)
    return [f"{name} {k} to {min(k + AXES - 1, count)}" for k in firsts]


def _parts(
    names: Sequence[str], masses: Masses, more: Sequence[np.ndarray], centre: np.ndarray
) -> list[Part]:
    """Return bodies with shapes and rotations by squares, ``more``, behind those by amplitudes."""
    shape, rotation = (
        np.concatenate(both, axis=2)
        for both in zip((masses.shape, masses.rotation), more, strict=True)
    )
    return [
        Part(one, float(masses.mass[k]), float(masses.inertia[k]), centre + masses.place[k],
             shape[k], rotation[k])
        for k, one in enumerate(names)
    ]  # fmt: skip


def _damping(body: ReducedBody, found: Particles) -> np.ndarray:
    """Return the damping (q,) by amplitudes."""
    result: np.ndarray = np.diag(body.damping) * found.scale**2
    return result


def build_elastic_body(parts: Parts, start: Start) -> tuple[ElasticBody, tuple[RigidBody, ...]]:
    """Return the records of an elastic body and of its rigid bodies at the ``start``."""
    frame, *followers = parts.bodies
    start = _with_squares(parts, start)
    body = ElasticBody(
        frame.name,
        tuple(
            Follower(p.name, _vector(p.place), _rows(p.shape), _rows(p.rotation), p.is_node)
            for p in followers
        ),
        tuple(parts.stiffness.tolist()),
        tuple(parts.damping.tolist()),
        parts.squares,
    )
    first = RigidBody(
        *(frame.name, frame.mass, _vector(frame.place), _sphere(frame.inertia)),
        *start[:4],
    )
    return body, (first, *(_follower(part, start) for part in followers))


def _with_squares(parts: Parts, start: Start) -> Start:
    """Return the start with the squares and their rates behind the amplitudes."""
    if not parts.squares:
        return start
    q, count = parts.stiffness.size, len(parts.squares)
    first = 1 + -(-q // AXES) + -(-count // AXES)
    sums = [row[:q] for part in parts.bodies[first:] for row in part.shape]
    rows = np.array([*np.eye(q), *sums])[[one.argument for one in parts.squares]]
    factor = np.array([one.factor for one in parts.squares])
    value, rate = rows @ start.amplitude, rows @ start.rate
    return start._replace(
        amplitude=np.r_[start.amplitude, factor * value**2],
        rate=np.r_[start.rate, 2.0 * factor * value * rate],
    )


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
