"""Matrices of solids by the elements of scikit-fem.

    k(u, v) = integral of sigma(u) : eps(v)    sigma = lambda tr(eps) 1 + 2 mu eps    [N/m]
    m(u, v) = integral of rho u . v                                                   [kg]

Elements are isoparametric with full integration: 4 and 10 nodes of tetrahedra, 8, 20 and 27 nodes
of hexahedra.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from msahl.reduction.elastic_model import Matrices
from msahl.reduction.faults import ReductionError
from msahl.reduction.mesh.material import Material
from msahl.reduction.mesh.mesh import Mesh
from msahl.reduction.mesh.read import MISSING
from msahl.reduction.mesh.reference import REFERENCES, scikit_element, scikit_order

FARTHEST_MIDDLE = 0.25
"""Distance of a middle node from the middle of its corners, by the largest distance of these: at
a quarter the element becomes singular. Farther ones are nodes of another order."""
LEAST_JACOBIAN = 1e-6
"""Smallest determinant of an element's mapping, by its diameter cubed: flatter elements have
stiffnesses that round-off destroys."""
AT_ONCE = 2**25
"""Entries of elements' stiffnesses that are in memory at once: 256 MB."""


@dataclass(frozen=True, eq=False, slots=True)
class Block:
    """Elements of one kind: their scalar basis of scikit-fem, and the ``nodes`` (e, k) of its
    functions, as indices into the mesh."""

    basis: Any
    nodes: np.ndarray


@dataclass(frozen=True, eq=False, slots=True)
class Solid:
    """A mesh of solids with its material, and its volume; in the units of the mesh."""

    mesh: Mesh
    material: Material
    blocks: tuple[Block, ...]
    volume: float


def build_solid(mesh: Mesh, material: Material) -> Solid:
    """Return the solid of a mesh; raises ``ReductionError``: degenerate elements."""
    blocks = tuple(_block(mesh, kind, nodes) for kind, nodes in mesh.elements.items())
    return Solid(mesh, material, blocks, float(sum(one.basis.dx.sum() for one in blocks)))


def _block(mesh: Mesh, kind: str, nodes: np.ndarray) -> Block:
    try:
        import skfem
    except ImportError as error:
        raise ReductionError(mesh.source, MISSING) from error
    _require_shape(mesh, kind, nodes)
    reference, element = REFERENCES[kind], scikit_element(kind)
    ordered = nodes[:, scikit_order(kind)]
    used, t = np.unique(ordered, return_inverse=True)
    t = np.ascontiguousarray(t.reshape(ordered.shape).T)
    made: Any = skfem.MeshTet1 if reference.is_tetrahedron else skfem.MeshHex1
    extra = {"affine": not reference.middles} if reference.is_tetrahedron else {}
    points = np.ascontiguousarray(mesh.places[used].T)
    with np.errstate(all="ignore"):  # of degenerate elements, which are found below
        own = made(points, t, elem=element, **extra)
        basis = skfem.Basis(own, element(), intorder=reference.degree)
    _require_volume(mesh, kind, nodes, basis)
    return Block(basis, ordered)


def _require_shape(mesh: Mesh, kind: str, nodes: np.ndarray) -> None:
    """Raise ``ReductionError`` for an element that has a node twice, as a wedge written as a
    hexahedron, or whose middle nodes are not in the middle."""
    ordered = np.sort(nodes, axis=1)
    again = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    if again.any():
        _degenerate(mesh, kind, int(np.argmax(again)), nodes, "a node twice")
    corners = mesh.places[nodes[:, : len(REFERENCES[kind].corners)]]
    for k, around in enumerate(REFERENCES[kind].middles, corners.shape[1]):
        some = corners[:, list(around)]
        size = np.linalg.norm(some - some[:, :1], axis=2).max(axis=1)
        away = np.linalg.norm(mesh.places[nodes[:, k]] - some.mean(axis=1), axis=1)
        wrong = away > FARTHEST_MIDDLE * size
        if wrong.any():
            element = int(np.argmax(wrong))
            what = f"a middle node, {mesh.labels[nodes[element, k]]}, far from the middle"
            _degenerate(mesh, kind, element, nodes, what)


