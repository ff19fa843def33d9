"""Matrices of straight beam elements, by the static solution of Timoshenko's equations.

In the plane of a bending stiffness E I with shear stiffness k G A and the length h, x = s/h,
Phi = 12 E I/(k G A h^2), the deflection and the rotation of the cross-section are

    w  = (N_1 w_1 + N_2 h t_1 + N_3 w_2 + N_4 h t_2)/(1 + Phi)
    N_1 = 1 - 3 x^2 + 2 x^3 + Phi (1 - x)         N_2 = x - 2 x^2 + x^3 + Phi (x - x^2)/2
    t  = (6 (x^2 - x) w_1/h + (1 - 4 x + 3 x^2 + Phi (1 - x)) t_1 + ...)/(1 + Phi)

and N_3, N_4 by symmetry. Loads at nodes give the displacements of the theory exactly. The mass is
consistent with these functions, with rotary inertia. Stretch and twist are linear in x. Source:
Przemieniecki 1968, Theory of Matrix Structural Analysis, 5.6 and 11.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import sparse

from msahl.reduction.elastic_model import Matrices
from msahl.reduction.faults import ReductionError
from msahl.reduction.mesh.material import BeamSection, Material
from msahl.reduction.mesh.mesh import BEAM, Mesh

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)
"""Exact for products of two cubics."""
LEAST_LENGTH = 1e-9
"""Shortest element, by the size of the mesh."""
ALONG = 1e-3
"""Smallest sine between a beam and the direction of its height: a tenth of a degree."""


def beam_matrices(mesh: Mesh, material: Material, section: BeamSection) -> Matrices:
    """Return mass and stiffness of a mesh of beams. Raises ``ReductionError``."""
    nodes = mesh.elements[BEAM]
    along = mesh.places[nodes[:, 1]] - mesh.places[nodes[:, 0]]
    lengths = np.linalg.norm(along, axis=1)
    size = np.ptp(mesh.places, axis=0).max()
    if not (lengths > LEAST_LENGTH * size).all():
        k = int(np.argmin(lengths))
        raise ReductionError(
            mesh.source,
            f"beam {k + 1} (nodes {', '.join(map(str, mesh.labels[nodes[k]]))}) has no length; "
            "delete it",
        )
    axes = element_axes(mesh, section)
    K, M = _local(lengths, material, section)
    T = np.zeros((len(nodes), 12, 12))
    for k in range(4):
        T[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = axes
    rows = (6 * nodes[:, :, None] + np.arange(6)).reshape(len(nodes), 12)
    count = len(mesh.labels)
    assembled = (_assembled(T.transpose(0, 2, 1) @ A @ T, rows, 6 * count) for A in (M, K))
    labels, components = np.repeat(mesh.labels, 6), np.tile(np.arange(6), count)
    return Matrices(labels, components, *assembled)


def volume(mesh: Mesh, section: BeamSection) -> float:
    """Return the volume of a mesh of beams, in its units."""
    first, second = mesh.places[mesh.elements[BEAM]].transpose(1, 0, 2)
    return float(section.geometry.area * np.linalg.norm(second - first, axis=1).sum())


def refined(mesh: Mesh) -> Mesh:
    """Return the mesh with each element cut in two, its new nodes behind the others."""
    nodes = mesh.elements[BEAM]
    middle = len(mesh.labels) + np.arange(len(nodes))
    halves = np.concatenate(
        [np.column_stack([nodes[:, 0], middle]), np.column_stack([middle, nodes[:, 1]])]
    )
    return replace(
        mesh,
        labels=np.concatenate([mesh.labels, mesh.labels.max() + 1 + np.arange(len(nodes))]),
        places=np.concatenate([mesh.places, mesh.places[nodes].mean(axis=1)]),
        elements={BEAM: halves},
    )


def element_axes(mesh: Mesh, section: BeamSection) -> np.ndarray:
    """Return the rows d_1, d_2, d_3 (e, 3, 3) of each element."""
    nodes = mesh.elements[BEAM]
    d1 = mesh.places[nodes[:, 1]] - mesh.places[nodes[:, 0]]
    d1 = d1 / np.linalg.norm(d1, axis=1)[:, None]
    if section.height is None:  # any direction across the beam
        height = np.eye(3)[np.argmin(np.abs(d1), axis=1)]
    else:
        height = np.broadcast_to(np.array(section.height), d1.shape)
    d2 = np.cross(height, d1)
    sines = np.linalg.norm(d2, axis=1) / np.linalg.norm(height, axis=1)
    if (sines < ALONG).any():
        labels = ", ".join(map(str, mesh.labels[nodes[np.argmin(sines)]]))
        raise ReductionError(
            mesh.source, f"the beam between the nodes {labels} is along d3, the height of its "
            "section; reduce it apart, or choose another d3",
        )  # fmt: skip
    d2 = d2 / np.linalg.norm(d2, axis=1)[:, None]
    return np.stack([d1, d2, np.cross(d1, d2)], axis=1)


def _local(
    lengths: np.ndarray, material: Material, section: BeamSection
) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and mass (e, 12, 12) in the axes of each element."""
    A, I2, I3, J, k2, k3 = section.geometry
    E, G, rho = material.E, material.shear, material.rho
    K, M = np.zeros((2, len(lengths), 12, 12))
    rod = np.array([[1.0, -1.0], [-1.0, 1.0]]) / lengths[:, None, None]
    inertia = np.array([[2.0, 1.0], [1.0, 2.0]]) * lengths[:, None, None] / 6.0
    for ends, k, m in (((0, 6), E * A, rho * A), ((3, 9), G * J, rho * (I2 + I3))):
        _add(K, ends, k * rod)
        _add(M, ends, m * inertia)
    # About d_2 the deflection is along d_3, and the slope of positive rotations is negative.
    for rows, sign, second, k in (((1, 5, 7, 11), 1.0, I3, k2), ((2, 4, 8, 10), -1.0, I2, k3)):
        bend, mass = _bending(lengths, E * second, k * G * A, rho * A, rho * second)
        S = np.diag([1.0, sign, 1.0, sign])
        _add(K, rows, S @ bend @ S)
        _add(M, rows, S @ mass @ S)
    return K, M


