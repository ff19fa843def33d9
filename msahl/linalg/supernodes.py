"""Find the supernodes of a system: groups of pivots that are eliminated together.

Nodes in their order of elimination (``node_order``) make a supernode if they follow each other and
couple with the same later nodes. With its s pivots and the r later pivots that these couple with
(``row``), the factors have two panels with contiguous rows,

    of U (s, s + r)       then of L^T (s, r)

The first s columns of the first one hold the pivots and L left of them. After a panel is factored
its product is taken from panels that come later. The pivots of ``row`` are in groups, each of one
later supernode and contiguous; so the product of two groups comes from one rectangle.

Blocks of two nodes count as full and symmetric, which costs some percent more multiplications than
the exact pattern of an element of a beam.
"""

from typing import NamedTuple

import numpy as np

from msahl.linalg.pattern import Pattern
from msahl.linalg.symbolic import fill

MOST = 9
"""Pivots of a supernode at most; more would be factored row by row, without the kernels of dense
products."""

SPARE = 8
"""Entries behind all others: four columns are read and made even where there are fewer."""


class Updates(NamedTuple):
    """Rectangles (u,) that the products of a panel are taken from.

    C <- C - A B, where A^T are columns of one panel of a supernode and B columns of the other.
    """

    of_lower: np.ndarray  # whether C and B are parts of L^T, and A^T one of U
    left: np.ndarray  # first of ``row`` in A, counted in the supernode
    rows: np.ndarray  # how many
    right: np.ndarray  # likewise in B
    columns: np.ndarray
    start: np.ndarray  # place in the factors where the first row of C's panel begins
    column: np.ndarray  # C's first column in that panel
    width: np.ndarray  # columns of that panel


class Supernodes(NamedTuple):
    """How the Jacobian is factored by panels (k supernodes). Places count entries."""

    first: np.ndarray  # (k + 1,) first pivot
    rest: np.ndarray  # (k + 1,) where the supernode's part of ``row`` begins
    row: np.ndarray  # (.,) later pivots that the supernode couples with
    start: np.ndarray  # (k + 1,) where the panel of U begins; the last is the number of entries
    update: np.ndarray  # (k + 1,) where its part of the updates begins
    updates: Updates
    entry: np.ndarray  # (q, 3) of each entry of the matrix: start, column and width as of updates
    in_lower: np.ndarray  # (q,) whether it is in L^T


class _Grouped(NamedTuple):
    """Supernodes of nodes, and what follows from them."""

    super_of: np.ndarray  # (f,) supernode of each pivot
    first: np.ndarray
    rest: np.ndarray
    row: np.ndarray
    start: np.ndarray
    key: np.ndarray  # number of the supernode times f, plus ``row``: sorted


