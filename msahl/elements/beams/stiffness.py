"""Derivatives of the forces of beams, by the multipliers and, at fixed multipliers, by the places.

    f_a = c slope_a sum_i lam_i d_i                     of a Gauss point on node a, c = w J
    g_i = c (N_a dE/dd_i + slope_a dE/dd_i')            on its directors, E = lam . (Gamma, kappa)
    T_a = sum_i d_i^a x g_i + arm_a x f_a               moment

Rotations psi of nodes are those at the end of a step. The forces have the means of vectors over
it, which change by a ``share`` of 1/2; at one configuration the share is 1.
"""

import numpy as np

from msahl.algebra.vector import (
    Matrix,
    Vector,
    combine,
    dot,
    matrix_at,
    multiple,
    outer,
    product,
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
from msahl.elements.constraints.products import add_block
from msahl.elements.frames import Frames
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
        c = sign * group.weight[g] * group.mass[g] * frames.inverse_mass[f]
        by_q = c / frames.length[f]
        places = group.load_block[g, a]
        add_block(values, places[U_STRETCH], c * group.slope[g, a], _columns(means[0], of_n))
        add_block(values, places[Q_STRETCH], by_q, _columns(gamma, of_n))
        add_block(values, places[Q_BEND], by_q * group.length[g], _columns(kappa, of_m))


@kernel
def _columns(rows: Matrix, c: Vector) -> Matrix:
    """Return the matrix with the columns ``c_i`` times ``rows`` i."""
    return transpose((scale(c[0], rows[0]), scale(c[1], rows[1]), scale(c[2], rows[2])))


@apart
def add_stiffness(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    g: int,
    lam: tuple[Vector, Vector],
    at_point: tuple[Point, float, float],
    values: np.ndarray,
) -> None:
    """Add a factor times the derivatives of the accelerations by the places, at the multipliers
    ``lam`` of Gauss point ``g``; ``at_point`` are the means there, the share and the factor.
    """
    means, share, factor = at_point
    q, by_d, by_slope = director_loads(lam[0], lam[1], means)
    c = group.weight[g]
    first, count = nodes_of(group, g)
    for a in range(count):
        m = group.node[first + a]
        d, arm = node_vectors(start, m, 0.5)
        N, slope = group.value[g, a], group.slope[g, a]
        own = combine(c * N, by_d, multiple(c * slope, by_slope))
        force = scale(c * slope, q)
        for b in range(count):
            _add_pair(group, start, frames, (g, a, b), lam, (d, arm, share, factor), values)
        self = multiple(share, _self_term(*node_vectors(start, m, 1.0), own, force))
        f, e = group.frame[m], group.element[g]
        by_q = factor * frames.inverse_mass[f] / frames.length[f]
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


@apart
def _add_pair(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    place: tuple[int, int, int],
    lam: tuple[Vector, Vector],
    of_node: tuple[Matrix, Vector, float, float],
    values: np.ndarray,
) -> None:
    """Add the derivatives of force and moment on node a by the place of node b, at the Gauss point
    g of ``place`` (g, a, b); ``of_node`` are mean directors and arm of a, share and factor.
    """
    g, a, b = place
    d_a, arm_a, share, factor = of_node
    e = group.element[g]
    first = group.first[e]
    f, n = group.frame[group.node[first + a]], group.node[first + b]
    d_b, arm_b = node_vectors(start, n, 1.0)
    c = share * group.weight[g]
    ahead, behind = (
        c * group.slope[g, a] * group.value[g, b],
        c * group.value[g, a] * group.slope[g, b],
    )
    q_a, q_b = skew(resultants(lam[0], d_a)), skew(scale(-ahead, resultants(lam[0], d_b)))
    by_q = _pair_term(scale(0.5 * (ahead - behind), lam[1]), d_a, d_b)
    stretch = -c * group.value[g, a] * group.value[g, b] * lam[0][0]
    by_q = combine(stretch, _double_cross(d_a[0], d_b[0]), by_q)
    by_q = combine(-behind, product(q_a, skew(arm_b)), by_q)
    by_q = combine(1.0, skew_product(arm_a, q_b), by_q)
    places = group.pair_block[e, a, b]
    of_force = factor * frames.inverse_mass[f]
    of_moment = of_force / frames.length[f]
    G = matrix_at(start.tangent, n)
    add_block(values, places[U_BY_Q], of_force, product(q_b, G))
    add_block(values, places[Q_BY_U], of_moment * behind, q_a)
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
