"""The constraint equations that close the loops of a tree: of cut joints, couplings and motions.

They are those of the system (``elements.constraints``), in groups of their own. A
multiplier's force acts as wrenches on up to four bodies of the tree, its *pieces*: those of the
frames A and B of either coordinate. An equation depends on the coordinates between the ground and
these bodies, its *entries*, but for those that all of its bodies lie beyond: there it sees a rigid
motion.
"""

from typing import Any, NamedTuple

import numpy as np

from msahl.elements.constraints.coincide import Coincide, CoincideWorkspace
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace
from msahl.formulations.absolute.frames import first_multiplier
from msahl.formulations.tree.table import Tree
from msahl.system.arrays import System, new_coordinates_workspace, node_count
from msahl.system.reductions import coordinate_subset

PIECES = 4
"""Most bodies on which the multiplier of one equation acts."""


class Cut(NamedTuple):
    """Constant data of m cut equations with e entries; -1 stands for no number."""

    coincide: Coincide
    scalar: ScalarConstraints | None
    angle: np.ndarray  # (q,) number of each coordinate in the system
    frame: np.ndarray  # (c,) frames that the equations see
    body: np.ndarray  # (c,) numbers of these in the tree
    pair: np.ndarray  # (m,) pair of points of an equation in inertial axes
    equation: np.ndarray  # (m,) scalar equation
    place: np.ndarray  # (m, 2) which of the multipliers' nodes, and its slot
    scale: np.ndarray  # (m,) multiplier [N or N m] of a unit of the equation's [N]
    piece: np.ndarray  # (m, PIECES) body of the tree on which each piece acts; 0: none
    first: np.ndarray  # (m + 1,) first entry of each equation
    coordinate: np.ndarray  # (e,) of the tree
    acts: np.ndarray  # (e, PIECES) whether the piece acts on a body beyond that coordinate
    redundant: bool  # whether some equations follow from others


class CutWorkspace(NamedTuple):
    """The cut joints' vectors in one configuration, and counted angles there."""

    coincide: CoincideWorkspace
    scalar: ScalarWorkspace  # None where the group is
    angle: np.ndarray  # (q,)


def build_cut(system: System, free: np.ndarray, tree: Tree, elements: set[int]) -> Cut | None:
    """Return the equations of the ``elements``, by number among joints, couplings and motions, as
    far as their multipliers are ``free`` unknowns; None if there are none.
    """
    frames, first = system.frames, first_multiplier(system.frames)
    is_cut = np.isin(system.multipliers.element, list(elements))
    needed = np.zeros((node_count(system), 3), dtype=bool)
    needed.reshape(-1)[free] = True
    needed = needed[first:] & is_cut[:, None]
    pairs = np.flatnonzero(needed[system.coincide.row - first].any(axis=1))
    coincide = Coincide(*(array[pairs] for array in system.coincide))
    scalar, used = _scalar_part(system, needed)
    body_of = np.zeros(frames.length.size, dtype=np.int64)
    body_of[tree.frame] = np.arange(tree.frame.size)
    rows: list[tuple[int, int, int, int, float, list[int]]] = []
    for c, (a, b, row) in enumerate(zip(coincide.a, coincide.b, coincide.row - first, strict=True)):
        for slot in np.flatnonzero(needed[row]):
            rows.append((c, -1, int(row), int(slot), 1.0, [a, b]))
    if scalar is not None:
        products = scalar.coordinates.products
        for r, (row, slot) in enumerate(scalar.equations.place):
            seen: list[int] = []
            for q in scalar.equations.coordinate[r]:
                k = scalar.coordinates.first[q]
                seen += [products.a[k], products.b[k]] if q >= 0 else []
            rows.append((-1, r, int(row), int(slot), float(scalar.equations.scale[r]), seen))
    if not rows:
        return None
    piece = np.zeros((len(rows), PIECES), dtype=np.int64)
    for row_number, row_data in enumerate(rows):
        piece[row_number, : len(row_data[5])] = body_of[row_data[5]]
    counts, coordinate, acts = _entries(tree, piece, [len(row[5]) for row in rows])
    seen_bodies = np.unique(piece[piece > 0])
    return Cut(
        coincide=coincide,
        scalar=scalar,
        angle=used,
        frame=tree.frame[seen_bodies],
        body=seen_bodies,
        pair=np.array([row[0] for row in rows]),
        equation=np.array([row[1] for row in rows]),
        place=np.array([row[2:4] for row in rows]),
        scale=np.array([row[4] for row in rows]),
        piece=piece,
        first=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        coordinate=coordinate,
        acts=acts,
        redundant=system.relaxation > 0.0,
    )


def _scalar_part(system: System, needed: np.ndarray) -> tuple[ScalarConstraints | None, np.ndarray]:
    """Return the scalar constraints whose multipliers are ``needed`` (k, 3), and the numbers of
    their coordinates in the system.
    """
    scalar = system.scalar
    if scalar is None:
        return None, np.zeros(0, dtype=np.int64)
    place = scalar.equations.place
    kept = np.flatnonzero(needed[place[:, 0], place[:, 1]])
    equations = type(scalar.equations)(*(array[kept] for array in scalar.equations))
    used = np.unique(equations.coordinate[equations.coordinate >= 0])
    group, number = coordinate_subset(scalar.coordinates, used)
    part = scalar._replace(
        coordinates=group,
        equations=equations._replace(coordinate=number[equations.coordinate]),
        equation_column=scalar.equation_column[kept],
    )
    return part, used


def _entries(
    tree: Tree, piece: np.ndarray, given: list[int]
) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Return the number of entries of each equation, their coordinates, and ``Cut.acts``."""
    counts, coordinate, acts = [], [], []
    for bodies, count in zip(piece, given, strict=True):
        paths = [_path(tree, int(b)) for b in bodies]
        found = sorted(set().union(*paths))
        # The two sides of one coordinate see no difference beyond what carries both.
        common = paths[0] & paths[1] if count == 2 else set()
        kept = [k for k in found if k not in common]
        counts.append(len(kept))
        coordinate += kept
        acts += [[k in path for path in paths] for k in kept]
    shape = (len(coordinate), PIECES)
    return counts, np.array(coordinate, dtype=np.int64), np.array(acts, dtype=bool).reshape(shape)


def _path(tree: Tree, b: int) -> set[int]:
    """Return the coordinates between the ground and body ``b``."""
    path: set[int] = set()
    while b > 0:
        path.update(range(int(tree.first[b]), int(tree.first[b + 1])))
        b = int(tree.parent[b])
    return path


def new_cut_workspace(cut: Cut, nodes: int) -> CutWorkspace:
    """Return the workspace of one configuration of a system of so many ``nodes``."""
    k = cut.coincide.a.size
    scalar: Any = cut.scalar and ScalarWorkspace(
        coordinates=new_coordinates_workspace(cut.scalar.coordinates, nodes),
        rate=np.zeros(cut.angle.size),
    )
    return CutWorkspace(
        coincide=CoincideWorkspace(*np.zeros((3, k, 3))),
        scalar=scalar,
        angle=np.zeros(cut.angle.size),
    )
