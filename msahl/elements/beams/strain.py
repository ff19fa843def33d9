"""Strains of beams: their values, exact changes over a step, and gradients.

    Gamma_1 = d_1 . r' + (1 - d_1 . d_1)/2                      stretch
    Gamma_i = d_i . r'                                          shears, i = 2, 3
    kappa_l = (d_k . d_j' - d_j . d_k')/2 ,  (l, j, k) cyclic   torsion and bendings, [1/m]

    r(s) = sum_a N_a r_a ,  d_i(s) = sum_a N_a d_i^a            between the nodes a of an element
    r_a    point of the reference line at a node, mass centre + arm
    d_i^a  axes of the node

The directors between nodes that differ by a rotation t are shorter, by the order of t^2, which the
second term of Gamma_1 makes up for: else tension would let neighbouring nodes rotate to and fro. It
is zero where directors are unit vectors, and leaves the order of convergence.

They are sums of scalar products of directors and of differences of positions, so they do not change
in a rigid motion. They are quadratic in (r, d): over a step a product a . b changes by exactly
mean(a) . db + mean(b) . da, and d_i^a by Q_a x mean(d_i^a). So forces with the means of all vectors
do exactly the work lam . (change of the strains).

Source: A. Ibrahimbegovic, S. Mamouri (1998) and P. Betsch, P. Steinmann, Frame-indifferent beam
finite elements, Int. J. Numer. Meth. Eng. 54 (2002), for the interpolation of directors;
I. Romero, F. Armero, ibid., for the exact changes; the mixed form and the degrees are ours.
"""

import numpy as np

from msahl.algebra.rotation import rotation_change, rotation_tangent
from msahl.algebra.vector import (
    ZERO,
    Matrix,
    Vector,
    add,
    at,
    axpy,
    combine,
    cross,
    dot,
    matrix_at,
    multiple,
    put,
    put_matrix,
    scale,
    sub,
    times,
    transpose,
)
from msahl.elements.beams.group import Beams, BeamsWorkspace
from msahl.formulations.absolute.frames import Frames, displacement, rotation_increment
from msahl.jit.kernel import apart, kernel

NONE: Matrix = (ZERO, ZERO, ZERO)
Point = tuple[Matrix, Matrix, Vector]
"""Directors d_i, their derivatives d_i' (rows), and r' at a Gauss point; or changes of these."""


@kernel
def set_configuration(group: Beams, x: np.ndarray, R: np.ndarray, start: BeamsWorkspace) -> None:
    """Set directors and r' of the configuration; r' is by differences of positions."""
    for m in range(group.frame.size):
        axes = matrix_at(R, group.frame[m])
        put_matrix(start.d, m, transpose(axes))
        put(start.arm, m, times(axes, at(group.arm, m)))
    for g in range(group.element.size):
        director, d_slope, r_slope = NONE, NONE, ZERO
        first, count = nodes_of(group, g)
        origin = at(x, group.frame[group.node[first]])
        for a in range(count):
            m = group.node[first + a]
            N, slope = group.value[g, a], group.slope[g, a]
            d = matrix_at(start.d, m)
            director, d_slope = combine(N, d, director), combine(slope, d, d_slope)
            place = add(sub(at(x, group.frame[m]), origin), at(start.arm, m))
            r_slope = axpy(slope, place, r_slope)
        put_matrix(start.director, g, director)
        put_matrix(start.d_slope, g, d_slope)
        put(start.r_slope, g, r_slope)


@kernel
def nodes_of(group: Beams, g: int) -> tuple[int, int]:
    """Return where the nodes of the element of Gauss point ``g`` begin, and their number."""
    e = group.element[g]
    first = int(group.first[e])
    return first, int(group.first[e + 1]) - first


@kernel
def strain_at(group: Beams, start: BeamsWorkspace, g: int) -> tuple[Vector, Vector]:
    """Return Gamma and kappa of the configuration at Gauss point ``g``, less the reference."""
    d, d_slope = matrix_at(start.director, g), matrix_at(start.d_slope, g)
    r_slope, kappa = at(start.r_slope, g), bending(d, d_slope)
    zero = group.reference
    return (
        (
            dot(d[0], r_slope) + 0.5 * (1.0 - dot(d[0], d[0])) - zero[g, 0],
            dot(d[1], r_slope) - zero[g, 1],
            dot(d[2], r_slope) - zero[g, 2],
        ),
        (kappa[0] - zero[g, 3], kappa[1] - zero[g, 4], kappa[2] - zero[g, 5]),
    )


@kernel
def bending(d: Matrix, d_slope: Matrix) -> Vector:
    """Return (d_k . b_j - d_j . b_k)/2, (l, j, k) cyclic, of directors d_i and b_i."""
    return (
        0.5 * (dot(d[2], d_slope[1]) - dot(d[1], d_slope[2])),
        0.5 * (dot(d[0], d_slope[2]) - dot(d[2], d_slope[0])),
        0.5 * (dot(d[1], d_slope[0]) - dot(d[0], d_slope[1])),
    )


@kernel
def move(group: Beams, start: BeamsWorkspace, frames: Frames, Z: np.ndarray) -> None:
    """Set the changes of the nodes' directors and points over the step of the unknowns ``Z``."""
    for m in range(group.frame.size):
        f = group.frame[m]
        Q, d = rotation_increment(frames, Z, f), matrix_at(start.d, m)
        for i in range(3):
            change = rotation_change(Q, d[i])
            start.d_change[m, i, 0], start.d_change[m, i, 1], start.d_change[m, i, 2] = change
        arm_change = rotation_change(Q, at(start.arm, m))
        put(start.arm_change, m, arm_change)
        put(start.moved, m, add(displacement(frames, Z, f), arm_change))