def _add(A: np.ndarray, rows: Sequence[int], block: np.ndarray) -> None:
    A[np.ix_(range(len(A)), rows, rows)] += block


def _bending(
    lengths: np.ndarray, EI: float, kGA: float, mass: float, rotary: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and mass (e, 4, 4) of bending in a plane, of deflection and rotation at both
    ends; ``mass`` and ``rotary`` inertia per length."""
    h = lengths[:, None, None]
    Phi = 12.0 * EI / (kGA * h**2) if kGA else np.zeros_like(h)
    x = 0.5 * (POINTS + 1.0)[:, None]
    one = np.ones_like(x)
    # Functions (e, points, 4), the terms with Phi apart.
    N = np.hstack([1 - 3 * x**2 + 2 * x**3, x - 2 * x**2 + x**3, 3 * x**2 - 2 * x**3, x**3 - x**2])
    N_Phi = np.hstack([one - x, (x - x**2) / 2, x, (x**2 - x) / 2])
    t = np.hstack([6 * (x**2 - x), 1 - 4 * x + 3 * x**2, 6 * (x - x**2), 3 * x**2 - 2 * x])
    t_Phi = np.hstack([0 * x, one - x, 0 * x, x])
    curvature = np.hstack([12 * x - 6, 6 * x - 4, 6 - 12 * x, 6 * x - 2])
    curvature_Phi = np.hstack([0 * x, -one, 0 * x, one])
    scale = np.concatenate([h / h, h, h / h, h], axis=2)
    w = (N + Phi * N_Phi) * scale / (1.0 + Phi)
    theta = (t + Phi * t_Phi) * scale / (1.0 + Phi) / h
    kappa = (curvature + Phi * curvature_Phi) * scale / (1.0 + Phi) / h**2
    weights = 0.5 * WEIGHTS
    products = [np.einsum("p,epi,epj->eij", weights, a, a) * h for a in (w, theta, kappa)]
    K = EI * products[2]
    if kGA:
        # Without load the shear is constant: w' - theta.
        slope = np.array([-1.0, -0.5, 1.0, -0.5]) * scale * Phi / (1.0 + Phi) / h
        K = K + kGA * slope.transpose(0, 2, 1) * slope * h
    return K, mass * products[0] + rotary * products[1]


def _assembled(blocks: np.ndarray, rows: np.ndarray, size: int) -> sparse.csr_array:
    at = np.repeat(rows, 12, axis=1).ravel(), np.tile(rows, (1, 12)).ravel()
    return sparse.csr_array(sparse.coo_array((blocks.ravel(), at), shape=(size, size)))
