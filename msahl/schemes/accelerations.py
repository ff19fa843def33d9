"""Accelerations and joint forces of a state, at its own time: the index-1 problem.

    [ M  -G^T ] [ a   ]   [ forces      ]
    [ G    0  ] [ lam ] = [ -dG/dt v    ]

The multipliers of a step are means over it: of order 2 at its middle, of order 1 at its ends. These
are forces at one time, as accurate as the state they are asked of. The matrix is the limit of the
step's own Jacobian for h -> 0, where the terms of the forces (by h^2) and of the spins (by h) fade.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import add, at, copy, matrix_at, put, scale, times, transpose
from msahl.elements import forces
from msahl.elements.constraints import scalar
from msahl.elements.frames import displacement_node, first_multiplier, moving_count, rotation_node
from msahl.elements.reactions import MOST_ROUNDS, is_unchanged, write_reactions
from msahl.jit.kernel import apart, kernel
from msahl.linalg import dense, sparse_lu
from msahl.schemes.midpoint import newton
from msahl.schemes.midpoint.load_moments import NO_STEP
from msahl.schemes.midpoint.workspace import Workspace
from msahl.start.redundancy import INDEPENDENT
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, node_count
from msahl.system.reductions import all_unknowns
from msahl.system.unknowns import Unknowns, choose


class Instant(NamedTuple):
    """Room for the index-1 problem of one system."""

    unknowns: Unknowns
    Z: np.ndarray  # (nodes, 3) zeros: no step is taken
    values: np.ndarray  # block values of the matrix
    factor: np.ndarray  # its sparse factors
    rows: np.ndarray  # (nodes, 3) right-hand side
    y: np.ndarray  # (f,) the same in the order of elimination
    solution: np.ndarray  # (nodes, 3)
    force: np.ndarray  # (k, 3) where the state's multipliers are kept meanwhile
    reaction: np.ndarray  # (j, 6) likewise its reactions
    last: np.ndarray  # (j, 6) those of the round before


def new_instant(system: System, unknowns: Unknowns | None = None) -> Instant:
    """Room for any state of ``system``; of all its unknowns, unless some are known not to move."""
    if unknowns is None:
        unknowns = choose(system, all_unknowns(system))
    nodes = (node_count(system), 3)
    return Instant(
        unknowns=unknowns,
        Z=np.zeros(nodes),
        values=np.zeros_like(system.constant),
        factor=np.zeros(int(unknowns.elimination.base[-1])),
        rows=np.zeros(nodes),
        y=np.zeros(unknowns.elimination.order.size),
        solution=np.zeros(nodes),
        force=np.zeros((system.multipliers.node.size, 3)),
        reaction=np.zeros((system.reactions.child.size, 6)),
        last=np.zeros((system.reactions.child.size, 6)),
    )


@kernel
def free(system: System, state: State, start: SystemWorkspace, instant: Instant) -> None:
    """Set the ``rows`` to what accelerations must balance, and factor the matrix."""
    for node in range(instant.rows.shape[0]):
        for i in range(3):
            instant.rows[node, i] = 0.0
    evaluate.free_acceleration(system, state, start, instant.Z, instant.rows)
    evaluate.joint_jacobian(system, start, NO_STEP, instant.Z, instant.values)
    sparse_lu.factor(instant.unknowns.elimination, instant.values, instant.factor)


@kernel
def solve(instant: Instant) -> None:
    """Solve for the ``rows`` by the factors; the ``solution`` is zero at what is not free."""
    order = instant.unknowns.elimination.order
    dense.gather(order, instant.rows, instant.y)
    sparse_lu.solve(instant.unknowns.elimination, instant.factor, instant.y)
    dense.spread(order, instant.y, instant.solution)


@kernel
def react(system: System, state: State, start: SystemWorkspace, instant: Instant) -> None:
    """Set the state's multipliers and reactions from the ``solution``."""
    first = first_multiplier(system.frames)
    for k in range(state.force.shape[0]):
        for i in range(3):
            state.force[k, i] = instant.solution[first + k, i] * system.unit[k, i]
    evaluate.set_reactions(system, state, start, instant.Z)


