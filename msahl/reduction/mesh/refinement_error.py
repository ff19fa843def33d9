"""Frequencies of a body on a finer mesh, from its modes on the given one.

    A Y = M X,  A = K + sigma M,   then the eigenvalues of K in the columns of Y    (twice)

X begins with the modes P u of the given mesh, which are displacements of the finer one. Their
errors are of short waves, which this inverse iteration reduces by the ratio of the eigenvalues. A
is not factorised: conjugate gradients solve for Y, with the sum of the given mesh's solution and of
the diagonal's as preconditioner, whose quality does not depend on the mesh.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.optimize import linear_sum_assignment

from msahl.reduction.body import ReducedBody
from msahl.reduction.elastic_model import ElasticModel
from msahl.reduction.interfaces import Interface, Tied, tied
from msahl.reduction.normal_modes import factorised
from msahl.reduction.reduce import MEAN, Wishes

ROUNDS = 2
SHIFT = 0.1
"""sigma, by the lowest eigenvalue: a free body has six of zero."""
RESIDUAL = 1e-3
"""Of the equations for Y, by that of their beginning: eigenvalues have its square."""
MOST_STEPS = 200
ALIKE = 0.5
"""Square of the modes' product by mass from which they are one, by that of equal ones."""


@dataclass(frozen=True, eq=False, slots=True)
class Levels:
    """The models of a mesh and of the finer one, and the displacements P (n', n) of its nodes."""

    given: ElasticModel
    finer: ElasticModel
    P: sparse.csr_array


def refinement_errors(levels: Levels, body: ReducedBody, wishes: Wishes, count: int) -> np.ndarray:
    """Return by how much each of the first ``count`` frequencies exceeds that of the finer mesh,
    relative to it; nan for modes that none of the finer mesh resembles."""
    coarse = tied(levels.given, wishes.interfaces)
    fine = tied(levels.finer, [_on_finer(levels, coarse, one) for one in wishes.interfaces])
    Q = _prolongation(levels, coarse, fine)
    X = Q @ _amplitudes(body, coarse)
    moving = np.arange(fine.model.size)
    if wishes.frame != MEAN:
        node = fine.model.node_of(fine.nodes[wishes.frame])
        moving = np.setdiff1d(moving, fine.model.rows_of(node))
    K, M = (A[moving][:, moving] for A in (fine.model.stiffness, fine.model.mass))
    values = _iterated(K, M, Q[moving], X[moving], body)
    return np.asarray(np.maximum(1.0 - np.sqrt(values / body.eigenvalues), 0.0)[:count])


def _on_finer(levels: Levels, coarse: Tied, one: Interface) -> Interface:
    """Return an interface of the finer mesh: nodes that only those of the interface move."""
    inside = np.isin(levels.given.labels, coarse.members[one.name])
    outside = levels.P @ np.where(inside, 0.0, 1.0)
    absolute = abs(levels.P) @ np.where(inside, 0.0, 1.0)
    labels = levels.finer.labels[(absolute == 0.0) & (outside == 0.0)]
    return Interface(one.name, tuple(range(k, k + 1) for k in labels.tolist()))


def _prolongation(levels: Levels, coarse: Tied, fine: Tied) -> sparse.csr_array:
    """Return the displacements (m', m) of the finer tied model by those of the given one."""
    all_nodes = sparse.csr_array(sparse.kron(levels.P, np.eye(3)) @ coarse.expansion)
    own = fine.model
    parts = []
    free = own.owners < len(levels.finer.labels)
    parts.append(all_nodes[3 * own.owners[free] + own.components[free]])
    points = coarse.model.owners >= len(levels.given.labels)
    unit = sparse.csr_array(sparse.eye_array(coarse.model.size))[np.flatnonzero(points)]
    return sparse.csr_array(sparse.vstack([*parts, unit]))


def _amplitudes(body: ReducedBody, coarse: Tied) -> np.ndarray:
    """Return the modes (m, q) of a body in the rows of its tied model."""
    model = coarse.model
    moves = model.components < 3
    found = np.zeros((model.size, len(body.eigenvalues)))
    found[moves] = body.node_shapes[model.owners[moves], model.components[moves]]
    of_label = {label: k for k, label in enumerate(coarse.nodes.values())}
    for row in np.flatnonzero(~moves):
        k = of_label[int(model.labels[model.owners[row]])]
        found[row] = body.interface_shapes[k, model.components[row]]
    return found


def _iterated(
    K: sparse.csr_array,
    M: sparse.csr_array,
    Q: sparse.csr_array,
    X: np.ndarray,
    body: ReducedBody,
) -> np.ndarray:
    """Return the eigenvalues (q,) of the finer mesh in the order of the modes X (m', q)."""
    sigma = SHIFT * float(body.eigenvalues.min())
    A = sparse.csr_array(K + sigma * M)
    kept = np.flatnonzero(abs(Q).sum(axis=0))
    Q = sparse.csr_array(Q[:, kept])
    factors = factorised(sparse.csr_array(Q.T @ A @ Q), "the finer mesh")
    inverse = 1.0 / A.diagonal()[:, None]

    def precondition(r: np.ndarray) -> np.ndarray:
        return np.asarray(Q @ factors.solve(np.ascontiguousarray(Q.T @ r)) + inverse * r)

    begin, values = M @ X, body.eigenvalues
    for _ in range(ROUNDS):
        X = _solved(A, M @ X, X / (values + sigma), precondition)
        X /= np.sqrt(np.einsum("ij,ij->j", X, M @ X))
        values, V = linalg.eigh(X.T @ (K @ X), X.T @ (M @ X))
        X = X @ V
    # Modes with large errors have another order on the finer mesh; all X have unit modal mass.
    alike = (begin.T @ X) ** 2
    _, order = linear_sum_assignment(-alike)
    found = alike[np.arange(len(order)), order] > ALIKE
    return np.where(found, values[order], np.nan)


def _solved(
    A: sparse.csr_array,
    B: np.ndarray,
    X: np.ndarray,
    precondition: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """Return X with A X = B by conjugate gradients, each column by itself."""
    r = B - A @ X
    z = precondition(r)
    p, rz = z, np.einsum("ij,ij->j", r, z)
    limit = RESIDUAL**2 * rz
    for _ in range(MOST_STEPS):
        if (rz <= limit).all():
            break
        Ap = A @ p
        step = rz / np.maximum(np.einsum("ij,ij->j", p, Ap), np.finfo(float).tiny)
        X = X + step * p
        r = r - step * Ap
        z = precondition(r)
        before, rz = rz, np.einsum("ij,ij->j", r, z)
        p = z + rz / np.maximum(before, np.finfo(float).tiny) * p
    return X
