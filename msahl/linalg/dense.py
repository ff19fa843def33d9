"""Gather and scatter: moves entries between arrays by nodes and vectors of the free unknowns."""

import numpy as np

from msahl.jit.kernel import kernel


@kernel
def scatter(free: np.ndarray, z: np.ndarray, Z: np.ndarray) -> None:
    """Write ``z`` (f,) to the ``free`` entries of ``Z`` (nodes, 3)."""
    for i in range(free.size):
        Z[free[i] // 3, free[i] % 3] = z[i]


@kernel
def gather(free: np.ndarray, F: np.ndarray, f: np.ndarray) -> None:
    """Read ``f`` (f,) from the ``free`` entries of ``F`` (nodes, 3)."""
    for i in range(free.size):
        f[i] = F[free[i] // 3, free[i] % 3]


@kernel
def scatter_matrix(
    dense_to: np.ndarray, dense_from: np.ndarray, values: np.ndarray, A: np.ndarray
) -> None:
    """Set ``A`` (f * f,) to the dense matrix whose entries ``dense_to`` are the entries
    ``dense_from`` of the block ``values``; all others are zero.
    """
    for i in range(A.size):
        A[i] = 0.0
    for i in range(dense_from.size):
        A[dense_to[i]] = values[dense_from[i]]
