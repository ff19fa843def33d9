"""Order in which the nodes of a matrix are eliminated, by what couples the bodies of a system.

**By bodies.** Bodies are eliminated in an order of smallest degree on the graph of bodies (the
ground does not count): in a tree that takes the leaves first, without fill-in, from however many
grounds the tree hangs, and of the leaves those on the ground. A body goes with a joint whose other
bodies, if any, have gone before, and alone where there is none: displacement, then the multipliers
that act on it, then rotation, then the multipliers that depend on rotations only; the pivots are
then 1, the share of the joint's mass, and an inertia about the joint. So a link leaves its
neighbour only the joint between them, and costs the same on whichever side of it the ground is. A
body that a force holds to another leaves that one in any case and goes with a joint at once. Joints
that close loops, and couplings, go after all their bodies. A body that follows others goes with its
equations at once, which leave its inertia to these. An element of a beam goes after all its nodes
but one, which leaves that one the rest of the beam, or after all where other elements have gone
with some of them: equations of rigid strains are independent in nodes that are free. So in systems
with beams all that the ground holds goes last.

**By elements**, in large systems with many closed loops. All bodies are eliminated first, which
leaves the matrix G M^-1 G^T of the constraints: positive definite if these are independent, so any
order of its pivots is stable. The elements follow in SuperLU's order of smallest degree, which sees
what each of them couples and not only their bodies. In a net of 3000 rods and knots this takes a
fifth of the multiplications, in chains and trees a quarter more.
"""

import heapq
from typing import NamedTuple

import numpy as np

from msahl.jit.by_size import LARGE, by_size
from msahl.jit.kernel import kernel
from msahl.linalg.pattern import SIZE, Pattern
from msahl.linalg.symbolic import NO_LIMIT, Lists, product_count

TREE = 2
"""Most bodies of an element that can be eliminated together with one of them."""


GAIN = 1.5
"""How many times more multiplications the order by bodies must take to be given up."""


class Graph(NamedTuple):
    """What couples the n bodies that move: e elements with constraints, and forces."""

    displacement: np.ndarray  # (n,) node of the displacement of each body
    rotation: np.ndarray  # (n,) node of its rotation
    bodies: Lists  # those of each joint, coupling or motion
    elements: Lists  # likewise the elements of each body
    of_beam: np.ndarray  # (e,) whether it is one of a beam
    follower: np.ndarray  # (e,) body that an element determines by the others; -1 for none
    pushing: Lists  # nodes of each element's multipliers that depend on displacements
    rotational: Lists  # those that depend on rotations only
    coupled: np.ndarray  # (p, 2) pairs of bodies that an equation of an element contains
    forced: np.ndarray  # (q, 2) pairs of bodies that a force couples


def node_order(graph: Graph, pattern: Pattern) -> np.ndarray:
    """Return the nodes of all multipliers and moving bodies in order of elimination."""
    near, held = neighbours(graph)
    has_beams = graph.of_beam.any()
    bodies = along_beams(graph, near, held) if has_beams else smallest_degree(near, held)
    nodes = by_bodies(graph, bodies)
    if graph.displacement.size < LARGE or graph.forced.size or not _has_loops(graph):
        return nodes
    other = by_elements(graph)
    limit = int(GAIN * block_products(pattern, other, NO_LIMIT))
    return other if block_products(pattern, nodes, limit) > limit else nodes


def _has_loops(graph: Graph) -> bool:
    """Return whether elements of a connected system close loops, also by way of the ground."""
    elements, bodies = graph.bodies.first.size - 1, graph.elements.first.size - 1
    grounded = np.count_nonzero(np.diff(graph.bodies.first) == 1)
    # A tree of bodies, elements and ground has fewer edges than vertices.
    return bool(graph.bodies.items.size + grounded >= bodies + elements + 1)


def block_products(pattern: Pattern, nodes: np.ndarray, most: int) -> int:
    """Return the multiplications of blocks with which all ``nodes`` are eliminated in their order;
    if they are more than ``most``, any number that is larger.
    """
    position = np.full(pattern.nodes, -1)
    position[nodes] = np.arange(nodes.size)
    couples = pattern.entries.reshape(-1, SIZE).any(axis=1)
    rows, columns = position[pattern.blocks[couples]].T
    return product_count(nodes.size, rows, columns, most)