def supernodes(
    pattern: Pattern, order: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> Supernodes:
    """Return the supernodes for the free unknowns in the ``order`` of elimination; ``rows`` and
    ``columns`` are those of the matrix's entries in that order.
    """
    nodes, begin = np.unique(order // 3, return_index=True)
    by_order = np.argsort(begin)
    nodes, begin = nodes[by_order], np.append(begin[by_order], order.size)
    later = _later_nodes(pattern, nodes)
    grouped = _grouped(later, begin)
    start, column, width, lower = _places(grouped, rows, columns)
    update, updates = _updates(grouped)
    return Supernodes(
        first=grouped.first,
        rest=grouped.rest,
        row=grouped.row,
        start=grouped.start,
        update=update,
        updates=updates,
        entry=np.stack([start, column, width], axis=1),
        in_lower=lower,
    )


def _later_nodes(pattern: Pattern, nodes: np.ndarray) -> list[np.ndarray]:
    """Return the later nodes that each of the ``nodes`` couples with when it is eliminated, all by
    their places in the order of elimination.
    """
    position = np.full(pattern.nodes, -1)
    position[nodes] = np.arange(nodes.size)
    a, b = position[pattern.blocks[1:]].T
    a, b = a[(a >= 0) & (b >= 0)], b[(a >= 0) & (b >= 0)]
    keys = np.unique(np.concatenate([a * nodes.size + b, b * nodes.size + a]))
    upper = fill(nodes.size, *np.divmod(keys, nodes.size)).upper
    return np.split(upper.items, upper.first[1:-1])


def _grouped(later: list[np.ndarray], begin: np.ndarray) -> _Grouped:
    """Return the supernodes; ``begin`` (nodes + 1,) is the first pivot of each node."""
    heads = [0]
    for k in range(1, len(later)):
        alike = np.array_equal(later[k - 1], np.append(k, later[k]))
        if not alike or begin[k + 1] - begin[heads[-1]] > MOST:
            heads.append(k)
    ends = [*heads[1:], len(later)]
    first = begin[[*heads, len(later)]]
    rows = [
        np.concatenate([np.arange(begin[b], begin[b + 1]) for b in later[end - 1]] or [np.zeros(0)])
        for end in ends
    ]
    rest = np.cumsum([0, *(row.size for row in rows)])
    row = np.concatenate(rows).astype(np.int64)
    s, r = np.diff(first), np.diff(rest)
    super_of = np.repeat(np.arange(s.size), s)
    key = np.repeat(np.arange(s.size), r) * super_of.size + row
    start = np.concatenate([[0], np.cumsum(s * (s + 2 * r))])
    return _Grouped(super_of, first, rest, row, start, key)


def _places(
    grouped: _Grouped, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return where entries of these pivots stand: start of a row of a panel, column in it, and its
    width; and whether it is one of L^T.
    """
    a, b = grouped.super_of[rows], grouped.super_of[columns]
    lower = a > b
    own, pivot = np.where(lower, b, a), np.where(lower, columns, rows)
    other = np.where(lower, rows, columns)
    s, r = np.diff(grouped.first)[own], np.diff(grouped.rest)[own]
    inside = other - grouped.first[own]
    behind = np.searchsorted(grouped.key, own * grouped.super_of.size + other) - grouped.rest[own]
    column = np.where(lower, behind, np.where(a == b, inside, s + behind))
    width = np.where(lower, r, s + r)
    start = (
        grouped.start[own] + np.where(lower, s * (s + r), 0) + (pivot - grouped.first[own]) * width
    )
    return start, column, width, lower


def _updates(grouped: _Grouped) -> tuple[np.ndarray, Updates]:
    """Return where the updates of each supernode begin, and all updates."""
    pairs = [_pairs(grouped, k) for k in range(grouped.first.size - 1)]
    k, left, rows, right, columns = np.concatenate(pairs, axis=1)
    row = grouped.rest[k]
    start, column, width, lower = _places(
        grouped, grouped.row[row + left], grouped.row[row + right]
    )
    # The panel of L is transposed, so are its products.
    left, right = np.where(lower, right, left), np.where(lower, left, right)
    rows, columns = np.where(lower, columns, rows), np.where(lower, rows, columns)
    order = np.lexsort((right, left, lower, k))
    found = np.stack([k, lower, left, rows, right, columns, start, column, width])[:, order]
    k, lower, left, rows, right, columns, start, column, width = found
    goes_on = (np.diff(found[[0, 1, 2, 6]]) == 0).all(axis=0)
    goes_on &= (right[1:] == (right + columns)[:-1]) & (column[1:] == (column + columns)[:-1])
    head = np.flatnonzero(np.append(True, ~goes_on))[: k.size]
    counts = np.bincount(k[head], minlength=grouped.first.size - 1)
    merged = found[1:, head]
    if head.size:
        merged[4] = np.add.reduceat(columns, head)
    return np.append(0, np.cumsum(counts)), Updates(merged[0] > 0, *merged[1:])


def _pairs(grouped: _Grouped, k: int) -> np.ndarray:
    """Return, for pairs of groups in the ``row`` of supernode ``k``, (k, first of ``row``, size,
    first, size).
    """
    row = grouped.row[grouped.rest[k] : grouped.rest[k + 1]]
    new = (np.diff(row) != 1) | (np.diff(grouped.super_of[row]) != 0)
    edges = np.concatenate([[0], np.flatnonzero(new) + 1, [row.size]])[row.size == 0 :]
    first, size = edges[:-1], np.diff(edges)
    i, j = (index.reshape(-1) for index in np.indices((size.size, size.size)))
    return np.stack([np.full(i.size, k), first[i], size[i], first[j], size[j]])


def array_size(nodes: Supernodes, d: int) -> int:
    """Return the length of the array of the factors whose entries are ``d`` x ``d``, of a
    right-hand side and of a copy of a part of it.
    """
    unknowns, most = int(nodes.first[-1]), int(np.diff(nodes.rest).max(initial=0))
    return int(nodes.start[-1]) * d * d + unknowns * d + max(most, 4) * d + SPARE


def multiplications(nodes: Supernodes) -> int:
    """Return the multiplications of a factorisation."""
    s, r = np.diff(nodes.first), np.diff(nodes.rest)
    # The sum of (m - k)^2 over the s pivots of a panel, m = s + r.
    return int(sum(((a + b - np.arange(1, a + 1)) ** 2).sum() for a, b in zip(s, r, strict=True)))
