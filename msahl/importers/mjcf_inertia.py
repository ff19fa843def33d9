"""What MuJoCo's compiler finds by the mass matrix M of the tree at the pose of the file.

M has the armature of joints and no equalities. Rates are those of hinges and slides, three of a
ball about the link's axes, and six of a free joint: velocity of its origin, angular velocity.

    springdamper (T, z)     n/J = sum of (M^-1)_ii over the n rates of the joint
                            stiffness = J/(T z)^2,  damping = 2 J/T
    dampratio z             kv = 2 z sqrt(kp m),  1/m = c^T M^-1 c with the slopes c of the
                            actuator's length over the coordinates

Source: MuJoCo, XML reference, joint/springdamper and position/dampratio (m since version 3.15; its
older versions took the sum of M_ii/c_i^2); the sum over several rates is its compiler's.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from msahl.importers.build import world_pose
from msahl.importers.mjcf_bodies import WORLD
from msahl.importers.reading import Log, numbers
from msahl.importers.robot import Axis, Link, Pose, Robot, Terms

MOST_SMALL = 1e-15
"""The smallest inverse of an inertia, as in MuJoCo."""

Twist = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Velocity of the point of a body at a place, its angular velocity, and that place: (3,) each."""


class ReferenceInertia:
    """The mass matrix of a robot at the pose of its file, and the numbers of its rates by the names
    of axes."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.numbers: dict[str, list[int]] = {}
        self._columns: dict[str, list[tuple[int, Twist]]] = {}
        count = 0
        for link in robot.links.values():
            own: list[tuple[int, Twist]] = []
            for axis in link.axes:
                twists = list(_twists(axis, world_pose(link, robot, at_start=False)))
                self.numbers[axis.name] = list(range(count, count + len(twists)))
                own += zip(self.numbers[axis.name], twists, strict=True)
                count += len(twists)
            self._columns[link.name] = [*self._columns.get(link.parent, []), *own]
        self.count = count

    @cached_property
    def _inverse(self) -> np.ndarray:
        """Inverse of M; of a singular one, that of what is not singular."""
        return np.linalg.pinv(self._mass_matrix(), hermitian=True)

    def _mass_matrix(self) -> np.ndarray:
        M = np.zeros((self.count, self.count))
        for link in self.robot.links.values():
            for axis in link.axes:
                for k in self.numbers[axis.name]:
                    M[k, k] += axis.armature
            columns = self._columns[link.name]
            if columns and link.name != WORLD:
                place = world_pose(link, self.robot, at_start=False)
                numbers_, v, w = _velocities(link, place, columns)
                J = place.R @ link.inertia.J @ place.R.T
                M[np.ix_(numbers_, numbers_)] += link.inertia.mass * v @ v.T + w @ J @ w.T
        return M

    def of_axis(self, axis: Axis) -> float:
        """Return the inertia that a joint feels, other joints being free to move [kg, kg m^2]."""
        numbers_ = self.numbers[axis.name]
        mobility = float(self._inverse[numbers_, numbers_].sum())
        return len(numbers_) / max(mobility, MOST_SMALL)

    def along(self, terms: Terms) -> float:
        """Return the inertia that a force along a length feels [kg, kg m^2]."""
        c = np.zeros(self.count)
        for name, coefficients in terms:
            c[self.numbers[name]] += coefficients
        return 1.0 / max(float(c @ self._inverse @ c), MOST_SMALL)


def _twists(axis: Axis, place: Pose) -> Iterator[Twist]:
    """Yield what a unit of each rate of an axis moves its link by, at a ``place``."""
    zero, a, point = np.zeros(3), place.R @ axis.axis, place.p + place.R @ axis.point
    if axis.kind == "hinge":
        yield zero, a, point
    elif axis.kind == "slide":
        yield a, zero, point
    else:
        if axis.kind == "free":
            point = place.p
            yield from ((unit, zero, point) for unit in np.eye(3))
        yield from ((zero, column, point) for column in place.R.T)


def _velocities(
    link: Link, place: Pose, columns: Sequence[tuple[int, Twist]]
) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Return numbers of rates, and the velocity of the mass centre and the angular velocity at a
    unit of each (n, 3)."""
    c = place.p + place.R @ link.inertia.c
    v = np.array([v + np.cross(w, c - point) for _, (v, w, point) in columns])
    return [k for k, _ in columns], v, np.array([w for _, (_, w, _) in columns])


def set_spring_dampers(axes: Mapping[str, Axis], inertia: ReferenceInertia, log: Log) -> None:
    """Set stiffness and damping of the joints that give a time constant and a damping ratio."""
    for axis in axes.values():
        if "springdamper" not in axis.element.attrib:
            continue
        time, ratio = numbers(axis.element, "springdamper", log, count=2)
        if min(time, ratio) > 0.0:
            J = inertia.of_axis(axis)
            axis.stiffness, axis.damping = J / (time * ratio) ** 2, 2.0 * J / time


def damping_of(ratio: float, kp: float, terms: Terms, inertia: ReferenceInertia) -> float:
    """Return the damping kv of an actuator of the stiffness ``kp``, by its ratio."""
    return 2.0 * ratio * math.sqrt(max(kp, 0.0) * inertia.along(terms))
