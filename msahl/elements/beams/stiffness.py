"""Derivatives of the forces of beams, by the multipliers and, at fixed multipliers, by the places.

    f_a = c slope_a sum_i lam_i d_i                     of a Gauss point on node a, c = w J
    g_i = c (N_a dE/dd_i + slope_a dE/dd_i')            on its directors, E = lam . (Gamma, kappa)
    T_a = sum_i d_i^a x g_i + arm_a x f_a               moment

Rotations psi of nodes are those at the end of a step. The forces have the means of vectors over
it, which change by a ``share`` of 1/2; at one configuration the share is 1.
"""

import numpy as np

from msahl.algebra.vector import (
    ZERO,
    Matrix,
    Vector,
    at,
    axpy,
    combine,
    dot,
    matrix_at,
    multiple,
    outer,
    product,
    put,
    put_matrix,
    scale,
    skew,
    skew_product,
    transpose,
)
from msahl.elements.beams.group import (
    Q_BEND,
    Q_BY_Q,
    Q_BY_U,
    Q_STRETCH,
    U_BY_Q,
    U_STRETCH,
    Beams,
    BeamsWorkspace,
)
from msahl.elements.beams.rows import chosen
from msahl.elements.beams.strain import (
    Point,
    director_loads,
    node_gradient,
    node_vectors,
    nodes_of,
    resultants,
    rotate_rows,
)
from msahl.formulations.absolute.equations import add_block, force_factor, moment_factor
from msahl.formulations.absolute.frames import Frames
from msahl.jit.kernel import apart, kernel


@kernel
def add_loads(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    g: int,
    means: Point,
    what: tuple[float, int],
    values: np.ndarray,
) -> None:
    """Add a sign times the derivatives of the accelerations by those multipliers by mass at Gauss
    point ``g`` of which ``what`` (sign, components) speaks; ``means`` are d_i, d_i' and r' there.
    """
    sign, which = what
    one = (1.0, 1.0, 1.0)
    of_n, of_m = chosen(group, g, 0, which, one), chosen(group, g, 3, which, one)
    first, count = nodes_of(group, g)
    for a in range(count):
        m = group.node[first + a]
        f = group.frame[m]
        d, arm = node_vectors(start, m, 0.5)
        gamma, kappa = node_gradient(d, arm, means, group.value[g, a], group.slope[g, a])
        factor = sign * group.weight[g] * group.mass[g]
        c, by_q = force_factor(frames, factor, f), moment_factor(frames, factor, f)
        places = group.load_block[g, a]
        add_block(values, places[U_STRETCH], c * group.slope[g, a], _columns(means[0], of_n))
        add_block(values, places[Q_STRETCH], by_q, _columns(gamma, of_n))
        add_block(values, places[Q_BEND], by_q * group.length[g], _columns(kappa, of_m))


@kernel
def _columns(rows: Matrix, c: Vector) -> Matrix:
    """Return the matrix with the columns ``c_i`` times ``rows`` i."""
    return transpose((scale(c[0], rows[0]), scale(c[1], rows[1]), scale(c[2], rows[2])))


@kernel
def collect(
    group: Beams, start: BeamsWorkspace, g: int, lam: tuple[Vector, Vector], means: Point
) -> None:
    """Keep the multipliers ``lam`` at Gauss point ``g`` for ``add_stiffness``, and add what they
    make to g_i and f of the nodes; ``means`` are d_i, d_i' and r' there.
    """
    q, by_d, by_slope = director_loads(lam[0], lam[1], means)
    for i in range(3):
        start.lam[g, i], start.lam[g, 3 + i] = lam[0][i], lam[1][i]
    first, count = nodes_of(group, g)
    for a in range(count):
        k = first + a
        c, lever = group.weight[g] * group.value[g, a], group.weight[g] * group.slope[g, a]
        loads = combine(lever, by_slope, matrix_at(start.load, k))
        put_matrix(start.load, k, combine(c, by_d, loads))
        put(start.force, k, axpy(lever, q, at(start.force, k)))


@apart
def add_stiffness(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    share: float,
    factor: float,
    values: np.ndarray,
) -> None:
    """Add a ``factor`` times the derivatives of the accelerations by the places, at the multipliers
    of all Gauss points, which ``collect`` has been called for.
    """
    for e in range(group.first.size - 1):
        first = group.first[e]
        count = group.first[e + 1] - first
        for a in range(count):
            m = group.node[first + a]
            d, arm = node_vectors(start, m, 0.5)
            for b in range(count):
                _add_pair(group, start, frames, (e, a, b), (d, arm, share, factor), values)
            own, force = matrix_at(start.load, first + a), at(start.force, first + a)
            self = multiple(share, _self_term(*node_vectors(start, m, 1.0), own, force))
            f = group.frame[m]
            by_q = moment_factor(frames, factor, f)
            rotated = product(self, matrix_at(start.tangent, m))
            add_block(values, group.pair_block[e, a, a, Q_BY_Q], by_q, rotated)


