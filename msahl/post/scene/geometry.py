"""Rotations, boxes and shapes in the form of a scene: lists of floats and unit quaternions."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from msahl.algebra.rotation_arrays import euler_parameters, matrices

Shape = dict[str, Any]
UNTURNED = [1.0, 0.0, 0.0, 0.0]


def floats(vector: Iterable[float]) -> list[float]:
    """Return a vector as plain floats, without minus before zeros."""
    return [float(value) + 0.0 for value in vector]


def quaternion(R: np.ndarray) -> list[float]:
    """Return [w, x, y, z] of a rotation matrix (3, 3)."""
    return floats(euler_parameters(R))


def along(direction: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return a rotation matrix (3, 3) whose third column is along ``direction``, of any length."""
    z = np.asarray(direction, dtype=float)
    z = z / np.sqrt(z @ z)
    x = np.eye(3)[np.argmin(np.abs(z))]
    x = x - (x @ z) * z
    x = x / np.sqrt(x @ x)
    return np.column_stack([x, np.cross(z, x), z])


def smallest_rotation(before: ArrayLike, after: ArrayLike) -> np.ndarray:
    """Return the quaternion (4,) of the smallest rotation from one unit vector to another."""
    a, b = np.asarray(before, dtype=float), np.asarray(after, dtype=float)
    w, v = 1.0 + a @ b, np.cross(a, b)
    if w < 1e-12:  # half a revolution about any axis across
        w, v = 0.0, along(a)[:, 0]
    q = np.append(w, v)
    return np.asarray(q / np.linalg.norm(q))


def grid_faces(numbers: np.ndarray) -> np.ndarray:
    """Return two triangles (n, 3) for each cell of a grid of vertices, by their ``numbers`` (p, q):
    counterclockwise seen from where the next row is to the left of the next column.
    """
    a, b, c, d = numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def ring_faces(rings: int, around: int) -> np.ndarray:
    """Return the triangles between ``rings`` of vertices, which are counted ring by ring."""
    numbers = np.arange(rings * around).reshape(rings, around)
    return grid_faces(np.concatenate([numbers, numbers[:, :1]], axis=1))


def shape(
    kind: str,
    size: Iterable[float],
    position: Iterable[float] = (0.0, 0.0, 0.0),
    orientation: Sequence[float] = UNTURNED,
) -> Shape:
    """Return a derived shape: position and orientation [w, x, y, z] in the body's axes."""
    return {
        "kind": kind,
        "size": floats(size),
        "position": floats(position),
        "orientation": floats(orientation),
        "colour": None,
        "derived": True,
        "name": "",
    }


def half_box(shape: Shape) -> np.ndarray:
    """Return half the lengths (3,) of the box around a shape, in the shape's axes."""
    size, kind = shape["size"], shape["kind"]
    if kind in ("box", "mesh"):
        return 0.5 * np.array(size)
    radius = size[0]
    if kind == "sphere":
        return np.full(3, radius)
    return np.array([radius, radius, 0.5 * size[1] + (radius if kind == "capsule" else 0.0)])


def corners(shape: Shape) -> np.ndarray:
    """Return the corners (8, 3) of the box around a shape, in the axes of its body."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    middle = np.zeros(3)
    if shape["kind"] == "mesh":
        vertices = np.reshape(shape["vertices"], (-1, 3))
        middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    inside = middle + signs * half_box(shape)
    return np.asarray(inside @ matrices(shape["orientation"]).T + np.array(shape["position"]))
