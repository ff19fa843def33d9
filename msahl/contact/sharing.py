"""Forces of redundant contacts: of all that give the same motion, those whose squares are least.

    min |y|^2,      A y = A y_0,      y >= 0

The solution is the only one, and changes as little as the problem does, while a corner of the set
of solutions is one of several that round-off chooses between. With Z, an orthonormal basis of the
null space of A, and y_1 = y_0 - Z Z^T y_0, it is y_1 + Z s with the least s for which Z s >= -y_1:
a least distance problem, which nonnegative least squares solve. Source: C. L. Lawson, R. J.
Hanson, Solving Least Squares Problems (1974), section 23.4.
"""

import numpy as np

from msahl.start.redundancy import INDEPENDENT

NONE = 1e-12
"""Force, over the largest one, that is round-off."""


def least(A: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the least of the vectors (n,) >= 0 to which ``A`` (m, n) gives what it gives to one of
    them, ``y``; this itself if there is no other.
    """
    Z = _null_space(A)
    size = float(np.abs(y).max(initial=0.0))
    if Z.shape[1] == 0 or size == 0.0:
        return y
    first = (y - Z @ (Z.T @ y)) / size
    found = first + Z @ _least_step(Z, -first)
    return np.where(found <= NONE, 0.0, size * found)


def _null_space(A: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, p) of the null space of ``A`` (m, n)."""
    _, values, rows = np.linalg.svd(A, full_matrices=len(A) < A.shape[1])
    rank = np.count_nonzero(values > INDEPENDENT * values.max(initial=0.0))
    return rows[rank:].T


def _least_step(G: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Return the least s (p,) with ``G`` s >= ``h``, which has a solution."""
    from scipy.optimize import nnls  # which few models need

    right = np.append(np.zeros(G.shape[1]), 1.0)
    E = np.vstack([G.T, h])
    left = E @ nnls(E, right)[0] - right
    step: np.ndarray = -left[:-1] / left[-1]
    return step
