"""LU factorisation by dense panels: of systems with beams in space, and of large nets.

Its supernodes are those of ``supernodes``; it stands in place of ``sparse_lu`` and
``block_lu``. An element of a beam couples all its nodes and stress resultants, and so do the last
of many loops, so nearly all the work is on dense blocks. A panel of U has the rows of the pivots of
a supernode, one of L below it the rows of all later pivots that they couple with. After a panel is
factored, its product L U is taken from later panels, rectangle by rectangle:

    C <- C - L U          3 rows and 4 columns at a time, which stay in registers

Each unknown stands for the ``d`` stages of a collocation step, or for itself (d = 1), as entries
are d x d. Their pivots are blocks, inverted with a search for the largest entry. Rows of U are
multiplied by the inverse, those of L are not.
"""

import numpy as np

from msahl.jit.kernel import apart, kernel
from msahl.linalg.supernodes import SPARE, Supernodes

Row = tuple[float, float, float, float]
_INDEX = 2**48 - 1
"""A mask by which the compiler can see that an index is not negative. Else it provides for those
that count from the end, and does not load four entries at a time."""


@kernel
def _four(W: np.ndarray, k: int) -> Row:
    k &= _INDEX
    return (W[k], W[k + 1], W[k + 2], W[k + 3])


@kernel
def _less(a: Row, c: float, b: Row) -> Row:
    """``a - c b``."""
    return (a[0] - c * b[0], a[1] - c * b[1], a[2] - c * b[2], a[3] - c * b[3])


@kernel
def _times(c: float, a: Row) -> Row:
    return (c * a[0], c * a[1], c * a[2], c * a[3])


@kernel
def _put(W: np.ndarray, k: int, a: Row) -> None:
    k &= _INDEX
    W[k], W[k + 1], W[k + 2], W[k + 3] = a


@kernel
def _put_part(W: np.ndarray, k: int, a: Row, width: int) -> None:
    """Store the first one to three of four entries, by way of a spare place: LLVM would not keep
    ``a`` in one register if a part of it were stored.
    """
    spare = W.size - SPARE
    _put(W, spare, a)
    W[k] = W[spare]
    if width > 1:
        W[k + 1] = W[spare + 1]
    if width > 2:
        W[k + 2] = W[spare + 2]


@kernel
def first_unknown(nodes: Supernodes, d: int) -> int:
    """Return where the right-hand side begins in the array of the factors."""
    return int(nodes.start[nodes.start.size - 1]) * d * d


@apart
def subtract_product(
    W: np.ndarray,
    size: tuple[int, int, int],
    a: tuple[int, int, int],
    b: tuple[int, int],
    c: tuple[int, int],
) -> None:
    """``C <- C - A B`` with ``size`` (m, n, q) for C (m, n), A (m, q) and B (q, n), all in ``W``:
    where each begins, and the distance of its rows, of A those of its rows and columns.
    """
    m, n, q = size
    part = n % 4
    for i in range(0, m - m % 3, 3):
        left, row = (a[0] + i * a[1], a[1], a[2]), c[0] + i * c[1]
        for j in range(0, n - part, 4):
            x, y, z = _three_rows(W, q, left, (b[0] + j, b[1]), (row + j, c[1]))
            _put(W, row + j, x)
            _put(W, row + j + c[1], y)
            _put(W, row + j + 2 * c[1], z)
        if part > 0:
            j = n - part
            x, y, z = _three_rows(W, q, left, (b[0] + j, b[1]), (row + j, c[1]))
            _put_part(W, row + j, x, part)
            _put_part(W, row + j + c[1], y, part)
            _put_part(W, row + j + 2 * c[1], z, part)
    for i in range(m - m % 3, m):
        at, row = (a[0] + i * a[1], a[2]), c[0] + i * c[1]
        for j in range(0, n - part, 4):
            _put(W, row + j, _one_row(W, q, at, (b[0] + j, b[1]), row + j))
        if part > 0:
            j = n - part
            _put_part(W, row + j, _one_row(W, q, at, (b[0] + j, b[1]), row + j), part)


@kernel
def _three_rows(
    W: np.ndarray, q: int, a: tuple[int, int, int], b: tuple[int, int], c: tuple[int, int]
) -> tuple[Row, Row, Row]:
    """Return three rows and four columns of C - A B, see ``subtract_product``."""
    at, down, along = a
    x, y, z = _four(W, c[0]), _four(W, c[0] + c[1]), _four(W, c[0] + 2 * c[1])
    for k in range(q):
        row, first = _four(W, b[0] + k * b[1]), at + k * along
        x = _less(x, W[first & _INDEX], row)
        y = _less(y, W[(first + down) & _INDEX], row)
        z = _less(z, W[(first + 2 * down) & _INDEX], row)
    return x, y, z


