"""Eigenvalues that are exactly zero, of large models: their space, counted by rank.

Rigid-body modes are multiple eigenvalues zero of the pencil lambda E x = A x with fewer
eigenvectors, which round-off spreads to its square root. The k eigenvectors nearest to a shift
beside zero, found by inverse iteration, span a space. With a basis X of it, (S X)^T (S X) = 1 for
the unknowns that have a rate, the pencil is a small matrix there

    B = (S X)^T S A X         S = diag(omega, 1, 1): places count by a frequency omega

Its zeros are counted by rank and taken out in stages, as in ``eigenvalues``. The spaces found, X_0
of the pencil and Y_0 of the transposed one, are improved by inverse iteration. Then

    x - X_0 (Y_0^T E X_0)^-1 Y_0^T E x

is a vector x without its part in the space: so Arnoldi's method sees the other eigenvalues only.
"""

from typing import Any, NamedTuple

import numpy as np

from msahl.analysis.modes.eigenvalues import deflate

FIRST = 16
"""Vectors that are iterated at first."""
MOST = 128
"""Most of them."""
ZERO = 1e-9
"""Singular value of B, relative to the largest, that is zero, where round-off is less."""
ROUND_OFF = 100.0
"""Machine epsilons of the terms of B that may be round-off."""
CERTAIN = 0.75
"""Part of the vectors that may be zeros, so that the rest shows where these end."""
ITERATIONS = 12
"""Each shrinks what X_0 has of other eigenvectors by the ratio of the shift to them."""
SMALL = 0.1
"""Shift, relative to the eigenvalue next to zero, from which it is small."""


class ZeroSpace(NamedTuple):
    """Right and left vectors (m, z) of the eigenvalue zero, with all unknowns; those first in
    ``right`` are eigenvectors.
    """

    right: np.ndarray
    left: np.ndarray
    inverse: np.ndarray  # (z, z) of Y_0^T E X_0
    null: int  # eigenvectors

    def removed(self, x: np.ndarray, E: np.ndarray, transposed: str) -> np.ndarray:
        """Return a vector (m,) without its part in the space, or with "H" a left one."""
        if transposed == "H":
            rest: np.ndarray = x - self.left @ (self.inverse.T @ (self.right.T @ (E * x)))
            return rest
        rest = x - self.right @ (self.inverse @ (self.left.T @ (E * x)))
        return rest


def zero_space(
    A: Any, E: np.ndarray, coordinates: int, factors: Any, shift: float
) -> ZeroSpace | None:
    """Return the space of the eigenvalue zero, with the ``factors`` of A - shift E; None if there
    is none, if there are too many, or if the shift is too large or too small to tell.
    """
    right = _space(_Side(A, E, factors, "N", shift), coordinates)
    left = _space(_Side(A.T, E, factors, "H", shift), coordinates) if right else None
    if right is None or left is None or right[0].shape[1] != left[0].shape[1]:
        return None
    X, Y = right[0], left[0]
    return ZeroSpace(X, Y, np.linalg.inv(Y.T @ (E[:, None] * X)), right[1])


class _Side(NamedTuple):
    """The pencil or the transposed one, and the factors of A - shift E."""

    A: Any
    E: np.ndarray
    factors: Any
    transposed: str
    shift: float

    def improved(self, X: np.ndarray, times: int) -> np.ndarray:
        """Return vectors (m, k) after inverse iterations, orthonormal where they have a rate."""
        finite = int(np.count_nonzero(self.E))
        for _ in range(times):
            X = self.factors.solve(np.ascontiguousarray(self.E[:, None] * X), self.transposed)
            X = X @ np.linalg.inv(np.linalg.qr(X[:finite], mode="r"))
        return X


def _space(side: _Side, coordinates: int) -> tuple[np.ndarray, int] | None:
    """Return vectors (m, z) of the eigenvalue zero, eigenvectors first, and how many these are;
    None as ``zero_space``.
    """
    finite, wanted = int(np.count_nonzero(side.E)), FIRST
    rng = np.random.default_rng(0)
    while True:
        wanted = min(wanted, finite)
        start = np.zeros((side.E.size, wanted))
        start[:finite] = rng.normal(size=(finite, wanted))
        X = side.improved(start, ITERATIONS)
        small, least, S = _small(side, X, coordinates)
        basis, stages = deflate(small, None, least)
        zeros = sum(stages)
        # Vectors of a part of the zeros only are no invariant space: those look small, not zero.
        within = int(np.count_nonzero(np.abs(np.linalg.eigvals(small)) <= side.shift))
        if max(zeros, within) <= CERTAIN * wanted:
            break
        if wanted >= min(MOST, finite):
            return None
        wanted *= 2
    rest = basis[:, zeros:].T @ small @ basis[:, zeros:]
    if not zeros or np.abs(np.linalg.eigvals(rest)).min() < side.shift / SMALL:
        return None
    R = np.linalg.qr(S[:, None] * X[:finite], mode="r")
    X = side.improved(X @ np.linalg.solve(R, basis[:, :zeros]), ITERATIONS)
    # Eigenvectors first again.
    small, _, S = _small(side, X, coordinates)
    R = np.linalg.qr(S[:, None] * X[:finite], mode="r")
    return X @ np.linalg.solve(R, np.linalg.svd(small)[2][::-1].T), stages[0]


def _small(side: _Side, X: np.ndarray, coordinates: int) -> tuple[np.ndarray, float, np.ndarray]:
    """B (k, k), the singular value of it that counts as zero, and the diagonal of S (finite,)."""
    finite = int(np.count_nonzero(side.E))
    S = np.ones(finite)
    AX, size = (side.A @ X)[:finite], (abs(side.A) @ np.abs(X))[:finite]
    plain = np.linalg.lstsq(X[:finite], AX, rcond=None)[0]
    omega = float(np.abs(np.linalg.eigvals(plain)).max(initial=0.0)) or 1.0
    S[:coordinates] = omega if side.transposed == "N" else 1.0 / omega
    Q, R = np.linalg.qr(S[:, None] * X[:finite])
    back = np.linalg.inv(R)
    B = Q.T @ (S[:, None] * AX) @ back
    terms = np.abs(Q).T @ (S[:, None] * size) @ np.abs(back)
    rounding = ROUND_OFF * np.finfo(float).eps * float(np.linalg.norm(terms))
    return B, max(ZERO * float(np.linalg.norm(B, 2)), rounding), S
