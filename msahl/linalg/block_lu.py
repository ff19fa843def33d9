"""Sparse LU of a step of degree s: the program of ``system.order`` with s x s blocks for numbers.

An unknown of the lowest order is here the s of all stages together, so pattern, order and program
are the same. A pivot is a block, inverted with a search for the largest entry within it; the rows
of U are divided by it, those of L are not.

Blocks are transposed, row = stage of the unknown, so that all is done row by row, rows being tuples
of a length the compiler knows: four times as quick as loops to a length it does not. Hence an
algorithm for each degree, made of the same text.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra import vector
from msahl.jit.kernel import kernel
from msahl.system.ordering import Elimination

Kernel = Callable[..., Any]
Row = tuple[float, ...]


class _Degree(NamedTuple):
    """What makes and what solves with the factors of one degree."""

    factor: Kernel
    solve: Kernel


def _of_degree(s: int, at: Kernel, axpy: Kernel, put: Kernel) -> _Degree:
    """For rows of ``s`` numbers, by ``at``, ``axpy`` and ``put`` of ``vector`` for such."""
    zero = (0.0,) * s

    @kernel
    def invert(A: np.ndarray, taken: np.ndarray) -> None:
        """Invert ``A`` in place by Gauss and Jordan; where it is singular infinities are left."""
        for k in range(s):
            best = k
            for i in range(k + 1, s):
                if abs(A[i, k]) > abs(A[best, k]):
                    best = i
            taken[k] = best
            for j in range(s):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            inverse = 1.0 / A[k, k]
            A[k, k] = 1.0
            for j in range(s):
                A[k, j] *= inverse
            for i in range(s):
                if i != k:
                    c = A[i, k]
                    A[i, k] = 0.0
                    for j in range(s):
                        A[i, j] -= c * A[k, j]
        for k in range(s - 1, -1, -1):
            best = taken[k]
            for i in range(s):
                A[i, k], A[i, best] = A[i, best], A[i, k]

    @kernel
    def multiply(A: np.ndarray, B: np.ndarray) -> None:
        """``A <- A B``."""
        for i in range(s):
            row = zero
            for k in range(s):
                row = axpy(A[i, k], at(B, k), row)
            put(A, i, row)

    @kernel
    def take_product(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> None:
        """``C <- C - A B``."""
        for i in range(s):
            row = at(C, i)
            for k in range(s):
                row = axpy(-A[i, k], at(B, k), row)
            put(C, i, row)

    @kernel
    def factor(
        lu: Elimination, source: np.ndarray, values: np.ndarray, W: np.ndarray, taken: np.ndarray
    ) -> None:
        for e in range(W.shape[0]):
            for i in range(s):
                put(W[e], i, zero)
        for e in range(source.size):
            for i in range(s):
                put(W[lu.place[e]], i, at(values[source[e]], i))
        operation = 0
        for k in range(lu.order.size):
            pivot = lu.base[k]
            invert(W[pivot], taken)
            first_right, end = pivot + 1 + lu.lower[k], lu.base[k + 1]
            for right in range(first_right, end):
                multiply(W[right], W[pivot])
            for left in range(pivot + 1, first_right):
                for right in range(first_right, end):
                    take_product(W[right], W[left], W[lu.target[operation]])
                    operation += 1

    @kernel
    def solve(lu: Elimination, W: np.ndarray, y: np.ndarray) -> None:
        n = lu.order.size
        for k in range(n):
            row = zero
            for j in range(s):
                row = axpy(y[k, j], at(W[lu.base[k]], j), row)
            put(y, k, row)
            for left in range(lu.base[k] + 1, lu.base[k] + 1 + lu.lower[k]):
                row = at(y, lu.other[left])
                for j in range(s):
                    row = axpy(-y[k, j], at(W[left], j), row)
                put(y, lu.other[left], row)
        for k in range(n - 1, -1, -1):
            row = at(y, k)
            for right in range(lu.base[k] + 1 + lu.lower[k], lu.base[k + 1]):
                for j in range(s):
                    row = axpy(-y[lu.other[right], j], at(W[right], j), row)
            put(y, k, row)

    return _Degree(factor, solve)


@kernel
def _at_1(A: np.ndarray, k: int) -> Row:
    return (A[k, 0],)


@kernel
def _axpy_1(c: float, a: Row, b: Row) -> Row:
    return (c * a[0] + b[0],)


@kernel
def _put_1(A: np.ndarray, k: int, a: Row) -> None:
    A[k, 0] = a[0]


@kernel
def _at_2(A: np.ndarray, k: int) -> Row:
    return (A[k, 0], A[k, 1])


@kernel
def _axpy_2(c: float, a: Row, b: Row) -> Row:
    return (c * a[0] + b[0], c * a[1] + b[1])


@kernel
def _put_2(A: np.ndarray, k: int, a: Row) -> None:
    A[k, 0], A[k, 1] = a


@kernel
def _at_4(A: np.ndarray, k: int) -> Row:
    return (A[k, 0], A[k, 1], A[k, 2], A[k, 3])


@kernel
def _axpy_4(c: float, a: Row, b: Row) -> Row:
    return (c * a[0] + b[0], c * a[1] + b[1], c * a[2] + b[2], c * a[3] + b[3])


@kernel
def _put_4(A: np.ndarray, k: int, a: Row) -> None:
    A[k, 0], A[k, 1], A[k, 2], A[k, 3] = a


@kernel
def _at_5(A: np.ndarray, k: int) -> Row:
    return (A[k, 0], A[k, 1], A[k, 2], A[k, 3], A[k, 4])


@kernel
def _axpy_5(c: float, a: Row, b: Row) -> Row:
    ahead = (c * a[0] + b[0], c * a[1] + b[1], c * a[2] + b[2])
    return (*ahead, c * a[3] + b[3], c * a[4] + b[4])


@kernel
def _put_5(A: np.ndarray, k: int, a: Row) -> None:
    A[k, 0], A[k, 1], A[k, 2], A[k, 3], A[k, 4] = a


_factor_1, _solve_1 = _of_degree(1, _at_1, _axpy_1, _put_1)
_factor_2, _solve_2 = _of_degree(2, _at_2, _axpy_2, _put_2)
_factor_3, _solve_3 = _of_degree(3, vector.at, vector.axpy, vector.put)
_factor_4, _solve_4 = _of_degree(4, _at_4, _axpy_4, _put_4)
_factor_5, _solve_5 = _of_degree(5, _at_5, _axpy_5, _put_5)


@kernel
def factor(
    lu: Elimination, source: np.ndarray, values: np.ndarray, W: np.ndarray, taken: np.ndarray
) -> None:
    """Factor the blocks ``values`` (q, s, s) into ``W`` (entries, s, s), those of ``lu.place`` from
    ``source``; all blocks are transposed, ``taken`` (s,) is room.
    """
    s = values.shape[1]
    if s == 1:
        _factor_1(lu, source, values, W, taken)
    elif s == 2:
        _factor_2(lu, source, values, W, taken)
    elif s == 3:
        _factor_3(lu, source, values, W, taken)
    elif s == 4:
        _factor_4(lu, source, values, W, taken)
    elif s == 5:
        _factor_5(lu, source, values, W, taken)


@kernel
def solve(lu: Elimination, W: np.ndarray, y: np.ndarray) -> None:
    """Solve in place; ``y`` (f, s) is in the order of elimination."""
    s = y.shape[1]
    if s == 1:
        _solve_1(lu, W, y)
    elif s == 2:
        _solve_2(lu, W, y)
    elif s == 3:
        _solve_3(lu, W, y)
    elif s == 4:
        _solve_4(lu, W, y)
    elif s == 5:
        _solve_5(lu, W, y)