@kernel
def _one_row(W: np.ndarray, q: int, a: tuple[int, int], b: tuple[int, int], c: int) -> Row:
    """Return one row and four columns of C - A B, see ``subtract_product``."""
    x = _four(W, c)
    for k in range(q):
        x = _less(x, W[(a[0] + k * a[1]) & _INDEX], _four(W, b[0] + k * b[1]))
    return x


@kernel
def fill_values(nodes: Supernodes, source: np.ndarray, values: np.ndarray, W: np.ndarray) -> None:
    """Set the factors to the matrix with the block ``values`` at ``source``."""
    for e in range(first_unknown(nodes, 1)):
        W[e] = 0.0
    for e in range(source.size):
        W[nodes.entry[e, 0] + nodes.entry[e, 1]] = values[source[e]]


@kernel
def fill_blocks(nodes: Supernodes, source: np.ndarray, values: np.ndarray, W: np.ndarray) -> None:
    """Set the factors to the matrix with the blocks ``values`` (q, d, d), transposed."""
    d = values.shape[1]
    for e in range(first_unknown(nodes, d)):
        W[e] = 0.0
    for e in range(source.size):
        at, wide = nodes.entry[e, 0] * d * d + nodes.entry[e, 1] * d, nodes.entry[e, 2] * d
        for i in range(d):
            for j in range(d):
                # L^T is transposed, as the blocks are.
                k = at + i * wide + j if nodes.in_lower[e] else at + j * wide + i
                W[k] = values[source[e], i, j]


@kernel
def factor(nodes: Supernodes, d: int, W: np.ndarray) -> None:
    """Factor the matrix in ``W``, whose entries are d x d; a zero pivot leaves infinities there."""
    for k in range(nodes.first.size - 1):
        s, r = _size(nodes, k)
        upper = nodes.start[k] * d * d
        wide, rest = (s + r) * d, r * d
        lower = upper + s * d * wide
        spare = first_unknown(nodes, d)
        for i in range(s):
            _eliminate(W, (i, d, s), (upper, wide), (lower, rest), spare)
        for e in range(nodes.update[k], nodes.update[k + 1]):
            _update(nodes, e, (s * d, d), (upper + s * d, wide), (lower, rest), W)


@kernel
def _size(nodes: Supernodes, k: int) -> tuple[int, int]:
    """Return the number of pivots of supernode ``k``, and of later ones that they couple with."""
    return int(nodes.first[k + 1] - nodes.first[k]), int(nodes.rest[k + 1] - nodes.rest[k])


@kernel
def _eliminate(
    W: np.ndarray,
    pivot: tuple[int, int, int],
    upper: tuple[int, int],
    lower: tuple[int, int],
    spare: int,
) -> None:
    """Eliminate one pivot of a panel from its others; ``pivot`` is (i, d, s), the panels are where
    they begin and their widths, behind ``spare`` are work entries.
    """
    i, d, s = pivot
    wide, rest, behind, left = upper[1], lower[1], (i + 1) * d, (s - i - 1) * d
    row = upper[0] + i * d * wide
    _invert(W, row + i * d, wide, d, spare)
    _multiply_rows(W, (d, wide - behind), (row + i * d, wide), row + behind, spare)
    if left > 0:
        under = upper[0] + behind * wide
        size, to = (left, wide - behind, d), (under + behind, wide)
        subtract_product(W, size, (under + i * d, wide, 1), (row + behind, wide), to)
        own, to = (lower[0] + i * d * rest, rest), (lower[0] + behind * rest, rest)
        subtract_product(W, (left, rest, d), (row + behind, 1, wide), own, to)


@kernel
def _update(
    nodes: Supernodes,
    e: int,
    size: tuple[int, int],
    upper: tuple[int, int],
    lower: tuple[int, int],
    W: np.ndarray,
) -> None:
    """Take product ``e`` of the two panels from its rectangle; ``size`` is (s d, d)."""
    q, d = size
    to = nodes.updates
    width = to.width[e] * d
    a, b = (upper, lower) if to.of_lower[e] else (lower, upper)
    subtract_product(
        W,
        (to.rows[e] * d, to.columns[e] * d, q),
        (a[0] + to.left[e] * d, 1, a[1]),
        (b[0] + to.right[e] * d, b[1]),
        (to.start[e] * d * d + to.column[e] * d, width),
    )


@kernel
def _multiply_rows(
    W: np.ndarray, size: tuple[int, int], inverse: tuple[int, int], at: int, spare: int
) -> None:
    """Multiply ``size`` (d, n) rows at ``at``, as wide as the panel of the pivot's ``inverse``
    (where it begins, width), by it; a copy is kept behind ``spare``.
    """
    d, n = size
    wide = inverse[1]
    part = n % 4
    if d == 1:
        for j in range(0, n - part, 4):
            _put(W, at + j, _times(W[inverse[0]], _four(W, at + j)))
        for j in range(n - part, n):
            W[at + j] *= W[inverse[0]]
        return
    for j in range(0, n, 4):
        width = min(n - j, 4)
        for i in range(d):
            row = at + i * wide + j
            _put(W, spare + 4 * i, _times(-1.0, _four(W, row)))
            for k in range(width):
                W[row + k] = 0.0
        subtract_product(W, (d, width, d), (inverse[0], wide, 1), (spare, 4), (at + j, wide))


