"""The skin of a mesh: the outer faces of solids, or rectangles along beams."""

import numpy as np

from msahl.reduction.body import ReducedBody
from msahl.reduction.mesh.beams import element_axes
from msahl.reduction.mesh.material import BeamSection
from msahl.reduction.mesh.mesh import BEAM, Mesh
from msahl.reduction.skin import Skin, thinned

FACES = {
    4: ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    8: ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}
"""Faces of tetrahedra and hexahedra by their corners in the order of VTK, seen from outside."""
SAME = 1e-9
"""Distance of points that are one, by the size of the mesh."""
CORNERS = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
"""Corners of a rectangle along d_2 and d_3, counterclockwise about d_1."""


def mesh_skin(
    mesh: Mesh, section: BeamSection | None, unit: float, body: ReducedBody, rotations: np.ndarray
) -> Skin:
    """Return the skin of a body of a mesh, whose nodes rotate by ``rotations`` (n, 3, q); ``unit``
    [m] is the length in which the section is given."""
    order = np.argsort(body.node_labels, kind="stable")
    nodes = order[np.searchsorted(body.node_labels[order], mesh.labels)]
    if section is None:
        return thinned(_of_solids(mesh, body.node_places[nodes], body.node_shapes[nodes]))
    moments = np.array([section.geometry.I3, section.geometry.I2])
    half = unit * np.sqrt(3.0 * moments / section.geometry.area)
    moved = body.node_shapes[nodes], rotations[nodes]
    return thinned(
        _of_beams(mesh, element_axes(mesh, section), half, body.node_places[nodes], *moved)
    )


def _of_solids(mesh: Mesh, places: np.ndarray, shapes: np.ndarray) -> Skin:
    """Return the faces that belong to one element alone, by their corners."""
    found = []
    for kind, nodes in mesh.elements.items():
        for face in FACES[4 if kind.startswith("tetra") else 8]:
            corners = nodes[:, list(face)]
            found.append(np.pad(corners, ((0, 0), (0, 4 - len(face))), mode="edge"))
    faces = np.concatenate(found)
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    outer = faces[np.sort(first[count == 1])]
    triangles = np.concatenate(
        [outer[:, [0, 1, 2]], outer[outer[:, 2] != outer[:, 3]][:, [0, 2, 3]]]
    )
    used, index = np.unique(triangles, return_inverse=True)
    return Skin(places[used], shapes[used], index.reshape(-1, 3))


def _of_beams(
    mesh: Mesh,
    axes: np.ndarray,
    half: np.ndarray,
    places: np.ndarray,
    shapes: np.ndarray,
    rotations: np.ndarray,
) -> Skin:
    """Return a rectangle with the radii of gyration of the section along each element, ``half`` as
    wide along d_2 and d_3: its corners move with the nodes as parts of rigid bodies."""
    nodes = mesh.elements[BEAM]
    arms = np.einsum("ca,eai->eci", CORNERS * half, axes[:, 1:])  # (e, 4, 3)
    arms = np.broadcast_to(arms[:, None], (len(nodes), 2, 4, 3))
    swept = np.cross(rotations[nodes].transpose(0, 1, 3, 2)[:, :, None], arms[:, :, :, None])
    points = places[nodes][:, :, None] + arms
    moved = shapes[nodes][:, :, None] + swept.transpose(0, 1, 2, 4, 3)
    c, d = np.arange(4), (np.arange(4) + 1) % 4
    sides = np.concatenate([np.column_stack([c, d, d + 4]), np.column_stack([c, d + 4, c + 4])])
    ends = np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]])
    faces = np.concatenate([sides, ends])
    triangles = (faces + 8 * np.arange(len(nodes))[:, None, None]).reshape(-1, 3)
    return _welded(Skin(points.reshape(-1, 3), moved.reshape(-1, 3, shapes.shape[2]), triangles))


def _welded(skin: Skin) -> Skin:
    """Return the skin with points once that are the same, and without faces inside, which two
    elements in one line have in common."""
    size = np.ptp(skin.places, axis=0).max()
    _, first, index = np.unique(
        np.rint(skin.places / (SAME * size)), axis=0, return_index=True, return_inverse=True
    )
    triangles = index.ravel()[skin.triangles]
    _, at, count = np.unique(
        np.sort(triangles, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return Skin(skin.places[first], skin.shapes[first], triangles[count[at.ravel()] == 1])
