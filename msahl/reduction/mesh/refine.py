"""Uniform refinement of solids: each element becomes eight of its kind, with the same shape.

Displacements of the given mesh are displacements of the finer one: u_fine = P u, where the rows of
P are the functions of the elements at the new nodes. Nodes that neighbouring elements share have
equal rows, by which they are recognised.
"""

from dataclasses import replace

import numpy as np
from scipy import sparse

from msahl.reduction.mesh.mesh import Mesh
from msahl.reduction.mesh.reference import REFERENCES, Reference, values

DENOMINATOR = 2**12
"""Values of the functions at halves and quarters of an element are multiples of its inverse."""
PARTS_OF_TETRAHEDRON = (
    *((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3)),
    *((4, 5, 6, 8), (4, 6, 7, 8), (5, 9, 6, 8), (6, 9, 7, 8)),
)
"""By corners and middles of edges in the order of VTK; all are oriented as their element."""


def refined(mesh: Mesh) -> tuple[Mesh, sparse.csr_array]:
    """Return the finer mesh, with nodes 1 to n', and P (n', n). It has no sets."""
    rows = {kind: _rows(kind, nodes) for kind, nodes in mesh.elements.items()}
    keys = np.concatenate([_keys(*one, len(mesh.labels)).ravel() for one in rows.values()])
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    P = sparse.csr_array((0, len(mesh.labels)))
    elements, begin = {}, 0
    for kind, (weights, parents) in rows.items():
        count = parents.shape[0] * weights.shape[0] * weights.shape[1]
        nodes = index[begin : begin + count].reshape(-1, weights.shape[1])
        chosen = first[(first >= begin) & (first < begin + count)] - begin
        P = sparse.vstack([P, _chosen(weights, parents, chosen, len(mesh.labels))])
        elements[kind] = nodes
        begin += count
    order = np.argsort(first, kind="stable")  # rows of P are in the order of appearance
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    elements = {kind: place[nodes] for kind, nodes in elements.items()}
    P = sparse.csr_array(P)
    labels = np.arange(1, P.shape[0] + 1)
    finer = replace(
        mesh, labels=labels, places=P @ mesh.places, elements=elements, sets={}, ignored={}
    )
    return finer, P


def _rows(kind: str, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the functions (8, k, k) of an element at the nodes of its parts, times DENOMINATOR,
    and the nodes (e, k) that they belong to."""
    parts = _parts(REFERENCES[kind])
    weights = values(kind, parts.reshape(-1, 3)).reshape(*parts.shape[:2], -1)
    return np.rint(DENOMINATOR * weights).astype(np.int64), nodes


def _parts(reference: Reference) -> np.ndarray:
    """Return the nodes (8, k, 3) of the eight parts of a reference element."""
    own = reference.nodes
    if not reference.is_tetrahedron:
        return 0.5 * (reference.corners[:, None] + own)
    halves = REFERENCES["tetra10"].nodes
    barycentric = np.column_stack([1.0 - own.sum(axis=1), own])
    return np.array([barycentric @ halves[list(one)] for one in PARTS_OF_TETRAHEDRON])


def _keys(weights: np.ndarray, parents: np.ndarray, size: int) -> np.ndarray:
    """Return a number (e, 8, k) for each node of each part, equal for equal rows of P: the sum of
    the weights times random numbers of the nodes, modulo 2^64."""
    random = np.random.default_rng(1).integers(0, 2**63, size, dtype=np.int64)
    with np.errstate(over="ignore"):
        found: np.ndarray = np.einsum("pkj,ej->epk", weights, random[parents])
    return found


def _chosen(
    weights: np.ndarray, parents: np.ndarray, chosen: np.ndarray, size: int
) -> sparse.csr_array:
    """Return rows (n, size) of P by their position among the nodes (e, 8, k) of all parts."""
    each = weights.shape[0] * weights.shape[1]
    element, local = np.divmod(np.sort(chosen), each)
    data = weights.reshape(each, -1)[local] / DENOMINATOR
    at = np.repeat(np.arange(len(chosen)), data.shape[1]), parents[element].ravel()
    found = sparse.csr_array(sparse.coo_array((data.ravel(), at), shape=(len(chosen), size)))
    found.eliminate_zeros()
    return found
