"""Solids of shapes: volume, mass centre and inertia, and how far shapes reach."""

import math
from collections.abc import Iterable

import numpy as np

from msahl.importers.meshes import MeshFiles
from msahl.importers.robot import Inertia, Look, about, together
from msahl.post.scene.meshes import Mesh

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
CLOSED = 1e-6
"""Sum of the areas of a mesh as vectors, relative to its surface, that counts as closed."""


def solid_of(looks: Iterable[Look], meshes: MeshFiles, mass: float) -> Inertia | None:
    """Return the solid of the closed meshes among the shapes of a link, of uniform density and this
    ``mass``; None if there are none."""
    parts = []
    for look in looks:
        mesh = meshes.mesh(look)
        part = None if mesh is None else mesh_solid(mesh)
        if part is not None and part.mass > 0.0:
            parts.append(part.seen_from(look.pose))
    total = together(parts)
    if not total.mass:
        return None
    return Inertia(mass, total.c, total.J * (mass / total.mass))


def mesh_solid(mesh: Mesh) -> Inertia | None:
    """Return volume, centre and inertia at the density 1 of the solid within a mesh; None if it is
    open. The sign of the volume says whether its faces look outwards.
    """
    corners = mesh.vertices[mesh.faces]  # (m, 3, 3)
    areas = _areas(corners)
    surface = np.sqrt((areas**2).sum(axis=1)).sum()
    if not surface > 0.0 or math.hypot(*areas.sum(axis=0)) > CLOSED * surface:
        return None
    volumes = _volumes(corners)
    volumes = volumes if volumes.sum() > 0.0 else -volumes
    volume = float(volumes.sum())
    if volume == 0.0:
        return None
    centre = _centre(volumes, corners)
    J = _tensor(volumes, corners) - about(volume, centre)
    return Inertia(volume, centre, J)


def pyramids(mesh: Mesh) -> Inertia | None:
    """Return the same by MuJoCo's default: all pyramids between the faces and one point count as
    positive, first about the centroid of the surface, then about the mass centre. It is the solid
    of meshes that are seen from these points completely; others come out larger. None if it is
    flat."""
    corners = mesh.vertices[mesh.faces]
    sizes = np.sqrt((_areas(corners) ** 2).sum(axis=1))
    if not sizes.sum() > 0.0:
        return None
    middle = np.einsum("m,mi->i", sizes, corners.mean(axis=1)) / sizes.sum()
    volumes = np.abs(_volumes(corners - middle))
    if not volumes.sum() > 0.0:
        return None
    centre = middle + _centre(volumes, corners - middle)
    corners = corners - centre
    volumes = np.abs(_volumes(corners))
    return Inertia(float(volumes.sum()), centre, _tensor(volumes, corners))


def _areas(corners: np.ndarray) -> np.ndarray:
    """Return twice the areas of triangles (m, 3, 3) as vectors (m, 3)."""
    a, b, c = (corners[:, i] for i in range(3))
    return np.cross(b - a, c - a)


def _volumes(corners: np.ndarray) -> np.ndarray:
    """Return V = a.(b x c)/6 (m,) of the tetrahedra of the triangles and the origin."""
    a, b, c = (corners[:, i] for i in range(3))
    return np.asarray(np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0)


def _centre(volumes: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the centre of tetrahedra."""
    return np.asarray(np.einsum("m,mi->i", volumes, corners.sum(axis=1)) / 4.0 / volumes.sum())


def _tensor(volumes: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the tensor of tetrahedra about the origin: of each int x x^T dV = V/20 (sum of v v^T
    over its corners + s s^T), s their sum."""
    s = corners.sum(axis=1)
    second = np.einsum("m,mki,mkj->ij", volumes, corners, corners)
    second = (second + np.einsum("m,mi,mj->ij", volumes, s, s)) / 20.0
    return np.asarray(np.trace(second) * np.eye(3) - second)


def extent(looks: Iterable[Look], meshes: MeshFiles, centre: np.ndarray) -> float:
    """Return the distance [m] of the farthest point of shapes, or of their boxes, from ``centre``;
    0 without shapes."""
    farthest = 0.0
    for look in looks:
        points = look.pose.p + bounds(look, meshes) @ look.pose.R.T - centre
        farthest = max(farthest, float(np.sqrt((points**2).sum(axis=1)).max(initial=0.0)))
    return farthest


def bounds(look: Look, meshes: MeshFiles) -> np.ndarray:
    """Return points (n, 3) whose hull contains a shape, in its own axes."""
    mesh = meshes.mesh(look)
    if mesh is not None:
        return mesh.vertices
    if look.kind == "box":
        return 0.5 * CORNERS * np.array(look.size)
    if look.kind == "mesh":
        return np.zeros((0, 3))
    radius = look.size[0]
    half = radius if look.kind == "sphere" else 0.5 * look.size[1]
    half += radius if look.kind == "capsule" else 0.0
    return CORNERS * np.array([radius, radius, half])
