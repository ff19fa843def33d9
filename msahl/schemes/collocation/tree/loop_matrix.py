"""Matrices of the multipliers that close loops, and which equations are independent."""

import numpy as np

from msahl.algebra import small_system
from msahl.formulations.tree import mass_matrix
from msahl.formulations.tree.table import Tree, TreeMotion
from msahl.jit.kernel import kernel, optional
from msahl.jit.lanes import load, spread, store
from msahl.schemes.collocation.tree import slopes
from msahl.schemes.collocation.tree.loop_stages import LoopStages
from msahl.schemes.collocation.tree.slopes import LoadSlopes

INDEPENDENT = 1e-10
"""Pivot, relative to the equation's own diagonal entry, above which one of redundant equations
counts as independent; its square is what that entry must be relative to the largest one."""


@kernel
def set_end_matrix(loops: LoopStages, tree: Tree, motion: TreeMotion) -> None:
    """Set ``end_matrix`` to G M^-1 G^T of lane 0, after the factors of M."""
    cut, y = loops.cut, motion.y
    m = cut.scale.size
    for r in range(m):
        for k in range(tree.body.size):
            store(y, k, spread(0.0))
        for e in range(cut.first[r], cut.first[r + 1]):
            store(y, cut.coordinate[e], spread(loops.gradient[e, 0]))
        mass_matrix.solve(tree, motion)
        for p in range(m):
            total = 0.0
            for e in range(cut.first[p], cut.first[p + 1]):
                total += loops.gradient[e, 0] * y[cut.coordinate[e], 0]
            loops.end_matrix[p, r] = total


@kernel
def choose(loops: LoopStages) -> None:
    """Mark equations as independent by the pivots of a Cholesky factorisation of ``end_matrix``,
    the largest ones first, relative to their own diagonal entries.
    """
    A, m, own = loops.end_matrix, loops.cut.scale.size, loops.end_right
    most = 0.0
    for r in range(m):
        own[r] = A[r, r]
        most = max(most, own[r])
        loops.independent[r] = False
    for _ in range(m):
        best, largest = -1, INDEPENDENT
        for r in range(m):
            acts = own[r] > INDEPENDENT**2 * most and not loops.independent[r]
            if acts and A[r, r] / own[r] > largest:
                best, largest = r, A[r, r] / own[r]
        if best < 0:
            break
        loops.independent[best] = True
        for p in range(m):
            if not loops.independent[p]:
                share = A[p, best] / A[best, best]
                for r in range(m):
                    if not loops.independent[r]:
                        A[p, r] -= share * A[best, r]


@optional()
def set_factors(
    loops: LoopStages, matrices: LoadSlopes | None, tree: Tree, motion: TreeMotion
) -> None:
    """Set the factors of T, after those of the matrices that make corrections of residuals."""
    cut, y, A = loops.cut, motion.y, loops.matrix
    s, m, n = loops.weight.size, cut.scale.size, tree.body.size
    coupled = slopes.are_used(matrices)  # the nodes, by slopes of loads
    for p in range(m):
        for i in range(s):
            column = m * i + p
            for k in range(n):
                store(y, k, spread(0.0))
            for e in range(cut.first[p], cut.first[p + 1]):
                pull = spread(loops.lever[e, i])
                store(y, cut.coordinate[e], pull * load(loops.across, i) if coupled else pull)
            slopes.correct(matrices, tree, motion)
            for k in range(n):
                total = spread(0.0)
                for j in range(s):
                    share = 1.0 if coupled else loops.across[i, j]
                    total = total + (share * y[k, j]) * load(loops.to_nodes, j)
                store(y, k, total)
            for r in range(m):
                total = spread(0.0)
                for e in range(cut.first[r], cut.first[r + 1]):
                    total = total + load(loops.gradient, e) * load(y, cut.coordinate[e])
                store(loops.rest, 0, total)
                for k in range(s):
                    A[m * k + r, column] = loops.rest[0, k]
    for r in range(m):
        if not loops.independent[r]:
            for k in range(s):
                take_out(A, m * k + r)
    small_system.factor(A, loops.pivot)


@kernel
def take_out(A: np.ndarray, r: int) -> None:
    """Replace row and column ``r`` of a matrix by those of the unit matrix."""
    for k in range(A.shape[0]):
        A[r, k] = A[k, r] = 0.0
    A[r, r] = 1.0
