"""Vectors of three floats and 3 x 3 matrices as tuples (of rows): exact names, no allocation.

Plain Python for the deck and the tests, registers for the compiled kernels. ``[a]`` stands for the
matrix of ``a x (.)``.
"""

from msahl.kernel import kernel

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@kernel
def add(a, b):
    """``a + b``."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def sub(a, b):
    """``a - b``."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def scale(c, a):
    """``c a`` for a number ``c``."""
    return (c * a[0], c * a[1], c * a[2])


@kernel
def axpy(c, a, b):
    """``c a + b`` for a number ``c``."""
    return (c * a[0] + b[0], c * a[1] + b[1], c * a[2] + b[2])


@kernel
def dot(a, b):
    """``a . b``."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """``a x b``."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def skew(a):
    """``[a]``, the matrix of ``a x (.)``."""
    return ((0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0))


@kernel
def times(M, a):
    """``M a``."""
    return (dot(M[0], a), dot(M[1], a), dot(M[2], a))


@kernel
def transpose(M):
    """``M^T``."""
    return (
        (M[0][0], M[1][0], M[2][0]),
        (M[0][1], M[1][1], M[2][1]),
        (M[0][2], M[1][2], M[2][2]),
    )


@kernel
def product(M, N):
    """``M N``."""
    T = transpose(N)
    return (times(T, M[0]), times(T, M[1]), times(T, M[2]))


@kernel
def at(A, k):
    """Row ``k`` of an array ``(n, 3)`` as a vector."""
    return (A[k, 0], A[k, 1], A[k, 2])


@kernel
def put(A, k, a):
    """Store the vector ``a`` in row ``k`` of an array ``(n, 3)``."""
    A[k, 0], A[k, 1], A[k, 2] = a


@kernel
def accumulate(A, k, a):
    """Add the vector ``a`` to row ``k`` of an array ``(n, 3)``."""
    A[k, 0] += a[0]
    A[k, 1] += a[1]
    A[k, 2] += a[2]


@kernel
def matrix_at(A, k):
    """Entry ``k`` of an array ``(n, 3, 3)`` as a matrix."""
    return (
        (A[k, 0, 0], A[k, 0, 1], A[k, 0, 2]),
        (A[k, 1, 0], A[k, 1, 1], A[k, 1, 2]),
        (A[k, 2, 0], A[k, 2, 1], A[k, 2, 2]),
    )


@kernel
def put_matrix(A, k, M):
    """Store the matrix ``M`` in entry ``k`` of an array ``(n, 3, 3)``."""
    for i in range(3):
        A[k, i, 0], A[k, i, 1], A[k, i, 2] = M[i]
