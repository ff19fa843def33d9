"""Vectors of three floats and 3 x 3 matrices as tuples (of rows): exact names, no allocation.

Plain Python for the deck and the tests, registers for the compiled kernels. ``[a]`` stands for the
matrix of ``a x (.)``.
"""

import numpy as np

from msahl.jit.kernel import kernel

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@kernel
def add(a: Vector, b: Vector) -> Vector:
    """``a + b``."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def sub(a: Vector, b: Vector) -> Vector:
    """``a - b``."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def scale(c: float, a: Vector) -> Vector:
    """``c a`` for a number ``c``."""
    return (c * a[0], c * a[1], c * a[2])


@kernel
def axpy(c: float, a: Vector, b: Vector) -> Vector:
    """``c a + b`` for a number ``c``."""
    return (c * a[0] + b[0], c * a[1] + b[1], c * a[2] + b[2])


@kernel
def dot(a: Vector, b: Vector) -> float:
    """``a . b``."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """``a x b``."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def skew(a: Vector) -> Matrix:
    """``[a]``, the matrix of ``a x (.)``."""
    return ((0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0))


@kernel
def times(M: Matrix, a: Vector) -> Vector:
    """``M a``."""
    return (dot(M[0], a), dot(M[1], a), dot(M[2], a))


@kernel
def transpose(M: Matrix) -> Matrix:
    """``M^T``."""
    return (
        (M[0][0], M[1][0], M[2][0]),
        (M[0][1], M[1][1], M[2][1]),
        (M[0][2], M[1][2], M[2][2]),
    )


@kernel
def product(M: Matrix, N: Matrix) -> Matrix:
    """``M N``."""
    T = transpose(N)
    return (times(T, M[0]), times(T, M[1]), times(T, M[2]))


@kernel
def skew_product(a: Vector, M: Matrix) -> Matrix:
    """``[a] M``, without the terms that the zeros of ``[a]`` would add."""
    return (
        axpy(-a[2], M[1], scale(a[1], M[2])),
        axpy(a[2], M[0], scale(-a[0], M[2])),
        axpy(-a[1], M[0], scale(a[0], M[1])),
    )


@kernel
def combine(c: float, M: Matrix, N: Matrix) -> Matrix:
    """``c M + N`` for a number ``c``."""
    return (axpy(c, M[0], N[0]), axpy(c, M[1], N[1]), axpy(c, M[2], N[2]))


@kernel
def multiple(c: float, M: Matrix) -> Matrix:
    """``c M`` for a number ``c``."""
    return (scale(c, M[0]), scale(c, M[1]), scale(c, M[2]))


@kernel
def outer(c: float, a: Vector, b: Vector, M: Matrix) -> Matrix:
    """``c a b^T + M`` for a number ``c``."""
    return (axpy(c * a[0], b, M[0]), axpy(c * a[1], b, M[1]), axpy(c * a[2], b, M[2]))


@kernel
def at(A: np.ndarray, k: int) -> Vector:
    """Row ``k`` of an array ``(n, 3)`` as a vector."""
    return (A[k, 0], A[k, 1], A[k, 2])


@kernel
def copy(source: np.ndarray, target: np.ndarray) -> None:
    """Copy the entries of a table (n, m)."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@kernel
def put(A: np.ndarray, k: int, a: Vector) -> None:
    """Store the vector ``a`` in row ``k`` of an array ``(n, 3)``."""
    A[k, 0], A[k, 1], A[k, 2] = a


@kernel
def accumulate(A: np.ndarray, k: int, a: Vector) -> None:
    """Add the vector ``a`` to row ``k`` of an array ``(n, 3)``."""
    A[k, 0] += a[0]
    A[k, 1] += a[1]
    A[k, 2] += a[2]


@kernel
def matrix_at(A: np.ndarray, k: int) -> Matrix:
    """Entry ``k`` of an array ``(n, 3, 3)`` as a matrix."""
    return (
        (A[k, 0, 0], A[k, 0, 1], A[k, 0, 2]),
        (A[k, 1, 0], A[k, 1, 1], A[k, 1, 2]),
        (A[k, 2, 0], A[k, 2, 1], A[k, 2, 2]),
    )


@kernel
def put_matrix(A: np.ndarray, k: int, M: Matrix) -> None:
    """Store the matrix ``M`` in entry ``k`` of an array ``(n, 3, 3)``."""
    for i in range(3):
        A[k, i, 0], A[k, i, 1], A[k, i, 2] = M[i]
