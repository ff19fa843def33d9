"""Degrees of freedom: how many of the joints' equations are independent, and whose reactions are
unique.

A joint's reaction is unique if taking its equations away lowers the rank of the constraint matrix
by their number; else it shares with others what follows from the rest. Source: Wojtyra, Joint
reactions in rigid body mechanisms with dependent constraints, Mech. Mach. Theory 44 (2009).
"""

import numpy as np

from msahl.solve.initial import jacobian_at_rest, solve_sparse
from msahl.system.arrays import State, System, body_count, multiplier_count, node_count
from msahl.system.reduce import all_unknowns
from msahl.system.unknowns import Unknowns, choose

INDEPENDENT = 1e-9
"""Singular value, relative to the largest, below which an equation follows from the others."""
PART = 1e-6
"""Entry of a unit vector that is not round-off: far above what the last singular values leave."""


def constraint_matrix(system: System, state: State) -> np.ndarray:
    """(3 k, 6 (n+1)) derivative of the gaps by displacements and turns l Q, dimensionless."""
    values = jacobian_at_rest(system, state)
    first = 2 * body_count(system)
    G = np.zeros((3 * (node_count(system) - first), 3 * first))
    for start, (row, column) in enumerate(system.blocks[1:].tolist(), start=1):
        if row >= first > column:
            block = values[9 * start : 9 * start + 9].reshape(3, 3)
            G[3 * (row - first) : 3 * (row - first) + 3, 3 * column : 3 * column + 3] = block
    return G


def constraint_rank(system: System, state: State) -> int:
    """Number of independent joint equations in the state's configuration."""
    # A regular matrix of the whole scene proves them independent, and is cheap where it is large.
    if is_regular(system, state, choose(system, all_unknowns(system))):
        return multiplier_count(system)
    return _rank(constraint_matrix(system, state))


def is_regular(system: System, state: State, unknowns: Unknowns) -> bool:
    """Whether the scene's matrix at rest is regular in the ``unknowns``."""
    probe = np.random.default_rng(0).normal(size=3 * node_count(system))
    return solve_sparse(jacobian_at_rest(system, state), probe, unknowns) is not None


def shared_reactions(system: System, state: State) -> list[int]:
    """Numbers of the joints, couplings and motions whose reactions are not unique."""
    G = constraint_matrix(system, state)
    equations = np.any(G, axis=1)
    left, values, _ = np.linalg.svd(G[equations])
    # Multipliers that hold each other: rows without a part in any of them add to the rank.
    idle = left[:, _count(values) :]
    part = np.abs(idle).max(axis=1, initial=0.0) > PART
    of_row = np.repeat(system.multipliers.element, 3)[equations]
    return [int(element) for element in np.unique(of_row[part])]


def _rank(G: np.ndarray) -> int:
    return _count(np.linalg.svd(G, compute_uv=False)) if G.size else 0


def _count(values: np.ndarray) -> int:
    """How many singular values are not zero."""
    return int(np.count_nonzero(values > INDEPENDENT * values[0]))
