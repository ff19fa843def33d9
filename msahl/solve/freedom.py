"""Degrees of freedom: how many of the joints' equations are independent, and which components of
reactions are unique.

Multipliers lam with G^T lam = 0 move nothing: any amount of them can be added to a solution. They
form the null space of G^T. A component of a reaction is a linear function of the multipliers, so it
is unique if that function is zero in the whole null space. Source: Wojtyra, Joint reactions in
rigid body mechanisms with dependent constraints, Mech. Mach. Theory 44 (2009), who decides by
joint; the functions are those by which the reactions are published.
"""

import numpy as np

from msahl.joints import quantity
from msahl.schemes import preserving
from msahl.solve.initial import jacobian_at_rest, solve_sparse
from msahl.system.arrays import (
    State,
    System,
    body_count,
    multiplier_count,
    new_start,
    node_count,
)
from msahl.system.names import FORCE_COLUMNS, LOAD_COLUMN, MOMENT_COLUMNS
from msahl.system.reduce import all_unknowns
from msahl.system.unknowns import Unknowns, choose

INDEPENDENT = 1e-9
"""Singular value, relative to the largest, below which an equation follows from the others."""
PART = 1e-6
"""Component, in a null space of unit vectors, that is not round-off: a singular value that counts
as zero leaves 1e-9 at most, and a joint placed by the six digits of a deck some 1e-7."""


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


def shared_reactions(system: System, state: State) -> dict[int, list[str]]:
    """By number of the joint, coupling or motion, the columns of its reaction that are not unique
    in the state's configuration; those that are unique throughout have no entry.
    """
    null = _null_space(system, state)
    joints = _components(system, state, null)
    columns = (*FORCE_COLUMNS, *MOMENT_COLUMNS)
    shared = {
        j: [column for column, size in zip(columns, sizes, strict=True) if size > PART]
        for j, sizes in enumerate(joints)
    }
    if system.along:
        places = system.along.rows.place[system.shown.load_row]
        loads = np.linalg.norm(null[:, places[:, 0], places[:, 1]], axis=0)
        for e, load in enumerate(loads, start=len(joints)):
            shared[e] = [LOAD_COLUMN] if load > PART else []
    return {e: columns for e, columns in shared.items() if columns}


def _null_space(system: System, state: State) -> np.ndarray:
    """(n, k, 3) unit vectors, by the multipliers' nodes, that hold each other; all are forces, as
    rows in radians count by their length.
    """
    G = constraint_matrix(system, state)
    equations = np.any(G, axis=1)
    left, values, _ = np.linalg.svd(G[equations])
    null = np.zeros((G.shape[0] - (~equations).sum() - _count(values), G.shape[0]))
    null[:, equations] = left[:, _count(values) :].T
    return null.reshape(len(null), -1, 3)


def _components(system: System, state: State, null: np.ndarray) -> np.ndarray:
    """(j, 6) the largest forces, and moments over a body's length, that unit vectors of the null
    space give to each joint's reaction, by its columns; those not shown are zero.
    """
    unit, rest = np.ones_like(state.force), state._replace(reaction=np.zeros_like(state.reaction))
    start, Z = new_start(system, rest), np.zeros((node_count(system), 3))
    preserving.prepare(system, rest, start)
    if system.along:
        rows = system.along.rows
        unit[rows.place[:, 0], rows.place[:, 1]] = rows.scale
        quantity.evaluate(system.along.quantities, start.along.quantities, system.bodies, Z)
    squares = np.zeros_like(state.reaction)
    for vector in null:
        held = rest._replace(force=vector * unit)
        preserving.react(system, held, start, Z)
        squares += held.reaction**2
    sizes = np.sqrt(squares)
    sizes[:, 3:] /= system.bodies.length[system.reactions.child, None]
    sizes[~system.shown.moment, 3:] = 0.0
    return sizes


def _rank(G: np.ndarray) -> int:
    return _count(np.linalg.svd(G, compute_uv=False)) if G.size else 0


def _count(values: np.ndarray) -> int:
    """How many singular values are not zero."""
    return int(np.count_nonzero(values > INDEPENDENT * values[0]))