@kernel
def set_tangents(group: Beams, start: BeamsWorkspace, frames: Frames, Z: np.ndarray) -> None:
    """Set the derivatives of the nodes' rotations by the unknowns, and the loads that
    ``stiffness.collect`` adds to to zero.
    """
    for k in range(group.node.size):
        put_matrix(start.load, k, NONE)
        put(start.force, k, ZERO)
    for m in range(group.frame.size):
        f = group.frame[m]
        D = rotation_tangent(rotation_increment(frames, Z, f))
        put_matrix(start.tangent, m, multiple(1.0 / frames.length[f], D))


@kernel
def node_vectors(start: BeamsWorkspace, m: int, part: float) -> tuple[Matrix, Vector]:
    """Return directors and arm of node ``m`` after a ``part`` of their changes: 1/2 for the means
    over the step, 1 for its end.
    """
    d = combine(part, matrix_at(start.d_change, m), matrix_at(start.d, m))
    return d, axpy(part, at(start.arm_change, m), at(start.arm, m))


@kernel
def point_vectors(start: BeamsWorkspace, g: int, changed: Point, part: float) -> Point:
    """Return d_i, d_i' and r' at Gauss point ``g`` after a ``part`` of their changes."""
    dd, db, dr = changed
    return (
        combine(part, dd, matrix_at(start.director, g)),
        combine(part, db, matrix_at(start.d_slope, g)),
        axpy(part, dr, at(start.r_slope, g)),
    )


@apart
def changes(group: Beams, start: BeamsWorkspace, g: int) -> Point:
    """Return the changes of d_i, d_i' and r' at Gauss point ``g``, after ``move``."""
    director, d_slope, r_slope = NONE, NONE, ZERO
    first, count = nodes_of(group, g)
    for a in range(count):
        m = group.node[first + a]
        N, slope = group.value[g, a], group.slope[g, a]
        change = matrix_at(start.d_change, m)
        director, d_slope = combine(N, change, director), combine(slope, change, d_slope)
        r_slope = axpy(slope, at(start.moved, m), r_slope)
    return director, d_slope, r_slope


@kernel
def set_change(start: BeamsWorkspace, g: int, changed: Point) -> Point:
    """Set the change of the strains at Gauss point ``g``; return the means of d_i, d_i' and r'."""
    dd, db, dr = changed
    d, b, r = point_vectors(start, g, changed, 0.5)
    kappa = add(bending(d, db), bending(dd, b))
    start.change[g, 0] = dot(d[0], dr) + dot(dd[0], sub(r, d[0]))
    for i in range(1, 3):
        start.change[g, i] = dot(d[i], dr) + dot(dd[i], r)
    for i in range(3):
        start.change[g, 3 + i] = kappa[i]
    return d, b, r


@kernel
def resultants(lam: Vector, a: Matrix) -> Vector:
    """Return the sum of ``lam_i a_i``."""
    return axpy(lam[0], a[0], axpy(lam[1], a[1], scale(lam[2], a[2])))


@kernel
def rotate_rows(m: Vector, a: Matrix) -> Matrix:
    """Return the rows S a with S_jk = m_l for (l, j, k) cyclic, minus that for (l, k, j)."""
    return (
        axpy(m[2], a[1], scale(-m[1], a[2])),
        axpy(m[0], a[2], scale(-m[2], a[0])),
        axpy(m[1], a[0], scale(-m[0], a[1])),
    )


@kernel
def director_loads(n: Vector, m: Vector, means: Point) -> tuple[Vector, Matrix, Matrix]:
    """Return the derivatives of n . Gamma + m . kappa by r', by d_i and by d_i'."""
    d, b, r = means
    half = rotate_rows(scale(0.5, m), b)
    by_d = (
        sub(scale(n[0], sub(r, d[0])), half[0]),
        sub(scale(n[1], r), half[1]),
        sub(scale(n[2], r), half[2]),
    )
    return resultants(n, d), by_d, rotate_rows(scale(0.5, m), d)


@kernel
def node_gradient(
    d: Matrix, arm: Vector, at_point: Point, N: float, slope: float
) -> tuple[Matrix, Matrix]:
    """Return the derivatives (rows) of Gamma and kappa by the rotation of a node with the directors
    ``d``, the ``arm`` and the shape function ``N``.
    """
    D, B, r = at_point
    y = (
        axpy(-slope, D[0], scale(N, B[0])),
        axpy(-slope, D[1], scale(N, B[1])),
        axpy(-slope, D[2], scale(N, B[2])),
    )
    Nr, lever = scale(N, r), scale(slope, arm)
    gamma = (
        add(cross(d[0], scale(N, sub(r, D[0]))), cross(lever, D[0])),
        add(cross(d[1], Nr), cross(lever, D[1])),
        add(cross(d[2], Nr), cross(lever, D[2])),
    )
    kappa = (
        scale(0.5, sub(cross(d[2], y[1]), cross(d[1], y[2]))),
        scale(0.5, sub(cross(d[0], y[2]), cross(d[2], y[0]))),
        scale(0.5, sub(cross(d[1], y[0]), cross(d[0], y[1]))),
    )
    return gamma, kappa
