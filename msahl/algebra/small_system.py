"""Solve small dense systems of linear equations with partial pivoting, without allocation."""

import numpy as np

from msahl.jit.kernel import kernel


@kernel
def factor(A: np.ndarray, pivot: np.ndarray) -> None:
    """Replace ``A`` (n, n) by factors L U of its permuted rows; ``pivot`` (n,) receives these."""
    n = A.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        pivot[k] = best
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
        for i in range(k + 1, n):
            A[i, k] /= A[k, k]
            if A[i, k] != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= A[i, k] * A[k, j]


@kernel
def solve(A: np.ndarray, pivot: np.ndarray, b: np.ndarray) -> None:
    """Replace ``b`` (n,) by the solution x of A x = b, by the factors of ``A``."""
    n = A.shape[0]
    for k in range(n):
        best = pivot[k]
        if best != k:
            b[k], b[best] = b[best], b[k]
    for k in range(n):
        for i in range(k + 1, n):
            b[i] -= A[i, k] * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]


@kernel
def solve_transposed(A: np.ndarray, pivot: np.ndarray, b: np.ndarray) -> None:
    """Replace ``b`` (n,) by the solution x of A^T x = b, by the factors of ``A``."""
    n = A.shape[0]
    for k in range(n):
        for j in range(k):
            b[k] -= A[j, k] * b[j]
        b[k] /= A[k, k]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            b[k] -= A[i, k] * b[i]
    for k in range(n - 1, -1, -1):
        best = pivot[k]
        if best != k:
            b[k], b[best] = b[best], b[k]
