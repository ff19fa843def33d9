"""Triangulate the shapes of a scene: vertices, normals and faces in the axes of the shape.

Round shapes are surfaces of revolution about z of a profile, whose smooth pieces (radius, z) have
normals of their own, so that edges stay sharp.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.post.scene.geometry import Shape, grid_faces

AROUND, QUARTER = 32, 8
"""Segments of a circle, and of a quarter of it along a meridian."""


class Triangles(NamedTuple):
    """Vertices (n, 3) [m], normals (n, 3) or None for flat faces, and faces (m, 3)."""

    vertices: np.ndarray
    normals: np.ndarray | None
    faces: np.ndarray


class Piece(NamedTuple):
    """A smooth piece of a profile: points (k, 2) and normals (k, 2), radius and z, upwards on the
    outside."""

    points: np.ndarray
    normals: np.ndarray


def triangles(shape: Shape) -> Triangles:
    """Return the surface of a shape; faces are counterclockwise seen from outside."""
    kind, size = shape["kind"], shape["size"]
    if kind == "mesh":
        return Triangles(
            np.reshape(shape["vertices"], (-1, 3)), None, np.reshape(shape["faces"], (-1, 3))
        )
    if kind == "box":
        return _box(size)
    return revolved(_profile(kind, *size))


def _box(size: list[float]) -> Triangles:
    vertices: list[np.ndarray] = []
    normals: list[np.ndarray] = []
    faces: list[tuple[int, int, int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            u, v = np.eye(3)[axis - 2], np.eye(3)[axis - 1]  # u x v is along the axis
            square = [(-1, -1), (1, -1), (1, 1), (-1, 1)][:: int(sign)]
            k = len(vertices)
            vertices += [(normal + a * u + b * v) * 0.5 * np.array(size) for a, b in square]
            normals += [normal] * 4
            faces += [(k, k + 1, k + 2), (k, k + 2, k + 3)]
    return Triangles(np.array(vertices), np.array(normals), np.array(faces))


def _profile(kind: str, radius: float, length: float = 0.0) -> list[Piece]:
    """Return the profile of a sphere, capsule, cylinder or cone, from its lowest point up."""
    top = 0.5 * length
    if kind in ("sphere", "capsule"):
        a = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 2 * QUARTER + 1)
        if kind == "capsule":
            a = np.insert(a, QUARTER, 0.0)
        normals = np.column_stack([np.cos(a), np.sin(a)])
        shift = np.where(np.arange(len(a)) > QUARTER, top, -top)
        return [Piece(radius * normals + shift[:, None] * [0.0, 1.0], normals)]
    base = straight((0.0, -top), (radius, -top))
    if kind == "cone":
        return [base, straight((radius, -top), (0.0, top))]
    side = straight((radius, -top), (radius, top))
    return [base, side, straight((radius, top), (0.0, top))]


def straight(start: tuple[float, float], end: tuple[float, float]) -> Piece:
    """Return the straight piece from ``start`` to ``end``, whose outside is on the right."""
    along = np.subtract(end, start)
    normal = np.array([along[1], -along[0]]) / math.hypot(*along)
    return Piece(np.array([start, end]), np.array([normal, normal]))


def revolved(pieces: list[Piece]) -> Triangles:
    """Return the surface of revolution of a profile about z."""
    angle = np.linspace(0.0, 2.0 * math.pi, AROUND + 1)
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    vertices: list[np.ndarray] = []
    normals: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    for points, directions in pieces:
        first, k = sum(len(found) for found in vertices), len(points)
        for profile, found in ((points, vertices), (directions, normals)):
            ring = around[:, None, :] * profile[None, :, :1]
            height = np.broadcast_to(profile[None, :, 1:], (*ring.shape[:2], 1))
            found.append(np.concatenate([ring, height], axis=2).reshape(-1, 3))
        faces.append(grid_faces(first + np.arange(len(around) * k).reshape(-1, k).T))
    return Triangles(np.concatenate(vertices), np.concatenate(normals), _proper(vertices, faces))


def _proper(vertices: list[np.ndarray], faces: list[np.ndarray]) -> np.ndarray:
    """Return the faces that have an area: at the poles two corners are one point."""
    every, all_faces = np.concatenate(vertices), np.concatenate(faces)
    a, b, c = (every[all_faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.asarray(all_faces[area > 1e-9 * area.max()])
