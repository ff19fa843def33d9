"""Sparse LU factorisation of the Jacobian, by the program of ``elimination``.

    A = L U ,   A y = b

The pivots have a fixed order, found once for a system. Positions, targets and lengths of rows
of L and U are tables of the ``Elimination``, so nothing is searched for here.
"""

import math

import numpy as np

from msahl.jit.kernel import apart, kernel, optional, unit
from msahl.linalg import supernodal_lu
from msahl.linalg.elimination import Elimination
from msahl.linalg.supernodes import Supernodes


@unit
def factor(lu: Elimination, values: np.ndarray, W: np.ndarray) -> None:
    """Factor the block ``values`` into ``W``; a zero pivot leaves infinities there."""
    _factor_by_pivots(lu.target, lu, values, W)
    _factor_by_supernodes(lu.supernodes, lu, values, W)


@optional()
def _factor_by_supernodes(
    nodes: Supernodes, lu: Elimination, values: np.ndarray, W: np.ndarray
) -> None:
    supernodal_lu.fill_values(nodes, lu.source, values, W)
    supernodal_lu.factor(nodes, 1, W)


@optional()
def _factor_by_pivots(
    target: np.ndarray, lu: Elimination, values: np.ndarray, W: np.ndarray
) -> None:
    for e in range(W.size):
        W[e] = 0.0
    for e in range(lu.source.size):
        W[lu.place[e]] = values[lu.source[e]]
    operation = 0
    for k in range(lu.order.size):
        pivot = lu.base[k]
        inverse = 1.0 / W[pivot]
        W[pivot] = inverse
        first_upper = pivot + 1 + lu.lower[k]
        for left in range(pivot + 1, first_upper):
            W[left] *= inverse
            multiple = W[left]
            for right in range(first_upper, lu.base[k + 1]):
                W[target[operation]] -= multiple * W[right]
                operation += 1


@kernel
def pivot_ratio(lu: Elimination, W: np.ndarray) -> float:
    """Ratio of the largest to the smallest pivot of a matrix just factored into ``W``: a lower
    estimate of its condition number, at no cost.
    """
    smallest, largest = math.inf, 0.0
    for k in range(lu.order.size):
        inverse = abs(W[lu.base[k]])
        smallest, largest = min(smallest, inverse), max(largest, inverse)
    return largest / smallest


@apart
def scaled_pivot_ratio(
    lu: Elimination, blocks: np.ndarray, values: np.ndarray, W: np.ndarray, sizes: np.ndarray
) -> float:
    """Ratio of the largest entry to the smallest pivot of the matrix with its rows, and then its
    columns, divided by their largest entries (LAPACK's xGEEQU), by the factors ``W`` of the matrix
    itself.

    So the units of equations do not matter, and those of unknowns hardly. ``blocks`` (b, 2) are
    rows and columns, in nodes, of the block ``values``; ``sizes`` (2, nodes, 3) is a work array.
    """
    rows, columns = sizes
    rows[:] = 0.0
    columns[:] = 0.0
    for b in range(blocks.shape[0]):
        row = rows[blocks[b, 0]]
        for e in range(9):
            row[e // 3] = max(row[e // 3], abs(values[9 * b + e]))
    for b in range(blocks.shape[0]):
        row, column = rows[blocks[b, 0]], columns[blocks[b, 1]]
        for e in range(9):
            size = abs(values[9 * b + e])
            if size > 0.0:
                column[e % 3] = max(column[e % 3], size / row[e // 3])
    largest = 0.0
    for k in range(lu.order.size):
        node, i = lu.order[k] // 3, lu.order[k] % 3
        largest = max(largest, rows[node, i] * columns[node, i] * abs(W[lu.base[k]]))
    return largest


@unit
def solve(lu: Elimination, W: np.ndarray, y: np.ndarray) -> None:
    """Replace the right-hand side ``y`` (f,), in the order of elimination, by the solution."""
    _solve_by_pivots(lu.other, lu, W, y)
    _solve_by_supernodes(lu.supernodes, W, y)


@optional()
def _solve_by_supernodes(nodes: Supernodes, W: np.ndarray, y: np.ndarray) -> None:
    first = supernodal_lu.first_unknown(nodes, 1)
    for k in range(y.size):
        W[first + k] = y[k]
    supernodal_lu.solve(nodes, 1, W)
    for k in range(y.size):
        y[k] = W[first + k]


@optional()
def _solve_by_pivots(other: np.ndarray, lu: Elimination, W: np.ndarray, y: np.ndarray) -> None:
    n = lu.order.size
    for k in range(n):
        y_k = y[k]
        for left in range(lu.base[k] + 1, lu.base[k] + 1 + lu.lower[k]):
            y[other[left]] -= W[left] * y_k
    for k in range(n - 1, -1, -1):
        y_k = y[k]
        for right in range(lu.base[k] + 1 + lu.lower[k], lu.base[k + 1]):
            y_k -= W[right] * y[other[right]]
        y[k] = y_k * W[lu.base[k]]
