"""Computes accelerations and constraint forces of a state at its own time: the index-1 problem.

    [ M  -G^T ] [ a   ]   [ forces      ]
    [ G    0  ] [ lam ] = [ -dG/dt v    ]

    M, G      mass matrix, derivative of the constraints by positions
    a, lam    accelerations, multipliers
    v         velocities

The multipliers of a step of order 2 are means over it: of order 2 at its middle, of order 1 at its
ends. The forces here are those at one time, as accurate as the state. The matrix is the limit of
the Jacobian of a step for h -> 0, where the terms of the forces (with h^2) and of the angular
velocities (with h) vanish. The same matrix projects positions and velocities onto the constraints,
by the least change weighted by mass.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import add, at, copy, matrix_at, put, scale, times, transpose
from msahl.elements.beams import instant as beams
from msahl.elements.constraints import scalar
from msahl.elements.reactions import MOST_ROUNDS, is_unchanged, write_reactions
from msahl.formulations.absolute.frames import (
    displacement_node,
    first_multiplier,
    moving_count,
    rotation_increment,
    rotation_node,
)
from msahl.formulations.absolute.rigid_body import write_accelerations
from msahl.jit.kernel import apart, kernel, unit
from msahl.linalg import dense, sparse_lu
from msahl.linalg.elimination import new_factor
from msahl.ports import forces, sliding
from msahl.schemes.common.workspace import Workspace
from msahl.start.redundancy import INDEPENDENT
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, node_count
from msahl.system.reductions import all_unknowns
from msahl.system.unknowns import Unknowns, choose

NO_STEP = 1e-100
"""Step size [s] of the limit in which the Jacobian contains only masses and constraints; its square
is still a normal number."""
LEAST = (1.0, -9.0, 11.0, -4.0)
"""What makes relaxed multipliers the least ones. With S = G M^-1 G^T, of eigenvalues s, the relaxed
ones are b/(s + e) for b/s. A solution for e times them multiplies them by q = e/(s + e), which is
1e-7 or less for constraints, and nearly 1 where s is a rounding error. With these weights of q to
q^4 the sum

    1 + q - 9 q^2 + 11 q^3 - 4 q^4 = (1 - q)^3 (1 + 4 q) = (s + e)/s + O(q^2)

gives b/s to round-off. Where s is round-off, 1e-5 of e, 1e-15 is left: b is there what the step's
error makes of dG/dt v, so b/(s + e) may be thousands of times as large as all reactions."""


class Instant(NamedTuple):
    """Work arrays of the index-1 problem of one system."""

    unknowns: Unknowns
    Z: np.ndarray  # (nodes, 3) zeros: no step is taken
    values: np.ndarray  # block values of the matrix
    factor: np.ndarray  # its sparse factors
    rows: np.ndarray  # (nodes, 3) right-hand side
    y: np.ndarray  # (f,) the same in the order of elimination
    solution: np.ndarray  # (nodes, 3)
    force: np.ndarray  # (k, 3) copy of the state's multipliers
    reaction: np.ndarray  # (j, 6) copy of its reactions
    last: np.ndarray  # (j, 6) reactions of the previous iteration
    a: np.ndarray  # (f, 3) accelerations of the frames [m/s^2]
    alpha: np.ndarray  # (f, 3) their angular accelerations [rad/s^2]
    publishes_reactions: bool  # whether tables have reactions at the output times, not means


def new_instant(
    system: System, unknowns: Unknowns | None = None, publishes_reactions: bool = True
) -> Instant:
    """Return the work arrays for any state of ``system``, for all its unknowns or those given."""
    if unknowns is None:
        unknowns = choose(system, all_unknowns(system))
    nodes = (node_count(system), 3)
    count = sliding.reaction_count(system.forces.sliding, system.reactions.child.size)
    return Instant(
        unknowns=unknowns,
        Z=np.zeros(nodes),
        values=np.zeros_like(system.constant),
        factor=new_factor(unknowns.elimination),
        rows=np.zeros(nodes),
        y=np.zeros(unknowns.elimination.order.size),
        solution=np.zeros(nodes),
        force=np.zeros((system.multipliers.node.size, 3)),
        reaction=np.zeros((count, 6)),
        last=np.zeros((count, 6)),
        a=np.zeros((system.frames.length.size, 3)),
        alpha=np.zeros((system.frames.length.size, 3)),
        publishes_reactions=publishes_reactions,
    )


@unit
def assemble(
    system: System, state: State, start: SystemWorkspace, instant: Instant, slides: bool
) -> None:
    """Set the right-hand side ``rows`` and factor the matrix, with the friction of contacts if it
    ``slides``.
    """
    instant.rows[:] = 0.0
    evaluate.free_acceleration(system, state, start, instant.Z, instant.rows)
    evaluate.joint_jacobian(system, start, NO_STEP, instant.Z, instant.values)
    if slides:
        dt2 = evaluate.dt2(system, NO_STEP)
        group, place = system.forces.sliding, start.scalar
        sliding.add_to_matrix(group, system.scalar, place, system.frames, dt2, instant.values)
    sparse_lu.factor(instant.unknowns.elimination, instant.values, instant.factor)


@apart
def solve(instant: Instant) -> None:
    """Solve for the right-hand side ``rows``; the ``solution`` is zero where it is not free."""
    order = instant.unknowns.elimination.order
    dense.gather(order, instant.rows, instant.y)
    sparse_lu.solve(instant.unknowns.elimination, instant.factor, instant.y)
    dense.scatter(order, instant.y, instant.solution)


@kernel
def remove_relaxation(system: System, instant: Instant) -> None:
    """Take out of the ``solution`` what the relaxation e changed in it, and of its multipliers what
    redundant constraints leave undetermined in them: see ``LEAST``.

    That is much where the velocities satisfy the constraints but for an error of the step: then
    dG/dt v is in part what no acceleration can give.
    """
    order, first = instant.unknowns.elimination.order, first_multiplier(system.frames)
    for k in range(order.size):
        instant.y[k] = instant.solution[order[k] // 3, order[k] % 3]
    for weight in LEAST:
        for k in range(order.size):
            is_multiplier = order[k] // 3 >= first
            instant.y[k] = -system.relaxation * instant.y[k] if is_multiplier else 0.0
        sparse_lu.solve(instant.unknowns.elimination, instant.factor, instant.y)
        for k in range(order.size):
            instant.solution[order[k] // 3, order[k] % 3] += weight * instant.y[k]


@kernel
def set_reactions(system: System, state: State, start: SystemWorkspace, instant: Instant) -> None:
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

    Friction depends on reactions, and these on friction: the iteration ends when the reactions do
    not change. Each iteration leaves about the coefficient of friction times the last change.
    """
    for _ in range(MOST_ROUNDS):
        copy(state.reaction, instant.last)
        assemble(system, state, start, instant, True)
        solve(instant)
        if system.relaxation > 0.0:
            remove_relaxation(system, instant)
        set_reactions(system, state, start, instant)
        if not forces.depend_on_reactions(system.forces) or is_unchanged(
            state.reaction, instant.last
        ):
            break


