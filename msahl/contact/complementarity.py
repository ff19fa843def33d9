"""Linear complementarity problems of contacts, solved by Lemke's method.

    w = W z + q,    w >= 0,  z >= 0,  w . z = 0

W = G M^-1 G^T of contacts is positive semidefinite, and q is in reach of it where their equations
can be met, so a solution exists and Lemke's method ends with one: Cottle, Pang, Stone, The Linear
Complementarity Problem (1992), section 4.4. Where contacts are redundant, w is unique and z is not;
the z found belongs to as few contacts as are independent.
"""

import numpy as np

TINY = 1e-10
"""Entry of a scaled column, relative to its largest, that is round-off and no pivot."""
DAMPED = (0.0, 1e-11, 1e-9)
"""Added to the diagonal of the scaled matrix, in turn until the method ends: the set of contacts
that press is found so, and their forces are then those without it."""
RIGHT = 1e-9
"""Violation, relative to the terms, by which a set of contacts that press is wrong."""


class NoSolution(Exception):  # noqa: N818 - an outcome
    """A problem without a solution that the method can find."""


def solve(W: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return z (n,) for ``W`` (n, n) and ``q`` (n,). Raises ``NoSolution``."""
    if not (q < 0.0).any():
        return np.zeros(q.size)
    d = np.sqrt(np.abs(np.diag(W)))
    d = np.where(d > 0.0, d, max(float(d.max()), 1.0))
    scaled, right = W / np.outer(d, d), q / d
    size = float(np.abs(right).max())
    for added in DAMPED:
        active = _pressing(scaled + added * np.eye(q.size), right / size)
        if active is None:
            continue
        z = np.zeros(q.size)
        z[active] = np.linalg.lstsq(scaled[np.ix_(active, active)], -right[active], rcond=None)[0]
        largest = np.abs(z).max(initial=0.0)
        if z.min() >= -RIGHT * largest and (scaled @ z + right).min() >= -RIGHT * (size + largest):
            return np.maximum(z, 0.0) / d
    raise NoSolution


def _pressing(W: np.ndarray, q: np.ndarray) -> np.ndarray | None:
    """Return which z are not zero, by pivots on a tableau of w, z, the artificial variable, q, and
    powers of a small number beside q, which break ties; None if the method ends on a ray.
    """
    n = q.size
    columns = [np.eye(n), -W, -np.ones((n, 1)), q[:, None], np.eye(n)]
    tableau, basis = np.hstack(columns), np.arange(n)
    row, entering = min(range(n), key=lambda i: tuple(tableau[i, 2 * n + 1 :])), 2 * n
    for _ in range(50 * (n + 1)):
        leaving = int(basis[row])
        _pivot(tableau, row, entering)
        basis[row] = entering
        if leaving == 2 * n:
            return np.sort(basis[basis >= n] - n)
        entering = leaving + n if leaving < n else leaving - n
        found = _next_row(tableau, n, entering, basis)
        if found is None:
            return None
        row = found
    return None


def _next_row(tableau: np.ndarray, n: int, entering: int, basis: np.ndarray) -> int | None:
    """Return the row whose variable leaves, by the smallest ratio; the artificial one if it can."""
    column = tableau[:, entering]
    rows = np.flatnonzero(column > TINY * max(float(np.abs(column).max()), TINY))
    if not rows.size:
        return None
    ratios = tableau[rows, 2 * n + 1] / column[rows]
    near = rows[ratios <= ratios.min() + TINY]
    artificial = near[basis[near] == 2 * n]
    if artificial.size:
        return int(artificial[0])
    return int(min(near, key=lambda i: tuple(tableau[i, 2 * n + 1 :] / column[i])))


def _pivot(tableau: np.ndarray, row: int, column: int) -> None:
    """Make ``column`` the unit vector of ``row``."""
    tableau[row] /= tableau[row, column]
    for i in range(len(tableau)):
        if i != row and tableau[i, column] != 0.0:
            tableau[i] -= tableau[i, column] * tableau[row]