def by_elements(graph: Graph) -> np.ndarray:
    """Return the nodes of all bodies, then those of all elements by smallest degree."""
    from scipy.sparse import csr_array, eye_array
    from scipy.sparse.linalg import splu

    count, bodies = graph.bodies.first.size - 1, graph.elements.first.size - 1
    ones = np.ones(graph.bodies.items.size)
    touched = csr_array((ones, graph.bodies.items, graph.bodies.first), shape=(count, bodies))
    # Only the pattern matters: a matrix that needs no search for pivots.
    coupled = (touched @ touched.T + graph.bodies.items.size * eye_array(count)).tocsc()
    factors = splu(
        coupled,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    moving = np.stack([graph.displacement, graph.rotation], axis=1).reshape(-1)
    rest = [
        lists.items[lists.first[e] : lists.first[e + 1]]
        for e in np.argsort(factors.perm_c).tolist()
        for lists in (graph.pushing, graph.rotational)
    ]
    return np.concatenate([moving, *rest])


def neighbours(graph: Graph) -> tuple[list[set[int]], set[int]]:
    """Return the bodies that a force or an element couples each body with, and those that an
    element holds to the ground or to nothing.
    """
    near: list[set[int]] = [set() for _ in range(graph.displacement.size)]
    pairs = np.concatenate([graph.coupled, graph.forced, graph.forced[:, ::-1]])
    for first, second in pairs.tolist():
        near[first].add(second)
    single = np.flatnonzero(np.diff(graph.bodies.first) == 1)
    return near, set(graph.bodies.items[graph.bodies.first[single]].tolist())


def smallest_degree(
    neighbours: list[set[int]], held: set[int], held_first: bool = True
) -> np.ndarray:
    """Return the vertices of a graph, each of smallest degree among those left, if there are
    several one that is ``held`` or was near one; with ``held_first`` false all of these come last.
    Consumes both.
    """

    def key(vertex: int) -> tuple[bool, int, bool, int]:
        later = vertex in held
        return later and not held_first, len(neighbours[vertex]), not later, vertex

    heap = [key(vertex) for vertex in range(len(neighbours))]
    heapq.heapify(heap)
    order: list[int] = []
    done = [False] * len(neighbours)
    while heap:
        given = heapq.heappop(heap)
        vertex = given[-1]
        if done[vertex] or given[:2] != key(vertex)[:2]:
            continue
        done[vertex] = True
        order.append(vertex)
        near = neighbours[vertex]
        if vertex in held:
            held |= near
        for other in near:
            neighbours[other] |= near
            neighbours[other] -= {vertex, other}
            heapq.heappush(heap, key(other))
    return np.array(order, dtype=np.int64)


def along_beams(graph: Graph, near: list[set[int]], held: set[int]) -> np.ndarray:
    """Return the bodies of a system with beams in order of smallest degree, as ``smallest_degree``
    with what is ``held`` last. Nodes that couple with nothing but their element go before the first
    of its others.
    """
    bodies, elements = graph.bodies, graph.elements
    inner: dict[int, list[int]] = {}  # by element
    for e in np.flatnonzero(graph.of_beam).tolist():
        nodes = set(bodies.items[bodies.first[e] : bodies.first[e + 1]].tolist())
        alone = [b for b in sorted(nodes) if elements.first[b + 1] - elements.first[b] == 1]
        inner[e] = [b for b in alone if near[b] | {b} == nodes]
    inside = {b for nodes in inner.values() for b in nodes}
    order: list[int] = []
    left = [set() if b in inside else others - inside for b, others in enumerate(near)]
    for b in smallest_degree(left, held - inside, held_first=False).tolist():
        for e in elements.items[elements.first[b] : elements.first[b + 1]].tolist():
            order += inner.pop(e, [])
        if b not in inside:
            order.append(b)
    return np.array(order, dtype=np.int64)


def by_bodies(graph: Graph, bodies: np.ndarray) -> np.ndarray:
    """Return the nodes in the order of their ``bodies``."""
    multipliers = graph.pushing.items.size + graph.rotational.items.size
    count, size = graph.bodies.first.size - 1, 2 * bodies.size + multipliers
    order, forced = np.zeros(size, dtype=np.int64), np.zeros(bodies.size, dtype=bool)
    forced[graph.forced.reshape(-1)] = True
    missing = np.diff(graph.bodies.first)
    # What couples nodes of a beam is an element, which they wait for.
    forced[graph.bodies.items[np.repeat(graph.of_beam, missing)]] = False
    of_elements, of_bodies = (
        np.zeros((2, count), dtype=bool),
        np.zeros((2, bodies.size), dtype=bool),
    )
    progress = Progress(missing, *of_elements, *of_bodies)
    by_size(_place_nodes, size)(
        graph,
        bodies,
        (graph.displacement, graph.rotation),
        forced,
        progress,
        order,
    )
    return order


class Progress(NamedTuple):
    """How far the elimination is."""

    missing: np.ndarray  # (e,) bodies that each element still waits for
    placed: np.ndarray  # (e,) whether it has gone
    used: np.ndarray  # (e,) whether another one went with one of its bodies
    gone: np.ndarray  # (n,) whether the displacement of each body has gone
    rotates: np.ndarray  # (n,) whether its rotation waits for an element of a beam


@kernel
def _place_nodes(
    graph: Graph,
    bodies: np.ndarray,
    nodes: tuple[np.ndarray, np.ndarray],
    forced: np.ndarray,
    progress: Progress,
    order: np.ndarray,
) -> None:
    """Set ``order``; ``nodes`` are those of the displacements and rotations of the bodies."""
    missing, placed, used = progress.missing, progress.placed, progress.used
    gone, rotates = progress.gone, progress.rotates
    end = 0
    for b in bodies:
        first, last = graph.elements.first[b], graph.elements.first[b + 1]
        gone[b] = True
        for i in range(first, last):
            missing[graph.elements.items[i]] -= 1
        tree = _element_to_go_with(graph, b, forced[b], missing, placed)
        order[end] = nodes[0][b]
        end += 1
        follows = tree >= 0 and graph.follower[tree] == b
        if tree >= 0 and not follows:
            end = _put(graph.pushing, tree, order, end)
        rotates[b] = tree < 0 and _is_in_beam(graph, b, placed)
        if not rotates[b]:
            order[end] = nodes[1][b]
            end += 1
        if follows:  # some of its equations have its rotation and displacements of others
            end = _put(graph.pushing, tree, order, end)
        if tree >= 0:
            end = _put(graph.rotational, tree, order, end)
            placed[tree] = True
        for i in range(first, last):
            e = graph.elements.items[i]
            used[e] = used[e] or tree >= 0
            early = graph.of_beam[e] and not used[e]
            if missing[e] <= (1 if early else 0) and not placed[e]:
                end = _put_element(graph, e, nodes[1], progress, order, end)
    # What couples no body that moves comes last.
    for e in range(placed.size):
        if not placed[e]:
            end = _put(graph.rotational, e, order, _put(graph.pushing, e, order, end))


@kernel
def _is_in_beam(graph: Graph, b: int, placed: np.ndarray) -> bool:
    """Return whether body ``b`` is a node of a beam's element that has not gone."""
    for i in range(graph.elements.first[b], graph.elements.first[b + 1]):
        e = graph.elements.items[i]
        if graph.of_beam[e] and not placed[e]:
            return True
    return False


@kernel
def _put_element(
    graph: Graph, e: int, rotation: np.ndarray, progress: Progress, order: np.ndarray, end: int
) -> int:
    """Append the multipliers of element ``e`` that act on displacements, the rotations that have
    waited for it, and its other multipliers; the new end. Of a beam's element the first need only
    displacements, which leaves rotations and bendings with fewer unknowns.
    """
    progress.placed[e] = True
    if graph.of_beam[e]:
        end = _put(graph.pushing, e, order, end)
    for i in range(graph.bodies.first[e], graph.bodies.first[e + 1]):
        b = graph.bodies.items[i]
        if progress.rotates[b]:
            progress.rotates[b] = False
            order[end] = rotation[b]
            end += 1
    if graph.of_beam[e]:
        _mark_used(graph, e, progress.gone, progress.used)
    else:
        end = _put(graph.pushing, e, order, end)
    return _put(graph.rotational, e, order, end)


@kernel
def _mark_used(graph: Graph, e: int, gone: np.ndarray, used: np.ndarray) -> None:
    """Mark as ``used`` all elements of those bodies of element ``e`` that have ``gone``."""
    for i in range(graph.bodies.first[e], graph.bodies.first[e + 1]):
        b = graph.bodies.items[i]
        for j in range(graph.elements.first[b], graph.elements.first[b + 1] if gone[b] else 0):
            used[graph.elements.items[j]] = True


@kernel
def _element_to_go_with(
    graph: Graph, b: int, forced: bool, missing: np.ndarray, placed: np.ndarray
) -> int:
    """The element that body ``b`` is eliminated together with, -1 if there is none.

    Elements to bodies that have gone come first: left for later they would hold the body at both
    ends.
    """
    for waits in range(2 if forced else 1):
        for i in range(graph.elements.first[b], graph.elements.first[b + 1]):
            e = graph.elements.items[i]
            if graph.follower[e] == b and not placed[e]:
                return int(e)
            bodies = graph.bodies.first[e + 1] - graph.bodies.first[e]
            goes = not placed[e] and not graph.of_beam[e] and bodies <= TREE
            if goes and (missing[e] == 0) == (waits == 0):
                return int(e)
    return -1


@kernel
def _put(lists: Lists, k: int, order: np.ndarray, end: int) -> int:
    """Append list ``k`` to ``order``, which ends at ``end``; the new end."""
    for i in range(lists.first[k], lists.first[k + 1]):
        order[end] = lists.items[i]
        end += 1
    return end
