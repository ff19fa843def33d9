"""Coordinates of joints: values, rates and accelerations of a relative motion, and the inverse.

    slide               displacement of the child's point from the parent's along the axis [m]
    slide1, slide2      likewise along the parent's reference x, and along y = axis x reference [m]
    angle               rotation of the child about the axis, from x to the child's reference [rad]
    angle1, angle2      of a universal joint: rotation of the cross about the parent's axis, and of
                        the child about its own axis relative to the cross [rad]
    orientation         rotation from the parent's axes to the child's: P1 P2 P3, Wiener-Milenkovic
                        parameters; wx wy wz, relative angular velocity in the child's axes [rad/s]

All are functions of the configuration alone and do not depend on where the motion starts: an angle
is zero where the child's reference direction is along the parent's. ``angle1`` is zero where the
child's axis is along the parent's reference, ``angle2`` where the parent's axis is along the
child's reference. Angles are found within half a revolution of zero; ``run.joint_table`` counts.

Everything here is in the parent's axes, for m output times at once:

    D       from the parent's point to the child's [m]        v, a          its derivatives
    R       child's axes to parent's                          w, alpha      relative angular
                                                              velocity, and its derivative
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.rotation_arrays import cross, dot, parameters, rotated
from msahl.algebra.vector import Vector
from msahl.joints.joint import X, Z
from msahl.joints.registry import KINDS
from msahl.model.joints import Joint

ORIENTATION = "orientation"
SPATIAL = (("P1", "P2", "P3"), ("wx", "wy", "wz"), ("alphax", "alphay", "alphaz"))
"""Columns of an orientation, its rate and its acceleration."""
SUFFIXES = ("", "Rate", "Acceleration")
"""What is added to the name of a coordinate for its value, its rate and its acceleration."""
LEVELS = len(SUFFIXES)


class Relative(NamedTuple):
    """Motion of a joint's child relative to its parent, in the parent's axes; see the module."""

    D: np.ndarray  # (m, 3)
    R: np.ndarray  # (m, 3, 3)
    v: np.ndarray  # (m, 3)
    w: np.ndarray  # (m, 3)
    a: np.ndarray | None = None  # (m, 3)
    alpha: np.ndarray | None = None  # (m, 3)


def coordinates(joint: Joint) -> tuple[str, ...]:
    """Return the names of the coordinates of a joint; () if it has none."""
    return KINDS[joint.kind].pose or ()


def columns(joint: Joint, level: int) -> list[str]:
    """Return the names of values (``level`` 0), rates (1) or accelerations (2) of a joint."""
    names: list[str] = []
    for name in coordinates(joint):
        names += SPATIAL[level] if name == ORIENTATION else [name + SUFFIXES[level]]
    return names


def is_angle(column: str) -> bool:
    """Return whether a column of values counts revolutions."""
    return column in ("angle", "angle1", "angle2")


def frames(joint: Joint) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows x, y, z (3, 3) of the parent's and of the child's frame that coordinates
    refer to, each in its own body's axes: x is the reference, z the axis.
    """
    parent = _frame(joint.parent_reference or joint.parent_axes[X], joint.parent_axes[Z])
    return parent, _frame(joint.child_reference or joint.child_axes[X], joint.child_axes[Z])


def angle_offset(joint: Joint) -> float:
    """Return the ``angle`` [rad] at which x of the two frames ``parent_axes`` and ``child_axes``
    are parallel: the difference between the angle and the one that the equations of motion count.
    It is within half a revolution of zero, as the angle is at the start.
    """
    here, there = frames(joint)
    parent = _direction(here[X], np.array(joint.parent_axes))
    offset = _direction(there[X], np.array(joint.child_axes)) - parent
    return math.remainder(offset, 2.0 * math.pi)


class Geometry(NamedTuple):
    """Points and frames of a joint, or of j joints of one kind that all arrays have as another
    axis, before the last or the last two."""

    names: tuple[str, ...]  # of the coordinates
    s_a: np.ndarray  # (3,) point of the parent from B, its axes [m]
    s_b: np.ndarray  # (3,) likewise of the child
    here: np.ndarray  # (3, 3) rows x, y, z of the parent's frame, its axes
    there: np.ndarray  # (3, 3) likewise of the child


def geometry(joint: Joint) -> Geometry:
    """Return the points and frames of a joint."""
    return Geometry(
        coordinates(joint),
        np.array(joint.parent_point),
        np.array(joint.child_point),
        *frames(joint),
    )


def stacked(joints: Sequence[Joint]) -> Geometry:
    """Return the points and frames of joints of one kind, with their number as first axis."""
    _, *arrays = zip(*map(geometry, joints), strict=True)
    return Geometry(coordinates(joints[0]), *map(np.array, arrays))


