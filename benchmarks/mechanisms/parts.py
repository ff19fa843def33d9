"""Make records of bodies, joints and loads for the mechanisms that have no deck of their own."""

from collections.abc import Iterable

import numpy as np

from msahl.algebra.vector import Vector
from msahl.model import (
    Coupling,
    Ground,
    Joint,
    JointSpring,
    Load,
    Model,
    RigidBody,
    Simulation,
    SpringDamper,
)

ORIGIN: Vector = (0.0, 0.0, 0.0)
GROUND = "Base"
STEP = 0.001
"""Step size of the deck's own run [s]; a measurement replaces it."""


def body(
    name: str,
    mass: float,
    inertia: np.ndarray,
    position: Iterable[float],
    angular_velocity: Vector = ORIGIN,
) -> RigidBody:
    """Return a body with its mass centre in B, its axes along the inertial ones.

    The velocity follows from the joints when the start is made consistent.
    """
    x, y, z = (_vector(row) for row in inertia)
    return RigidBody(
        name, mass, ORIGIN, (x, y, z), _vector(position), ORIGIN, ORIGIN, angular_velocity
    )


def rod(mass: float, vector: Iterable[float], radius: float) -> np.ndarray:
    """Return the inertia [kg m^2] about the mass centre of a cylinder along ``vector`` [m]."""
    along = np.array(list(vector), dtype=float)
    length = float(np.sqrt(along @ along))
    axis = np.outer(along, along) / length**2
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    inertia: np.ndarray = across * (np.eye(3) - axis) + 0.5 * mass * radius**2 * axis
    return inertia


def disk(mass: float, axis: Vector, radius: float, width: float) -> np.ndarray:
    """Return the inertia [kg m^2] of a disk of ``width`` [m] about the unit vector ``axis``."""
    return rod(mass, width * np.array(axis), radius)


def joint(
    kind: str,
    name: str,
    pair: tuple[RigidBody | None, RigidBody],
    point: Iterable[float],
    axis: Vector = (0.0, 0.0, 1.0),
    child_axis: Vector | None = None,
) -> Joint:
    """Return a joint at ``point`` [m] between two bodies, or ground and a body, at t = 0.

    All bodies have inertial axes then; a universal joint has a second axis in the child.
    """
    parent, child = pair
    place = np.array(list(point), dtype=float)
    point_P, point_C = (
        _vector(place - (np.array(b.position) if b else np.zeros(3))) for b in (parent, child)
    )
    frame_P, frame_C = _frame(axis), _frame(child_axis or axis)
    outer = parent.name if parent else GROUND
    return Joint(name, kind, outer, child.name, point_P, point_C, frame_P, frame_C)


def damper(joint_name: str, damping: float) -> JointSpring:
    """Return viscous friction of ``damping`` [N m s/rad] in a revolute joint."""
    return JointSpring(f"{joint_name} friction", joint_name, "angle", 0.0, damping)


def spring(
    name: str,
    pair: tuple[RigidBody | None, RigidBody],
    points: tuple[Vector, Vector],
    stiffness: float,
    damping: float,
) -> SpringDamper:
    """Return a spring-damper between two points [m] at t = 0, where it is unloaded."""
    parent, child = pair
    ends = [
        _vector(np.array(point) - (np.array(b.position) if b else np.zeros(3)))
        for point, b in zip(points, (parent, child), strict=True)
    ]
    free = float(np.linalg.norm(np.subtract(points[1], points[0])))
    names = [b.name if b else GROUND for b in (parent, child)]
    return SpringDamper(name, names[0], names[1], ends[0], ends[1], stiffness, damping, free)


def model(
    title: str,
    gravity: Vector,
    bodies: Iterable[RigidBody],
    joints: Iterable[Joint],
    loads: Iterable[Load] = (),
    couplings: Iterable[Coupling] = (),
) -> Model:
    """Return the model of these parts."""
    simulation = Simulation(title, STEP, 1.0)
    return Model(
        gravity,
        (Ground(GROUND),),
        tuple(bodies),
        tuple(joints),
        tuple(loads),
        simulation,
        couplings=tuple(couplings),
    )


def _frame(axis: Vector) -> tuple[Vector, Vector, Vector]:
    """Rows x, y, z of a right-handed frame whose z is ``axis``."""
    z = np.array(axis) / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return _vector(x), _vector(np.cross(z, x)), _vector(z)


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
