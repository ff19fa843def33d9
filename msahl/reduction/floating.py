"""Modes of a floating frame: a basis of shapes without rigid displacements, orthonormalised.

    Phi' = T - R d,   N: amplitudes that move Phi'   K X = lambda M' X,   Phi = Phi' X

R rigid displacements of the nodes, d those that the frame takes from each shape. The frame's
reference conditions determine d:

    mean      d = (R^T M R)^-1 R^T M T    mean axes (Buckens): deformations have neither momentum
                                          nor angular momentum, to first order
    at a node d = R_n^-1 T_n              the frame is fixed to node n

Modes have unit modal mass. Both frames have the same deformations; in mean axes the eigenvalues are
those of the free body, in the other ones those with the node fixed.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from msahl.reduction.craig_bampton import Basis
from msahl.reduction.elastic_model import ElasticModel
from msahl.reduction.faults import ReductionError
from msahl.reduction.normal_modes import lowest_dense
from msahl.reduction.rigid import mass_centre, rigid_fields

RESISTANCE = 1e-6
"""Forces of a rigid displacement, by the size of their terms, that files of seven digits leave."""
MASSLESS_INTERFACE = (
    "the interface moves without mass; give its nodes a mass, and rotations of them an inertia"
)
CONTAINED = 1e-8
"""Smallest squared sine of an angle between a rigid displacement and the shapes."""


@dataclass(frozen=True, eq=False, slots=True)
class FloatingModes:
    """Deformations of a body in its floating frame, whose origin is the undeformed mass centre."""

    model: ElasticModel
    eigenvalues: np.ndarray  # (q,) [rad^2/s^2]
    shapes: np.ndarray  # (m, q), with unit modal mass
    amplitudes: np.ndarray  # (k, q): the modes in the amplitudes of the basis
    damping: np.ndarray | None  # (q, q)
    rigid: np.ndarray  # (m, 6)
    inertia: np.ndarray  # (6, 6): R^T M R
    centre: np.ndarray  # (3,) [m]
    resistance: float
    """Largest force of a rigid displacement, by the size of its terms."""


def floating_modes(basis: Basis, node: int | None = None) -> FloatingModes:
    """Return the modes of mean axes, or of a frame fixed to a ``node``, by its index.

    Raises ``ReductionError``: the body is not free, or its mass is that of none.
    """
    model = basis.model
    _, centre = mass_centre(model)
    R = rigid_fields(model, centre)
    resistance = require_free(model, R)
    MR = model.mass @ R
    J = R.T @ MR
    require_inertia(model, J)
    B = MR.T @ basis.shapes
    d = np.linalg.solve(J, B) if node is None else _at_node(model, node, R, basis.shapes)
    cross = B.T @ d
    mass = basis.mass - cross - cross.T + d.T @ J @ d
    N = _moving(basis, R)
    K, M = N.T @ basis.stiffness @ N, N.T @ (0.5 * (mass + mass.T)) @ N
    values, X = lowest_dense(K, M, len(K), model.source) if K.size else (np.zeros(0), K)
    if len(values) < len(K):
        raise ReductionError(model.source, MASSLESS_INTERFACE)
    amplitudes = N @ X
    shapes = basis.shapes @ amplitudes - R @ (d @ amplitudes)
    damping = None if basis.damping is None else amplitudes.T @ basis.damping @ amplitudes
    return FloatingModes(
        model, values, shapes, amplitudes, damping, R, J, centre, resistance
    )  # fmt: skip


def require_free(model: ElasticModel, R: np.ndarray) -> float:
    """Return the resistance to rigid displacements; raises ``ReductionError`` if it is fixed."""
    terms = abs(model.stiffness) @ np.abs(R)
    forces = np.abs(model.stiffness @ R)
    sizes = terms.max(axis=0)
    parts = forces.max(axis=0) / np.where(sizes > 0.0, sizes, 1.0)
    if parts.max() > RESISTANCE:
        k = int(np.argmax(parts))
        row = model.row_name(int(np.argmax(forces[:, k])))
        kind = "translation along" if k < 3 else "rotation about"
        raise ReductionError(
            model.source,
            f"the stiffness resists a rigid {kind} {'xyz'[k % 3]}, most at {row}; write the "
            "matrices of the free body, without supports or constraints, and the right places",
        )
    return float(parts.max())


def require_inertia(model: ElasticModel, J: np.ndarray) -> None:
    """Raise ``ReductionError`` unless the rigid body has a mass and moments of inertia."""
    masses = np.diag(J)[:3]
    if not masses.min() > 0.0:
        raise ReductionError(model.source, "its mass is zero; give the matrix of mass")
    if masses.max() - masses.min() > 1e-6 * masses.max():
        shown = ", ".join(f"{m:.6g}" for m in masses)
        raise ReductionError(
            model.source,
            f"its mass along x, y and z differs: {shown} kg; write the matrices of the free body",
        )
    if not np.linalg.eigvalsh(J[3:, 3:]).min() > 1e-12 * np.trace(J[3:, 3:]):
        raise ReductionError(
            model.source,
            "it has no moment of inertia about an axis: its nodes are on a line; add inertias of "
            "rotation, or nodes beside the line",
        )


def _at_node(model: ElasticModel, node: int, R: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    rows = model.rows_of(node)
    if len(rows) < 6:
        raise ReductionError(
            model.source,
            f"node {model.labels[node]} has no rotations, so no frame is fixed to it; tie nodes "
            "to an interface, or take --frame mean",
        )
    result: np.ndarray = np.linalg.solve(R[rows], shapes[rows])
    return result


def _moving(basis: Basis, R: np.ndarray) -> np.ndarray:
    """Return amplitudes (k, q), orthonormal by mass, of the shapes without rigid displacements."""
    if not np.diag(basis.mass).min() > 0.0:
        raise ReductionError(basis.model.source, MASSLESS_INTERFACE)
    scale = 1.0 / np.sqrt(np.diag(basis.mass))
    T = basis.shapes * scale
    M = basis.model.mass
    # Cosines of the angles between rigid displacements and shapes, by the matrix of mass.
    values, V = np.linalg.eigh(T.T @ (M @ T))
    good = values > 1e-12 * values.max()
    P = V[:, good] / np.sqrt(values[good])
    upper = linalg.cholesky(R.T @ (M @ R))
    G = linalg.solve_triangular(upper, R.T @ (M @ T) @ P, trans="T")
    _, cosines, rows = np.linalg.svd(G)
    contained = int((1.0 - cosines**2 < CONTAINED).sum())
    rest: np.ndarray = scale[:, None] * (P @ rows[contained:].T)
    return rest