@kernel
def projection_rounds(system: System) -> int:
    """Number of projections: the relaxation of redundant constraints weakens each of them."""
    return 3 if system.relaxation > 0.0 else 1


@kernel
def solve_projection(
    system: System, state: State, start: SystemWorkspace, violation: np.ndarray, instant: Instant
) -> None:
    """Set the ``solution`` to the least change, weighted by mass, that removes the ``violation``
    (k, 3) [m] or [m/s].
    """
    first = first_multiplier(system.frames)
    assemble(system, state, start, instant, False)
    for node in range(instant.rows.shape[0]):
        for i in range(3):
            instant.rows[node, i] = 0.0 if node < first else -violation[node - first, i]
    solve(instant)


@unit
def project_velocities(
    system: System,
    state: State,
    start: SystemWorkspace,
    violation: np.ndarray,
    rate: np.ndarray,
    instant: Instant,
) -> None:
    """Project the velocities onto the constraints, by the least change weighted by mass; set
    ``violation`` and ``rate`` (k, 3) to the violations at position level [m] and at velocity level.
    """
    frames = system.frames
    for _ in range(projection_rounds(system)):
        evaluate.observe(system, state, start, violation, rate)
        scalar.in_metres(system.scalar, violation, rate)
        beams.in_metres(system.beams, violation, rate)
        solve_projection(system, state, start, rate, instant)
        for b in range(moving_count(frames)):
            R = matrix_at(start.frames.R, b)
            dW = rotation_increment(frames, instant.solution, b)
            put(state.v, b, add(at(state.v, b), at(instant.solution, displacement_node(frames, b))))
            put(state.w, b, add(at(state.w, b), times(transpose(R), dW)))
        scalar.motion_work(system.scalar, frames, state.time[0], 1.0, instant.solution, state.work)
        evaluate.prepare(system, state, start)


@kernel
def write_instantaneous_reactions(workspace: Workspace, instant: Instant, row: int) -> None:
    """Write the reactions at the time of the state to a ``row`` of the tables, instead of means,
    and the accelerations if they are wanted.

    Those in the state, from which the next step is predicted, are not changed.
    """
    system, state, start = workspace.system, workspace.state, workspace.start
    force, reaction = instant.force, instant.reaction
    copy(state.force, force)
    copy(state.reaction, reaction)
    accelerate(system, state, start, instant)
    if instant.publishes_reactions:
        write_reactions(
            system.shown,
            system.scalar,
            state.reaction,
            state.force,
            state.time[0],
            workspace.tables.reactions,
            row,
        )
        beams.write_resultants(system.beams, state.force, workspace.tables.resultants, row)
    if workspace.tables.accelerations.shape[1] > 0:
        for f in range(moving_count(system.frames)):
            put(instant.a, f, at(instant.solution, displacement_node(system.frames, f)))
            by_length = at(instant.solution, rotation_node(system.frames, f))
            put(instant.alpha, f, scale(1.0 / system.frames.length[f], by_length))
        write_accelerations(
            system.bodies,
            start.frames,
            state.w,
            instant.a,
            instant.alpha,
            workspace.tables.accelerations,
            row,
        )
    copy(force, state.force)
    copy(reaction, state.reaction)


def solve_least(instant: Instant) -> None:
    """Solve as ``solve`` if the matrix is singular: the least forces of redundant constraints; nan
    where numbers went beyond what a computer holds, as the solution of a regular matrix is.
    """
    free, size = instant.unknowns.free, instant.unknowns.free.size
    A = np.zeros(size * size)
    A[instant.unknowns.dense_to] = instant.values[instant.unknowns.dense_from]
    right = instant.rows.reshape(-1)[free]
    if np.isfinite(A).all() and np.isfinite(right).all():
        least = np.linalg.lstsq(A.reshape(size, size), right, rcond=INDEPENDENT)[0]
    else:
        least = np.full(size, np.nan)
    instant.solution.reshape(-1)[free] = least
