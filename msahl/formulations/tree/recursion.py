"""Motion, momenta and forces of a tree of rigid bodies, at several nodes of a step at once.

World axes, spatial vectors about one fixed origin O. For each coordinate q_k with its axis a
through P, and each body with its mass centre c:

    S_k = (a, P x a) for a hinge, (0, a) for a slide       motion by a unit rate
    V   = sum S_k u_k      over the coordinates between the ground and the body: its twist
    h   = (c x m v_c + J w, m v_c)                         its momentum
    F   = (c x f + M, f)                                   the load on it
    H, W    sums of h and F over the body of q_k and all beyond it

    p_k = S_k . H ,    dp_k/dt = (dS_k/dt) . H + S_k . W ,    dS_k/dt = V x S_k

so momenta and their rates take one sweep from the ground and one back, and no derivative of the
mass matrix. Coordinates count from the start of the step; ``begin`` takes from the state where
bodies and axes are then.

For a ball ``moment`` has in addition the rates of its momenta about the axes that its hinges have
at the start of the step, if these were all fixed in its parent: the components of a vector there,
which the rates of the hinges' momenta are not.

Source: R. Featherstone, Rigid Body Dynamics Algorithms (2008), for spatial vectors; the rates of
the momenta follow from Lagrange's equations, dT/dq_k = (dS_k/dt) . H.
"""

import numpy as np

from msahl.algebra.lanes import (
    LaneVector,
    accumulate_vector,
    cross,
    difference,
    dot,
    half_angle,
    matrix_at,
    matrix_of,
    multiple,
    put_quaternion,
    put_vector,
    quaternion_at,
    rotated,
    rotation_change,
    spread_vector,
    sum_of,
    times,
    transposed_times,
    vector_at,
)
from msahl.algebra.vector import (
    ZERO,
    Vector,
    add,
    at,
    axpy,
    product,
    put,
    put_matrix,
    scale,
    sub,
    transpose,
)
from msahl.algebra.vector import cross as cross_product
from msahl.algebra.vector import dot as scalar_product
from msahl.algebra.vector import matrix_at as plain_matrix
from msahl.algebra.vector import times as plain_times
from msahl.formulations.absolute.frames import FramesWorkspace
from msahl.formulations.tree.table import ALIGN_AXES, Tree, TreeMotion
from msahl.jit.kernel import kernel, unit
from msahl.jit.lanes import load, spread, store


@unit
def begin(tree: Tree, motion: TreeMotion, x: np.ndarray, frames: FramesWorkspace) -> None:
    """Set the start of a step from mass centres ``x`` (f, 3) [m] and the prepared ``frames``, with
    the rates and momenta of all coordinates there.
    """
    R = frames.R
    put(motion.parent_arm, 0, ZERO)
    for b in range(1, tree.frame.size):
        f, g = tree.frame[b], tree.frame[tree.parent[b]]
        put_matrix(motion.inertia, b, _in_world(tree, R, b))
        put(motion.child_arm, b, plain_times(plain_matrix(R, f), at(tree.child_point, b)))
        put(motion.parent_arm, b, plain_times(plain_matrix(R, g), at(tree.parent_point, b)))
        _align(tree, motion, R, b)
        offset = sub(add(at(x, f), at(motion.child_arm, b)), at(x, g))
        offset = sub(offset, at(motion.parent_arm, b))
        for k in range(tree.first[b], tree.first[b + 1]):
            axis = plain_times(plain_matrix(R, tree.axis_frame[k]), at(tree.axis, k))
            put(motion.axis, k, axis)
            if tree.slides[k]:
                way = scale(scalar_product(offset, axis), axis)
                put(motion.parent_arm, b, add(at(motion.parent_arm, b), way))
        _set_rates(tree, motion, frames, b)
    ground = at(x, tree.frame[0])
    origin = add(ground, at(motion.parent_arm, 1))
    for i in range(3):
        motion.origin[i] = origin[i]
        store(motion.place, i, spread(ground[i] - origin[i]))
    _begin_momenta(tree, motion, x, frames)


@kernel
def _in_world(tree: Tree, R: np.ndarray, b: int) -> tuple[Vector, Vector, Vector]:
    """Inertia of body ``b`` in inertial axes."""
    R_b = plain_matrix(R, tree.frame[b])
    return product(product(R_b, plain_matrix(tree.inertia, b)), transpose(R_b))


@kernel
def _align(tree: Tree, motion: TreeMotion, R: np.ndarray, b: int) -> None:
    """Set half the rotation that makes axes meet which rounding errors of many steps part."""
    e = ZERO
    if tree.alignment[b] > 0:
        R_p, R_c = plain_matrix(R, tree.frame[tree.parent[b]]), plain_matrix(R, tree.frame[b])
        first, share = (2, 0.5) if tree.alignment[b] == ALIGN_AXES else (0, 0.25)
        for i in range(first, 3):
            mine = plain_times(R_c, at(tree.child_axes[b], i))
            its = plain_times(R_p, at(tree.parent_axes[b], i))
            e = axpy(share, cross_product(mine, its), e)
    put(motion.misalignment, b, e)


