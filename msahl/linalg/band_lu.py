"""LU factorisation of a banded matrix, with a search for the largest pivot of each column.

    P A = L U ,   A z = b

Row i of the array ``A`` (n, 3 b + 1) has the entries of columns i - b to i + 2 b of the matrix,
of which those beyond i + b are zero at first: exchanged rows reach as far. Rows are looked at only
up to their last entry, so a profile within the band costs what it contains.

Source: G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., 2013, section 4.3.
"""

import numpy as np

from msahl.jit.kernel import kernel


@kernel
def factor(A: np.ndarray, b: int, pivot: np.ndarray, end: np.ndarray) -> None:
    """Replace ``A`` by its factors, with the ``pivot`` (n,) rows; ``end`` (n,) is the column after
    the last entry of each row, and grows. A zero pivot leaves infinities.
    """
    n = A.shape[0]
    for k in range(n):
        last = min(n, k + b + 1)
        best = k
        for i in range(k + 1, last):
            if abs(A[i, k - i + b]) > abs(A[best, k - best + b]):
                best = i
        pivot[k] = best
        if best != k:
            end[k], end[best] = end[best], end[k]
            for j in range(k, max(end[k], end[best])):
                upper, lower = A[k, j - k + b], A[best, j - best + b]
                A[k, j - k + b], A[best, j - best + b] = lower, upper
        for i in range(k + 1, last):
            if A[i, k - i + b] != 0.0:
                _subtract(A, b, (k, i), end)


@kernel
def _subtract(A: np.ndarray, b: int, rows: tuple[int, int], end: np.ndarray) -> None:
    """Subtract the multiple of row k from row i, with ``rows`` k and i, that makes its entry in
    column k zero, and keep the multiple there.
    """
    k, i = rows
    own, shift = b - k, b - i
    multiple = A[i, k + shift] / A[k, b]
    A[i, k + shift] = multiple
    for j in range(k + 1, end[k]):
        A[i, j + shift] -= multiple * A[k, j + own]
    end[i] = max(end[i], end[k])


@kernel
def solve(A: np.ndarray, b: int, pivot: np.ndarray, end: np.ndarray, z: np.ndarray) -> None:
    """Replace the right-hand side ``z`` (n,) by the solution, with what ``factor`` left."""
    n = A.shape[0]
    for k in range(n):
        z[k], z[pivot[k]] = z[pivot[k]], z[k]
        for i in range(k + 1, min(n, k + b + 1)):
            z[i] -= A[i, k - i + b] * z[k]
    for k in range(n - 1, -1, -1):
        value = z[k]
        for j in range(k + 1, end[k]):
            value -= A[k, j - k + b] * z[j]
        z[k] = value / A[k, b]
