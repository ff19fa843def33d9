"""Derivatives of the equations and forces of beams in a plane; as ``rows`` and ``stiffness``.

Entries of the blocks out of the plane stay zero: they belong to no unknown that is solved for.
"""

import numpy as np

from msahl.elements.beams.group import (
    BEND_Q,
    Q_BEND,
    Q_BY_Q,
    Q_BY_U,
    Q_STRETCH,
    STRETCH_Q,
    STRETCH_U,
    U_BY_Q,
    U_STRETCH,
    Beams,
    BeamsWorkspace,
    Plane,
)
from msahl.elements.beams.plane import (
    Flat,
    FlatPoint,
    Three,
    axes_of,
    axpy,
    components,
    cross,
    dot,
    loads_of,
    node_vectors,
    perpendicular,
    scale,
    signs,
)
from msahl.elements.beams.rows import own_compliance
from msahl.elements.beams.strain import nodes_of
from msahl.formulations.absolute.equations import force_factor, moment_factor
from msahl.formulations.absolute.frames import Frames, rotation_node
from msahl.jit.kernel import apart, kernel


@kernel
def node_gradient(
    D: Flat, arm: Flat, at_point: FlatPoint, sign: Flat, N: float, slope: float
) -> Three:
    """Return the derivatives of the strains at a point by the rotation of a node with the director
    ``D``, the ``arm`` and the shape function ``N``.
    """
    P, B, r = at_point
    stretch = N * cross(D, axpy(-1.0, P, r)) + slope * cross(arm, P)
    shear = slope * dot(arm, P) - N * dot(D, r)
    return stretch, sign[0] * shear, sign[1] * (slope * dot(D, P) - N * dot(D, B))


@kernel
def add_equations(
    plane: Plane,
    group: Beams,
    start: BeamsWorkspace,
    g: int,
    at_point: FlatPoint,
    factor: Three,
    values: np.ndarray,
) -> None:
    """Add ``factor`` times the derivatives of the strains at Gauss point ``g`` by the places of its
    nodes at the end of the step.
    """
    sign = signs(plane, g)
    first, count = nodes_of(group, g)
    for a in range(count):
        D, arm = node_vectors(plane, start, group.node[first + a], 1.0)
        by_q = node_gradient(D, arm, at_point, sign, group.value[g, a], group.slope[g, a])
        add_rows(plane, group, start, (g, a), (at_point[0], by_q), factor, values)


@kernel
def add_rows(
    plane: Plane,
    group: Beams,
    start: BeamsWorkspace,
    place: tuple[int, int],
    by: tuple[Flat, Three],
    factor: Three,
    values: np.ndarray,
) -> None:
    """Add ``factor`` times the derivatives of the strains at Gauss point g by the place of node a
    of its element, (g, a) being ``place``: ``by`` are D at the point and those by the rotation.
    Block 0 belongs to no node.
    """
    (g, a), (D, by_q) = place, by
    (i, j, k), (_, s, n) = axes_of(plane), components(plane, g)
    places, slope = group.load_block[g, a], group.slope[g, a]
    G = start.tangent[group.node[group.first[group.element[g]] + a], 0, 0]
    if places[STRETCH_U] > 0:
        u, q, bend = places[STRETCH_U], places[STRETCH_Q], places[BEND_Q]
        along, across = factor[0] * slope, factor[1] * slope * plane.shear_sign[g]
        values[u + i] += along * D[0]
        values[u + j] += along * D[1]
        values[u + 3 * s + i] -= across * D[1]
        values[u + 3 * s + j] += across * D[0]
        values[q + k] += factor[0] * by_q[0] * G
        values[q + 3 * s + k] += factor[1] * by_q[1] * G
        values[bend + 3 * (n - 3) + k] += factor[2] * by_q[2] * G


@kernel
def set_tangents(
    plane: Plane, group: Beams, start: BeamsWorkspace, frames: Frames, Z: np.ndarray
) -> None:
    """Set the derivatives of the nodes' rotations by the unknowns, and the loads that ``collect``
    adds to to zero.
    """
    for m in range(group.frame.size):
        f = group.frame[m]
        q = Z[rotation_node(frames, f), plane.axes[2]] / frames.length[f]
        start.tangent[m, 0, 0] = 1.0 / (frames.length[f] * (1.0 + 0.25 * q * q))
    for k in range(group.node.size):
        for i in range(2):
            start.load[k, 0, i] = 0.0
            start.force[k, i] = 0.0


