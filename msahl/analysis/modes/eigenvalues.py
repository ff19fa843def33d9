"""Eigenvalues of a matrix with how well they are determined; zeros are counted by rank.

A matrix of a system with rigid-body modes has multiple eigenvalues zero with fewer eigenvectors,
which any round-off spreads to its square or third root. They are taken out first: with an
orthonormal basis [N X], N of the null space of A,

    A = [N X] [ 0  N^T A X ] [N X]^T          A -> X^T A X , until it has full rank
              [ 0  X^T A X ]

The others have condition numbers kappa = |x| |y| / |y^H x| (right and left eigenvector): a change
E of the matrix changes them by kappa |E| to first order, and a double eigenvalue by sqrt(|E| |A|).
Round-off is of the size of eps |A| at least. Without damping and gyroscopic terms
A = [[0, 1], [K, 0]] with a symmetric K: then the eigenvalues are the roots of those of K, which are
well conditioned.
"""

from typing import NamedTuple

import numpy as np

ZERO = 1e-14
"""Singular value, relative to the largest and for the root of the size, that is round-off: five
times ``ROUND_OFF``. The slowest vibration of a slender blade has 1e-12 of the largest.
"""
NOTHING = 1e-30
"""Entry of a matrix, relative to the largest, that is round-off of zero."""
SYMMETRIC = 1e-13
"""Asymmetry of a matrix, relative to its largest entry, that is round-off."""
ROUND_OFF = 8.0
"""Machine epsilons of the norm by which round-off is taken to change a matrix, for each root of its
size."""

CANCELLED = 100.0
"""Machine epsilons of the terms of a stiffness that may remain where they cancel each other."""


class Eigenvalues(NamedTuple):
    """Eigenvalues by size, those that are zero first; m of a matrix (n, n)."""

    value: np.ndarray  # (m,) complex [1/s]
    vector: np.ndarray  # (n, m) complex; of zeros a basis of their invariant subspace
    condition: np.ndarray  # (m,) condition numbers; nan of zeros
    error: np.ndarray  # (m,) change of the eigenvalue by round-off of the matrix [1/s]
    zeros: int
    null: int  # dimension of the null space: eigenvectors of the eigenvalue zero
    stages: tuple[int, ...]  # dimensions of the null spaces that were taken out in turn


