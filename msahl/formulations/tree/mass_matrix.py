"""Mass matrix of a tree's joint coordinates, its factors, and solutions with them, in lanes.

    M_kj = S_j . I_k S_k       I_k: inertia of the body of q_k and all beyond it, about the origin

for q_j before q_k on the path from the ground; all other entries are zero. M = L^T D L with an L of
the same pattern, so nothing fills in. The row of a coordinate has its own entry first, then those
of the coordinates before it, the nearest first.

Source: R. Featherstone, Rigid Body Dynamics Algorithms (2008), sections 6.2 and 8.
"""

import numpy as np

from msahl.algebra.lanes import (
    cross,
    difference,
    dot,
    matrix_at,
    multiple,
    put_vector,
    sum_of,
    times,
    vector_at,
)
from msahl.algebra.vector import matrix_at as plain_matrix
from msahl.formulations.tree.table import Tree, TreeMotion
from msahl.jit.kernel import kernel, unit
from msahl.jit.lanes import load, spread, store


@unit
def set_factors(tree: Tree, motion: TreeMotion) -> None:
    """Set ``motion.mass`` to the factors of the mass matrix, after ``set_places``."""
    set_matrix(tree, motion)
    _factor(tree, motion.mass)


@unit
def set_matrix(tree: Tree, motion: TreeMotion) -> None:
    """Set ``motion.mass`` to the mass matrix itself."""
    for b in range(1, tree.frame.size):
        _set_inertia(tree, motion, b)
    for b in range(tree.frame.size - 1, 0, -1):
        _enter(tree, motion, b)
        if tree.parent[b] > 0:
            for i in range(10):
                row = 10 * tree.parent[b] + i
                store(
                    motion.composite,
                    row,
                    load(motion.composite, row) + load(motion.composite, 10 * b + i),
                )


@kernel
def _set_inertia(tree: Tree, motion: TreeMotion, b: int) -> None:
    """Set mass, first and second moments of body ``b`` about the origin: m; m c; xx, yx, yy, zx,
    zy, zz of the inertia.
    """
    c, D = vector_at(motion.place, 3 * b), matrix_at(motion.rotation, 9 * b)
    J, row = plain_matrix(motion.inertia, b), 10 * b
    first = multiple(tree.mass[b], c)
    store(motion.composite, row, spread(tree.mass[b]))
    put_vector(motion.composite, row + 1, first)
    square = dot(first, c)
    for i in range(3):
        column = times(J, D[i])
        for j in range(i + 1):
            moment = dot(D[j], column) - first[i] * c[j]
            if i == j:
                moment = moment + square
            store(motion.composite, row + 4 + i * (i + 1) // 2 + j, moment)


@kernel
def _enter(tree: Tree, motion: TreeMotion, b: int) -> None:
    """Set the rows of the coordinates of body ``b``."""
    row = 10 * b
    m, first = load(motion.composite, row), vector_at(motion.composite, row + 1)
    xx, yx = load(motion.composite, row + 4), load(motion.composite, row + 5)
    yy, zx = load(motion.composite, row + 6), load(motion.composite, row + 7)
    zy, zz = load(motion.composite, row + 8), load(motion.composite, row + 9)
    inertia = ((xx, yx, zx), (yx, yy, zy), (zx, zy, zz))
    for k in range(tree.first[b], tree.first[b + 1]):
        a, s = vector_at(motion.screw, 6 * k), vector_at(motion.screw, 6 * k + 3)
        L = sum_of(times(inertia, a), cross(first, s))
        P = difference(multiple(m, s), cross(first, a))
        j = k
        for entry in range(tree.row[k], tree.row[k + 1]):
            a, s = vector_at(motion.screw, 6 * j), vector_at(motion.screw, 6 * j + 3)
            store(motion.mass, entry, dot(a, L) + dot(s, P))
            j = tree.before[j]


@kernel
def _factor(tree: Tree, M: np.ndarray) -> None:
    """Replace the entries by those of the factors: 1/D on the diagonal, L beside it."""
    for k in range(tree.body.size - 1, -1, -1):
        inverse = 1.0 / load(M, tree.row[k])
        j, last = tree.before[k], tree.row[k + 1]
        for entry in range(tree.row[k] + 1, last):
            share = load(M, entry) * inverse
            for i in range(last - entry):
                place = tree.row[j] + i
                store(M, place, load(M, place) - share * load(M, entry + i))
            store(M, entry, share)
            j = tree.before[j]
        store(M, tree.row[k], inverse)


@unit
def solve(tree: Tree, motion: TreeMotion) -> None:
    """Replace ``motion.y`` by the solution of M x = y."""
    M, y = motion.mass, motion.y
    n = tree.body.size
    for k in range(n - 1, -1, -1):
        j, value = tree.before[k], load(y, k)
        for entry in range(tree.row[k] + 1, tree.row[k + 1]):
            store(y, j, load(y, j) - load(M, entry) * value)
            j = tree.before[j]
    for k in range(n):
        j, value = tree.before[k], load(y, k) * load(M, tree.row[k])
        for entry in range(tree.row[k] + 1, tree.row[k + 1]):
            value = value - load(M, entry) * load(y, j)
            j = tree.before[j]
        store(y, k, value)
