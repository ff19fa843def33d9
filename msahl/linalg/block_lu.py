"""Sparse LU factorisation for collocation steps: as ``sparse_lu``, with s x s blocks for numbers.

An unknown of the schemes of order 2 becomes the s unknowns of all stages, so pattern, order and
elimination program are the same. A pivot is a block, inverted with a search for its largest entry;
the rows of U are multiplied by the inverse, those of L are not.

Blocks are transposed (row = stage of the unknown), so that all operations are on rows. Rows are
tuples of a length known to the compiler, which is four times as fast as loops to an unknown length.
So the kernels exist once for each degree, made by the same functions.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra import vector
from msahl.jit.kernel import kernel, optional
from msahl.linalg import supernodal_lu
from msahl.linalg.elimination import Elimination
from msahl.linalg.supernodes import Supernodes

Kernel = Callable[..., Any]
Row = tuple[float, ...]


class _Rows(NamedTuple):
    """Length of a block's rows, and the functions of ``algebra.vector`` for such rows."""

    size: int
    at: Kernel
    axpy: Kernel
    put: Kernel


class _BlockKernels(NamedTuple):
    """Operations on blocks of one size."""

    invert: Kernel
    multiply: Kernel
    subtract_product: Kernel


def _new_block_kernels(rows: _Rows) -> _BlockKernels:
    """Return the operations on blocks with these ``rows``."""
    s, at, axpy, put = rows
    zero = (0.0,) * s

    @kernel
    def invert(A: np.ndarray, pivot_rows: np.ndarray) -> None:
        """Invert ``A`` in place by the Gauss-Jordan method; a singular one leaves infinities."""
        for k in range(s):
            best = k
            for i in range(k + 1, s):
                if abs(A[i, k]) > abs(A[best, k]):
                    best = i
            pivot_rows[k] = best
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
            best = pivot_rows[k]
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
    def subtract_product(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> None:
        """``C <- C - A B``."""
        for i in range(s):
            row = at(C, i)
            for k in range(s):
                row = axpy(-A[i, k], at(B, k), row)
            put(C, i, row)

    return _BlockKernels(invert, multiply, subtract_product)


def _new_factor(rows: _Rows) -> Kernel:
    """Return the kernel ``factor`` for blocks with these ``rows``."""
    s, at, _, put = rows
    zero = (0.0,) * s
    invert, multiply, subtract_product = _new_block_kernels(rows)

    @kernel
    def factor(
        target: np.ndarray,
        lu: Elimination,
        source: np.ndarray,
        values: np.ndarray,
        W: np.ndarray,
        pivot_rows: np.ndarray,
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
            invert(W[pivot], pivot_rows)
            first_right, end = pivot + 1 + lu.lower[k], lu.base[k + 1]
            for right in range(first_right, end):
                multiply(W[right], W[pivot])
            for left in range(pivot + 1, first_right):
                for right in range(first_right, end):
                    subtract_product(W[right], W[left], W[target[operation]])
                    operation += 1

    return factor


def _new_solve(rows: _Rows) -> Kernel:
    """Return the kernel ``solve`` for blocks with these ``rows``."""
    s, at, axpy, put = rows
    zero = (0.0,) * s

    @kernel
    def solve(other: np.ndarray, lu: Elimination, W: np.ndarray, y: np.ndarray) -> None:
        n = lu.order.size
        for k in range(n):
            row = zero
            for j in range(s):
                row = axpy(y[k, j], at(W[lu.base[k]], j), row)
            put(y, k, row)
            for left in range(lu.base[k] + 1, lu.base[k] + 1 + lu.lower[k]):
                row = at(y, other[left])
                for j in range(s):
                    row = axpy(-y[k, j], at(W[left], j), row)
                put(y, other[left], row)
        for k in range(n - 1, -1, -1):
            row = at(y, k)
            for right in range(lu.base[k] + 1 + lu.lower[k], lu.base[k + 1]):
                for j in range(s):
                    row = axpy(-y[other[right], j], at(W[right], j), row)
            put(y, k, row)

    return solve


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


_ROWS = (
    _Rows(1, _at_1, _axpy_1, _put_1),
    _Rows(2, _at_2, _axpy_2, _put_2),
    _Rows(3, vector.at, vector.axpy, vector.put),
    _Rows(4, _at_4, _axpy_4, _put_4),
    _Rows(5, _at_5, _axpy_5, _put_5),
)
_factor_1, _factor_2, _factor_3, _factor_4, _factor_5 = map(_new_factor, _ROWS)
_solve_1, _solve_2, _solve_3, _solve_4, _solve_5 = map(_new_solve, _ROWS)


@kernel
def factor(
    lu: Elimination, source: np.ndarray, values: np.ndarray, W: np.ndarray, pivot_rows: np.ndarray
) -> None:
    """Factor the blocks ``values`` (q, s, s) into ``W`` (entries, s, s), those of ``lu.place`` from
    ``source``; all blocks are transposed, ``pivot_rows`` (s,) is a work array.
    """
    _factor_by_blocks(lu.target, lu, source, values, W, pivot_rows)
    _factor_by_supernodes(lu.supernodes, source, values, W)


@optional()
def _factor_by_supernodes(
    nodes: Supernodes, source: np.ndarray, values: np.ndarray, W: np.ndarray
) -> None:
    supernodal_lu.fill_blocks(nodes, source, values, W)
    supernodal_lu.factor(nodes, values.shape[1], W)


@optional()
def _factor_by_blocks(
    target: np.ndarray,
    lu: Elimination,
    source: np.ndarray,
    values: np.ndarray,
    W: np.ndarray,
    pivot_rows: np.ndarray,
) -> None:
    s = values.shape[1]
    if s == 1:
        _factor_1(target, lu, source, values, W, pivot_rows)
    elif s == 2:
        _factor_2(target, lu, source, values, W, pivot_rows)
    elif s == 3:
        _factor_3(target, lu, source, values, W, pivot_rows)
    elif s == 4:
        _factor_4(target, lu, source, values, W, pivot_rows)
    elif s == 5:
        _factor_5(target, lu, source, values, W, pivot_rows)


@kernel
def solve(lu: Elimination, W: np.ndarray, y: np.ndarray) -> None:
    """Replace the right-hand side ``y`` (f, s), in the order of elimination, by the solution."""
    _solve_by_blocks(lu.other, lu, W, y)
    _solve_by_supernodes(lu.supernodes, W, y)


@optional()
def _solve_by_supernodes(nodes: Supernodes, W: np.ndarray, y: np.ndarray) -> None:
    d = y.shape[1]
    first = supernodal_lu.first_unknown(nodes, d)
    for k in range(y.shape[0]):
        for i in range(d):
            W[first + k * d + i] = y[k, i]
    supernodal_lu.solve(nodes, d, W)
    for k in range(y.shape[0]):
        for i in range(d):
            y[k, i] = W[first + k * d + i]


@optional()
def _solve_by_blocks(other: np.ndarray, lu: Elimination, W: np.ndarray, y: np.ndarray) -> None:
    s = y.shape[1]
    if s == 1:
        _solve_1(other, lu, W, y)
    elif s == 2:
        _solve_2(other, lu, W, y)
    elif s == 3:
        _solve_3(other, lu, W, y)
    elif s == 4:
        _solve_4(other, lu, W, y)
    elif s == 5:
        _solve_5(other, lu, W, y)
