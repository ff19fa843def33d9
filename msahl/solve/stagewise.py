"""Sparse LU of a step of degree s: the program of ``system.order`` with s x s blocks for numbers.

An unknown of the lowest order is here the s of all stages together, so pattern, order and program
are the same. A pivot is a block, inverted with a search for the largest entry within it.
"""

import numpy as np

from msahl.kernel import kernel
from msahl.system.order import Elimination
from msahl.vector import copy


@kernel
def factor(lu: Elimination, values: np.ndarray, W: np.ndarray, room: np.ndarray) -> None:
    """Factor the blocks ``values`` (9 m, s, s) into ``W``; ``room`` is (2, s, s)."""
    s = room.shape[1]
    for e in range(W.shape[0]):
        for i in range(s):
            for j in range(s):
                W[e, i, j] = 0.0
    for e in range(lu.source.size):
        copy(values[lu.source[e]], W[lu.place[e]])
    operation = 0
    for k in range(lu.order.size):
        pivot = lu.base[k]
        invert(W[pivot], room[0])
        first_upper = pivot + 1 + lu.lower[k]
        for left in range(pivot + 1, first_upper):
            multiply(W[left], W[pivot], room[1])
            for right in range(first_upper, lu.base[k + 1]):
                take_product(W[left], W[right], W[lu.target[operation]])
                operation += 1


@kernel
def invert(A: np.ndarray, room: np.ndarray) -> None:
    """Invert ``A`` in place by Gauss and Jordan; where it is singular infinities are left."""
    s = A.shape[0]
    for i in range(s):
        for j in range(s):
            room[i, j] = 1.0 if i == j else 0.0
    for k in range(s):
        best = k
        for i in range(k + 1, s):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        for j in range(s):
            A[k, j], A[best, j] = A[best, j], A[k, j]
            room[k, j], room[best, j] = room[best, j], room[k, j]
        inverse = 1.0 / A[k, k]
        for j in range(s):
            A[k, j] *= inverse
            room[k, j] *= inverse
        for i in range(s):
            if i != k:
                c = A[i, k]
                for j in range(s):
                    A[i, j] -= c * A[k, j]
                    room[i, j] -= c * room[k, j]
    copy(room, A)


@kernel
def multiply(A: np.ndarray, B: np.ndarray, room: np.ndarray) -> None:
    """``A <- A B``."""
    s = A.shape[0]
    for i in range(s):
        for j in range(s):
            total = 0.0
            for k in range(s):
                total += A[i, k] * B[k, j]
            room[i, j] = total
    copy(room, A)


@kernel
def take_product(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> None:
    """``C <- C - A B``."""
    s = A.shape[0]
    for i in range(s):
        for k in range(s):
            c = A[i, k]
            # Rows of gaps hold nothing of other stages.
            if c != 0.0:
                for j in range(s):
                    C[i, j] -= c * B[k, j]


@kernel
def solve(lu: Elimination, W: np.ndarray, y: np.ndarray, room: np.ndarray) -> None:
    """Solve in place; ``y`` (f, s) is in the order of elimination, ``room`` is (s,)."""
    n, s = lu.order.size, y.shape[1]
    for k in range(n):
        for left in range(lu.base[k] + 1, lu.base[k] + 1 + lu.lower[k]):
            _take(W[left], y[k], y[lu.other[left]])
    for k in range(n - 1, -1, -1):
        for right in range(lu.base[k] + 1 + lu.lower[k], lu.base[k + 1]):
            _take(W[right], y[lu.other[right]], y[k])
        for i in range(s):
            room[i] = 0.0
            for j in range(s):
                room[i] += W[lu.base[k], i, j] * y[k, j]
        for i in range(s):
            y[k, i] = room[i]


@kernel
def _take(A: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
    """``y <- y - A x``."""
    for i in range(x.size):
        for j in range(x.size):
            y[i] -= A[i, j] * x[j]
