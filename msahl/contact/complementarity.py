"""Linear complementarity problems of contacts, solved by Lemke's method.

    w = W z + q,    w >= 0,  z >= 0,  w . z = 0

W = G M^-1 G^T of contacts is positive semidefinite, and q is in reach of it where their equations
can be met, so a solution exists and Lemke's method ends with one: Cottle, Pang, Stone, The Linear
Complementarity Problem (1992), section 4.4. Where contacts are redundant, w is unique and z is not;
the z found belongs to as few contacts as are independent.
"""

import numpy as np

TINY = 1e-13
"""Entry of a column, relative to its largest, that is no pivot."""


class NoSolution(Exception):  # noqa: N818 - an outcome
    """A problem without a solution that the method can find."""


def solve(W: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return z (n,) for ``W`` (n, n) and ``q`` (n,). Raises ``NoSolution``."""
    n = q.size
    scale = np.abs(q).max(initial=0.0)
    if not (q < 0.0).any():
        return np.zeros(n)
    # Columns: w, z, and the artificial variable that makes all q positive.
    d = np.sqrt(np.abs(np.diag(W)))
    d = np.where(d > 0.0, d, max(float(d.max(initial=0.0)), 1.0))
    scaled = W / np.outer(d, d)
    tableau = np.hstack([np.eye(n), -scaled, -np.ones((n, 1)), (q / d / scale)[:, None]])
    # Powers of a small number on the right break ties, so that no basis comes twice.
    tableau = np.hstack([tableau, np.eye(n)])
    basis = np.arange(n)
    row, entering = _first_row(tableau, n), 2 * n
    for _ in range(50 * (n + 1)):
        leaving = int(basis[row])
        _pivot(tableau, row, entering)
        basis[row] = entering
        if leaving == 2 * n:
            z = np.zeros(n)
            of_z = (basis >= n) & (basis < 2 * n)
            z[basis[of_z] - n] = tableau[of_z, 2 * n + 1]
            return np.maximum(z, 0.0) * scale / d
        entering = leaving + n if leaving < n else leaving - n
        row = _next_row(tableau, n, entering, basis)
    raise NoSolution


def _first_row(tableau: np.ndarray, n: int) -> int:
    """Return the row in which the artificial variable enters: that of the smallest q."""
    return min(range(n), key=lambda i: tuple(tableau[i, 2 * n + 1 :]))


def _next_row(tableau: np.ndarray, n: int, entering: int, basis: np.ndarray) -> int:
    """Return the row whose variable leaves, by the smallest ratio; the artificial one if it can."""
    column = tableau[:, entering]
    rows = np.flatnonzero(column > TINY * max(np.abs(column).max(), TINY))
    if not rows.size:
        raise NoSolution
    ratios = tableau[rows, 2 * n + 1] / column[rows]
    near = rows[ratios <= ratios.min() + TINY]
    artificial = near[basis[near] == 2 * n]
    if artificial.size:
        return int(artificial[0])
    return min(near, key=lambda i: tuple(tableau[i, 2 * n + 1 :] / column[i]))


def _pivot(tableau: np.ndarray, row: int, column: int) -> None:
    """Make ``column`` the unit vector of ``row``."""
    tableau[row] /= tableau[row, column]
    for i in range(len(tableau)):
        if i != row and tableau[i, column] != 0.0:
            tableau[i] -= tableau[i, column] * tableau[row]