@apart
def accelerate(system: System, state: State, start: SystemWorkspace, instant: Instant) -> None:
    """Set the ``solution`` to accelerations a, l alpha and multipliers over their units, and the
    state's reactions; ``start`` is prepared.

    Friction presses by the reaction, which depends on friction: rounds until it is
    unchanged, each of which leaves about the coefficient of friction times the change before.
    """
    for _ in range(MOST_ROUNDS):
        copy(state.reaction, instant.last)
        free(system, state, start, instant)
        solve(instant)
        react(system, state, start, instant)
        if not forces.depend_on_reactions(system.forces) or is_unchanged(
            state.reaction, instant.last
        ):
            break


@kernel
def rounds(system: System) -> int:
    """How often a change must be asked for where the relaxation of redundant joints takes a part
    of each away.
    """
    return 3 if system.relaxation > 0.0 else 1


@kernel
def undo(
    system: System, state: State, start: SystemWorkspace, violation: np.ndarray, instant: Instant
) -> None:
    """Set the ``solution`` to the least change by mass that takes away the ``gap`` (k, 3) [m]."""
    first = first_multiplier(system.frames)
    free(system, state, start, instant)
    for node in range(instant.rows.shape[0]):
        for i in range(3):
            instant.rows[node, i] = 0.0 if node < first else -violation[node - first, i]
    solve(instant)


@kernel
def keep_closed(
    system: System,
    state: State,
    start: SystemWorkspace,
    violation: np.ndarray,
    rate: np.ndarray,
    instant: Instant,
) -> None:
    """Change the velocities, least by mass, so that no joint opens; ``gap`` and ``rate`` (k, 3) are
    set to the gaps [m] and what is left of their rates.
    """
    frames = system.frames
    for _ in range(rounds(system)):
        evaluate.observe(system, state, start, violation, rate)
        scalar.in_metres(system.scalar, violation, rate)
        undo(system, state, start, rate, instant)
        for b in range(moving_count(frames)):
            R = matrix_at(start.frames.R, b)
            dW = scale(1.0 / frames.length[b], at(instant.solution, rotation_node(frames, b)))
            put(state.v, b, add(at(state.v, b), at(instant.solution, displacement_node(frames, b))))
            put(state.w, b, add(at(state.w, b), times(transpose(R), dW)))
        scalar.motion_work(system.scalar, frames, state.time[0], 1.0, instant.solution, state.work)
        evaluate.prepare(system, state, start)


@kernel
def publish(workspace: Workspace, instant: Instant, row: int) -> None:
    """Write the reactions at the scene's own time into a ``row`` of its tables, in place of means.

    The state's own, from which the next step is guessed, stay what they are.
    """
    system, state, start = workspace.system, workspace.state, workspace.start
    force, reaction = instant.force, instant.reaction
    copy(state.force, force)
    copy(state.reaction, reaction)
    accelerate(system, state, start, instant)
    write_reactions(
        system.shown,
        system.scalar,
        state.reaction,
        state.force,
        state.time[0],
        workspace.tables.reactions,
        row,
    )
    copy(force, state.force)
    copy(reaction, state.reaction)


@kernel
def march(
    workspace: Workspace, instant: Instant, h: float, first: int, last: int, schedule: np.ndarray
) -> int:
    """``newton.march`` with the reactions of every published row at its own time."""
    for k in range(first, last):
        if newton.march(workspace, h, k, k + 1, schedule) == k:
            return k
        if schedule[k] >= 0:
            publish(workspace, instant, schedule[k])
    return last


def solve_least(instant: Instant) -> None:
    """As ``solve``, of a singular matrix: least forces of joints that are not independent."""
    free, size = instant.unknowns.free, instant.unknowns.free.size
    A = np.zeros(size * size)
    A[instant.unknowns.dense_to] = instant.values[instant.unknowns.dense_from]
    right = instant.rows.reshape(-1)[free]
    least = np.linalg.lstsq(A.reshape(size, size), right, rcond=INDEPENDENT)[0]
    instant.solution.reshape(-1)[free] = least