@kernel
def _set_rates(tree: Tree, motion: TreeMotion, frames: FramesWorkspace, b: int) -> None:
    """Set the rates of the coordinates of body ``b`` at the start, whose axes are perpendicular."""
    f, g = tree.frame[b], tree.frame[tree.parent[b]]
    arm, arm_g = at(motion.child_arm, b), at(motion.parent_arm, b)
    w = sub(at(frames.W, f), at(frames.W, g))
    v = sub(at(frames.v, f), at(frames.v, g))
    v = add(v, sub(cross_product(at(frames.W, f), arm), cross_product(at(frames.W, g), arm_g)))
    for k in range(tree.first[b], tree.first[b + 1]):
        motion.rate[k] = scalar_product(at(motion.axis, k), v if tree.slides[k] else w)


@kernel
def _begin_momenta(tree: Tree, motion: TreeMotion, x: np.ndarray, frames: FramesWorkspace) -> None:
    """Set the momenta of the coordinates at the start, from the velocities of the bodies."""
    origin = (motion.origin[0], motion.origin[1], motion.origin[2])
    for row in range(motion.momenta.shape[0]):
        store(motion.momenta, row, spread(0.0))
    for b in range(tree.frame.size - 1, 0, -1):
        f = tree.frame[b]
        c = sub(at(x, f), origin)
        linear = scale(tree.mass[b], at(frames.v, f))
        angular = plain_times(plain_matrix(motion.inertia, b), at(frames.W, f))
        angular = add(angular, cross_product(c, linear))
        accumulate_vector(motion.momenta, 6 * b, spread_vector(angular))
        accumulate_vector(motion.momenta, 6 * b + 3, spread_vector(linear))
        point = add(c, at(motion.child_arm, b))
        L = (motion.momenta[6 * b, 0], motion.momenta[6 * b + 1, 0], motion.momenta[6 * b + 2, 0])
        P = (
            motion.momenta[6 * b + 3, 0],
            motion.momenta[6 * b + 4, 0],
            motion.momenta[6 * b + 5, 0],
        )
        about = sub(L, cross_product(point, P))
        for k in range(tree.first[b], tree.first[b + 1]):
            motion.momentum[k] = scalar_product(at(motion.axis, k), P if tree.slides[k] else about)
        if tree.parent[b] > 0:
            place = 6 * tree.parent[b]
            accumulate_vector(motion.momenta, place, vector_at(motion.momenta, 6 * b))
            accumulate_vector(motion.momenta, place + 3, vector_at(motion.momenta, 6 * b + 3))


@unit
def set_places(tree: Tree, motion: TreeMotion) -> None:
    """Set places, rotations and screws at the coordinates ``motion.q``."""
    for b in range(1, tree.frame.size):
        before = tree.parent[b]
        D = matrix_at(motion.rotation, 9 * before)
        e = quaternion_at(motion.quaternion, 4 * before)
        P = sum_of(vector_at(motion.place, 3 * before), times(D, at(motion.parent_arm, b)))
        for k in range(tree.first[b], tree.first[b + 1]):
            axis = at(motion.axis, k)
            a = times(D, axis)
            if tree.slides[k]:
                put_vector(motion.screw, 6 * k, spread_vector(ZERO))
                put_vector(motion.screw, 6 * k + 3, a)
                P = sum_of(P, multiple(load(motion.q, k), a))
            else:
                put_vector(motion.screw, 6 * k, a)
                put_vector(motion.screw, 6 * k + 3, cross(P, a))
                sine, cosine = half_angle(load(motion.q, k))
                e = rotated(e, axis, sine, cosine)
                D = matrix_of(e)
        if tree.alignment[b] > 0:
            e = rotated(e, at(motion.misalignment, b), spread(1.0), spread(1.0))
            D = matrix_of(e)
        put_quaternion(motion.quaternion, 4 * b, e)
        for i in range(3):
            put_vector(motion.rotation, 9 * b + 3 * i, D[i])
        put_vector(motion.place, 3 * b, difference(P, times(D, at(motion.child_arm, b))))


@unit
def set_displacements(tree: Tree, motion: TreeMotion, out: np.ndarray) -> None:
    """Set ``out`` (3 (b+1), LANES) to the displacements [m] of all mass centres since the start of
    the step, after ``set_places``; unlike differences of places they have no round-off of these.
    """
    put_vector(out, 0, spread_vector(ZERO))
    for b in range(1, tree.frame.size):
        before = tree.parent[b]
        e = quaternion_at(motion.quaternion, 4 * before)
        u = sum_of(vector_at(out, 3 * before), rotation_change(e, at(motion.parent_arm, b)))
        for k in range(tree.first[b], tree.first[b + 1]):
            if tree.slides[k]:
                u = sum_of(u, multiple(load(motion.q, k), vector_at(motion.screw, 6 * k + 3)))
        e = quaternion_at(motion.quaternion, 4 * b)
        put_vector(out, 3 * b, difference(u, rotation_change(e, at(motion.child_arm, b))))


