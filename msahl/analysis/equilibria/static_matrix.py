"""Factorises the matrix of the equations of an equilibrium.

    [ K  G^T ] [ dq   ]     [ force     ]
    [ G   C  ] [ dlam ]  =  [ change    ]

Rows of G are divided by their size, and K by the largest stiffness. Where constraints are
redundant, or a direction has no stiffness, small numbers on the diagonal choose the least
multipliers and the least motion.

The matrix is a band in the order of Cuthill and McKee: a narrow one for beams, chains and trees of
bodies. Wide bands are left to SuperLU.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msahl.analysis.equilibria.static_equations import Balance
from msahl.analysis.equilibria.static_layout import Pattern
from msahl.jit.by_size import compiled_once
from msahl.jit.compiled import DISABLED
from msahl.linalg import band_lu
from msahl.system.arrays import System

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

REDUNDANT = 1e-10
"""On the diagonal of the multipliers, where the largest stiffness is 1."""
FLAT = 1e-12
"""Likewise on the diagonal of the places."""
SYMMETRIC = 1e-7
"""Difference of K and its transpose, over the largest stiffness, that is round-off."""
INDEPENDENT = 1e-9
"""Part of a constraint that no other constraint has, of independent ones."""
FEW = 1e4
"""Products of a factorisation up to which plain Python is faster than loading its code."""
MANY = 3e8
"""Products of a band's factorisation above which SuperLU takes over."""


class Factors(NamedTuple):
    """The factorised matrix of an iteration, with the scales of its unknowns and equations."""

    pattern: Pattern
    band: tuple[np.ndarray, np.ndarray, np.ndarray] | None  # arrays of ``band_lu``
    sparse: "SuperLU | None"
    size: np.ndarray  # (c,) of each row of G, and its multiplier's
    stiffness: float


def _entries(now: Balance, shift: float) -> tuple[np.ndarray, np.ndarray, float]:
    """(m,) entries of the matrix, the sizes (c,) by which its constraints are divided, and the
    stiffness [N/m] by which the equations of forces are.
    """
    layout = now.layout
    k, c = layout.stiff, now.violation.size
    K, G, row = now.values[:k], now.values[k:], layout.row[k:]
    size = np.sqrt(np.bincount(row, G * G, c))
    size[size == 0.0] = 1.0
    G = G / size[row]
    stiffness = float(np.abs(K).max(initial=0.0))
    C = layout.soft[2] / (size[layout.soft[0]] * size[layout.soft[1]])
    # An unloaded beam has all its stiffness in its compliance.
    softest = float(np.abs(C).max(initial=0.0))
    stiffness = max(stiffness, 1.0 / softest if softest else 0.0)
    stiffness = stiffness or max(now.largest / now.size, 1e-300)
    flat = np.full(now.force.size, -FLAT - shift / stiffness)
    parts = [K / stiffness, G, G, stiffness * C, flat, np.full(c, REDUNDANT)]
    return np.concatenate(parts), size, stiffness


def factorise(now: Balance, shift: float = 0.0) -> Factors:
    """Factorise the matrix of an iteration; a ``shift`` [N/m] makes all directions stiffer."""
    entries, size, stiffness = _entries(now, shift)
    pattern = now.layout.pattern
    n, b = pattern.position.size, pattern.width
    if pattern.products > MANY or (DISABLED and pattern.products > FEW):
        return Factors(pattern, None, _super_lu(pattern, entries), size, stiffness)
    A = np.bincount(pattern.place, entries, n * (3 * b + 1)).reshape(n, 3 * b + 1)
    band = (A, np.zeros(n, dtype=np.int64), pattern.end.copy())
    _call(pattern, band_lu.factor, A, b, *band[1:])
    return Factors(pattern, band, None, size, stiffness)


