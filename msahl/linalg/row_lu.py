"""Sparse LU factorisation row by row, with m x m blocks for numbers, and of the transpose.

    A = L U ,   A x = b ,   A^T x = b

It serves the auxiliary states, whose blocks are the m nodes of a step: as many as the scheme has.
The order of the pivots is found once (``plan``), by smallest degree; a pivot is a block, whose own
factors are found with a search for the largest entry. No list of operations is kept: a row is
spread over a work row, so nothing takes more memory than a full matrix where all is coupled.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra import small_system
from msahl.algebra.vector import copy
from msahl.jit.kernel import kernel
from msahl.linalg.node_order import smallest_degree
from msahl.linalg.symbolic import Lists, fill, transposed

COUPLED_WITH_ALL = 0.25
"""Fraction of the entries of a matrix above which no order makes the factors much emptier."""


class Plan(NamedTuple):
    """Pattern of a matrix and of its factors, in the order of elimination."""

    position: np.ndarray  # (n,) of each unknown in the order
    order: np.ndarray  # (n,) unknown of each pivot
    lower: Lists  # columns left of the diagonal, by rows, sorted
    upper: Lists  # right of it


def plan(coupled: Lists) -> Plan:
    """Return the order and the pattern for a matrix with a full diagonal and the entries
    ``coupled``, columns by rows.
    """
    n, size = coupled.first.size - 1, coupled.items.size
    rows, columns = np.repeat(np.arange(n), np.diff(coupled.first)), coupled.items
    order = np.arange(n)
    if size <= COUPLED_WITH_ALL * n * n:
        near: list[set[int]] = [set() for _ in range(n)]
        for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
            if i != j:
                near[i].add(j)
                near[j].add(i)
        order = smallest_degree(near, set())
    position = np.zeros(n, dtype=np.int64)
    position[order] = np.arange(n)
    filled = fill(n, position[rows], position[columns])
    return Plan(position, order, transposed(filled.lower)[0], filled.upper)


class Factors(NamedTuple):
    """Blocks of the factors, and work arrays."""

    lower: np.ndarray  # (l, m, m) where ``Plan.lower`` has them
    upper: np.ndarray  # (u, m, m)
    pivot: np.ndarray  # (n, m, m) factors of the pivots ...
    exchanged: np.ndarray  # (n, m) ... and which rows were
    row: np.ndarray  # (n, m, m) one row of the matrix
    right: np.ndarray  # (n, m) right-hand side and solution, in the order of elimination


def new_factors(given: Plan, m: int) -> Factors:
    """Return the arrays for blocks of the size ``m``."""
    n = given.order.size
    return Factors(
        lower=np.zeros((given.lower.items.size, m, m)),
        upper=np.zeros((given.upper.items.size, m, m)),
        pivot=np.zeros((n, m, m)),
        exchanged=np.zeros((n, m), dtype=np.int64),
        row=np.zeros((n, m, m)),
        right=np.zeros((n, m)),
    )


@kernel
def clear_row(given: Plan, own: Factors, i: int) -> None:
    """Set the blocks of ``own.row`` to zero that row ``i`` has in the factors."""
    _clear(own.row[i])
    for e in range(given.lower.first[i], given.lower.first[i + 1]):
        _clear(own.row[given.lower.items[e]])
    for e in range(given.upper.first[i], given.upper.first[i + 1]):
        _clear(own.row[given.upper.items[e]])


@kernel
def eliminate_row(given: Plan, own: Factors, i: int) -> None:
    """Set row ``i`` of the factors, after all rows before it, from that of the matrix in
    ``own.row``; a singular pivot leaves infinities.
    """
    m = own.right.shape[1]
    for e in range(given.lower.first[i], given.lower.first[i + 1]):
        k = given.lower.items[e]
        for a in range(m):
            small_system.solve_transposed(own.pivot[k], own.exchanged[k], own.row[k, a])
        copy(own.row[k], own.lower[e])
        for u in range(given.upper.first[k], given.upper.first[k + 1]):
            _subtract_product(own.lower[e], own.upper[u], own.row[given.upper.items[u]])
    for e in range(given.upper.first[i], given.upper.first[i + 1]):
        copy(own.row[given.upper.items[e]], own.upper[e])
    copy(own.row[i], own.pivot[i])
    small_system.factor(own.pivot[i], own.exchanged[i])


@kernel
def solve(given: Plan, own: Factors) -> None:
    """Replace ``own.right`` by the solution x of A x = b."""
    x = own.right
    n, m = x.shape
    for i in range(n):
        for e in range(given.lower.first[i], given.lower.first[i + 1]):
            for a in range(m):
                for b in range(m):
                    x[i, a] -= own.lower[e, a, b] * x[given.lower.items[e], b]
    for i in range(n - 1, -1, -1):
        for e in range(given.upper.first[i], given.upper.first[i + 1]):
            for a in range(m):
                for b in range(m):
                    x[i, a] -= own.upper[e, a, b] * x[given.upper.items[e], b]
        small_system.solve(own.pivot[i], own.exchanged[i], x[i])


@kernel
def solve_transposed(given: Plan, own: Factors) -> None:
    """Replace ``own.right`` by the solution x of A^T x = b; where it is zero there is no work."""
    x = own.right
    n, m = x.shape
    for i in range(n):
        if _is_zero(x[i]):
            continue
        small_system.solve_transposed(own.pivot[i], own.exchanged[i], x[i])
        for e in range(given.upper.first[i], given.upper.first[i + 1]):
            for a in range(m):
                for b in range(m):
                    x[given.upper.items[e], b] -= own.upper[e, a, b] * x[i, a]
    for i in range(n - 1, -1, -1):
        if _is_zero(x[i]):
            continue
        for e in range(given.lower.first[i], given.lower.first[i + 1]):
            for a in range(m):
                for b in range(m):
                    x[given.lower.items[e], b] -= own.lower[e, a, b] * x[i, a]


@kernel
def _clear(A: np.ndarray) -> None:
    for a in range(A.shape[0]):
        for b in range(A.shape[0]):
            A[a, b] = 0.0


@kernel
def _subtract_product(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> None:
    """``C <- C - A B``."""
    m = A.shape[0]
    for a in range(m):
        for c in range(m):
            for b in range(m):
                C[a, b] -= A[a, c] * B[c, b]


@kernel
def _is_zero(x: np.ndarray) -> bool:
    zero = True
    for a in range(x.size):
        zero = zero and x[a] == 0.0
    return zero
