"""Degrees of freedom: how many of the joints' equations are independent."""

import numpy as np

from msahl.solve.initial import jacobian_at_rest, solve_sparse
from msahl.system.arrays import State, System, node_count
from msahl.system.reduce import all_unknowns
from msahl.system.unknowns import choose

INDEPENDENT = 1e-9
"""Singular value, relative to the largest, below which an equation follows from the others."""


def constraint_matrix(system: System, state: State) -> np.ndarray:
    """(3 k, 6 (n+1)) derivative of the gaps by displacements and turns l Q, dimensionless."""
    values = jacobian_at_rest(system, state)
    first = 2 * system.bodies.inverse_mass.size
    G = np.zeros((3 * (node_count(system) - first), 3 * first))
    for start, (row, column) in enumerate(system.blocks[1:].tolist(), start=1):
        if row >= first > column:
            block = values[9 * start : 9 * start + 9].reshape(3, 3)
            G[3 * (row - first) : 3 * (row - first) + 3, 3 * column : 3 * column + 3] = block
    return G


def constraint_rank(system: System, state: State) -> int:
    """Number of independent joint equations in the state's configuration."""
    unknowns = choose(system, all_unknowns(system))
    # A regular matrix of the whole scene proves them independent, and is cheap where it is large.
    probe = np.random.default_rng(0).normal(size=3 * node_count(system))
    if solve_sparse(jacobian_at_rest(system, state), probe, unknowns) is not None:
        return 3 * system.coincide.a.size
    G = constraint_matrix(system, state)
    values = np.linalg.svd(G, compute_uv=False)
    return int(np.count_nonzero(values > INDEPENDENT * values[0]))
