"""Count the independent joint equations and find the components of reactions that are unique.

Multipliers lam with G^T lam = 0 move nothing: any amount of them can be added to a solution. They
form the null space of G^T. A component of a reaction is a linear function of the multipliers, so it
is unique if that function is zero in all of the null space. Source: Wojtyra, Joint reactions in
rigid body mechanisms with dependent constraints, Mech. Mach. Theory 44 (2009), who decides by
joint; the functions are those by which the reactions are published.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.elements.constraints import coordinates
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.jit.by_size import by_size
from msahl.start.velocities import solve_sparse
from msahl.system import evaluate
from msahl.system.arrays import State, System, multiplier_count, new_system_workspace, node_count
from msahl.system.evaluate import jacobian_at_rest
from msahl.system.names import FORCE_COLUMNS, LOAD_COLUMN, MOMENT_COLUMNS
from msahl.system.reductions import all_unknowns
from msahl.system.unknowns import Unknowns, choose

if TYPE_CHECKING:
    from scipy.sparse import csr_array

GOLDEN_RATIO = 0.5 * (1.0 + 5.0**0.5)
INDEPENDENT = 1e-9
"""Singular value, relative to the largest, below which an equation follows from the others."""
PART = 1e-6
"""Component, in a null space of unit vectors, that is not round-off: a singular value that counts
as zero leaves 1e-9 at most, and a joint placed by the six digits of a deck some 1e-7."""
LARGEST_DENSE = 600
"""Most rows of a constraint matrix that is decomposed as a dense one, in half a second or so: time
grows with the third power of the equations, and memory with the second."""
SHIFT = 1e-13
"""Put on the diagonal of G G^T, relative to its largest entries, so that it has factors: above the
round-off of its null space, below what belongs to the smallest other singular value."""
INVERSE_ITERATIONS = 4
"""Each enlarges the null space against the rest by the ratio of their eigenvalues, 1e4 and more."""


def constraint_matrix(
    system: System, state: State, values: np.ndarray | None = None
) -> "csr_array":
    """(3 k, 6 (n+1)) derivative of the constraint equations by u and l Q, dimensionless; ``values``
    are those of ``jacobian_at_rest``, if they are at hand.
    """
    from scipy.sparse import coo_array

    values = jacobian_at_rest(system, state) if values is None else values
    values = values.reshape(-1, 3, 3)
    first = first_multiplier(system.frames)
    row, column = system.blocks.T
    chosen = np.flatnonzero((row >= first) & (column < first))
    i, j = np.broadcast_arrays(
        3 * (row[chosen, None, None] - first) + np.arange(3)[:, None],
        3 * column[chosen, None, None] + np.arange(3),
    )
    shape = (3 * (node_count(system) - first), 3 * first)
    return coo_array((values[chosen].ravel(), (i.ravel(), j.ravel())), shape).tocsr()


def constraint_rank(
    system: System,
    state: State,
    unknowns: Unknowns | None = None,
    values: np.ndarray | None = None,
) -> int:
    """Number of independent joint equations in the state's configuration; ``unknowns`` are all
    unknowns of the system, ``values`` those of ``jacobian_at_rest``, if they are at hand.
    """
    # A regular matrix of the full system proves them independent, and is cheap where it is large.
    if is_regular(system, state, unknowns or choose(system, all_unknowns(system)), values):
        return multiplier_count(system)
    G = constraint_matrix(system, state, values)
    equations = _equations(G)
    return int(equations.sum()) - null_space(G[equations]).shape[1]


def is_tree_of_points(system: System) -> bool:
    """Return whether all constraints are points that coincide, and none closes a loop of bodies.

    They are independent then, wherever the bodies are: each moves a body that those before do not.
    """
    if system.scalar is not None or system.beams is not None:
        return False
    leader = list(range(moving_count(system.frames) + 1))
    for a, b in zip(system.coincide.a.tolist(), system.coincide.b.tolist(), strict=True):
        while leader[a] != a:
            leader[a] = a = leader[leader[a]]
        while leader[b] != b:
            leader[b] = b = leader[leader[b]]
        if a == b:
            return False
        leader[b] = a
    return True


def is_regular(
    system: System, state: State, unknowns: Unknowns, values: np.ndarray | None = None
) -> bool:
    """Return whether the system's matrix at rest is regular in the ``unknowns``; ``values`` are
    those of ``jacobian_at_rest``, if they are at hand.
    """
    values = jacobian_at_rest(system, state) if values is None else values
    # Fractional parts of multiples of the golden ratio serve as well as random numbers, and
    # numpy.random takes 7 ms to import.
    probe = np.modf(GOLDEN_RATIO * np.arange(1, 3 * node_count(system) + 1))[0] - 0.5
    return solve_sparse(values, probe, unknowns) is not None


def non_unique_reactions(
    system: System,
    state: State,
    others: Sequence[np.ndarray] = (),
    values: np.ndarray | None = None,
) -> dict[int, list[str]]:
    """By number of the joint, coupling or motion, the columns of its reaction that are not unique
    in the state's configuration; those that are unique throughout have no entry. ``others`` (k, 3)
    are further unit vectors of multipliers, by their nodes, of which any amount may be added;
    ``values`` are those of ``jacobian_at_rest``, if they are at hand.
    """
    null = _null_space(constraint_matrix(system, state, values))
    null = np.concatenate([null, *(other[None] for other in others)])
    joints = _components(system, state, null)
    columns = (*FORCE_COLUMNS, *MOMENT_COLUMNS)
    shared = {
        j: [column for column, size in zip(columns, sizes, strict=True) if size > PART]
        for j, sizes in enumerate(joints)
    }
    if system.scalar:
        places = system.scalar.equations.place[system.shown.load_equation]
        loads = np.linalg.norm(null[:, places[:, 0], places[:, 1]], axis=0)
        for e, load in enumerate(loads, start=len(joints)):
            shared[e] = [LOAD_COLUMN] if load > PART else []
    return {e: columns for e, columns in shared.items() if columns}


def _null_space(G: "csr_array") -> np.ndarray:
    """(n, k, 3) unit vectors, by the multipliers' nodes, in equilibrium with each other; all are
    forces, as equations in radians count by their length.
    """
    equations = _equations(G)
    idle = null_space(G[equations])
    null = np.zeros((idle.shape[1], G.shape[0]))
    null[:, equations] = idle.T
    return null.reshape(len(null), G.shape[0] // 3, 3)


def _components(system: System, state: State, null: np.ndarray) -> np.ndarray:
    """(j, 6) the largest forces, and moments over a body's length, that unit vectors of the null
    space give to each joint's reaction, by its columns; those not shown are zero.
    """
    unit, rest = np.ones_like(state.force), state._replace(reaction=np.zeros_like(state.reaction))
    start, Z = new_system_workspace(system, rest), np.zeros((node_count(system), 3))
    by_size(evaluate.prepare, moving_count(system.frames))(system, rest, start)
    if system.scalar:
        rows = system.scalar.equations
        unit[rows.place[:, 0], rows.place[:, 1]] = rows.scale
        coordinates.evaluate(system.scalar.coordinates, start.scalar.coordinates, system.frames, Z)
    squares = np.zeros_like(state.reaction)
    for vector in null:
        held = rest._replace(force=vector * unit)
        evaluate.set_reactions(system, held, start, Z)
        squares += held.reaction**2
    sizes = np.sqrt(squares)
    sizes[:, 3:] /= system.frames.length[system.reactions.child, None]
    sizes[~system.shown.moment, 3:] = 0.0
    return sizes


def _equations(G: "csr_array") -> np.ndarray:
    """(3 k,) which rows are equations: the last node of an element may have fewer than three."""
    equations: np.ndarray = abs(G).sum(axis=1) > 0.0
    return equations


def null_space(G: "csr_array") -> np.ndarray:
    """(m, d) orthonormal basis of the vectors y with y^T G = 0."""
    if not G.shape[0]:
        return np.zeros((0, 0))
    if G.shape[0] <= LARGEST_DENSE:
        left, values, _ = np.linalg.svd(G.toarray())
        dense: np.ndarray = left[:, np.count_nonzero(values > INDEPENDENT * values[0]) :]
        return dense
    return _null_space_by_inverse_iteration(G)


def _null_space_by_inverse_iteration(G: "csr_array") -> np.ndarray:
    """As ``null_space``: memory grows with the rows times the dimension of the null space."""
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    m = G.shape[0]
    S = G @ G.T
    size = float(abs(S).sum(axis=0).max())  # an upper bound of the largest eigenvalue
    shifted: Any = (S + SHIFT * size * eye_array(m)).tocsc()
    factors = splu(
        shifted,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    draw = np.random.default_rng(0)
    wanted = 8
    while True:
        wanted = min(wanted, m)
        Y = draw.normal(size=(m, wanted))
        for _ in range(INVERSE_ITERATIONS):
            Y = np.linalg.qr(factors.solve(Y))[0]
        # G itself says which of them are null: in G G^T a small singular value is lost.
        _, values, rotated = np.linalg.svd(np.linalg.qr(G.T @ Y)[1])
        null = values <= INDEPENDENT * np.sqrt(size)
        if not null.all() or wanted == m:
            basis: np.ndarray = Y @ rotated[null].T
            return basis
        wanted *= 2
