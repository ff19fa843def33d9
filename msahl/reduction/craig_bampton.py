"""Craig-Bampton basis: static modes of the interface, and normal modes with the interface held.

    u = T (u_b, eta),   T = [ 1    0   ]      Psi = -K_ii^-1 K_ib
                            [ Psi  Phi ]      K_ii Phi = M_ii Phi Lambda,   Phi^T M_ii Phi = 1

u_b displacements of the interface, eta amplitudes of the modes kept. Loads at the interface produce
the static displacements of the full model. Source: Craig, Bampton 1968, AIAA Journal 6, 1313.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU

from msahl.reduction.elastic_model import ElasticModel
from msahl.reduction.faults import ReductionError
from msahl.reduction.normal_modes import (
    MECHANISM,
    NormalModes,
    Wanted,
    factorised,
    normal_modes,
)

MOST_NUMBERS = 2**29
"""Numbers in the shapes of a basis: 4 GiB."""
WORST_RESIDUAL = 1e-6
"""Residual of the static modes, by the size of their terms, above which K_ii is singular."""


@dataclass(frozen=True, eq=False, slots=True)
class Basis:
    """Shapes of an elastic model, and its matrices in their amplitudes. The first ``boundary``
    amplitudes are displacements of the interface."""

    model: ElasticModel
    shapes: np.ndarray  # (m, k)
    mass: np.ndarray  # (k, k)
    stiffness: np.ndarray  # (k, k)
    damping: np.ndarray | None
    boundary: int


@dataclass(frozen=True, eq=False, slots=True)
class Interior:
    """The rows ``inner`` between the interface's, ``outer``: what the error of a basis needs."""

    inner: np.ndarray
    outer: np.ndarray
    factors: SuperLU
    modes: NormalModes
    coupling: np.ndarray  # (i, b): W = M_ii Psi + M_ib
    residual: float
    """Largest residual of the static modes' equations, by the size of their terms."""


def craig_bampton(model: ElasticModel, outer: np.ndarray, wanted: Wanted) -> tuple[Basis, Interior]:
    """Return the basis of an interface of these rows. Raises ``ReductionError``."""
    inner = np.setdiff1d(np.arange(model.size), outer)
    _require_memory(model, len(outer) + (wanted.number or 0))
    K, M = model.stiffness, model.mass
    K_ii, M_ii = K[inner][:, inner], M[inner][:, inner]
    K_ib = K[inner][:, outer].toarray()
    factors = factorised(K_ii, model.source) if len(inner) else None
    Psi = np.zeros((0, len(outer))) if factors is None else -factors.solve(K_ib)
    residual = _residual(K_ii, Psi, K_ib)
    if not residual < WORST_RESIDUAL:
        raise ReductionError(model.source, MECHANISM)
    modes = normal_modes(K_ii, M_ii, factors, wanted, model.source)
    T = np.zeros((model.size, len(outer) + len(modes.eigenvalues)))
    T[outer, np.arange(len(outer))] = 1.0
    T[inner, : len(outer)], T[inner, len(outer) :] = Psi, modes.shapes
    coupling = M_ii @ Psi + M[inner][:, outer].toarray()
    basis = Basis(model, T, *_projected(model, T, outer, modes), len(outer))
    return basis, Interior(inner, outer, factors, modes, coupling, residual)


def _require_memory(model: ElasticModel, columns: int) -> None:
    if model.size * columns > MOST_NUMBERS:
        raise ReductionError(
            model.source,
            f"{columns} shapes of {model.size} degrees of freedom exceed 4 GiB; "
            "choose fewer interface nodes or modes",
        )


def _residual(K_ii: sparse.csr_array, Psi: np.ndarray, K_ib: np.ndarray) -> float:
    if Psi.size == 0:
        return 0.0
    size = float((abs(K_ii) @ np.abs(Psi) + np.abs(K_ib)).max())
    with np.errstate(invalid="ignore"):
        return float(np.abs(K_ii @ Psi + K_ib).max()) / (size or 1.0)


def _projected(
    model: ElasticModel, T: np.ndarray, outer: np.ndarray, modes: NormalModes
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return mass, stiffness and damping in the amplitudes of the basis."""
    count = len(outer)
    mass = T.T @ (model.mass @ T)
    mass[count:, count:] = np.eye(len(modes.eigenvalues))
    stiffness = np.zeros_like(mass)
    static = (model.stiffness @ T[:, :count])[outer]  # zero in the other rows
    stiffness[:count, :count] = 0.5 * (static + static.T)
    stiffness[count:, count:] = np.diag(modes.eigenvalues)
    damping = None if model.damping is None else T.T @ (model.damping @ T)
    return 0.5 * (mass + mass.T), stiffness, damping