@unit
def set_twists(tree: Tree, motion: TreeMotion) -> None:
    """Set the twists of all bodies and the rates of their screws, at the rates ``motion.u``, after
    ``set_places``.
    """
    for b in range(1, tree.frame.size):
        before = 6 * tree.parent[b]
        w, v = vector_at(motion.twist, before), vector_at(motion.twist, before + 3)
        for k in range(tree.first[b], tree.first[b + 1]):
            a, s = vector_at(motion.screw, 6 * k), vector_at(motion.screw, 6 * k + 3)
            put_vector(motion.screw_rate, 6 * k, cross(w, a))
            put_vector(motion.screw_rate, 6 * k + 3, sum_of(cross(w, s), cross(v, a)))
            rate = load(motion.u, k)
            w = sum_of(w, multiple(rate, a))
            v = sum_of(v, multiple(rate, s))
        put_vector(motion.twist, 6 * b, w)
        put_vector(motion.twist, 6 * b + 3, v)


@unit
def set_momenta(tree: Tree, motion: TreeMotion) -> None:
    """Set the momenta of all coordinates and their rates by the loads ``motion.load``, after
    ``set_twists``.
    """
    bodies = tree.frame.size
    for b in range(1, bodies):
        w, v = vector_at(motion.twist, 6 * b), vector_at(motion.twist, 6 * b + 3)
        c, D = vector_at(motion.place, 3 * b), matrix_at(motion.rotation, 9 * b)
        linear = multiple(tree.mass[b], sum_of(v, cross(w, c)))
        J = plain_matrix(motion.inertia, b)
        angular = times(D, times(J, transposed_times(D, w)))
        put_vector(motion.momenta, 6 * b, sum_of(angular, cross(c, linear)))
        put_vector(motion.momenta, 6 * b + 3, linear)
        weight = scale(tree.mass[b], (tree.gravity[0], tree.gravity[1], tree.gravity[2]))
        force = sum_of(vector_at(motion.load, 6 * b + 3), spread_vector(weight))
        moment = sum_of(vector_at(motion.load, 6 * b), cross(c, force))
        put_vector(motion.wrench, 6 * b, moment)
        put_vector(motion.wrench, 6 * b + 3, force)
    for b in range(bodies - 1, 0, -1):
        L, P = vector_at(motion.momenta, 6 * b), vector_at(motion.momenta, 6 * b + 3)
        M, F = vector_at(motion.wrench, 6 * b), vector_at(motion.wrench, 6 * b + 3)
        for k in range(tree.first[b], tree.first[b + 1]):
            a, s = vector_at(motion.screw, 6 * k), vector_at(motion.screw, 6 * k + 3)
            da, ds = vector_at(motion.screw_rate, 6 * k), vector_at(motion.screw_rate, 6 * k + 3)
            store(motion.p, k, dot(a, L) + dot(s, P))
            store(motion.force, k, dot(da, L) + dot(ds, P) + dot(a, M) + dot(s, F))
        if tree.ball[b] >= 0:
            _set_moment(tree, motion, b)
        if tree.parent[b] > 0:
            place = 6 * tree.parent[b]
            accumulate_vector(motion.momenta, place, L)
            accumulate_vector(motion.momenta, place + 3, P)
            accumulate_vector(motion.wrench, place, M)
            accumulate_vector(motion.wrench, place + 3, F)


@kernel
def _set_moment(tree: Tree, motion: TreeMotion, b: int) -> None:
    """Set the rates of the momenta of the ball of body ``b`` about axes fixed in its parent."""
    L, P = vector_at(motion.momenta, 6 * b), vector_at(motion.momenta, 6 * b + 3)
    M, F = vector_at(motion.wrench, 6 * b), vector_at(motion.wrench, 6 * b + 3)
    point = pivot(tree, motion, b)
    w, v = vector_at(motion.twist, 6 * b), vector_at(motion.twist, 6 * b + 3)
    velocity = sum_of(v, cross(w, point))
    before = tree.parent[b]
    w, D = vector_at(motion.twist, 6 * before), matrix_at(motion.rotation, 9 * before)
    for k in range(tree.ball[b], tree.first[b + 1]):
        a = times(D, at(motion.axis, k))
        s, da = cross(point, a), cross(w, a)
        ds = sum_of(cross(velocity, a), cross(point, da))
        store(motion.moment, k, dot(da, L) + dot(ds, P) + dot(a, M) + dot(s, F))


@kernel
def pivot(tree: Tree, motion: TreeMotion, b: int) -> LaneVector:
    """Point about which the last hinges of body ``b`` rotate, from the origin."""
    D = matrix_at(motion.rotation, 9 * b)
    return sum_of(vector_at(motion.place, 3 * b), times(D, at(motion.child_arm, b)))
