"""Find the program of the sparse LU factorisation of a matrix, once.

``node_order`` finds the order of pivots. These keep it whatever the values; a system for which that
fails is left to the dense solver.

Column k of L and row k of U stand one after the other in the factor array, from ``base[k]``: the
pivot (kept inverted), ``lower[k]`` entries of L, ``upper[k]`` of U. ``other`` says in which row or
column those act. ``target`` lists, pivot by pivot, the entries that the outer product of both is
taken from.
"""

from typing import NamedTuple

import numpy as np

from msahl.linalg.pattern import Pattern
from msahl.linalg.supernodes import Supernodes, array_size, multiplications, supernodes
from msahl.linalg.symbolic import Filled, fill, grouped, targets


class Elimination(NamedTuple):
    """A program that factors the Jacobian without looking at its pattern again."""

    order: np.ndarray  # (f,) flat unknowns as they are eliminated
    base: np.ndarray  # (f + 1,) where pivot k stands in the factor; the last is its length
    lower: np.ndarray  # (f,) number of entries of L below pivot k
    upper: np.ndarray  # (f,) number of entries of U right of pivot k
    other: np.ndarray | None  # (length,) row (of L entries) or column (of U ones) in the order
    target: np.ndarray | None  # (operations,) places in the factor, in 32 bits: the longest by far
    source: np.ndarray  # (q,) places in the block values ...
    place: np.ndarray  # (q,) ... and where they go in the factor
    supernodes: Supernodes | None  # with dense panels; there is no ``other`` and ``target`` then


class _Entries(NamedTuple):
    """Entries of the matrix that are not always zero: row, column, place in the block values."""

    rows: np.ndarray
    columns: np.ndarray
    source: np.ndarray


def eliminate(
    pattern: Pattern, free: np.ndarray, nodes: np.ndarray, by_panels: bool
) -> Elimination:
    """Return the elimination of the ``free`` unknowns of a matrix, in the order of its ``nodes``;
    ``by_panels`` asks for ``supernodes``.
    """
    position = np.full(3 * pattern.nodes, -1)
    position[free] = 0
    flat = (3 * nodes[:, None] + np.arange(3)).reshape(-1)
    order = flat[position[flat] == 0]
    position[order] = np.arange(order.size)
    entries = _scalar_entries(pattern, position)
    if by_panels:
        return _by_supernodes(order, entries, supernodes(pattern, order, *entries[:2]))
    return _program(order, entries)


def _by_supernodes(order: np.ndarray, entries: _Entries, nodes: Supernodes) -> Elimination:
    """Return the elimination by ``nodes``, which have most of what it needs."""
    none = np.zeros(0, dtype=np.int64)
    s, r = np.diff(nodes.first), np.diff(nodes.rest)
    width, within = np.repeat(s + r, s), np.arange(order.size) - np.repeat(nodes.first[:-1], s)
    pivots = np.repeat(nodes.start[:-1], s) + within * (width + 1)
    return Elimination(
        order=order,
        base=np.append(pivots, array_size(nodes, 1)),
        lower=none,
        upper=none,
        other=None,
        target=None,
        source=entries.source,
        place=none,
        supernodes=nodes,
    )


def new_factor(lu: Elimination, degree: int | None = None) -> np.ndarray:
    """Return an array for the factors of a Jacobian, or for those of collocation steps of a
    ``degree``.
    """
    if lu.supernodes is not None:
        return np.zeros(array_size(lu.supernodes, degree or 1))
    return np.zeros(int(lu.base[-1]) if degree is None else (int(lu.base[-1]), degree, degree))


def products(lu: Elimination) -> int:
    """Return the multiplications of a factorisation."""
    if lu.supernodes is not None:
        return multiplications(lu.supernodes)
    return 0 if lu.target is None else lu.target.size


def _scalar_entries(pattern: Pattern, position: np.ndarray) -> _Entries:
    """The entries between free unknowns, by their ``position`` in the order, -1 for the others."""
    source = np.flatnonzero(pattern.entries)
    block, within = np.divmod(source, 9)
    row, column = np.divmod(within, 3)
    rows = position[3 * pattern.blocks[block, 0] + row]
    columns = position[3 * pattern.blocks[block, 1] + column]
    free = (rows >= 0) & (columns >= 0)
    return _Entries(rows[free], columns[free], source[free])


def _program(order: np.ndarray, entries: _Entries) -> Elimination:
    n = order.size
    filled = fill(n, entries.rows, entries.columns)
    lower, upper = np.diff(filled.lower.first), np.diff(filled.upper.first)
    base = np.concatenate([[0], np.cumsum(1 + lower + upper)]).astype(np.int64)
    by_row = np.argsort(entries.rows, kind="stable")
    wanted = grouped(entries.rows, entries.columns, n)
    target, place_by_row = targets(filled, base, wanted)
    place = np.zeros_like(place_by_row)
    place[by_row] = place_by_row
    return Elimination(
        order=order,
        base=base,
        lower=lower,
        upper=upper,
        other=_others(filled, base),
        target=target,
        source=entries.source,
        place=place,
        supernodes=None,
    )


def _others(filled: Filled, base: np.ndarray) -> np.ndarray:
    """(length,) rows of the entries of L and columns of those of U, where they stand."""
    other = np.zeros(int(base[-1]), dtype=np.int64)
    lower, upper = np.diff(filled.lower.first), np.diff(filled.upper.first)
    for lists, begin in ((filled.lower, base[:-1] + 1), (filled.upper, base[:-1] + 1 + lower)):
        count = lower if lists is filled.lower else upper
        other[np.repeat(begin - lists.first[:-1], count) + np.arange(lists.items.size)] = (
            lists.items
        )
    return other
