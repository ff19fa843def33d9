"""Symbolic LU factorisation: the fill-in of a sparse matrix and the program that factors it.

Pivots have a fixed order, the matrix need not be symmetric. Row i of U begins with the matrix's own
entries right of the diagonal; each pivot k < i with an entry (i, k) in L adds its row of U, since

    A_ij <- A_ij - A_ik A_kj / A_kk

Columns of L grow alike by columns of U. So rows and columns are merged pivot by pivot, in time
proportional to the multiplications of the factorisation. These are kernels of whole numbers,
because one set operation of Python takes as long as a hundred of them.
"""

from typing import NamedTuple

import numpy as np

from msahl.jit.by_size import by_size
from msahl.jit.kernel import kernel

SPARE = 4
"""Length of the lists at first, per entry of the matrix; it is doubled as often as necessary."""

NO_LIMIT = int(np.iinfo(np.int64).max)


class Lists(NamedTuple):
    """Lists of numbers: list k is ``items[first[k] : first[k + 1]]``."""

    first: np.ndarray  # (n + 1,)
    items: np.ndarray


class _Half(NamedTuple):
    """Rows of U, or columns of L, while they are found.

    The entries of column j (of U; row j of L) are chained: ``newest[j]`` is the last one found,
    ``before[e]`` the one found before entry e, -1 if there is none; ``pivot[e]`` its row.
    """

    first: np.ndarray  # (n + 1,)
    items: np.ndarray  # (length,)
    pivot: np.ndarray  # (length,)
    before: np.ndarray  # (length,)
    newest: np.ndarray  # (n,)


class Filled(NamedTuple):
    """Pattern of the factors: rows below (columns of L) and columns right of each pivot (U)."""

    lower: Lists
    upper: Lists


def fill(n: int, rows: np.ndarray, columns: np.ndarray) -> Filled:
    """Return the pattern of the factors of an (n, n) matrix with entries (``rows``, ``columns``)
    and a full diagonal; all lists are sorted.
    """
    lower, upper, _ = _merged(n, rows, columns, NO_LIMIT)
    return Filled(_sorted(lower), _sorted(upper))


def product_count(n: int, rows: np.ndarray, columns: np.ndarray, most: int) -> int:
    """Return the multiplications that factor such a matrix; if they are more than ``most``, any
    number that is larger.
    """
    return _merged(n, rows, columns, most)[2]


