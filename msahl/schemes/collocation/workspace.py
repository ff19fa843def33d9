"""Arrays of a collocation step, and the state of the system at a time node within it."""

from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, to_increment
from msahl.algebra.vector import (
    ZERO,
    Vector,
    add,
    at,
    axpy,
    matrix_at,
    put,
    put_matrix,
    scale,
    times,
    transpose,
)
from msahl.elements.beams import instant
from msahl.elements.constraints import scalar
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.elements.signals import inputs
from msahl.elements.signals.group import Stages, new_stages
from msahl.formulations.absolute import local_rotation
from msahl.formulations.absolute.frames import (
    Frames,
    displacement,
    displacement_node,
    first_multiplier,
    frame_count,
    moving_count,
    put_rotation,
    rotation_node,
)
from msahl.jit.kernel import kernel, unit
from msahl.ports import forces
from msahl.schemes.collocation.tableau import Tableau, state_nodes
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace, node_count
from msahl.system.unknowns import Unknowns

BODY, FORCE, VIOLATION, MULTIPLIER = range(4)
"""Kinds of a block of the Jacobian: equations of bodies by bodies, of bodies by multipliers,
constraint equations by bodies, constraint equations by multipliers."""


class StageArrays(NamedTuple):
    """Unknowns, equations and work arrays of a step with s stages; nodes as in ``system.arrays``.

    "At the node" means at the time node that ``set_node`` was called for last.
    """

    tableau: Tableau
    # The Jacobian's entries
    linear: np.ndarray  # (9 m,) constant part of the constraints' derivatives
    needed: np.ndarray  # (q,) entries that the free unknowns have
    blocks: np.ndarray  # (b,) and the blocks that these are in
    block_kind: np.ndarray  # (q,) kind of the block that each belongs to
    is_rate_row: np.ndarray  # (q,) whether its row is a constraint equation between rates
    slot: np.ndarray  # (9 m,) index of each entry among the needed ones, -1 if it is not needed
    source: np.ndarray  # those of the sparse factors, likewise
    gravity_only: bool  # whether gravity and inertia are all that acts at c_i
    inverse_inertia: np.ndarray  # (b, 3, 3) of the bodies, body axes [1/(kg m^2)]
    # At the node
    state: State
    start: SystemWorkspace
    parameters: np.ndarray  # (f, 3) c, the rotation since the start of the step
    parameter_rates: np.ndarray  # (f, 3) c_dot [1/s]
    tangent: np.ndarray  # (f, 3, 3) H(c)
    base_change: np.ndarray  # (f, 3, 3) see ``equations._set_base_change``
    base_change_rate: np.ndarray  # (f, 3, 3) its derivative by t/h
    at_rest: np.ndarray  # (nodes, 3) zero increments, and the node's multipliers
    increments: np.ndarray  # (nodes, 3) u and l Q since the start of the step, no multipliers [m]
    accelerations: np.ndarray  # (nodes, 3) by the forces or the multipliers [m/s^2]
    violation: np.ndarray  # (nodes, 3) constraint violation [m]
    by_position: np.ndarray  # (9 m,) derivatives by positions
    by_rate: np.ndarray  # (9 m,) derivatives by rates
    derivatives: Derivatives  # these two, and what it takes to compute them
    # Of the step
    Z: np.ndarray  # (s, nodes, 3) unknowns z_1..z_s, multipliers 0..s-1
    F: np.ndarray  # (s, nodes, 3) equations
    impulse: np.ndarray  # (nodes, 3) change of momentum over the step, by mass [m/s]
    work: np.ndarray  # (w,) of loads and prescribed motions over the step [J]
    values: np.ndarray  # (q, s, s) the Jacobian, by stage of the unknown, then of the equation
    momentum_slopes: np.ndarray  # (6, 3, 3) of a body: see ``jacobian._add_rotational_inertia``
    momentum_loads: np.ndarray  # (2, 3) force and momentum of a body
    signals: Stages  # None where the system has none
    load_scale: np.ndarray  # (nodes,) largest part of a load along a coordinate, by node [m]
    last_load_scale: np.ndarray  # (nodes,) of these near the end of the last step, by h^2
    # For the next prediction
    rate: np.ndarray  # (s, nodes, 3) velocities at c_i, inertial axes
    last_rates: np.ndarray  # (s + 1, nodes, 3) those of the step to follow, and at its start last
    reaction: np.ndarray  # (s, j, 6) reactions of the joints at c_i [N, N m]
    factor: np.ndarray  # (s, k) of the forces that depend on time, at c_i
    last_step: np.ndarray  # (2,) start and size of the step to follow [s]; size 0: there is none
    prediction_window: np.ndarray  # (3,) these by the present step, and ``predicted_well``
    predicted_well: np.ndarray  # (1,) 1 if the last prediction was good, else 0
    rate_weights: np.ndarray  # (s, s + 2) of ``last_rates`` and the present one in the prediction
    multiplier_weights: np.ndarray  # (s, s) of the multipliers of the step to follow, h^2 included
    first_energy: np.ndarray  # (1,) energy balance at the start of the run [J]


