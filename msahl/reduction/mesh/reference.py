"""Reference elements of solids: nodes in the order of VTK, and the elements of scikit-fem.

scikit-fem has the same elements with other orders of nodes, so nodes are matched by their places in
the reference element, a tetrahedron or a cube of edge 1.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

TETRA = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
CUBE = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    dtype=float,
)
TETRA_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
CUBE_EDGES = (
    *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6)),
    *((6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
)
CUBE_FACES = ((0, 4, 7, 3), (1, 5, 6, 2), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7))


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """An element: its ``corners`` (c, 3), which corners each further node is in the middle of, the
    name of its functions in scikit-fem, and the degree that is integrated exactly: of products of
    two of its functions in elements with straight edges."""

    corners: np.ndarray
    middles: tuple[tuple[int, ...], ...]
    functions: str
    degree: int

    @property
    def is_tetrahedron(self) -> bool:
        """Whether it is a tetrahedron, not a hexahedron."""
        return len(self.corners) == len(TETRA)

    @property
    def nodes(self) -> np.ndarray:
        """Places (k, 3) of its nodes."""
        middles = [self.corners[list(one)].mean(axis=0) for one in self.middles]
        return np.array([*self.corners, *middles])


REFERENCES = {
    "tetra": Reference(TETRA, (), "ElementTetP1", 2),
    "tetra10": Reference(TETRA, TETRA_EDGES, "ElementTetP2", 4),
    "hexahedron": Reference(CUBE, (), "ElementHex1", 3),
    "hexahedron20": Reference(CUBE, CUBE_EDGES, "ElementHexS2", 5),
    "hexahedron27": Reference(
        CUBE, (*CUBE_EDGES, *CUBE_FACES, tuple(range(8))), "ElementHex2", 5
    ),
}  # fmt: skip
"""Elements by meshio's names."""


def scikit_element(kind: str) -> Any:
    """Return the class of an element's functions in scikit-fem."""
    import skfem

    return getattr(skfem, REFERENCES[kind].functions)


@cache
def scikit_order(kind: str) -> np.ndarray:
    """Return for each function of scikit-fem the node (k,) that it belongs to."""
    places = np.asarray(scikit_element(kind).doflocs, dtype=float)
    away = np.abs(places[:, None] - REFERENCES[kind].nodes).max(axis=2)
    return np.asarray(np.argmin(away, axis=1))


def values(kind: str, points: np.ndarray) -> np.ndarray:
    """Return the functions (p, k) of an element's nodes at points (p, 3) of the reference
    element."""
    element = scikit_element(kind)()
    found = np.empty((len(points), len(REFERENCES[kind].nodes)))
    for i, node in enumerate(scikit_order(kind)):
        found[:, node] = element.lbasis(points.T.copy(), i)[0]
    return found