@kernel
def add_compliance(
    plane: Plane, group: Beams, g: int, i: int, divisor: float, values: np.ndarray
) -> None:
    """Add the derivatives of equation ``i`` at Gauss point ``g`` by its multipliers, divided."""
    for j in components(plane, g):
        place = group.compliance_block[g, i // 3, j // 3] + 3 * (i % 3) + j % 3
        values[place] += own_compliance(group, g, i, j) / divisor


@kernel
def add_loads(
    plane: Plane,
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    g: int,
    means: FlatPoint,
    factor: Three,
    values: np.ndarray,
) -> None:
    """Add ``factor`` times the derivatives of the accelerations by the multipliers by mass at Gauss
    point ``g``; ``means`` are D, D' and r' there.
    """
    (i, j, k), (_, s, n), sign = axes_of(plane), components(plane, g), signs(plane, g)
    P, mass = means[0], group.weight[g] * group.mass[g]
    first, count = nodes_of(group, g)
    for a in range(count):
        m = group.node[first + a]
        f = group.frame[m]
        D, arm = node_vectors(plane, start, m, 0.5)
        slope = group.slope[g, a]
        stretch, shear, bend = node_gradient(D, arm, means, sign, group.value[g, a], slope)
        places = group.load_block[g, a]
        if places[U_STRETCH] > 0:
            u = places[U_STRETCH]
            q, q_bend = places[Q_STRETCH] + 3 * k, places[Q_BEND] + 3 * k
            c, by_q = force_factor(frames, mass, f) * slope, moment_factor(frames, mass, f)
            along, across = factor[0] * c, factor[1] * c * sign[0]
            values[u + 3 * i] += along * P[0]
            values[u + 3 * j] += along * P[1]
            values[u + 3 * i + s] -= across * P[1]
            values[u + 3 * j + s] += across * P[0]
            values[q] += factor[0] * by_q * stretch
            values[q + s] += factor[1] * by_q * shear
            values[q_bend + n - 3] += factor[2] * by_q * group.length[g] * bend


@kernel
def collect(
    plane: Plane, group: Beams, start: BeamsWorkspace, g: int, lam: Three, means: FlatPoint
) -> None:
    """Keep the multipliers ``lam``, times the signs, at Gauss point ``g`` for ``add_stiffness``,
    and add the loads that they make to those of the nodes; ``means`` are D, D' and r' there.
    """
    sign = signs(plane, g)
    q, by_D, by_slope = loads_of(lam, sign, means)
    start.lam[g, 0], start.lam[g, 1] = lam[0], sign[0] * lam[1]
    start.lam[g, 2] = sign[1] * lam[2]
    first, count = nodes_of(group, g)
    for a in range(count):
        c, lever = group.weight[g] * group.value[g, a], group.weight[g] * group.slope[g, a]
        on = axpy(c, by_D, scale(lever, by_slope))
        for i in range(2):
            start.load[first + a, 0, i] += on[i]
            start.force[first + a, i] += lever * q[i]


@apart
def add_stiffness(
    plane: Plane,
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    share: float,
    factor: float,
    values: np.ndarray,
) -> None:
    """Add a ``factor`` times the derivatives of the accelerations by the places, at the multipliers
    of all Gauss points, which ``collect`` has been called for; means over a step change by a
    ``share`` of what their ends do.
    """
    _, _, k = axes_of(plane)
    for e in range(group.first.size - 1):
        first = group.first[e]
        count = group.first[e + 1] - first
        for a in range(count):
            m = group.node[first + a]
            f = group.frame[m]
            scales = (
                force_factor(frames, share * factor, f),
                moment_factor(frames, share * factor, f),
            )
            for b in range(count):
                _add_pair(plane, group, start, (e, a, b), scales, values)
            place = group.pair_block[e, a, a, Q_BY_Q]
            if place > 0:
                D, arm = node_vectors(plane, start, m, 1.0)
                load, force = start.load[first + a, 0], start.force[first + a]
                own = -dot(D, (load[0], load[1])) - dot(arm, (force[0], force[1]))
                values[place + 4 * k] += scales[1] * own * start.tangent[m, 0, 0]


@kernel
def _sums(
    group: Beams, start: BeamsWorkspace, place: tuple[int, int, int]
) -> tuple[Flat, Flat, float, float]:
    """Return sums over the Gauss points of an element, with c = w J, of c slope_a N_b (n, q) and
    c N_a slope_b (n, q); of c (N_a slope_b - slope_a N_b) m; and of c N_a N_b n.
    """
    e, a, b = place
    ahead, behind, m, stretch = (0.0, 0.0), (0.0, 0.0), 0.0, 0.0
    first = group.first[e] - e
    for g in range(first, first + group.first[e + 1] - group.first[e] - 1):
        c = group.weight[g]
        i, j = c * group.slope[g, a] * group.value[g, b], c * group.value[g, a] * group.slope[g, b]
        n = (start.lam[g, 0], start.lam[g, 1])
        ahead, behind = axpy(i, n, ahead), axpy(j, n, behind)
        m += (j - i) * start.lam[g, 2]
        stretch += c * group.value[g, a] * group.value[g, b] * n[0]
    return ahead, behind, m, stretch


@kernel
def _add_pair(
    plane: Plane,
    group: Beams,
    start: BeamsWorkspace,
    place: tuple[int, int, int],
    scales: Flat,
    values: np.ndarray,
) -> None:
    """Add the derivatives of force and moment on node a by the place of node b, of the element e of
    ``place`` (e, a, b), times ``scales`` of force and moment.
    """
    e, a, b = place
    places, first = group.pair_block[e, a, b], group.first[e]
    if not places[Q_BY_Q] > 0:
        return
    i, j, k = axes_of(plane)
    node = group.node[first + b]
    D_a, arm_a = node_vectors(plane, start, group.node[first + a], 0.5)
    D_b, arm_b = node_vectors(plane, start, node, 1.0)
    ahead, behind, m, stretch = _sums(group, start, place)
    by_q = axpy(ahead[0], perpendicular(D_b), scale(-ahead[1], D_b))
    by_u = axpy(behind[0], perpendicular(D_a), scale(-behind[1], D_a))
    by_rotation = m * cross(D_a, D_b) - stretch * dot(D_a, D_b)
    by_rotation += dot(by_u, perpendicular(arm_b)) + cross(arm_a, by_q)
    G = start.tangent[node, 0, 0]
    values[places[U_BY_Q] + 3 * i + k] += scales[0] * G * by_q[0]
    values[places[U_BY_Q] + 3 * j + k] += scales[0] * G * by_q[1]
    values[places[Q_BY_U] + 3 * k + i] += scales[1] * by_u[0]
    values[places[Q_BY_U] + 3 * k + j] += scales[1] * by_u[1]
    values[places[Q_BY_Q] + 4 * k] += scales[1] * G * by_rotation