def _merged(n: int, rows: np.ndarray, columns: np.ndarray, most: int) -> tuple[_Half, _Half, int]:
    """Return columns of L and rows of U, unsorted, and the multiplications of all pivots; these end
    with the first that makes them more than ``most``.
    """
    above = rows < columns
    below = rows > columns
    right = grouped(rows[above], columns[above], n)
    under = grouped(columns[below], rows[below], n)
    lower, upper = _new_half(under), _new_half(right)
    k, products = 0, np.zeros(1, dtype=np.int64)
    while True:
        mark = np.full((2, n), -1)
        merge = by_size(_merge, n, rows.size**2 // max(1, n))
        k = merge((k, most), under, right, (lower, upper), mark, products)
        if k == n or products[0] > most:
            return lower, upper, int(products[0])
        lower, upper = _enlarged(lower), _enlarged(upper)


def grouped(keys: np.ndarray, items: np.ndarray, n: int) -> Lists:
    """Return the ``items`` by their ``keys`` < n, those of one key in their given order."""
    first = np.zeros(n + 1, dtype=np.int64)
    np.cumsum(np.bincount(keys, minlength=n), out=first[1:])
    return Lists(first, items[np.argsort(keys, kind="stable")].astype(np.int64))


def _new_half(given: Lists) -> _Half:
    n, length = given.first.size - 1, SPARE * given.items.size + given.first.size
    items, pivot, before = np.zeros((3, length), dtype=np.int64)
    return _Half(np.zeros(n + 1, dtype=np.int64), items, pivot, before, np.full(n, -1))


def _enlarged(half: _Half) -> _Half:
    items, pivot, before = (
        np.concatenate([array, np.zeros_like(array)])
        for array in (half.items, half.pivot, half.before)
    )
    return half._replace(items=items, pivot=pivot, before=before)


@kernel
def _merge(
    begin: tuple[int, int],
    under: Lists,
    right: Lists,
    halves: tuple[_Half, _Half],
    mark: np.ndarray,
    products: np.ndarray,
) -> int:
    """Find row and column of the pivots from the first number of ``begin`` on, until ``products``
    is larger than the second; return the pivot that does not fit into the arrays, the number of
    pivots if all do.
    """
    k, most = begin
    lower, upper = halves
    n = lower.newest.size
    while k < n and products[0] <= most:
        if not _gather(k, right, upper, lower, mark[0]):
            return k
        if not _gather(k, under, lower, upper, mark[1]):
            return k
        _chain(k, upper)
        _chain(k, lower)
        below, above = lower.first[k + 1] - lower.first[k], upper.first[k + 1] - upper.first[k]
        products[0] += below * above
        k += 1
    return k


@kernel
def _gather(k: int, given: Lists, half: _Half, other: _Half, mark: np.ndarray) -> bool:
    """Set list ``k`` of a ``half`` to what is ``given`` and what pivots before it add; return
    whether it fits into the arrays.
    """
    end = half.first[k]
    for e in range(given.first[k], given.first[k + 1]):
        if end == half.items.size:
            return False
        mark[given.items[e]] = k
        half.items[end] = given.items[e]
        end += 1
    link = other.newest[k]
    while link >= 0:
        q = other.pivot[link]
        for e in range(half.first[q], half.first[q + 1]):
            j = half.items[e]
            if j > k and mark[j] != k:
                if end == half.items.size:
                    return False
                mark[j] = k
                half.items[end] = j
                end += 1
        link = other.before[link]
    half.first[k + 1] = end
    return True


@kernel
def _chain(k: int, half: _Half) -> None:
    """Add the entries of list ``k`` to the chains of their rows or columns."""
    for e in range(half.first[k], half.first[k + 1]):
        j = half.items[e]
        half.pivot[e] = k
        half.before[e] = half.newest[j]
        half.newest[j] = e


def _sorted(half: _Half) -> Lists:
    """Return the lists sorted: transposed twice, which takes time in proportion to their length."""
    return transposed(transposed(Lists(half.first, half.items[: half.first[-1]]))[0])[0]


def transposed(lists: Lists) -> tuple[Lists, np.ndarray]:
    """Return the sorted numbers k of the ``lists`` that contain j, by j, and where they do."""
    n, size = lists.first.size - 1, lists.items.size
    first = np.zeros(n + 1, dtype=np.int64)
    np.cumsum(np.bincount(lists.items, minlength=n), out=first[1:])
    out = Lists(first, np.zeros(size, dtype=np.int64))
    entry = np.zeros(size, dtype=np.int64)
    by_size(_transpose, n, size)(lists, out, entry, first.copy())
    return out, entry


@kernel
def _transpose(lists: Lists, out: Lists, entry: np.ndarray, place: np.ndarray) -> None:
    """Fill ``out`` and the ``entry`` of the lists; ``place`` (n + 1,) begins as ``out.first``."""
    for k in range(lists.first.size - 1):
        for e in range(lists.first[k], lists.first[k + 1]):
            j = lists.items[e]
            out.items[place[j]] = k
            entry[place[j]] = e
            place[j] += 1


def targets(filled: Filled, base: np.ndarray, wanted: Lists) -> tuple[np.ndarray, np.ndarray]:
    """Return where the factorisation's products go, and the matrix's own entries.

    Pivot, column of L and row of U of pivot k stand one after the other from ``base[k]``. The first
    array has the places from which the products of pivot k are taken, for each entry of L those
    with all entries of U, pivot by pivot; the second those of the entries ``wanted``, by rows.
    """
    n, (lower, upper) = base.size - 1, filled
    products = np.diff(lower.first) * np.diff(upper.first)
    operation = np.concatenate([[0], np.cumsum(products)]).astype(np.int64)
    if base[-1] > np.iinfo(np.uint32).max:
        raise MemoryError  # some 30 GB of factors
    target = np.zeros(int(operation[-1]), dtype=np.uint32)
    place = np.zeros(wanted.items.size, dtype=np.int64)
    by_row, entry = transposed(lower)
    by_size(_fill_targets, n, target.size)(
        filled, by_row, entry, (base, operation), wanted, (np.zeros(n, np.int64), target, place)
    )
    return target, place


@kernel
def _fill_targets(
    filled: Filled,
    by_row: Lists,
    entry: np.ndarray,
    starts: tuple[np.ndarray, np.ndarray],
    wanted: Lists,
    out: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    """Go through the matrix row by row: ``where`` has the places of the entries of a row."""
    base, operation = starts
    where, target, place = out
    lower, upper = filled.lower, filled.upper
    for i in range(base.size - 1):
        where[i] = base[i]
        right = base[i] + 1 + lower.first[i + 1] - lower.first[i] - upper.first[i]
        for e in range(upper.first[i], upper.first[i + 1]):
            where[upper.items[e]] = right + e
        for r in range(by_row.first[i], by_row.first[i + 1]):
            q = by_row.items[r]
            where[q] = base[q] + 1 + entry[r] - lower.first[q]
        for e in range(wanted.first[i], wanted.first[i + 1]):
            place[e] = where[wanted.items[e]]
        for r in range(by_row.first[i], by_row.first[i + 1]):
            q = by_row.items[r]
            first = upper.first[q]
            width = upper.first[q + 1] - first
            to = operation[q] + (entry[r] - lower.first[q]) * width
            for e in range(width):
                target[to + e] = where[upper.items[first + e]]
