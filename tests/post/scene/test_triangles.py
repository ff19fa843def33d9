"""Surfaces of shapes: closed, facing outwards, with the volume of the solid."""

import math

import numpy as np
import pytest

from msahl.post.scene.geometry import corners, shape
from msahl.post.scene.triangles import AROUND, triangles

PRISM = AROUND / (2 * math.pi) * math.sin(2 * math.pi / AROUND)
"""Area of a regular polygon of AROUND corners relative to that of its circle."""

SHAPES = {
    "box": ([0.2, 0.3, 0.5], 0.03, 1e-12),
    "cylinder": ([0.2, 0.5], PRISM * math.pi * 0.04 * 0.5, 1e-12),
    "rod": ([0.01, 2.0], PRISM * math.pi * 1e-4 * 2, 1e-12),
    "cone": ([0.2, 0.6], PRISM * math.pi * 0.04 * 0.6 / 3, 1e-12),
    # Chords of 5.6 degrees along the meridian take another 0.5 %.
    "sphere": ([0.3], PRISM * 4 / 3 * math.pi * 0.027, 1e-2),
    "capsule": ([0.1, 0.4], PRISM * (4 / 3 * math.pi * 1e-3 + math.pi * 0.01 * 0.4), 1e-2),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_surface(kind):
    size, volume, tolerance = SHAPES[kind]
    solid = shape(kind, size)
    found = triangles(solid)
    a, b, c = (found.vertices[found.faces[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(volume, rel=tolerance)
    # Closed: every edge belongs to two faces, in opposite directions, once equal points are one.
    _, places = np.unique(found.vertices.round(9), axis=0, return_inverse=True)
    faces = places.reshape(-1)[found.faces]
    edges = {(f[i], f[i - 2]) for f in faces.tolist() for i in range(3)}
    assert len(edges) == 3 * len(faces)
    assert {(j, i) for i, j in edges} == edges
    # Normals are unit vectors and on the side of their faces.
    assert np.allclose(np.linalg.norm(found.normals, axis=1), 1, rtol=0, atol=1e-12)
    flat = np.cross(b - a, c - a)
    assert np.all(np.einsum("fj,fkj->fk", flat, found.normals[found.faces]) > 0)
    assert np.abs(found.vertices).max(axis=0) == pytest.approx(corners(solid).max(axis=0))


def test_a_mesh_has_flat_faces():
    square = shape("mesh", [1, 1, 0]) | {
        "vertices": [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0],
        "faces": [0, 1, 2, 0, 2, 3],
    }
    found = triangles(square)
    assert found.normals is None
    assert found.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert corners(square).min(axis=0).tolist() == [0, 0, 0]