def relative(joint: Joint | Geometry, parent: "Motion", child: "Motion") -> Relative:
    """Return the motion of the child relative to the parent."""
    shape = geometry(joint) if isinstance(joint, Joint) else joint
    a, b = point_motion(parent, shape.s_a), point_motion(child, shape.s_b)
    R_a = np.swapaxes(parent.R, -1, -2)  # inertial to parent's axes
    D, w_a = rotated(R_a, b.x - a.x), rotated(R_a, parent.w)
    w = rotated(R_a, child.w) - w_a
    v = rotated(R_a, b.v - a.v) - cross(w_a, D)
    found = Relative(D, np.einsum("...ij,...jk->...ik", R_a, child.R), v, w)
    if a.a is None or b.a is None or parent.alpha is None or child.alpha is None:
        return found
    alpha_a = rotated(R_a, parent.alpha)
    centripetal = cross(w_a, cross(w_a, D) + 2.0 * v)
    return found._replace(
        a=rotated(R_a, b.a - a.a) - cross(alpha_a, D) - centripetal,
        alpha=rotated(R_a, child.alpha) - alpha_a - cross(w_a, w),
    )


class Motion(NamedTuple):
    """Motion of a body, or of a ground, at m output times: its point B and its axes."""

    x: np.ndarray  # (m, 3) position, inertial axes [m]
    R: np.ndarray  # (m, 3, 3) body to inertial axes
    v: np.ndarray  # (m, 3) velocity, inertial axes [m/s]
    w: np.ndarray  # (m, 3) angular velocity, inertial axes [rad/s]
    a: np.ndarray | None = None  # (m, 3) acceleration, inertial axes [m/s^2]
    alpha: np.ndarray | None = None  # (m, 3) angular acceleration, inertial axes [rad/s^2]


def at_rest(m: int, accelerations: bool = False) -> Motion:
    """Return the motion of a ground."""
    zero = np.broadcast_to(np.zeros(3), (m, 3))
    still = Motion(zero, np.broadcast_to(np.eye(3), (m, 3, 3)), zero, zero)
    return still._replace(a=zero, alpha=zero) if accelerations else still


def point_motion(body: Motion, s: np.ndarray) -> Motion:
    """Return the motion of the point ``s`` (3,) of a body, given from B in its axes [m]."""
    r = rotated(body.R, s)
    spin = cross(body.w, r)
    a = None
    if body.a is not None and body.alpha is not None:
        a = body.a + cross(body.alpha, r) + cross(body.w, spin)
    return body._replace(x=body.x + r, v=body.v + spin, a=a)


def values_and_rates(joint: Joint | Geometry, motion: Relative) -> list[np.ndarray]:
    """Return values and rates, and accelerations if ``motion`` has them: each (m, c) by the
    ``columns`` of its level.
    """
    shape = geometry(joint) if isinstance(joint, Joint) else joint
    parts: list[list[np.ndarray]] = [[], [], []]
    for name in shape.names:
        for level, columns_of in enumerate(_FUNCTIONS[name](shape, motion)):
            parts[level].append(columns_of)
    known = 2 if motion.a is None else 3
    none = np.zeros((*motion.D.shape[:-1], 0))
    return [np.concatenate([none, *part], axis=-1) for part in parts[:known]]


def pose(joint: Joint, values: dict[str, float], P: Vector) -> tuple[np.ndarray, np.ndarray]:
    """Return D (3,) and R (3, 3) of a joint whose coordinates have these ``values``, missing ones
    are 0, with the orientation ``P`` where that is a coordinate. Inverse of ``values_and_rates``.
    """
    here, there = frames(joint)
    D = np.zeros(3)
    for name, row in _SLIDES.items():
        D = D + values.get(name, 0.0) * here[row]
    names = coordinates(joint)
    if ORIENTATION in names:
        return D, np.array(matrix(P))
    if "angle1" in names:
        c, s = math.cos(values.get("angle2", 0.0)), -math.sin(values.get("angle2", 0.0))
        across = child_axis(here, values.get("angle1", 0.0))
        parents_axis = c * there[0] + s * there[1]  # in the child's axes
        in_parent = np.array([across, here[Z], np.cross(across, here[Z])])
        in_child = np.array([there[Z], parents_axis, np.cross(there[Z], parents_axis)])
        return D, in_parent.T @ in_child
    if not KINDS[joint.kind].axes:
        return D, np.eye(3)
    c, s = math.cos(values.get("angle", 0.0)), math.sin(values.get("angle", 0.0))
    return D, here.T @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ there


