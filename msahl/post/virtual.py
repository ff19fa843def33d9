"""Virtual work of the joints over each step, from the published rows alone.

    Hainge's definition    F . C (V_{k-1} + V_k)/2 dt                       (3.16)-(3.18)
    exact definition    F . (du_child - du_parent) + M . (Q_child - Q_parent)

F and M are the reaction on the child over the step, M about the joint's point P on the child; the
opposite acts on the parent at the same place in space. With rotation increments Q and the arms'
means over the step,  du = u + Q x mean(P - x)  is the displacement of a body's matter at P, and the
second is the total work of the reaction on both bodies: zero to round-off for an ideal joint,
whatever the step.

A rolling disk's moment is not published. Its forces act at the rim's lowest point, as
``products`` (ROLL) and ``coordinate_kinds`` (ROUND) have it, n the plane's normal, e the
disk's axis:

    M = rho(mean(e)) x F_t + w mean(e) x F_n,    w = r (m0 + m1)/(root0 + root1),
                                                 m = n . e,  root = sqrt(1 - m^2)
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, inverse, matrix, rotation_change, to_increment
from msahl.algebra.vector import Vector, add, at, axpy, cross, dot, scale, sub, times
from msahl.elements.constraints.products import rim
from msahl.formulations.absolute.rigid_body import STATE_SIZE, three
from msahl.jit.compiled import compiled
from msahl.jit.kernel import kernel
from msahl.joints.joint import Equation, Z
from msahl.joints.registry import KINDS
from msahl.model import Joint, Model
from msahl.post.replay import History, body_columns
from msahl.results.read import Run
from msahl.system.build import build_system
from msahl.system.collect import frame_index


class Joints(NamedTuple):
    """All joints of a system of n bodies; body n is the ground."""

    parent: np.ndarray  # (k,)
    child: np.ndarray  # (k,)
    s: np.ndarray  # (k, 3) the joint's point on the child from its mass centre, its axes [m]
    radius: np.ndarray  # (k,) of a rolling disk; else 0 [m]
    normal: np.ndarray  # (k, 3) of the plane it rolls on, inertial axes
    axis: np.ndarray  # (k, 3) of the disk, its body's axes


def joints_of(model: Model) -> Joints:
    """The joints of ``model``."""
    index, reactions = frame_index(model), build_system(model).reactions
    return Joints(
        parent=np.array([index[joint.parent] for joint in model.joints], dtype=np.int64),
        child=reactions.child,
        s=reactions.s,
        radius=np.array([_rolling_radius(joint) for joint in model.joints]),
        normal=np.array([j.parent_axes[Z] for j in model.joints], dtype=float).reshape(-1, 3),
        axis=np.array([j.child_axes[Z] for j in model.joints], dtype=float).reshape(-1, 3),
    )


def _rolling_radius(joint: Joint) -> float:
    """Radius of a disk that rolls, else 0 [m]."""
    for equation in KINDS[joint.kind].equations(joint):
        for product in equation.first.products if isinstance(equation, Equation) else ():
            if product.up is not None:
                return float(np.linalg.norm(product.up))
    return 0.0


def child_work(joints: Joints, run: Run, part: slice, force: np.ndarray) -> np.ndarray:
    """(m - 1, k) Hainge's definition of every joint and step between the m rows of a part;
    ``force`` (m, k, 3)."""
    table, dt = body_columns(run, part), np.diff(run.time[part])
    work = np.zeros((len(dt), force.shape[1]))
    _sum_child(joints, table, dt, force, work)
    return work


def reaction_work(
    joints: Joints, history: History, force: np.ndarray, moment: np.ndarray
) -> np.ndarray:
    """(m - 1, k) work by the exact definition; ``force`` and ``moment`` (m, k, 3), else zero."""
    work = np.zeros((len(force) - 1, force.shape[1]))
    _sum_reaction(joints, history, force, moment, work)
    return work


@kernel
def _child_work(
    joints: Joints, table: np.ndarray, dt: np.ndarray, force: np.ndarray, work: np.ndarray
) -> None:
    ground = table.shape[1] // STATE_SIZE
    for row in range(1, table.shape[0]):
        for k in range(joints.child.size):
            child = joints.child[k]
            if child == ground:  # it has no velocity
                continue
            before = three(table, row - 1, STATE_SIZE * child + 6)
            after = three(table, row, STATE_SIZE * child + 6)
            C = matrix(three(table, row, STATE_SIZE * child + 3))
            V = times(C, scale(0.5, add(before, after)))
            work[row - 1, k] = dt[row - 1] * dot(at(force[row], k), V)


@kernel
def _reaction_work(
    joints: Joints, history: History, force: np.ndarray, moment: np.ndarray, work: np.ndarray
) -> None:
    for row in range(1, force.shape[0]):
        for k in range(joints.child.size):
            a, b = joints.parent[k], joints.child[k]
            Q_a, Q_b = _rotation(history, row, a), _rotation(history, row, b)
            arm = _mean(Q_b, _carried(history, row - 1, b, at(joints.s, k)))
            P = add(_middle(history, row, b), arm)
            du_a = add(_displacement(history, row, a), cross(Q_a, sub(P, _middle(history, row, a))))
            du_b = add(_displacement(history, row, b), cross(Q_b, arm))
            F, M = at(force[row], k), at(moment[row], k)
            if joints.radius[k] > 0.0:
                e = _carried(history, row - 1, b, at(joints.axis, k))
                M = _rolling_moment(joints.radius[k], at(joints.normal, k), e, Q_b, F)
            work[row - 1, k] = dot(F, sub(du_b, du_a)) + dot(M, sub(Q_b, Q_a))


@kernel
def _rolling_moment(r: float, n: Vector, e0: Vector, Q: Vector, F: Vector) -> Vector:
    """Mean moment of a disk's reaction about its centre over a rotation increment ``Q``."""
    e1 = add(e0, rotation_change(Q, e0))
    m0, m1 = dot(n, e0), dot(n, e1)
    root0, root1 = math.sqrt(1.0 - m0 * m0), math.sqrt(1.0 - m1 * m1)
    mean = scale(0.5, add(e0, e1))
    F_n = scale(dot(F, n), n)
    lever = scale(r * (m0 + m1) / (root0 + root1), mean)
    return add(cross(rim(scale(r, n), mean), sub(F, F_n)), cross(lever, F_n))


@kernel
def _carried(history: History, row: int, b: int, a: Vector) -> Vector:
    """A vector fixed in body ``b`` in inertial axes; the ground's are those."""
    return times(matrix(at(history.p[row], b)), a)


@kernel
def _rotation(history: History, row: int, b: int) -> Vector:
    """Return the rotation increment of body ``b`` over the step that ends at ``row``."""
    before, after = at(history.p[row - 1], b), at(history.p[row], b)
    return to_increment(compose(after, inverse(before)))


@kernel
def _mean(Q: Vector, a: Vector) -> Vector:
    """Return the mean over a rotation increment ``Q`` of a vector that starts as ``a``."""
    return axpy(0.5, rotation_change(Q, a), a)


@kernel
def _displacement(history: History, row: int, b: int) -> Vector:
    """Displacement of the mass centre of body ``b`` over the step that ends at ``row``."""
    return sub(at(history.x[row], b), at(history.x[row - 1], b))


@kernel
def _middle(history: History, row: int, b: int) -> Vector:
    """Mean position of the mass centre of body ``b`` over that step."""
    return scale(0.5, add(at(history.x[row], b), at(history.x[row - 1], b)))


_sum_child = compiled(_child_work)
_sum_reaction = compiled(_reaction_work)