@kernel
def _self_term(d: Matrix, arm: Vector, g: Matrix, force: Vector) -> Matrix:
    """Return the derivative of sum_i d_i x g_i + arm x force by a rotation of the d_i and arm."""
    total = dot(d[0], g[0]) + dot(d[1], g[1]) + dot(d[2], g[2]) + dot(arm, force)
    M = outer(
        1.0, arm, force, multiple(-total, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    )
    return outer(1.0, d[0], g[0], outer(1.0, d[1], g[1], outer(1.0, d[2], g[2], M)))


@kernel
def _sums(
    group: Beams, start: BeamsWorkspace, place: tuple[int, int, int]
) -> tuple[Vector, Vector, Vector, float]:
    """Return sums over the Gauss points of an element, with c = w J, of c slope_a N_b n and
    c N_a slope_b n; of c (slope_a N_b - N_a slope_b) m/2; and of c N_a N_b n_1. ``place`` is
    (element, a, b).
    """
    e, a, b = place
    ahead, behind, m, stretch = ZERO, ZERO, ZERO, 0.0
    first = group.first[e] - e
    for g in range(first, first + group.first[e + 1] - group.first[e] - 1):
        c = group.weight[g]
        i, j = c * group.slope[g, a] * group.value[g, b], c * group.value[g, a] * group.slope[g, b]
        n = (start.lam[g, 0], start.lam[g, 1], start.lam[g, 2])
        ahead, behind = axpy(i, n, ahead), axpy(j, n, behind)
        m = axpy(0.5 * (i - j), (start.lam[g, 3], start.lam[g, 4], start.lam[g, 5]), m)
        stretch += c * group.value[g, a] * group.value[g, b] * n[0]
    return ahead, behind, m, stretch


@apart
def _add_pair(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    place: tuple[int, int, int],
    of_node: tuple[Matrix, Vector, float, float],
    values: np.ndarray,
) -> None:
    """Add the derivatives of force and moment on node a by the place of node b, of the element e of
    ``place`` (e, a, b); ``of_node`` are mean directors and arm of a, share and factor.

    They are linear in the multipliers, so these are summed over the Gauss points first.
    """
    e, a, b = place
    d_a, arm_a, share, factor = of_node
    first = group.first[e]
    f, n = group.frame[group.node[first + a]], group.node[first + b]
    d_b, arm_b = node_vectors(start, n, 1.0)
    ahead, behind, m, stretch = _sums(group, start, place)
    q_a, q_b = skew(resultants(behind, d_a)), skew(scale(-1.0, resultants(ahead, d_b)))
    by_q = _pair_term(m, d_a, d_b)
    by_q = combine(-stretch, _double_cross(d_a[0], d_b[0]), by_q)
    by_q = combine(-1.0, product(q_a, skew(arm_b)), by_q)
    by_q = combine(1.0, skew_product(arm_a, q_b), by_q)
    places = group.pair_block[e, a, b]
    of_force = force_factor(frames, share * factor, f)
    of_moment = moment_factor(frames, share * factor, f)
    G = matrix_at(start.tangent, n)
    add_block(values, places[U_BY_Q], of_force, product(q_b, G))
    add_block(values, places[Q_BY_U], of_moment, q_a)
    add_block(values, places[Q_BY_Q], of_moment, product(by_q, G))


@kernel
def _double_cross(a: Vector, b: Vector) -> Matrix:
    """Return the matrix of a x ((.) x b): (a.b) 1 - b a^T."""
    M = multiple(dot(a, b), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    return outer(-1.0, b, a, M)


@kernel
def _pair_term(m: Vector, d_a: Matrix, d_b: Matrix) -> Matrix:
    """Return tr(X) - X^T of X = sum_i d_i^a s_i^T with the rows s = S d^b of ``rotate_rows``."""
    s = rotate_rows(m, d_b)
    total = dot(d_a[0], s[0]) + dot(d_a[1], s[1]) + dot(d_a[2], s[2])
    M = multiple(total, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    return outer(-1.0, s[0], d_a[0], outer(-1.0, s[1], d_a[1], outer(-1.0, s[2], d_a[2], M)))
