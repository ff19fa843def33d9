"""Which unknowns are solved for, and the maps that bring them together.

The step's equations are written for every node; a solver works on the free ones only. The others
keep their predicted values, which the reductions of ``system.reductions`` make exact: gravity's
own, or zero.
"""

from typing import NamedTuple

import numpy as np

from msahl.elements.constraints.equations import is_active
from msahl.formulations.absolute.frames import moving_count
from msahl.jit.by_size import LARGE
from msahl.jit.recent import Recent
from msahl.linalg import elimination
from msahl.linalg.elimination import Elimination
from msahl.linalg.node_order import block_products
from msahl.linalg.pattern import Pattern
from msahl.system.arrays import System, node_count
from msahl.system.graph import node_order, pattern_of

PANELS = 100
"""Products of blocks per node from which factors of large systems are dense panels. With 55 (a net
of 1000 bodies) a step takes half the time, but finding the panels that of ten steps; with 280 (a
net of 10,000) both take less than half."""


class Unknowns(NamedTuple):
    """The free unknowns of a system, for the dense and for the sparse solver."""

    free: np.ndarray  # (f,) indices into the flat unknowns
    dense_from: np.ndarray  # (q,) positions in the block values of the free-free entries
    dense_to: np.ndarray  # (q,) their positions in the dense (f, f) matrix
    elimination: Elimination


# By the pattern's identity, so each is kept with the pattern. Systems of one topology share it.
_ORDERS: Recent[tuple[np.ndarray, np.ndarray]] = Recent(32)
_CHOSEN: Recent[tuple[np.ndarray, Unknowns]] = Recent(64)


def choose(system: System, free: np.ndarray, nodes: np.ndarray | None = None) -> Unknowns:
    """The maps for solving the ``free`` unknowns; ``nodes`` is the order of the system's nodes, if
    it is known and stays throughout a run. Small systems of one topology share them.
    """
    if nodes is not None or moving_count(system.frames) >= LARGE:
        return _chosen(system, free, nodes)
    pattern, active = system.blocks, b""
    if system.scalar is not None:
        active = is_active(system.scalar.equations).tobytes()

    def chosen() -> tuple[np.ndarray, Unknowns]:
        _, order = _ORDERS.get((id(pattern), active), lambda: (pattern, node_order(system)))
        return pattern, _chosen(system, free, order)

    return _CHOSEN.get((id(pattern), active, free.tobytes(), _by_panels(system)), chosen)[1]


def _chosen(system: System, free: np.ndarray, nodes: np.ndarray | None) -> Unknowns:
    dense_from, dense_to = _dense_map(system, free)
    return Unknowns(free, dense_from, dense_to, eliminate(system, free, nodes))


def eliminate(system: System, free: np.ndarray, nodes: np.ndarray | None = None) -> Elimination:
    """Return the elimination of the ``free`` unknowns of a system; ``nodes`` as in ``choose``."""
    pattern = pattern_of(system)
    # An order that may change later must not change the kind of factors with it.
    large = moving_count(system.frames) >= LARGE
    by_panels = _by_panels(system)
    if large and nodes is not None:
        by_panels |= _fills_up(pattern, free, nodes)
    nodes = node_order(system) if nodes is None else nodes
    return elimination.eliminate(pattern, free, nodes, by_panels)


def _fills_up(pattern: Pattern, free: np.ndarray, nodes: np.ndarray) -> bool:
    """Whether the factors of a system in space have so many entries that dense panels are faster,
    and take a fraction of the memory: the list of all products would be the largest array by far.
    """
    limit = PANELS * nodes.size
    in_space = free.size > 2 * nodes.size
    return in_space and block_products(pattern, nodes, limit) > limit


def _by_panels(system: System) -> bool:
    """Whether factors are dense panels, as those of beams in space; in a plane these would have a
    quarter of the entries, too few to be worth it.
    """
    return system.beams is not None and system.beams.plane is None


def _dense_map(system: System, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where each free-free entry stands in the block values and in the dense matrix."""
    position = np.full(3 * node_count(system), -1, dtype=np.int64)
    position[free] = np.arange(free.size)
    offsets = np.arange(3)
    rows = position[3 * system.blocks[:, 0, None, None] + offsets[:, None]]
    columns = position[3 * system.blocks[:, 1, None, None] + offsets[None, :]]
    rows, columns = np.broadcast_arrays(rows, columns)
    solved = (rows >= 0) & (columns >= 0) & pattern_of(system).entries.reshape(rows.shape)
    return np.flatnonzero(solved), (rows * free.size + columns)[solved]