def _require_volume(mesh: Mesh, kind: str, nodes: np.ndarray, basis: Any) -> None:
    """Raise ``ReductionError`` for elements without volume, or folded over."""
    jacobian = np.broadcast_to(basis.mapping.detDF(basis.X), basis.dx.shape)
    diameter = np.linalg.norm(np.ptp(mesh.places[nodes], axis=1), axis=1)
    flat = ~(np.abs(jacobian).min(axis=1) > LEAST_JACOBIAN * diameter**3)
    folded = (jacobian.min(axis=1) < 0.0) & (jacobian.max(axis=1) > 0.0)
    for wrong, what in ((folded, "parts folded inside out"), (flat, "no volume")):
        if wrong.any():
            _degenerate(mesh, kind, int(np.argmax(wrong)), nodes, what)


def _degenerate(mesh: Mesh, kind: str, element: int, nodes: np.ndarray, what: str) -> None:
    labels = ", ".join(map(str, mesh.labels[nodes[element]][:8]))
    raise ReductionError(
        mesh.source,
        f"element {element + 1} of the {kind} elements (nodes {labels}) has {what}; correct the "
        "mesh",
    )


def matrices(solid: Solid) -> Matrices:
    """Return mass and stiffness, in the units of the mesh."""
    labels = solid.mesh.labels
    size = len(labels)
    K = sparse.csr_array((3 * size, 3 * size))
    M = sparse.csr_array((size, size))
    for block in solid.blocks:
        count = AT_ONCE // (3 * block.nodes.shape[1]) ** 2
        for first in range(0, len(block.nodes), count):
            some = slice(first, first + count)
            K += _stiffness(block, some, solid.material, 3 * size)
            M += _mass(block, some, solid.material, size)
    rows, components = np.repeat(labels, 3), np.tile(np.arange(3), size)
    every = sparse.csr_array(sparse.kron(M, np.eye(3)))
    return Matrices(rows, components, every, K)


def _stiffness(block: Block, some: slice, material: Material, size: int) -> sparse.csr_array:
    """Return the stiffness of ``some`` elements of a block."""
    E, nu, mu = material.E, material.nu, material.shear
    lam = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    slopes = np.stack([np.asarray(one[0].grad)[:, some] for one in block.basis.basis])
    k, _, e, _ = slopes.shape
    g = slopes.transpose(2, 0, 1, 3).reshape(e, 3 * k, -1)
    # T[e, i, a, j, b] = integral of (d_a N_i) (d_b N_j)
    T = ((g * block.basis.dx[some, None]) @ g.transpose(0, 2, 1)).reshape(e, k, 3, k, 3)
    Ke = lam * T + mu * T.transpose(0, 1, 4, 3, 2)
    Ke += mu * np.einsum("eicjc,ab->eiajb", T, np.eye(3))
    rows = (3 * block.nodes[some, :, None] + np.arange(3)).reshape(e, -1)
    return _assembled(Ke.reshape(e, 3 * k, 3 * k), rows, size)


def _mass(block: Block, some: slice, material: Material, size: int) -> sparse.csr_array:
    """Return the mass in each direction of ``some`` elements of a block."""
    dx = block.basis.dx[some]
    N = np.stack(list(_values(block, some, dx.shape)), axis=1)
    Me = material.rho * (N * dx[:, None]) @ N.transpose(0, 2, 1)
    return _assembled(Me, block.nodes[some], size)


def _values(block: Block, some: slice, shape: tuple[int, ...]) -> Iterator[np.ndarray]:
    """Yield the functions (e, q) at the points of integration, which have one row if they are the
    same in all elements."""
    for one in block.basis.basis:
        value = np.asarray(one[0])
        yield np.broadcast_to(value if len(value) == 1 else value[some], shape)


def _assembled(blocks: np.ndarray, rows: np.ndarray, size: int) -> sparse.csr_array:
    """Return the sum (size, size) of matrices (e, k, k) of elements, whose rows are (e, k)."""
    k = rows.shape[1]
    at = np.repeat(rows, k, axis=1).ravel(), np.tile(rows, (1, k)).ravel()
    return sparse.csr_array(sparse.coo_array((blocks.ravel(), at), shape=(size, size)))
