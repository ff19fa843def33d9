"""What couples the bodies of a system: graph and pattern by which it is eliminated."""

import numpy as np

from msahl.elements.constraints.equations import is_active
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.linalg import node_order as order
from msahl.linalg.node_order import Graph
from msahl.linalg.pattern import SIZE, Pattern
from msahl.linalg.symbolic import grouped
from msahl.system.arrays import Multipliers, System, node_count


def node_order(system: System) -> np.ndarray:
    """Return the nodes of all multipliers and moving frames in order of elimination."""
    return order.node_order(graph_of(system), pattern_of(system))


def pattern_of(system: System) -> Pattern:
    """Return the pattern of the Jacobian, with the blocks of contacts that are closed."""
    entries = system.pattern
    if system.scalar is not None:
        rows = system.scalar.equations
        along = system.scalar.coordinates.block[rows.coordinate[is_active(rows), 0]]
        places = (rows.force_block, rows.constraint_block)
        own = [place[is_active(rows)].reshape(-1) for place in places]
        blocks = np.concatenate([along.reshape(-1), *own]) // SIZE
        entries = entries.reshape(-1, SIZE).copy()
        entries[blocks[blocks > 0]] = True
    return Pattern(node_count(system), system.blocks, entries.reshape(-1))


def _open(system: System) -> np.ndarray:
    """(k,) which of the multipliers' nodes are those of open contacts alone: no block of theirs is
    in the pattern.
    """
    pattern, first = pattern_of(system), first_multiplier(system.frames)
    nodes = pattern.blocks[pattern.entries.reshape(-1, SIZE).any(axis=1)]
    return ~np.isin(system.multipliers.node, nodes[nodes >= first])


def graph_of(system: System) -> Graph:
    """Return what couples the bodies; elements are numbered as their multipliers come."""
    ground, couples = moving_count(system.frames), ~_open(system)
    multipliers = Multipliers(*(array[couples] for array in system.multipliers))
    _, first, number = np.unique(
        multipliers.element, return_index=True, return_inverse=True
    )  # by the numbers of the model
    rank = np.argsort(np.argsort(first))
    element, count = rank[number.reshape(-1)], first.size
    bodies, n = multipliers.bodies.reshape(-1), ground + 1
    pairs = n * np.repeat(element, multipliers.bodies.shape[1]) + bodies
    touched = np.stack(np.divmod(_sorted_set(pairs[bodies != ground]), n))
    pushing, rotational = (
        grouped(element[chosen], multipliers.node[chosen], count)
        for chosen in (~multipliers.rotational, multipliers.rotational)
    )
    return Graph(
        displacement=system.frames.displacement[:ground],
        rotation=system.frames.rotation[:ground],
        bodies=grouped(touched[0], touched[1], count),
        elements=grouped(touched[1], touched[0], ground),
        of_beam=multipliers.of_beam[first],
        follower=_followers(system, multipliers.element[first]),
        pushing=pushing,
        rotational=rotational,
        coupled=_coupled(multipliers, ground),
        forced=_forced(system, ground),
    )


def _followers(system: System, numbers: np.ndarray) -> np.ndarray:
    """(e,) frames that follow others by the elements of these ``numbers``, -1 for other elements:
    those whose equations have more than two coordinates."""
    followers = np.full(numbers.size, -1, dtype=np.int64)
    if system.scalar is not None and system.scalar.sums is not None:
        rows, coords = system.scalar.equations, system.scalar.coordinates
        row = system.scalar.sums.row
        element = system.multipliers.element[rows.place[row, 0]]
        frame = coords.products.b[coords.first[rows.coordinate[row, 0]]]
        followers[np.searchsorted(numbers, element)] = frame
    return followers


def _sorted_set(numbers: np.ndarray) -> np.ndarray:
    """Return the different ``numbers``, sorted.

    ``np.unique`` would import ``numpy.ma``, which takes 10 ms.
    """
    ordered = np.sort(numbers)
    return ordered[np.diff(ordered, prepend=ordered[:1] - 1) != 0]


def _coupled(multipliers: Multipliers, ground: int) -> np.ndarray:
    """(p, 2) pairs of frames of one equation, in both orders."""
    bodies = multipliers.bodies
    first, second = np.broadcast_arrays(bodies[:, :, None], bodies[:, None, :])
    return _moving(np.stack([first.reshape(-1), second.reshape(-1)], axis=1), ground)


def _forced(system: System, ground: int) -> np.ndarray:
    """(q, 2) pairs of frames whose equations a force couples."""
    pattern = pattern_of(system)
    blocks = pattern.blocks[pattern.entries.reshape(-1, SIZE).any(axis=1)]
    of_frames = (blocks < first_multiplier(system.frames)).all(axis=1)
    return _moving(system.frames.of_node[blocks[of_frames]], ground)


def _moving(pairs: np.ndarray, ground: int) -> np.ndarray:
    """Return the pairs of two different frames that can move."""
    chosen: np.ndarray = pairs[(pairs < ground).all(axis=1) & (pairs[:, 0] != pairs[:, 1])]
    return chosen