def eigenvalues(
    A: np.ndarray, stages: tuple[int, ...] | None = None, weight: np.ndarray | None = None
) -> Eigenvalues:
    """Return all eigenvalues of ``A`` (n, n); the ``weight`` W, see ``stiffness_weight``, bounds
    round-off of a stiffness, 0 without one.

    With the ``stages`` of a matrix nearby so many are zero as there: what passes through zero then
    keeps its value, where by rank it would count as zero.
    """
    from scipy.linalg import eig, matrix_balance

    n = len(A)
    if not n:
        none = np.zeros(0)
        return Eigenvalues(none.astype(complex), np.zeros((0, 0)), none, none, 0, 0, ())
    if _is_conservative(A):
        return _vibrations(A[n // 2 :, : n // 2], stages, weight)
    # Balancing would scale round-off of zeros to the size of the others.
    A = np.where(np.abs(A) > NOTHING * np.abs(A).max(initial=0.0), A, 0.0)
    balanced, (scaling, _) = matrix_balance(A, permute=False, separate=True)
    basis, taken = deflate(balanced, stages)
    zeros = sum(taken)
    rest = basis[:, zeros:].T @ balanced @ basis[:, zeros:]
    value, left, right = eig(rest, left=True)
    condition = 1.0 / np.maximum(np.abs(np.einsum("im,im->m", left.conj(), right)), 1e-300)
    size = ROUND_OFF * np.sqrt(n) * np.finfo(float).eps * np.linalg.norm(balanced, 2)
    error = np.minimum(size * condition, np.sqrt(size * np.linalg.norm(balanced, 2)))
    inner = _complete_vectors(basis, zeros, balanced, value, right)
    order = np.lexsort((-value.imag, value.real, np.round(np.abs(value), 12)))
    vectors = np.concatenate([basis[:, :zeros].astype(complex), inner[:, order]], axis=1)
    return Eigenvalues(
        value=np.concatenate([np.zeros(zeros, dtype=complex), value[order]]),
        vector=scaling[:, None] * vectors,
        condition=np.concatenate([np.full(zeros, np.nan), condition[order]]),
        error=np.concatenate([np.zeros(zeros), error[order]]),
        zeros=zeros,
        null=taken[0] if taken else 0,
        stages=taken,
    )


def _is_conservative(A: np.ndarray) -> bool:
    """Return whether ``A`` is [[0, 1], [K, 0]] with a symmetric K."""
    d = len(A) // 2
    if len(A) % 2 or A[:d, :d].any() or A[d:, d:].any():
        return False
    if np.abs(A[:d, d:] - np.eye(d)).max() > SYMMETRIC * d:
        return False
    K = A[d:, :d]
    return bool(np.abs(K - K.T).max() <= SYMMETRIC * np.abs(K).max(initial=0.0))


def _vibrations(
    K: np.ndarray, stages: tuple[int, ...] | None, weight: np.ndarray | None
) -> Eigenvalues:
    """Return the eigenvalues +-sqrt(mu) of [[0, 1], [K, 0]], mu those of the symmetric ``K``."""
    d = len(K)
    mu, vectors = np.linalg.eigh(0.5 * (K + K.T))
    order = np.argsort(np.abs(mu), kind="stable")
    mu, vectors = mu[order], vectors[:, order]
    eps, largest = float(np.finfo(float).eps), float(np.abs(mu).max(initial=0.0))
    terms = np.zeros(d) if weight is None else np.sum((weight @ vectors) ** 2, axis=0)
    least = np.maximum(ZERO * np.sqrt(d) * largest, CANCELLED * eps * terms)
    null = int(np.count_nonzero(np.abs(mu) <= least))
    if stages is not None:
        null = sum(stages) // 2
    rest, moving = np.sqrt(mu[null:].astype(complex)), vectors[:, null:]
    still, zero = vectors[:, :null], np.zeros((d, null))
    value = np.stack([rest, -rest], axis=1).reshape(-1)
    size = ROUND_OFF * np.sqrt(d) * eps * np.repeat(np.maximum(largest, terms[null:]), 2)
    error = 0.5 * size / np.maximum(np.abs(value), np.sqrt(np.maximum(size, 1e-300)))
    shape = np.repeat(moving, 2, axis=1)
    vector = np.concatenate([shape, shape * value])
    rigid = np.concatenate([np.concatenate([still, zero]), np.concatenate([zero, still])], axis=1)
    return Eigenvalues(
        value=np.concatenate([np.zeros(2 * null), value]),
        vector=np.concatenate([rigid, vector], axis=1).astype(complex),
        condition=np.concatenate([np.full(2 * null, np.nan), np.ones(value.size)]),
        error=np.concatenate([np.zeros(2 * null), error]),
        zeros=2 * null,
        null=null,
        stages=(null, null) if null else (),
    )


def deflate(
    A: np.ndarray, stages: tuple[int, ...] | None = None, least: float | None = None
) -> tuple[np.ndarray, tuple[int, ...]]:
    """(n, n) orthonormal basis whose first columns span the invariant subspace of the eigenvalue
    zero, and how many of them each stage takes out, by rank unless ``stages`` are given; the first
    are eigenvectors. ``least`` is the singular value up to which one is zero.
    """
    n, zeros, taken = len(A), 0, list[int]()
    basis, rest = np.eye(n), A
    least = ZERO * np.sqrt(n) * float(np.linalg.norm(A, 2)) if least is None else least
    while zeros < n and (stages is None or len(taken) < len(stages)):
        _, values, right = np.linalg.svd(rest)
        nulls = int(np.count_nonzero(values <= least))
        nulls = nulls if stages is None else stages[len(taken)]
        if not nulls:
            break
        rotated = np.concatenate([right[len(right) - nulls :], right[: len(right) - nulls]]).T
        basis[:, zeros:] = basis[:, zeros:] @ rotated
        zeros = zeros + nulls
        taken.append(nulls)
        rest = basis[:, zeros:].T @ A @ basis[:, zeros:]
    return basis, tuple(taken)


def _complete_vectors(
    basis: np.ndarray, zeros: int, A: np.ndarray, value: np.ndarray, inner: np.ndarray
) -> np.ndarray:
    """(n, m) eigenvectors of ``A``, from those of its part without zeros: the rest follows from
    (lambda - A_0) x_0 = N^T A X x, where A_0 is nilpotent.
    """
    if not zeros:
        return inner
    N, X = basis[:, :zeros], basis[:, zeros:]
    along, across = N.T @ A @ N, N.T @ A @ X
    outer = np.empty((zeros, value.size), dtype=complex)
    for m, eigenvalue in enumerate(value):
        shifted = (eigenvalue or np.finfo(float).tiny) * np.eye(zeros)
        outer[:, m] = np.linalg.solve(shifted - np.triu(along, 1), across @ inner[:, m])
    return N @ outer + X @ inner
