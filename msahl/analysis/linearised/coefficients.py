"""The equations of motion linearised at one configuration, without a step.

    M dv'      = K dq + D dv + S ds + F_u du + G^T dlam             balance of forces and moments
    dq'        = dv + T dq                                          rates of the places
    G_h dq     = 0                                                  constraints between places
    G dv + B dq = 0                                                 their rates, and constraints
                                                                    between rates
    ds'        = s_q dq + s_v dv + s_s ds                           auxiliary states

    dq  displacement of each frame's origin [m] and a rotation vector [rad], inertial axes, on the
        left: the axes become exp(dtheta) R
    dv  change of v [m/s] and W [rad/s], inertial axes
    M   mass matrix;  K, D  derivatives of all forces by places and rates, where K contains those of
        the constraint forces G^T lam at fixed multipliers, and of the inertia, -d(M a)/dq
    T   as W is that of rotated axes, dtheta' = dW + W x dtheta;  for displacements T is zero
    G   derivative of the constraints by the places, or by the rates of those between rates
    B   derivative of the rates of the constraints by the places, at fixed v and W

Stress resultants of beams are multipliers with a compliance C, and times tau of damping; their
equations are minus those of the strains, so that forces are G^T lam:

    G_e dq + tau (G_e dv + B_e dq) + C dlam = 0

They are eliminated, which adds -G_e^T C^-1 (G_e + tau B_e) to K and -G_e^T C^-1 tau G_e to D, or
kept (``resultants``).

Derivatives are analytic, from the laws of the elements. They omit that friction's normal force
and inputs that are reactions of joints change with the motion, which ``reaction_feedback`` has.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msahl.analysis.linearised.plain_units import (
    acting_rows,
    coordinate_numbers,
    elastic_equations,
    equation_scale,
    evaluation_size,
    multiplier_numbers,
    scales,
)
from msahl.elements.beams import instant
from msahl.elements.beams import linear as beams
from msahl.elements.beams.group import Beams
from msahl.elements.constraints import coincide, scalar
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.elements.signals import inputs
from msahl.elements.signals.group import use_reactions
from msahl.expressions.tape import by_input, gradient
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.jit.by_size import by_size
from msahl.jit.kernel import unit
from msahl.ports import forces
from msahl.system import evaluate
from msahl.system.arrays import (
    State,
    System,
    SystemWorkspace,
    new_system_workspace,
    node_count,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Coefficients(NamedTuple):
    """A linearised system in plain units; n coordinates, c constraint equations, s states.

    With ``resultants`` the equations of elastic strains are among those of the constraints.
    """

    coordinate: np.ndarray  # (n,) number of each coordinate among the flat unknowns, 3 node + axis
    length: np.ndarray  # (n,) l of a rotation, 1 of a displacement
    rotational: np.ndarray  # (n,) whether a coordinate is one of a rotation
    holonomic: np.ndarray  # (c,) whether an equation constrains places
    mass: "csr_array"  # (n, n) M
    by_place: "csr_array"  # (n, n) K
    by_rate: "csr_array"  # (n, n) D
    drift: "csr_array"  # (n, n) T
    constraint: "csr_array"  # (c, n) G
    constraint_rate: "csr_array"  # (c, n) B; of constraints between places it may be missing
    by_state: np.ndarray  # (n, s) S
    state_by_place: np.ndarray  # (s, n)
    state_by_rate: np.ndarray  # (s, n)
    state_by_state: np.ndarray  # (s, s)
    velocity: np.ndarray  # (n,) v and W
    acceleration: np.ndarray  # (n,) their rates
    force: np.ndarray  # (n,) all forces without those of constraints [N, N m]
    state_rate: np.ndarray  # (s,) rates of the auxiliary states
    weight: float  # largest weight of a body [N]
    equation: np.ndarray  # (c,) number of each multiplier in ``State.force``, 3 node + axis
    compliance: "csr_array | None" = None  # (c, c) C; None where no strain is elastic


class Work(NamedTuple):
    """Arrays of ``differentiate`` beside those of the derivatives."""

    at_rest: np.ndarray  # (nodes, 3) zeros, and the multipliers by mass
    rows: np.ndarray  # (nodes, 3) right-hand side of the index-1 problem
    unused: np.ndarray  # (nodes, 3) receives forces of constraints
    constraint: np.ndarray  # (9 m,) derivatives of constraint forces and equations by places


@unit
def differentiate(
    system: System, state: State, start: SystemWorkspace, work: Work, out: Derivatives
) -> None:
    """Set the right-hand side of the index-1 problem, and add derivatives of the forces and of
    equations between rates to ``out``, those of constraint forces and equations to ``work``.
    """
    group, scalar_start, frames = system.scalar, start.scalar, system.frames
    evaluate.prepare(system, state, start)
    scalar.count_rotations(group, scalar_start, state.angle)
    instant.set_strains(system.beams, start.beams)
    evaluate.free_acceleration(system, state, start, out.still, work.rows)
    evaluate.add_force_derivatives(system, state, start, out)
    scalar.add_rate_derivatives(group, scalar_start, frames, start.frames, out)
    scalar.add_constraint_forces(group, scalar_start, frames, work.at_rest, work.unused)
    coincide.add_derivatives(system.coincide, start.coincide, frames, work.at_rest, work.constraint)
    scalar.add_constraint_derivatives(group, scalar_start, frames, work.at_rest, work.constraint)
    beams.add_derivatives(
        system.beams,
        start.beams,
        frames,
        start.frames,
        work.at_rest,
        work.constraint,
        out.by_place,
    )


class Evaluated(NamedTuple):
    """What ``differentiate`` computes, and the scales of its equations and unknowns."""

    start: SystemWorkspace
    rows: np.ndarray
    by_place: np.ndarray
    by_rate: np.ndarray
    constraint: np.ndarray
    coordinate: np.ndarray
    equation: np.ndarray
    force_scale: np.ndarray
    place_scale: np.ndarray
    equation_scale: np.ndarray


def coefficients(
    system: System, state: State, found: Evaluated | None = None, resultants: bool = False
) -> Coefficients:
    """Linearise ``system`` at ``state``, whose accelerations and multipliers are consistent, with
    stress ``resultants`` of beams as multipliers, or without; ``found`` is what ``evaluated``
    returns, if it is at hand.
    """
    found = found or evaluated(system, state)
    G, B = _constraints(system, found)
    M, T, inertia, velocity, acceleration = _inertia(system, state, found)
    K = _square(system, found, found.by_place) + _square(system, found, found.constraint) - inertia
    S, state_by_place, state_by_rate, state_by_state, rate = _auxiliary(system, found)
    force = (found.rows.reshape(-1) * found.force_scale)[found.coordinate]
    linear = Coefficients(
        coordinate=found.coordinate,
        length=found.place_scale[found.coordinate],
        rotational=system.frames.rotates[found.coordinate // 3].astype(bool),
        holonomic=holonomic(system),
        mass=M,
        by_place=K.tocsr(),
        by_rate=_square(system, found, found.by_rate),
        drift=T,
        constraint=G,
        constraint_rate=B,
        by_state=S,
        state_by_place=state_by_place,
        state_by_rate=state_by_rate,
        state_by_state=state_by_state,
        velocity=velocity,
        acceleration=acceleration,
        force=force,
        state_rate=rate,
        weight=_largest_weight(system),
        equation=found.equation - 3 * first_multiplier(system.frames),
    )
    if system.beams is None:
        return linear
    compliance, stiffness, damping = _laws(system.beams, linear.equation.size)
    if resultants:
        return linear._replace(compliance=compliance)
    return _without_resultants(linear, elastic_equations(system), stiffness, damping)


def _laws(group: Beams, equations: int) -> tuple["csr_array", "csr_array", np.ndarray]:
    """(c, c) w J C of all equations, its inverse for elastic ones, and (c,) damping times [s]."""
    from scipy.sparse import csr_array

    weight, first = group.weight[:, None, None], equations - group.damping.size
    six = np.arange(6)
    rows = first + 6 * np.arange(group.weight.size)[:, None, None] + six[:, None]
    columns = np.swapaxes(rows, 1, 2)
    at = np.stack(np.broadcast_arrays(rows, columns)).reshape(2, -1)
    compliance, inverse = (
        csr_array((blocks.reshape(-1), at), shape=(equations, equations))
        for blocks in (weight * group.compliance, group.stiffness / weight)
    )
    return compliance, inverse, np.concatenate([np.zeros(first), group.damping.reshape(-1)])


def _without_resultants(
    found: Coefficients, elastic: np.ndarray, stiffness: "csr_array", damping: np.ndarray
) -> Coefficients:
    """Return the coefficients with the forces of elastic strains among K and D."""
    G, B = found.constraint, found.constraint_rate
    loads, rigid = G.T @ stiffness, np.flatnonzero(~elastic)
    delayed = _scaled(G, damping, np.ones(G.shape[1]))
    rates = _scaled(B, damping, np.ones(G.shape[1]))
    return found._replace(
        by_place=(found.by_place - loads @ (G + rates)).tocsr(),
        by_rate=(found.by_rate - loads @ delayed).tocsr(),
        holonomic=found.holonomic[rigid],
        constraint=G[rigid],
        constraint_rate=B[rigid],
        equation=found.equation[rigid],
    )


def _largest_weight(system: System) -> float:
    masses = 1.0 / system.bodies.inverse_mass
    return float(masses.max(initial=0.0) * np.linalg.norm(system.bodies.gravity))


def depends_on_reactions(system: System) -> bool:
    """Return whether a force depends on reactions of joints, whose changes the derivatives omit."""
    return forces.depend_on_reactions(system.forces) or use_reactions(system.forces.signals)


def holonomic(system: System) -> np.ndarray:
    """(c,) whether each constraint equation constrains places."""
    scalars = np.zeros(0, dtype=bool)
    if system.scalar:
        scalars = system.scalar.equations.holonomic[acting_rows(system)]
    strains = np.ones(6 * len(system.beams.weight) if system.beams else 0, dtype=bool)
    return np.concatenate([np.ones(3 * system.coincide.a.size, dtype=bool), scalars, strains])


def evaluated(system: System, state: State) -> Evaluated:
    """Return all derivatives at ``state`` in the scaled units of a step, for ``coefficients``."""
    state = state._replace(angle=state.angle.copy(), strain=state.strain.copy())
    start, frames = new_system_workspace(system, state), system.frames
    at_rest, rows, unused, still = np.zeros((4, node_count(system), 3))
    first = first_multiplier(frames)
    at_rest[first:] = np.divide(
        state.force, system.unit, out=np.zeros_like(state.force), where=system.unit != 0.0
    )
    by_place, by_rate, scratch = (np.zeros_like(system.constant) for _ in range(3))
    is_equation = system.blocks[:, 0] >= first
    is_force = ~is_equation & (system.blocks[:, 1] >= first)
    sign = np.select([is_equation, is_force], [1.0, -1.0], 0.0)
    constraint = np.repeat(sign, 9) * system.constant
    work, out = (
        Work(at_rest, rows, unused, constraint),
        Derivatives(by_place, by_rate, scratch, still),
    )
    by_size(differentiate, evaluation_size(system))(system, state, start, work, out)
    force_scale, place_scale = scales(system)
    return Evaluated(
        start=start,
        rows=rows,
        by_place=by_place,
        by_rate=by_rate,
        constraint=constraint,
        coordinate=coordinate_numbers(system),
        equation=multiplier_numbers(system),
        force_scale=force_scale,
        place_scale=place_scale,
        equation_scale=np.concatenate([np.ones(3 * first), equation_scale(system).reshape(-1)]),
    )


def _sparse(
    system: System, values: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> "csr_array":
    """Return the ``rows`` and ``columns`` (flat numbers) of the matrix of block ``values``."""
    from scipy.sparse import coo_array

    size = 3 * node_count(system)
    place_row, place_column = np.full((2, size), -1)
    place_row[rows], place_column[columns] = np.arange(rows.size), np.arange(columns.size)
    three = np.arange(3)
    i = place_row[3 * system.blocks[1:, 0, None, None] + three[:, None]]
    j = place_column[3 * system.blocks[1:, 1, None, None] + three]
    i, j = (array.reshape(-1) for array in np.broadcast_arrays(i, j))
    data = values[9:]
    kept = (i >= 0) & (j >= 0) & (data != 0.0)
    shape = (rows.size, columns.size)
    return coo_array((data[kept], (i[kept], j[kept])), shape=shape).tocsr()


def _scaled(matrix: Any, left: np.ndarray, right: np.ndarray) -> "csr_array":
    """Return diag(left) matrix diag(right)."""
    from scipy.sparse import csr_array

    rows = matrix.tocsr()
    factor = np.repeat(left, np.diff(rows.indptr))
    data = factor * rows.data * right[rows.indices]
    return csr_array((data, rows.indices, rows.indptr), shape=rows.shape)


def _square(system: System, found: Evaluated, values: np.ndarray) -> "csr_array":
    """(n, n) derivative of forces and moments in plain units."""
    at = found.coordinate
    matrix = _sparse(system, values, at, at)
    return _scaled(matrix, found.force_scale[at], found.place_scale[at])


def _constraints(system: System, found: Evaluated) -> tuple["csr_array", "csr_array"]:
    """(c, n) derivative of constraint equations by places, or by rates, and of equations between
    rates by places.
    """
    left, right = 1.0 / found.equation_scale[found.equation], found.place_scale[found.coordinate]
    return tuple(
        _scaled(_sparse(system, values, found.equation, found.coordinate), left, right)
        for values in (found.constraint, found.by_place)
    )  # type: ignore[return-value]


def _inertia(
    system: System, state: State, found: Evaluated
) -> tuple["csr_array", "csr_array", "csr_array", np.ndarray, np.ndarray]:
    """M, T, d(M a)/dq, and the velocities and accelerations (n,)."""
    from scipy.sparse import coo_array

    frames, bodies = system.frames, system.bodies
    place = np.full(3 * node_count(system), -1)
    place[found.coordinate] = np.arange(found.coordinate.size)
    u = place[3 * frames.displacement[bodies.frame][:, None] + np.arange(3)]
    theta = place[3 * frames.rotation[bodies.frame][:, None] + np.arange(3)]
    J, W = found.start.bodies.J, found.start.frames.W[bodies.frame]
    alpha = state.alpha[bodies.frame]
    by_rotation = J @ skews(alpha) - skews(np.einsum("bij,bj->bi", J, alpha))
    masses = np.eye(3) / bodies.inverse_mass[:, None, None]
    n = found.coordinate.size

    def blocks(*pairs: tuple[np.ndarray, np.ndarray]) -> "csr_array":
        """The matrix of 3 x 3 blocks on the diagonal at the given numbers."""
        i = np.concatenate([np.repeat(at, 3, axis=1).reshape(-1) for at, _ in pairs])
        j = np.concatenate([np.tile(at, 3).reshape(-1) for at, _ in pairs])
        data = np.concatenate([values.reshape(-1) for _, values in pairs])
        return coo_array((data, (i, j)), shape=(n, n)).tocsr()

    velocity, acceleration = np.zeros((2, n))
    velocity[u], velocity[theta] = state.v[bodies.frame], W
    acceleration[u], acceleration[theta] = state.a[bodies.frame], alpha
    return (
        blocks((u, masses), (theta, J)),
        blocks((theta, skews(W))),
        blocks((theta, by_rotation)),
        velocity,
        acceleration,
    )


def skews(a: np.ndarray) -> np.ndarray:
    """(m, 3, 3) matrices of a x (.) for vectors (m, 3)."""
    matrices = np.zeros((len(a), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrices[:, i, j], matrices[:, j, i] = -a[:, k], a[:, k]
    return matrices


def _auxiliary(system: System, found: Evaluated) -> tuple[np.ndarray, ...]:
    """Derivatives of forces by the auxiliary states, of the states' rates by places, rates and
    states, and these rates.
    """
    group, signals_start = system.forces.signals, found.start.forces.signals
    n, s = found.coordinate.size, 0 if group is None else group.rate.size
    by_state, by_place, by_rate = np.zeros((n, s)), np.zeros((s, n)), np.zeros((s, n))
    by_states, rate = np.zeros((s, s)), np.zeros(s)
    if group is None or not s:
        return by_state, by_place, by_rate, by_states, rate
    first = group.kind.size
    forces_by_state = np.zeros((3 * node_count(system), s))
    for r in range(group.result.size):
        gradient(group.tape, signals_start.values, group.result[r])
        slopes = np.array([by_input(group.tape, signals_start.values, first + k) for k in range(s)])
        if slopes.any():
            row = result_row(system, found.start, r)
            forces_by_state += np.outer(row, slopes)
    for k in range(s):
        rate[k] = signals_start.values.value[group.rate[k]]
        by_place[k], by_rate[k], by_states[k] = expression_slopes(system, found, int(group.rate[k]))
    at = found.coordinate
    return found.force_scale[at, None] * forces_by_state[at], by_place, by_rate, by_states, rate


def result_row(system: System, start: SystemWorkspace, r: int) -> np.ndarray:
    """(3 nodes,) what a unit of result ``r`` of the signals adds to the equations by mass."""
    group, signals_start = system.forces.signals, start.forces.signals
    assert group is not None
    signals_start.row[:] = 0.0
    forces.set_result_row(
        system.forces, start.forces, system.scalar, system.frames, 1.0, r, signals_start.row
    )
    rows = np.zeros((node_count(system), 3))
    for part, f in enumerate(group.acting[r].tolist()):
        if 0 <= f < moving_count(system.frames):
            nodes = system.frames.rotation if part % 2 else system.frames.displacement
            rows[nodes[f]] += signals_start.row[part]
    return rows.reshape(-1)


def expression_slopes(
    system: System, found: Evaluated, place: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of the expression at a ``place`` on the tape: (n,) by places, (n,) by rates and
    (s,) by states.
    """
    group, signals_start = system.forces.signals, found.start.forces.signals
    assert group is not None
    flat = np.zeros((2, node_count(system), 3))
    gradient(group.tape, signals_start.values, place)
    for j in range(group.kind.size):
        slope = by_input(group.tape, signals_start.values, j)
        for part in range(4 if slope != 0.0 else 0):
            f = inputs.frame_of_part(group, system.scalar, j, part)
            if 0 <= f < moving_count(system.frames):
                node = (system.frames.rotation if part % 2 else system.frames.displacement)[f]
                flat[0, node] += slope * signals_start.by_place[j, part]
                flat[1, node] += slope * signals_start.by_rate[j, part]
    states = np.array(
        [
            by_input(group.tape, signals_start.values, group.kind.size + k)
            for k in range(group.rate.size)
        ]
    )
    scaled = (flat.reshape(2, -1) * found.place_scale)[:, found.coordinate]
    return scaled[0], scaled[1], states
