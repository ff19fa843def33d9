"""Error of a Craig-Bampton basis: of each frequency, of the statics, and the mass that is missing.

A mode u = T x of the reduced body with the eigenvalue lambda pushes the omitted modes phi_k by
lambda phi_k . w, w = W u_b, W = M_ii Psi + M_ib (``craig_bampton``). To second order in this,

    lambda - lambda_true = sum_k (lambda phi_k . w)^2 / (lambda_k - lambda)
                        <= lambda^2 r . K_ii^-1 r / (1 - lambda / lambda_next)

r is w without its parts along the modes kept, and lambda_next the lowest omitted eigenvalue: no
omitted mode is computed. By Rayleigh's quotient the true frequencies are never higher. The estimate
is good up to half the lowest omitted frequency; nearer to it modes mix. It is infinite above, where
modes are there for the statics.
"""

from dataclasses import dataclass

import numpy as np

from msahl.reduction.craig_bampton import Interior
from msahl.reduction.elastic_model import ElasticModel
from msahl.reduction.floating import FloatingModes


@dataclass(frozen=True, eq=False, slots=True)
class ReductionErrors:
    """``frequency`` (q,): by how much each frequency is too high, relative to it; ``following``
    [Hz]: the lowest omitted frequency with the interface held; ``statics``: residual of the static
    modes, by the size of their terms; ``effective_mass`` (6,): the part of the mass between the
    interface nodes, and of its moments of inertia, that moves in the modes kept."""

    frequency: np.ndarray
    following: float
    statics: float
    effective_mass: np.ndarray


def reduction_errors(modes: FloatingModes, interior: Interior) -> ReductionErrors:
    """Return the errors of modes of a floating frame."""
    return ReductionErrors(
        _frequency_errors(modes, interior),
        float(np.sqrt(interior.modes.following)) / (2.0 * np.pi),
        interior.residual,
        _effective_mass(modes.model, modes.rigid, interior),
    )


def _frequency_errors(modes: FloatingModes, interior: Interior) -> np.ndarray:
    values, following = modes.eigenvalues, interior.modes.following
    if len(interior.inner) == 0 or np.isinf(following):
        return np.zeros(len(values))
    Phi = interior.modes.shapes
    M_ii = modes.model.mass[interior.inner][:, interior.inner]
    w = interior.coupling @ modes.shapes[interior.outer]
    r = w - M_ii @ (Phi @ (Phi.T @ w))
    flexibility = np.einsum("iq,iq->q", r, interior.factors.solve(r))
    below = values < following
    gap = np.where(below, 1.0 - values / following, 1.0)
    # d f / f = d lambda / (2 lambda)
    return np.where(below, 0.5 * values * np.maximum(flexibility, 0.0) / gap, np.inf)


def _effective_mass(model: ElasticModel, R: np.ndarray, interior: Interior) -> np.ndarray:
    inner = interior.inner
    R_i = R[inner]
    MR = model.mass[inner][:, inner] @ R_i
    total = np.einsum("ia,ia->a", R_i, MR)
    moving = ((interior.modes.shapes.T @ MR) ** 2).sum(axis=0)
    return np.where(total > 0.0, moving / np.where(total > 0.0, total, 1.0), 1.0)