def _call(pattern: Pattern, kernel: Callable[..., None], *given: Any) -> None:
    """Call a ``kernel`` of ``band_lu``, compiled if that pays; zero pivots are found later."""
    if pattern.products >= FEW:
        compiled_once(kernel)(*given)
        return
    with np.errstate(all="ignore"):
        kernel(*given)


def _super_lu(pattern: Pattern, entries: np.ndarray) -> "SuperLU":
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import splu

    n = pattern.position.size
    return splu(coo_array((entries, (pattern.row, pattern.column)), shape=(n, n)).tocsc())


def solve(factors: Factors, force: np.ndarray, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) displacements, rotations times lengths [m], and (c,) multipliers that change the forces
    over lengths by ``force`` [N] and the constraints by ``change``.
    """
    pattern, n = factors.pattern, force.size
    with np.errstate(over="ignore"):  # an infinite displacement ends the search
        right = np.concatenate([force / factors.stiffness, change / factors.size])
    if factors.sparse is not None:
        both = factors.sparse.solve(right)
    else:
        assert factors.band is not None
        A, pivot, end = factors.band
        z = np.empty_like(right)
        z[pattern.position] = right
        _call(pattern, band_lu.solve, A, pattern.width, pivot, end, z)
        both = z[pattern.position]
    return both[:n], both[n:] * factors.stiffness / factors.size


def symmetric_eigenvalues(now: Balance) -> np.ndarray:
    """(n + c,) eigenvalues of the symmetric part of [-K, G^T; G, -C], scaled, in ascending order: c
    of them are negative, and one more for each direction in which the equilibrium is unstable.
    """
    entries, _, _ = _entries(now, 0.0)
    pattern = now.layout.pattern
    n, size = now.force.size, pattern.position.size
    dense = np.zeros((size, size))
    np.add.at(dense, (pattern.row, pattern.column), entries)
    dense[:n, :n] *= -1.0
    dense[n:, n:] *= -1.0
    values: np.ndarray = np.linalg.eigvalsh(0.5 * (dense + dense.T))
    return values


def directions(now: Balance, system: System) -> np.ndarray | None:
    """Return the stiffnesses of the motions that the constraints leave, over the largest one of the
    model, in ascending order: negative ones are directions in which the equilibrium is unstable.
    None if forces follow bodies, so that there is no energy.
    """
    K, G = stiffness(now, system)
    largest = float(np.abs(K).max(initial=0.0)) or 1.0
    if not np.abs(K - K.T).max(initial=0.0) <= SYMMETRIC * largest:
        return None
    if len(G):
        Q, R = np.linalg.qr((G / np.sqrt((G * G).sum(axis=1, keepdims=True))).T, mode="complete")
        if np.abs(np.diagonal(R)).min() <= INDEPENDENT:
            return symmetric_eigenvalues(now)[now.violation.size :]
        K = Q[:, len(G) :].T @ K @ Q[:, len(G) :]
    values: np.ndarray = np.linalg.eigvalsh(0.5 * (K + K.T)) / largest
    return values


def stiffness(now: Balance, system: System) -> tuple[np.ndarray, np.ndarray]:
    """(n, n) minus the derivative of all forces, with those of elastic strains [N/m], and (k, n)
    that of the constraints and rigid strains, by lengths.
    """
    layout, c = now.layout, now.violation.size
    k, n, group = layout.stiff, now.force.size, system.beams
    K, G = np.zeros((n, n)), np.zeros((c, n))
    np.add.at(K, (layout.row[:k], layout.column[:k]), -now.values[:k])
    np.add.at(G, (layout.row[k:], layout.column[k:]), now.values[k:])
    if group is None:
        return K, G
    rigid = np.ones(c, dtype=bool)
    rigid[c - group.rigid.size :] = group.rigid.reshape(-1)
    strains = G[c - group.rigid.size :]
    resisted = (group.stiffness / group.weight[:, None, None]) @ strains.reshape(-1, 6, n)
    K += strains.T @ resisted.reshape(strains.shape)
    return K, G[rigid]
