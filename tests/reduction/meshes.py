"""Meshes of boxes by all kinds of solid elements, and of beams."""

import numpy as np

from msahl.reduction.mesh.mesh import build_mesh
from msahl.reduction.mesh.reference import CUBE, REFERENCES

KINDS = tuple(REFERENCES)
QUADRATIC = ("tetra10", "hexahedron20", "hexahedron27")
SPLIT = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))
"""Tetrahedra of a cube by its corners."""


def box_cells(kind, counts, sizes=(1.0, 1.0, 1.0)):
    """Places (n, 3) and elements (e, k) of a box with a corner at the origin."""
    grid = np.stack(np.meshgrid(*(np.arange(n + 1) for n in counts), indexing="ij"), axis=-1)
    index = np.arange(grid[..., 0].size).reshape(grid.shape[:3])
    corners = CUBE.astype(int)
    cells = np.array([index[tuple((np.array(at) + corners).T)] for at in np.ndindex(*counts)])
    if REFERENCES[kind].is_tetrahedron:
        cells = np.concatenate([cells[:, list(one)] for one in SPLIT])
    places = list(grid.reshape(-1, 3) * np.array(sizes) / counts)
    known, columns = {}, [cells]
    for around in REFERENCES[kind].middles:
        column = []
        for key in map(tuple, np.sort(cells[:, list(around)], axis=1)):
            if key not in known:
                known[key] = len(places)
                places.append(np.mean([places[k] for k in key], axis=0))
            column.append(known[key])
        columns.append(np.array(column)[:, None])
    return np.array(places), np.hstack(columns)


def box_mesh(kind, counts, sizes=(1.0, 1.0, 1.0)):
    """A box with the sets Root and Tip at its ends along x."""
    places, cells = box_cells(kind, counts, sizes)
    sets = {"Root": np.flatnonzero(places[:, 0] == 0.0),
            "Tip": np.flatnonzero(places[:, 0] == places[:, 0].max())}  # fmt: skip
    return build_mesh("box", np.arange(1, len(places) + 1), places, [(kind, cells)], sets)


def distorted(kind):
    """A cube of 8 or 48 straight elements whose inner corner is elsewhere."""
    places, cells = box_cells(kind, (2, 2, 2))
    corners = cells[:, : len(REFERENCES[kind].corners)]
    centre = np.flatnonzero((places == 0.5).all(axis=1))
    moved = places.copy()
    moved[centre[np.isin(centre, corners)]] += (0.11, -0.07, 0.05)
    for k, around in enumerate(REFERENCES[kind].middles, corners.shape[1]):
        moved[cells[:, k]] = moved[corners[:, list(around)]].mean(axis=1)
    return build_mesh("cube", np.arange(1, len(places) + 1), moved, [(kind, cells)], {})


def line_mesh(places, pairs=None):
    """Beams between these places, one after the other unless pairs are given."""
    places = np.asarray(places, dtype=float)
    if pairs is None:
        pairs = np.column_stack([np.arange(len(places) - 1), np.arange(1, len(places))])
    return build_mesh("beams", np.arange(1, len(places) + 1), places, [("line", pairs)], {})
