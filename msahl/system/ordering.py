"""Find the order of elimination and the sparse LU factorisation of a system, once.

Bodies are eliminated in an order of smallest degree on the graph of bodies (the ground does not
count): in a tree that takes the leaves first, without fill-in, from however many grounds the tree
hangs, and of the leaves those on the ground. A body goes with a joint whose other bodies, if any,
have gone before, and alone where there is none: displacement, then the multipliers that act on it,
then rotation, then the multipliers that depend on rotations only; the pivots are then 1, the
share of the joint's mass, and an inertia about the joint. So a link leaves its neighbour only the
joint between them, and costs the same on whichever side of it the ground is. A body that a force
holds to another leaves that one in any case and goes with a joint at once. Joints that close loops,
and couplings, go after all their bodies. Pivots keep this order whatever the values; a system for
which it fails is left to the dense solver.

Column k of L and row k of U stand one after the other in the factor array, from ``base[k]``: the
pivot (kept inverted), ``lower[k]`` entries of L, ``upper[k]`` of U. ``other`` says in which row or
column those act. ``target`` lists, pivot by pivot, the entries that the outer product of both is
taken from.
"""

import heapq
from typing import NamedTuple

import numpy as np

from msahl.elements.frames import displacement_node, first_multiplier, moving_count, rotation_node
from msahl.system.arrays import System


class Elimination(NamedTuple):
    """A program that factors the Jacobian without looking at its pattern again."""

    order: np.ndarray  # (f,) flat unknowns as they are eliminated
    base: np.ndarray  # (f + 1,) where pivot k stands in the factor; the last is its length
    lower: np.ndarray  # (f,) number of entries of L below pivot k
    upper: np.ndarray  # (f,) number of entries of U right of pivot k
    other: np.ndarray  # (length,) row (of L entries) or column (of U entries) in the order
    target: np.ndarray  # (operations,) places in the factor
    source: np.ndarray  # (q,) places in the block values ...
    place: np.ndarray  # (q,) ... and where they go in the factor


def eliminate(system: System, free: np.ndarray) -> Elimination:
    """The elimination of the ``free`` unknowns in the pattern of the system's blocks."""
    solved = set(free.tolist())
    nodes = _node_order(system)
    order = [3 * node + i for node in nodes for i in range(3) if 3 * node + i in solved]
    position = {unknown: k for k, unknown in enumerate(order)}
    entries = _scalar_entries(system, position)
    rows, columns = _fill(len(order), entries)
    return _program(order, entries, rows, columns)


def _node_order(system: System) -> list[int]:
    """Nodes in order of elimination."""
    ground = moving_count(system.frames)
    elements = _elements(system, ground)
    of_body: list[list[int]] = [[] for _ in range(ground)]
    for e, (bodies, _, _) in elements.items():
        for body in bodies:
            of_body[body].append(e)
    order: list[int] = []
    gone: set[int] = set()
    placed: set[int] = set()
    held = {body for bodies, _, _ in elements.values() if len(bodies) == 1 for body in bodies}
    forced = {body for pair in _forced(system, ground) for body in pair}
    for body in _smallest_degree(_neighbours(system, ground), held):
        gone.add(body)
        waiting = [e for e in of_body[body] if e not in placed]
        # Joints to what has gone first: left for later they would hold the body at both ends.
        waiting.sort(key=lambda e: not gone.issuperset(elements[e][0]))
        ready = [e for e in waiting if body in forced or gone.issuperset(elements[e][0])]
        tree = [e for e in ready if len(elements[e][0]) <= 2][:1]
        late = [e for e in waiting if e not in tree and gone.issuperset(elements[e][0])]
        order.append(displacement_node(system.frames, body))
        order += [node for e in tree for node in elements[e][1]]
        order.append(rotation_node(system.frames, body))
        order += [node for e in tree for node in elements[e][2]]
        order += [node for e in late for part in elements[e][1:] for node in part]
        placed.update(tree, late)
    # What couples no body that moves comes last.
    order += [n for e, (_, *parts) in elements.items() if e not in placed for p in parts for n in p]
    return order


def _elements(system: System, ground: int) -> dict[int, tuple[set[int], list[int], list[int]]]:
    """Return of each joint or coupling: its moving frames, its nodes with displacements and those
    with rotations only.
    """
    elements: dict[int, tuple[set[int], list[int], list[int]]] = {}
    multipliers = system.multipliers
    for k, node in enumerate(multipliers.node.tolist()):
        bodies, pushing, rotational = elements.setdefault(
            int(multipliers.element[k]), (set(), [], [])
        )
        bodies.update(b for b in multipliers.bodies[k].tolist() if b != ground)
        (rotational if multipliers.rotational[k] else pushing).append(node)
    return elements