def new_stage_arrays(
    system: System,
    unknowns: Unknowns,
    state: State,
    tableau: Tableau,
    like: StageArrays | None = None,
) -> StageArrays:
    """Return the arrays for steps by ``tableau`` from ``state``. They share with those of another
    degree, ``like`` them, what does not depend on it; these are work arrays and constants.
    """
    degree = tableau.force_weight.size
    shared = _shared_arrays(system, unknowns, state) if like is None else like._asdict()
    own = dict(
        tableau=tableau,
        values=np.zeros((shared["needed"].size, degree, degree)),
        factor=forces.new_node_factors(system.forces, degree),
        signals=new_stages(system.forces.signals, state_nodes(tableau)),
        **_step_arrays(system, state, degree),
        first_energy=np.zeros(1),
    )
    return StageArrays(**{**shared, **own})


def _shared_arrays(system: System, unknowns: Unknowns, state: State) -> dict[str, Any]:
    """Arrays that do not depend on the degree."""
    return dict(
        gravity_only=system.scalar is None
        and system.beams is None
        and not forces.acts_at_points(system.forces)
        and system.forces.signals is None,
        inverse_inertia=np.linalg.inv(system.bodies.inertia),
        work=np.zeros_like(state.work),
        momentum_slopes=np.zeros((6, 3, 3)),
        momentum_loads=np.zeros((2, 3)),
        **_jacobian_entries(system, unknowns),
        **_node_arrays(system, state),
    )


