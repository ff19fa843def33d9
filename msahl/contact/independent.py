"""Groups of contacts that do not act on each other: an impulse of one changes no rate of another.

Each group has a problem of its own, which is smaller, and an impact in which the others do not take
part: a box that falls on a floor does not move another one that rests there.
"""

from collections.abc import Iterator

import numpy as np

COUPLED = 1e-14
"""Entry of W, over the root of those on the diagonal, that is more than the round-off of none."""


def groups(W: np.ndarray, normal: np.ndarray, tangent: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the numbers of the contacts of each group, of k contacts with the unknowns ``normal``
    (k,) and ``tangent`` (k, 2), -1 without friction, of the matrix ``W`` (m, m).
    """
    owner = np.full(len(W), -1)
    owner[normal] = np.arange(normal.size)
    rough = tangent[:, 0] >= 0
    owner[tangent[rough]] = np.flatnonzero(rough)[:, None]
    size = np.sqrt(np.abs(np.diag(W)))
    i, j = np.nonzero(np.abs(W) > COUPLED * np.outer(size, size))
    linked = np.eye(normal.size, dtype=bool)
    linked[owner[i], owner[j]] = True
    left = np.ones(normal.size, dtype=bool)
    while left.any():
        found = np.zeros(normal.size, dtype=bool)
        found[np.argmax(left)] = True
        while True:
            more: np.ndarray = np.any(linked[found], axis=0)
            if (more == found).all():
                break
            found = more
        left &= ~found
        yield np.flatnonzero(found)