def _neighbours(system: System, ground: int) -> list[set[int]]:
    """Bodies that a force or a joint couples."""
    near: list[set[int]] = [set() for _ in range(ground)]
    pairs = _forced(system, ground)
    for bodies in system.multipliers.bodies.tolist():
        pairs += [(a, b) for a in bodies for b in bodies if max(a, b) < ground and a != b]
    for a, b in pairs:
        near[a].add(b)
        near[b].add(a)
    return near


def _forced(system: System, ground: int) -> list[tuple[int, int]]:
    """Pairs of bodies that a force couples."""
    of_node, first = system.frames.of_node, first_multiplier(system.frames)
    blocks = system.blocks[1:][(system.blocks[1:] < first).all(axis=1)]
    pairs = of_node[blocks].tolist()
    return [(a, b) for a, b in pairs if max(a, b) < ground and a != b]


def _smallest_degree(neighbours: list[set[int]], held: set[int]) -> list[int]:
    """Vertices of a graph, each of smallest degree among those left, if there are several one that
    is ``held`` or was near one; consumes both.
    """
    heap = [(len(near), vertex not in held, vertex) for vertex, near in enumerate(neighbours)]
    heapq.heapify(heap)
    order: list[int] = []
    done = [False] * len(neighbours)
    while heap:
        degree, _, vertex = heapq.heappop(heap)
        if done[vertex] or degree != len(neighbours[vertex]):
            continue
        done[vertex] = True
        order.append(vertex)
        near = neighbours[vertex]
        if vertex in held:
            held |= near
        for other in near:
            neighbours[other] |= near
            neighbours[other] -= {vertex, other}
            heapq.heappush(heap, (len(neighbours[other]), other not in held, other))
    return order


def _scalar_entries(system: System, position: dict[int, int]) -> dict[tuple[int, int], int]:
    """(row, column) in the order -> place in the block values."""
    entries: dict[tuple[int, int], int] = {}
    for place in np.flatnonzero(system.pattern).tolist():
        row, column = system.blocks[place // 9].tolist()
        at = position.get(3 * row + place % 9 // 3), position.get(3 * column + place % 3)
        if at[0] is not None and at[1] is not None:
            entries[at[0], at[1]] = place
    return entries


def _fill(n: int, entries: dict[tuple[int, int], int]) -> tuple[list[list[int]], list[list[int]]]:
    """Rows below and columns right of each pivot, with the fill-in of the elimination."""
    rows: list[set[int]] = [set() for _ in range(n)]
    columns: list[set[int]] = [set() for _ in range(n)]
    for i, j in entries:
        if i > j:
            rows[j].add(i)
        elif j > i:
            columns[i].add(j)
    for k in range(n):
        for i in rows[k]:
            for j in columns[k]:
                if i > j:
                    rows[j].add(i)
                elif j > i:
                    columns[i].add(j)
    return [sorted(r) for r in rows], [sorted(c) for c in columns]


def _program(
    order: list[int],
    entries: dict[tuple[int, int], int],
    rows: list[list[int]],
    columns: list[list[int]],
) -> Elimination:
    n = len(order)
    lower = np.array([len(r) for r in rows], dtype=np.int64)
    upper = np.array([len(c) for c in columns], dtype=np.int64)
    base = np.concatenate([[0], np.cumsum(1 + lower + upper)]).astype(np.int64)
    place = {(k, k): int(base[k]) for k in range(n)}
    other = np.zeros(int(base[-1]), dtype=np.int64)
    for k in range(n):
        start = int(base[k]) + 1
        place |= {(i, k): start + e for e, i in enumerate(rows[k])}
        place |= {(k, j): start + len(rows[k]) + e for e, j in enumerate(columns[k])}
        other[start : int(base[k + 1])] = rows[k] + columns[k]
    target = [place[i, j] for k in range(n) for i in rows[k] for j in columns[k]]
    return Elimination(
        order=np.array(order, dtype=np.int64),
        base=base,
        lower=lower,
        upper=upper,
        other=other,
        target=np.array(target, dtype=np.int64),
        source=np.array(list(entries.values()), dtype=np.int64),
        place=np.array([place[key] for key in entries], dtype=np.int64),
    )