def _jacobian_entries(system: System, unknowns: Unknowns) -> dict[str, Any]:
    """Return the entries of the Jacobian that are needed, and what they belong to."""
    of_body = system.blocks < first_multiplier(system.frames)
    kind = np.select(
        [of_body.all(axis=1), of_body[:, 0], of_body[:, 1]], [BODY, FORCE, VIOLATION], MULTIPLIER
    )
    needed = np.union1d(unknowns.elimination.source, unknowns.dense_from)
    slot = np.full(system.constant.size, -1)
    slot[needed] = np.arange(needed.size)
    # Accelerations by multipliers have the opposite sign of a step's equations by its unknowns.
    sign = np.select([kind == BODY, kind == VIOLATION], [0.0, 1.0], -1.0)
    return {
        "linear": np.repeat(sign, 9) * system.constant,
        "needed": needed,
        "blocks": np.unique(needed[needed >= 9] // 9),
        "block_kind": kind[needed // 9],
        "is_rate_row": _rate_rows(system)[needed],
        "slot": slot,
        "source": slot[unknowns.elimination.source],
    }


def _node_arrays(system: System, state: State) -> dict[str, Any]:
    """Arrays of one time node."""
    nodes, vectors = (node_count(system), 3), (frame_count(system.frames), 3)
    node_state = State(*(array.copy() for array in state))
    start = new_system_workspace(system, node_state)
    if start.scalar is not None:
        start.scalar.coordinates.partial[0] = True  # only events need the gaps of open contacts
    arrays: dict[str, Any] = {"state": node_state, "start": start}
    for name in ("parameters", "parameter_rates"):
        arrays[name] = np.zeros(vectors)
    for name in ("tangent", "base_change", "base_change_rate"):
        arrays[name] = np.zeros((*vectors, 3))
    for name in ("increments", "accelerations", "violation"):
        arrays[name] = np.zeros(nodes)
    by_position, by_rate, scratch = np.zeros((3, system.constant.size))
    derivatives = Derivatives(by_position, by_rate, scratch, np.zeros(nodes))
    return arrays | {
        "derivatives": derivatives,
        "by_position": by_position,
        "by_rate": by_rate,
        "at_rest": derivatives.still,
    }


def _step_arrays(system: System, state: State, degree: int) -> dict[str, Any]:
    """Arrays of the unknowns and equations of a step, and of its prediction."""
    nodes = node_count(system)
    arrays: dict[str, Any] = {n: np.zeros((degree, nodes, 3)) for n in ("Z", "F", "rate")}
    return arrays | {
        "impulse": np.zeros((nodes, 3)),
        "load_scale": np.zeros(nodes),
        "last_load_scale": np.zeros(nodes),
        "last_rates": np.zeros((degree + 1, nodes, 3)),
        "reaction": np.zeros((degree, *state.reaction.shape)),
        "last_step": np.zeros(2),
        "prediction_window": np.zeros(3),
        "predicted_well": np.zeros(1),
        "rate_weights": np.zeros((degree, degree + 2)),
        "multiplier_weights": np.zeros((degree, degree)),
    }


def _rate_rows(system: System) -> np.ndarray:
    """(9 m,) which entries of the Jacobian are in constraint equations between rates."""
    rows = np.zeros((node_count(system), 3), dtype=bool)
    if system.scalar:
        group = system.scalar.equations
        place = group.place[~group.holonomic]
        rows[first_multiplier(system.frames) + place[:, 0], place[:, 1]] = True
    return np.repeat(rows[system.blocks[:, 0]].reshape(-1), 3)


@unit
def set_node(system: System, state: State, stages: StageArrays, h: float, n: int) -> None:
    """Set ``stages.state`` and ``stages.start`` to the time node ``n`` of the tableau; where only
    inertia and gravity act there, set just what inertia needs.
    """
    tableau = stages.tableau
    bare = stages.gravity_only and tableau.force_stage[n] >= 0
    tau, phi, slope = tableau.node_time[n], tableau.node_basis[n], tableau.node_basis_rate[n]
    frames, Z, node = system.frames, stages.Z, stages.state
    node.time[0] = state.time[0] + h * tau
    for b in range(moving_count(frames)):
        u, lc, v, lc_dot = ZERO, ZERO, ZERO, ZERO
        for j in range(phi.size):
            u_j, lc_j = displacement(frames, Z[j], b), at(Z[j], rotation_node(frames, b))
            u, lc = axpy(phi[j], u_j, u), axpy(phi[j], lc_j, lc)
            rate = slope[j] / h
            v, lc_dot = axpy(rate, u_j, v), axpy(rate, lc_j, lc_dot)
        c = scale(1.0 / frames.length[b], lc)
        put(stages.parameters, b, c)
        put(stages.parameter_rates, b, scale(1.0 / frames.length[b], lc_dot))
        put_matrix(stages.tangent, b, local_rotation.tangent(c))
        put(node.v, b, v)
        if bare:
            continue
        put(stages.increments, displacement_node(frames, b), u)
        put_rotation(frames, stages.increments, b, to_increment(c))
        put(node.x, b, add(at(state.x, b), u))
        put(node.p, b, compose(c, at(state.p, b)))
    if not bare:
        evaluate.prepare(system, node, stages.start)
        instant.set_strains(system.beams, stages.start.beams)
        inputs.save_reactions(system.forces.signals, stages.start.forces.signals, state.reaction)
    for b in range(moving_count(frames)):
        put(
            stages.start.frames.W,
            b,
            times(matrix_at(stages.tangent, b), at(stages.parameter_rates, b)),
        )
    for q in range(node.angle.size):
        node.angle[q] = state.angle[q]
    scalar.count_rotations(system.scalar, stages.start.scalar, node.angle)


@kernel
def moment_for_parameters(frames: Frames, stages: StageArrays, b: int) -> Vector:
    """Moment in ``stages.accelerations`` on frame ``b`` as its equations contain it: H^T M if the
    scheme is variational.
    """
    if not stages.tableau.is_variational:
        return at(stages.accelerations, rotation_node(frames, b))
    return times(
        transpose(matrix_at(stages.tangent, b)), at(stages.accelerations, rotation_node(frames, b))
    )
