"""Order of the nodes of a graph in which its edges join numbers that are near each other.

Source: E. Cuthill, J. McKee, Reducing the bandwidth of sparse symmetric matrices, Proc. 24th
National Conference of the ACM (1969).
"""

import numpy as np


def band_order(count: int, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the ``count`` nodes of a graph, whose edges join nodes ``first`` and ``second``, in
    the order of Cuthill and McKee: breadth first, from one end of each component to the other.
    """
    neighbours: list[list[int]] = [[] for _ in range(count)]
    keys = np.unique(np.concatenate([first * count + second, second * count + first]))
    for a, b in zip(*(part.tolist() for part in np.divmod(keys, count)), strict=True):
        if a != b:
            neighbours[a].append(b)
    degree = [len(near) for near in neighbours]
    for near in neighbours:
        near.sort(key=degree.__getitem__)
    order: list[int] = []
    reached = [False] * count
    for start in sorted(range(count), key=degree.__getitem__):
        if not reached[start]:
            component = _breadth_first(neighbours, _far_end(neighbours, start))
            order += component
            for node in component:
                reached[node] = True
    return np.array(order, dtype=np.int64)


def _far_end(neighbours: list[list[int]], start: int) -> int:
    """A node from which others of its component are as far away as from almost any other."""
    for _ in range(2):
        start = _breadth_first(neighbours, start)[-1]
    return start


def _breadth_first(neighbours: list[list[int]], start: int) -> list[int]:
    """The nodes of a component by their distance from ``start``, each after its predecessor."""
    order, reached = [start], {start}
    for node in order:
        for near in neighbours[node]:
            if near not in reached:
                reached.add(near)
                order.append(near)
    return order