def directions(joint: Joint, R: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return v (3,) and w (3,) in the parent's axes for a unit rate of each column of rates."""
    here, there = frames(joint)
    zero = np.zeros(3)
    found: list[tuple[np.ndarray, np.ndarray]] = []
    for name in coordinates(joint):
        if name in _SLIDES:
            found.append((here[_SLIDES[name]], zero))
        elif name == ORIENTATION:
            found += [(zero, R[:, i]) for i in range(3)]
        else:
            found.append((zero, R @ there[Z] if name == "angle2" else here[Z]))
    return found


def child_axis(parent: np.ndarray, angle1: float) -> np.ndarray:
    """Return the child's axis (3,) of a universal joint, in the parent's axes."""
    return np.asarray(math.cos(angle1) * parent[0] + math.sin(angle1) * parent[1])


def _frame(x: Vector, z: Vector) -> np.ndarray:
    """Return rows x, y, z of a frame; x is made perpendicular to z."""
    axis = np.array(z)
    reference = np.array(x) - (axis @ np.array(x)) * axis
    reference /= np.sqrt(reference @ reference)
    return np.array([reference, np.cross(axis, reference), axis])


def _direction(a: np.ndarray, frame: np.ndarray) -> float:
    """Return the angle of ``a`` (3,) from x to y of a frame [rad]."""
    return math.atan2(frame[1] @ a, frame[0] @ a)


def _slide(row: int, geometry: Geometry, motion: Relative) -> list[np.ndarray]:
    """Return D along an axis of the parent's frame and its derivatives, each (..., 1)."""
    axis = geometry.here[..., row, :]
    vectors = (motion.D, motion.v, motion.a)
    return [dot(vector, axis)[..., None] for vector in vectors if vector is not None]


def _angle(geometry: Geometry, motion: Relative) -> list[np.ndarray]:
    """Return the angle about axes that stay parallel, and its derivatives, each (..., 1)."""
    x, y, z = (geometry.here[..., i, :] for i in range(3))
    e = rotated(motion.R, geometry.there[..., X, :])
    angle = np.arctan2(dot(e, y), dot(e, x))
    rates = [dot(w, z) for w in (motion.w, motion.alpha) if w is not None]
    return [column[..., None] for column in (angle, *rates)]


def _angle1(geometry: Geometry, motion: Relative) -> list[np.ndarray]:
    """Return the angle of the child's axis about the parent's, and its derivatives."""
    return _about(
        geometry.here, rotated(motion.R, geometry.there[..., Z, :]), motion.w, motion.alpha
    )


def _angle2(geometry: Geometry, motion: Relative) -> list[np.ndarray]:
    """Return minus the angle of the parent's axis about the child's, in the child's axes."""
    R = np.swapaxes(motion.R, -1, -2)
    alpha = None if motion.alpha is None else -rotated(R, motion.alpha)
    k = rotated(R, geometry.here[..., Z, :])
    return [-part for part in _about(geometry.there, k, -rotated(R, motion.w), alpha)]


def _about(
    frame: np.ndarray, k: np.ndarray, w: np.ndarray, alpha: np.ndarray | None
) -> list[np.ndarray]:
    """Return the angle of the vectors ``k`` (..., 3) from x to y of ``frame``, with its
    derivatives: k rotates at ``w`` relative to the frame.
    """
    k_dot, along_x, along_y = cross(w, k), frame[..., 0, :], frame[..., 1, :]
    x, y = dot(k, along_x), dot(k, along_y)
    x_dot, y_dot = dot(k_dot, along_x), dot(k_dot, along_y)
    square = x * x + y * y
    rate = (x * y_dot - y * x_dot) / square
    found = [np.arctan2(y, x), rate]
    if alpha is not None:
        k_ddot = cross(alpha, k) + cross(w, k_dot)
        torque = x * dot(k_ddot, along_y) - y * dot(k_ddot, along_x)
        found.append((torque - 2.0 * (x * x_dot + y * y_dot) * rate) / square)
    return [column[..., None] for column in found]


def _orientation(geometry: Geometry, motion: Relative) -> list[np.ndarray]:
    """Return the parameters, angular velocity and acceleration in the child's axes, (..., 3)."""
    R = np.swapaxes(motion.R, -1, -2)
    rates = [rotated(R, w) for w in (motion.w, motion.alpha) if w is not None]
    return [parameters(motion.R), *rates]


_SLIDES = {"slide": Z, "slide1": 0, "slide2": 1}
"""Rows of the parent's frame along which the displacements are measured."""
_FUNCTIONS = {
    "slide": lambda geometry, motion: _slide(Z, geometry, motion),
    "slide1": lambda geometry, motion: _slide(0, geometry, motion),
    "slide2": lambda geometry, motion: _slide(1, geometry, motion),
    "angle": _angle,
    "angle1": _angle1,
    "angle2": _angle2,
    ORIENTATION: _orientation,
}
"""Functions that return value, rate and acceleration of a coordinate by its name."""
