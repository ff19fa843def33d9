"""The skin of a reduced body: triangles of its surface, which views draw deformed."""

from dataclasses import dataclass

import numpy as np

MOST_NUMBERS = 120_000
"""Most numbers of the shapes of a skin, unless it has very few points: a page contains them."""
FEWEST_POINTS = 500
GROWTH = 1.15
"""Factor of the size of cells, until few enough are occupied."""


@dataclass(frozen=True, eq=False, slots=True)
class Skin:
    """Points (s, 3) [m] from the mass centre, their displacements (s, 3, q) in modes of unit modal
    mass, and triangles (t, 3) of them, seen from outside counterclockwise."""

    places: np.ndarray
    shapes: np.ndarray
    triangles: np.ndarray


def thinned(skin: Skin) -> Skin:
    """Return a skin with so few points that its shapes have at most ``MOST_NUMBERS``: points in one
    cell of a grid become one, at their mean."""
    q = max(skin.shapes.shape[2], 1)
    most = max(MOST_NUMBERS // (3 * q), FEWEST_POINTS)
    if len(skin.places) <= most:
        return skin
    low = skin.places.min(axis=0)
    size = float(np.ptp(skin.places, axis=0).max()) / np.sqrt(most)
    while True:
        cells = np.floor((skin.places - low) / size).astype(np.int64)
        _, cell = np.unique(cells, axis=0, return_inverse=True)
        if cell.max() < most:
            return _merged(skin, cell.ravel())
        size *= GROWTH


def _merged(skin: Skin, cell: np.ndarray) -> Skin:
    """Return the skin whose points are the means of those with the same number of ``cell``."""
    count = np.bincount(cell).astype(float)
    places, shapes = (np.zeros((len(count), *a.shape[1:])) for a in (skin.places, skin.shapes))
    np.add.at(places, cell, skin.places)
    np.add.at(shapes, cell, skin.shapes)
    triangles = cell[skin.triangles]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    return Skin(places / count[:, None], shapes / count[:, None, None], triangles[np.sort(first)])
