"""Where the numbers of the equations of an equilibrium stand, found once for a system.

Entries of the matrix

    [ K  G^T ]
    [ G   C  ]

are listed by row and column. In the order of Cuthill and McKee it is a band: a narrow one for
beams, chains and trees of bodies.
"""

from typing import NamedTuple

import numpy as np

from msahl.analysis.linearised.plain_units import (
    coordinate_numbers,
    equation_scale,
    multiplier_numbers,
    scales,
)
from msahl.formulations.absolute.frames import first_multiplier
from msahl.linalg.band_order import band_order
from msahl.system.arrays import System, node_count


class Pattern(NamedTuple):
    """Where the entries of the matrix stand: those of K, G, G^T, C and of the diagonal."""

    row: np.ndarray  # (m,)
    column: np.ndarray  # (m,)
    position: np.ndarray  # (n + c,) of each unknown in the order of elimination
    width: int  # b of ``band_lu``
    place: np.ndarray  # (m,) in the band
    end: np.ndarray  # (n + c,) columns after the last entries of its rows
    products: float  # of a factorisation


class Layout(NamedTuple):
    """Where the numbers of the equations stand: n coordinates, c equations, e entries of K, then of
    G; those of C are constant.
    """

    coordinate: np.ndarray  # (n,) number of each coordinate among the flat unknowns, 3 node + axis
    multiplier: np.ndarray  # (c,) number of each multiplier in ``State.force``, 3 node + axis
    length: np.ndarray  # (n,) l of a rotation [m], 1 of a displacement
    rotational: np.ndarray  # (n,) whether a coordinate is one of a rotation
    force: np.ndarray  # (n,) force over acceleration, moments over lengths [kg]
    stiff: int  # number of entries of K
    taken: np.ndarray  # (e,) places of the entries in the block values
    scale: np.ndarray  # (e,) by which they are multiplied
    row: np.ndarray  # (e,) among coordinates, or equations
    column: np.ndarray  # (e,) among coordinates
    soft: tuple[np.ndarray, np.ndarray, np.ndarray]  # rows, columns and values of C
    own: np.ndarray  # (c,) diagonal of C
    pattern: Pattern  # of the complete matrix


def layout_of(system: System, kept: np.ndarray | None = None) -> Layout:
    """Return where the numbers of the equations of a ``system`` stand, of all or of those unknowns
    that are ``kept`` (nodes, 3).
    """
    first = first_multiplier(system.frames)
    coordinate, equation = coordinate_numbers(system), multiplier_numbers(system)
    soft = _compliance(system, equation.size)
    if kept is not None:
        coordinate = coordinate[kept.reshape(-1)[coordinate]]
        soft = _of_some(soft, kept.reshape(-1)[equation])
        equation = equation[kept.reshape(-1)[equation]]
    force, length = (scale[coordinate] for scale in scales(system))
    by_equation = 1.0 / equation_scale(system).reshape(-1)[equation - 3 * first]
    K, G = _entries(system, coordinate, equation)
    own = np.zeros(equation.size)
    diagonal = soft[0] == soft[1]
    own[soft[0][diagonal]] = soft[2][diagonal]
    row, column = np.concatenate([K[1], G[1]]), np.concatenate([K[2], G[2]])
    return Layout(
        coordinate=coordinate,
        multiplier=equation - 3 * first,
        length=length,
        rotational=system.frames.rotates[coordinate // 3].astype(bool),
        force=force / length,
        stiff=K[0].size,
        taken=np.concatenate([K[0], G[0]]),
        scale=np.concatenate([(force / length)[K[1]], by_equation[G[1]]]),
        row=row,
        column=column,
        soft=soft,
        own=own,
        pattern=_pattern(_groups(system, coordinate, equation), (row, column), K[0].size, soft),
    )


Entries = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Places in the block values, or values; rows; columns."""


def _entries(
    system: System, coordinate: np.ndarray, equation: np.ndarray
) -> tuple[Entries, Entries]:
    """Places in the block values, rows and columns of the entries of K and of G."""
    place = np.full((2, 3 * node_count(system)), -1)
    place[0, coordinate], place[1, equation] = np.arange(coordinate.size), np.arange(equation.size)
    three = np.arange(3)
    i = 3 * system.blocks[:, 0, None, None] + three[:, None]
    j = 3 * system.blocks[:, 1, None, None] + three
    i, j = (flat.reshape(-1) for flat in np.broadcast_arrays(i, j))
    column = place[0, j]
    column[:9] = -1  # block 0 belongs to the ground
    found = []
    for row in place[:, i]:
        taken = np.flatnonzero((row >= 0) & (column >= 0))
        found.append((taken, row[taken], column[taken]))
    return found[0], found[1]


def _compliance(system: System, equations: int) -> Entries:
    """Rows, columns and values of w J C, whose equations are the last ones."""
    group = system.beams
    if group is None:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)
    six, values = np.arange(6), group.weight[:, None, None] * group.compliance
    first = equations - 6 * group.weight.size + 6 * np.arange(group.weight.size)
    rows, columns = np.broadcast_arrays(
        first[:, None, None] + six[:, None], first[:, None, None] + six
    )
    kept = values != 0.0
    return rows[kept], columns[kept], values[kept]


def _of_some(entries: Entries, kept: np.ndarray) -> Entries:
    """Return those of the ``entries`` whose rows and columns are ``kept`` (c,), numbered anew."""
    row, column, values = entries
    number, both = np.cumsum(kept) - 1, kept[row] & kept[column]
    return number[row[both]], number[column[both]], values[both]


def _groups(system: System, coordinate: np.ndarray, equation: np.ndarray) -> tuple[np.ndarray, ...]:
    """Numbers (n,) and (c,) of what unknowns belong to, which stay together in the order of
    elimination: frames, points of a beam, other multipliers' nodes.
    """
    group, frames = np.arange(node_count(system)), system.frames
    group[frames.rotation] = frames.displacement
    if system.beams is not None:
        place = first_multiplier(frames) + system.beams.place
        group[place + 1] = place
    return group[coordinate // 3], group[equation // 3]


def _pattern(
    groups: tuple[np.ndarray, ...],
    entries: tuple[np.ndarray, np.ndarray],
    stiff: int,
    soft: Entries,
) -> Pattern:
    """Return where the entries of the matrix stand, and the order in which they form a band: of
    unknowns in ``groups`` (n,) and (c,), and ``entries`` of K, of which there are ``stiff``, and of
    G.
    """
    n, c = (group.size for group in groups)
    k, every = stiff, np.arange(n + c)
    across, along = n + entries[0][k:], entries[1][k:]
    row = np.concatenate([entries[0][:k], across, along, n + soft[0], every])
    column = np.concatenate([entries[1][:k], along, across, n + soft[1], every])
    position = _positions(np.concatenate(groups), row, column)
    i, j = position[row], position[column]
    width = int(np.abs(i - j).max(initial=0))
    end = np.zeros(n + c, dtype=np.int64)
    np.maximum.at(end, i, j + 1)
    place = i * (3 * width + 1) + j - i + width
    return Pattern(row, column, position, width, place, end, 2.0 * (n + c) * width**2)


def _positions(group: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Return the places of unknowns in a ``group`` each in the order of elimination."""
    groups, number = np.unique(group, return_inverse=True)
    order = band_order(groups.size, number[row], number[column])
    rank = np.empty(groups.size, dtype=np.int64)
    rank[order] = np.arange(groups.size)
    position = np.empty(group.size, dtype=np.int64)
    position[np.argsort(rank[number], kind="stable")] = np.arange(group.size)
    return position