@kernel
def _invert(W: np.ndarray, at: int, wide: int, d: int, spare: int) -> None:
    """Invert the d x d block at ``at``, with rows ``wide`` apart, by the Gauss-Jordan method; a
    singular one leaves infinities. The rows of the pivots are kept behind ``spare``.
    """
    if d == 1:
        W[at] = 1.0 / W[at]
        return
    for k in range(d):
        best = k
        for i in range(k + 1, d):
            if abs(W[at + i * wide + k]) > abs(W[at + best * wide + k]):
                best = i
        W[spare + k] = best
        a, b = at + k * wide, at + best * wide
        for j in range(d):
            W[a + j], W[b + j] = W[b + j], W[a + j]
        inverse = 1.0 / W[a + k]
        W[a + k] = 1.0
        for j in range(d):
            W[a + j] *= inverse
        for i in range(d):
            b = at + i * wide
            if i != k:
                c = W[b + k]
                W[b + k] = 0.0
                for j in range(d):
                    W[b + j] -= c * W[a + j]
    for k in range(d - 1, -1, -1):
        best = int(W[spare + k])
        for i in range(d):
            a = at + i * wide
            W[a + k], W[a + best] = W[a + best], W[a + k]


@kernel
def solve(nodes: Supernodes, d: int, W: np.ndarray) -> None:
    """Replace the right-hand side, which is behind the factors in ``W``, by the solution."""
    last, y = nodes.first.size - 1, first_unknown(nodes, d)
    x = y + nodes.first[last] * d
    for k in range(last):
        s, r = _size(nodes, k)
        upper, y_own, row = nodes.start[k] * d * d, y + nodes.first[k] * d, nodes.rest[k]
        wide = (s + r) * d
        for i in range(s):
            _solve_row(W, (i * d, d), (upper, wide), y_own, x)
        for i in range(r * d):
            W[x + i] = W[y + nodes.row[row + i // d] * d + i % d]
        lower = (upper + s * d * wide, r * d)
        subtract_product(W, (1, r * d, s * d), (y_own, 0, 1), lower, (x, 0))
        for i in range(r * d):
            W[y + nodes.row[row + i // d] * d + i % d] = W[x + i]
    for k in range(last - 1, -1, -1):
        s, r = _size(nodes, k)
        upper, y_own, row = nodes.start[k] * d * d, y + nodes.first[k] * d, nodes.rest[k]
        wide = (s + r) * d
        for i in range(r * d):
            W[x + i] = W[y + nodes.row[row + i // d] * d + i % d]
        _subtract_rows(W, (s * d, r * d), (upper + s * d, wide), x, y_own)
        for i in range(s - 2, -1, -1):
            behind = (i + 1) * d
            at = upper + i * d * wide + behind
            _subtract_rows(W, (d, s * d - behind), (at, wide), y_own + behind, y_own + i * d)


@kernel
def _solve_row(W: np.ndarray, row: tuple[int, int], upper: tuple[int, int], y: int, x: int) -> None:
    """Solve for unknown ``row`` (first entry, entries) of a panel, of those at ``y``, with a copy
    at ``x``.
    """
    first, d = row
    for i in range(first, first + d):
        total = W[y + i]
        for j in range(first):
            total -= W[upper[0] + i * upper[1] + j] * W[y + j]
        W[x + i - first] = total
    for i in range(first, first + d):
        total = 0.0
        for j in range(d):
            total += W[upper[0] + i * upper[1] + first + j] * W[x + j]
        W[y + i] = total


@kernel
def _subtract_rows(
    W: np.ndarray, size: tuple[int, int], a: tuple[int, int], x: int, y: int
) -> None:
    """``y <- y - A x`` with ``size`` (m, n) for A: three rows at a time."""
    m, n = size
    at, wide = a
    for i in range(0, m - m % 3, 3):
        row, k = at + i * wide, (y + i) & _INDEX
        p, q, r = W[k], W[k + 1], W[k + 2]
        for j in range(n):
            c = W[(x + j) & _INDEX]
            p -= W[(row + j) & _INDEX] * c
            q -= W[(row + wide + j) & _INDEX] * c
            r -= W[(row + 2 * wide + j) & _INDEX] * c
        W[k], W[k + 1], W[k + 2] = p, q, r
    for i in range(m - m % 3, m):
        p = W[y + i]
        for j in range(n):
            p -= W[at + i * wide + j] * W[x + j]
        W[y + i] = p
