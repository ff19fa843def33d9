"""What couples the bodies of a system: graph and pattern by which it is eliminated."""

import numpy as np

from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.linalg import node_order as order
from msahl.linalg.node_order import Graph
from msahl.linalg.pattern import Pattern
from msahl.linalg.symbolic import grouped
from msahl.system.arrays import System, node_count


def node_order(system: System) -> np.ndarray:
    """Return the nodes of all multipliers and moving frames in order of elimination."""
    return order.node_order(graph_of(system), pattern_of(system))


def pattern_of(system: System) -> Pattern:
    """Return the pattern of the Jacobian."""
    return Pattern(node_count(system), system.blocks, system.pattern)


def graph_of(system: System) -> Graph:
    """Return what couples the bodies; elements are numbered as their multipliers come."""
    multipliers, ground = system.multipliers, moving_count(system.frames)
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
        pushing=pushing,
        rotational=rotational,
        coupled=_coupled(system, ground),
        forced=_forced(system, ground),
    )


def _sorted_set(numbers: np.ndarray) -> np.ndarray:
    """Return the different ``numbers``, sorted.

    ``np.unique`` would import ``numpy.ma``, which takes 10 ms.
    """
    ordered = np.sort(numbers)
    return ordered[np.diff(ordered, prepend=ordered[:1] - 1) != 0]


def _coupled(system: System, ground: int) -> np.ndarray:
    """(p, 2) pairs of frames of one equation, in both orders."""
    bodies = system.multipliers.bodies
    first, second = np.broadcast_arrays(bodies[:, :, None], bodies[:, None, :])
    return _moving(np.stack([first.reshape(-1), second.reshape(-1)], axis=1), ground)


def _forced(system: System, ground: int) -> np.ndarray:
    """(q, 2) pairs of frames whose equations a force couples."""
    blocks = system.blocks[1:]
    of_frames = (blocks < first_multiplier(system.frames)).all(axis=1)
    return _moving(system.frames.of_node[blocks[of_frames]], ground)


def _moving(pairs: np.ndarray, ground: int) -> np.ndarray:
    """Return the pairs of two different frames that can move."""
    chosen: np.ndarray = pairs[(pairs < ground).all(axis=1) & (pairs[:, 0] != pairs[:, 1])]
    return chosen
