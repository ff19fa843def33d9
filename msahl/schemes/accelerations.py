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
from msahl.elements import along
from msahl.elements.reactions import MOST_ROUNDS, stands
from msahl.elements.reactions import publish as publish_reactions
from msahl.jit.kernel import apart, kernel
from msahl.linalg import dense, sparse_lu
from msahl.schemes.midpoint import equations, newton
from msahl.schemes.midpoint.load_moments import NO_STEP
from msahl.schemes.midpoint.workspace import Scene
from msahl.start.redundancy import INDEPENDENT
from msahl.system.arrays import Start, State, System, node_count
from msahl.system.reductions import all_unknowns
from msahl.system.unknowns import Unknowns, choose


class Station(NamedTuple):
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


def new_station(system: System, unknowns: Unknowns | None = None) -> Station:
    """Room for any state of ``system``; of all its unknowns, unless some are known not to move."""
    if unknowns is None:
        unknowns = choose(system, all_unknowns(system))
    nodes = (node_count(system), 3)
    return Station(
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
def free(system: System, state: State, start: Start, station: Station) -> None:
    """Set the ``rows`` to what accelerations must balance, and factor the matrix."""
    for node in range(station.rows.shape[0]):
        for i in range(3):
            station.rows[node, i] = 0.0
    equations.free_acceleration(system, state, start, station.Z, station.rows)
    equations.joint_jacobian(system, start, NO_STEP, station.Z, station.values)
    sparse_lu.factor(station.unknowns.elimination, station.values, station.factor)


@kernel
def solve(station: Station) -> None:
    """Solve for the ``rows`` by the factors; the ``solution`` is zero at what is not free."""
    order = station.unknowns.elimination.order
    dense.gather(order, station.rows, station.y)
    sparse_lu.solve(station.unknowns.elimination, station.factor, station.y)
    dense.spread(order, station.y, station.solution)


@kernel
def react(system: System, state: State, start: Start, station: Station) -> None:
    """Set the state's multipliers and reactions from the ``solution``."""
    first = 2 * system.bodies.inverse_mass.size
    for k in range(state.force.shape[0]):
        for i in range(3):
            state.force[k, i] = station.solution[first + k, i] * system.unit[k, i]
    equations.react(system, state, start, station.Z)


@apart
def accelerate(system: System, state: State, start: Start, station: Station) -> None:
    """Set the ``solution`` to accelerations a, l alpha and multipliers over their units, and the
    state's reactions; ``start`` is prepared.

    Friction presses by the reaction, which depends on friction: rounds until it stands still, each
    of which leaves about the coefficient of friction times the change before.
    """
    for _ in range(MOST_ROUNDS):
        copy(state.reaction, station.last)
        free(system, state, start, station)
        solve(station)
        react(system, state, start, station)
        if not along.rubs(system.along) or stands(state.reaction, station.last):
            break


@kernel
def rounds(system: System) -> int:
    """How often a change must be asked for where the relaxation of redundant joints takes a part
    of each away.
    """
    return 3 if system.relaxation > 0.0 else 1


@kernel
def undo(system: System, state: State, start: Start, gap: np.ndarray, station: Station) -> None:
    """Set the ``solution`` to the least change by mass that takes away the ``gap`` (k, 3) [m]."""
    first = 2 * system.bodies.inverse_mass.size
    free(system, state, start, station)
    for node in range(station.rows.shape[0]):
        for i in range(3):
            station.rows[node, i] = 0.0 if node < first else -gap[node - first, i]
    solve(station)


@kernel
def keep_closed(
    system: System, state: State, start: Start, gap: np.ndarray, rate: np.ndarray, station: Station
) -> None:
    """Change the velocities, least by mass, so that no joint opens; ``gap`` and ``rate`` (k, 3) are
    set to the gaps [m] and what is left of their rates.
    """
    bodies = system.bodies
    for _ in range(rounds(system)):
        equations.observe(system, state, start, gap, rate)
        along.in_metres(system.along, gap, rate)
        undo(system, state, start, rate, station)
        for b in range(bodies.inverse_mass.size - 1):
            R = matrix_at(start.bodies.R, b)
            dW = scale(1.0 / bodies.length[b], at(station.solution, 2 * b + 1))
            put(state.v, b, add(at(state.v, b), at(station.solution, 2 * b)))
            put(state.w, b, add(at(state.w, b), times(transpose(R), dW)))
        along.drive_work(system.along, bodies, state.time[0], 1.0, station.solution, state.work)
        equations.prepare(system, state, start)


@kernel
def publish(scene: Scene, station: Station, row: int) -> None:
    """Write the reactions at the scene's own time into a ``row`` of its tables, in place of means.

    The state's own, from which the next step is guessed, stay what they are.
    """
    system, state, start = scene.system, scene.state, scene.start
    force, reaction = station.force, station.reaction
    copy(state.force, force)
    copy(state.reaction, reaction)
    accelerate(system, state, start, station)
    publish_reactions(
        system.shown,
        system.along,
        state.reaction,
        state.force,
        state.time[0],
        scene.tables.reactions,
        row,
    )
    copy(force, state.force)
    copy(reaction, state.reaction)


@kernel
def march(scene: Scene, station: Station, h: float, first: int, last: int, plan: np.ndarray) -> int:
    """``newton.march`` with the reactions of every published row at its own time."""
    for k in range(first, last):
        if newton.march(scene, h, k, k + 1, plan) == k:
            return k
        if plan[k] >= 0:
            publish(scene, station, plan[k])
    return last


def solve_least(station: Station) -> None:
    """As ``solve``, of a singular matrix: least forces of joints that are not independent."""
    free, size = station.unknowns.free, station.unknowns.free.size
    A = np.zeros(size * size)
    A[station.unknowns.dense_to] = station.values[station.unknowns.dense_from]
    right = station.rows.reshape(-1)[free]
    least = np.linalg.lstsq(A.reshape(size, size), right, rcond=INDEPENDENT)[0]
    station.solution.reshape(-1)[free] = least
