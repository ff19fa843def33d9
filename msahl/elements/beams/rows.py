"""Equations and multipliers of beams: scales, and derivatives by the places of the nodes."""

import numpy as np

from msahl.algebra.vector import Matrix, Vector, at, matrix_at, product, scale
from msahl.elements.beams.group import (
    BEND_Q,
    STRETCH_Q,
    STRETCH_U,
    Beams,
    BeamsWorkspace,
)
from msahl.elements.beams.strain import Point, node_gradient, node_vectors, nodes_of
from msahl.formulations.absolute.frames import Frames, first_multiplier
from msahl.jit.kernel import kernel

ALL, RIGID, ELASTIC = range(3)
"""Which components of the strains are meant."""


@kernel
def is_among(group: Beams, g: int, i: int, which: int) -> bool:
    """Return whether component ``i`` at Gauss point ``g`` is one of ``which``."""
    return which == ALL or bool(group.rigid[g, i]) == (which == RIGID)


@kernel
def chosen(group: Beams, g: int, first: int, which: int, lam: Vector) -> Vector:
    """Return ``lam``, of the components from ``first`` on, with zeros for all but ``which``."""
    return (
        lam[0] if is_among(group, g, first, which) else 0.0,
        lam[1] if is_among(group, g, first + 1, which) else 0.0,
        lam[2] if is_among(group, g, first + 2, which) else 0.0,
    )


@kernel
def multipliers(group: Beams, frames: Frames, Z: np.ndarray, g: int) -> tuple[Vector, Vector]:
    """Return lam of Gauss point ``g`` of multipliers by mass ``Z``: forces [N], moments [N m]."""
    node = first_multiplier(frames) + group.place[g]
    mass = group.mass[g]
    return scale(mass, at(Z, node)), scale(mass * group.length[g], at(Z, node + 1))


@kernel
def row_scale(group: Beams, g: int, i: int) -> float:
    """Return w J [m], times the length that makes an equation of kappa one in metres."""
    return group.weight[g] * (1.0 if i < 3 else group.length[g])


@kernel
def own_compliance(group: Beams, g: int, i: int, j: int) -> float:
    """Return w J C mass [s^2] of equation ``i`` and multiplier ``j`` by mass, both scaled."""
    length = 1.0 if j < 3 else group.length[g]
    return row_scale(group, g, i) * group.compliance[g, i, j] * group.mass[g] * length


@kernel
def add_equations(
    group: Beams, start: BeamsWorkspace, g: int, point: Point, values: np.ndarray
) -> None:
    """Add ``start.factor`` times the derivatives of the strains at Gauss point ``g`` by the places
    of its nodes; ``point`` are the vectors there.
    """
    first, count = nodes_of(group, g)
    for a in range(count):
        m = group.node[first + a]
        d, arm = node_vectors(start, m, 1.0)
        slope, G = group.slope[g, a], matrix_at(start.tangent, m)
        gamma, kappa = node_gradient(d, arm, point, group.value[g, a], slope)
        places = group.load_block[g, a]
        add_rows(start, g, 0, places[STRETCH_Q], product(gamma, G), values)
        add_rows(start, g, 3, places[BEND_Q], product(kappa, G), values)
        by_u = (scale(slope, point[0][0]), scale(slope, point[0][1]), scale(slope, point[0][2]))
        add_rows(start, g, 0, places[STRETCH_U], by_u, values)


@kernel
def add_rows(
    start: BeamsWorkspace, g: int, first: int, place: int, rows: Matrix, values: np.ndarray
) -> None:
    """Add ``rows``, times the factors of the components from ``first`` on, to the block at
    ``place``; block 0 belongs to no node.
    """
    if place > 0:
        for i in range(3):
            for k in range(3):
                values[place + 3 * i + k] += start.factor[g, first + i] * rows[i][k]
