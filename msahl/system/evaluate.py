"""Evaluate a system at one configuration: forces, constraints, energies and their derivatives.

The configuration is that of a ``State``: places x, rotations p, velocities v, w and the time.
``prepare`` computes what all other functions need of it. Two forms are available:

**For the solvers**, as kernels: ``free_acceleration`` and ``joint_jacobian`` set the right-hand
side and the matrix of the index-1 problem

    [ M  -G^T ] [ a   ]   [ forces      ]         M   mass matrix
    [ G    0  ] [ lam ] = [ -dG/dt v    ]         G   derivative of the constraints by the places

divided by masses and lengths as the equations of a step are (``elements.frames``);
``set_reactions`` sets the joints' reactions from the multipliers lam, ``observe`` constraint
violations and energies.

**In plain units**, for linearisation and equilibrium: ``evaluate_at`` returns

    Q(q, v, t)     generalised forces: gravity, gyroscopic moments and all forces  [N, N m]
    dQ/dq, dQ/dv   their derivatives                    [N/m, ..., N s/m, ...]
    M              mass matrix                          [kg, kg m^2]
    g(q, t), G     constraint violations [m or rad] and their derivative by q

Coordinates are those of the nodes of the frames (``Frames``): a displacement [m] and a rotation
vector [rad] of each frame, both along inertial axes; rates are v [m/s] and W [rad/s], inertial
axes. A derivative by a rotation is that at a rotation of zero from the configuration, on the left:
the frame's axes become exp(dtheta) R, while v and W stay what they are.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.elements import reactions, rigid_body
from msahl.elements.beams import instant
from msahl.elements.beams import midpoint as beams
from msahl.elements.constraints import coincide, coordinates, scalar
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.elements.frames import first_multiplier, moving_count
from msahl.elements.frames import prepare as prepare_frames
from msahl.elements.signals import inputs
from msahl.jit.by_size import by_size
from msahl.jit.kernel import apart, kernel, unit
from msahl.ports import forces
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace, node_count


@kernel
def dt2(system: System, h: float) -> float:
    """Displacement per acceleration over a step h: h^2/2, more with a decaying scheme [s^2]."""
    return system.decay.share * h * h


@unit
def prepare(system: System, state: State, start: SystemWorkspace) -> None:
    """Compute what the other functions need of the configuration of ``state`` into ``start``."""
    prepare_frames(
        system.frames,
        state.p,
        state.v,
        state.w,
        state.v_rise,
        state.w_rise,
        system.decay.chi,
        start.frames,
    )
    rigid_body.prepare(system.bodies, start.frames.R, start.bodies)
    R = start.frames.R
    coincide.prepare(system.coincide, R, start.coincide)
    scalar.prepare(system.scalar, state.x, R, state.angle, start.scalar)
    instant.prepare(system.beams, state.x, R, start.beams)
    reactions.prepare(system.reactions, system.scalar, R, start.reaction_arms)
    forces.prepare(system.forces, start.forces, system.scalar, state.reaction, state.reaction_trend)
    inputs.prepare(
        system.forces.signals,
        start.forces.signals,
        start.frames,
        state.x,
        state.p,
    )
    inputs.save_state(
        system.forces.signals,
        start.forces.signals,
        state.time[0],
        state.auxiliary,
        state.reaction,
    )


@unit
def joint_jacobian(
    system: System, start: SystemWorkspace, h: float, Z: np.ndarray, values: np.ndarray
) -> None:
    """Set the block ``values`` to the derivative of inertia and constraint equations over a step
    ``h``, after the step's residual at ``Z``.

    For ``Z`` zero, at rest or for h -> 0 it is the matrix of the index-1 problem.
    """
    h2 = dt2(system, h)
    for i in range(values.size):
        values[i] = system.constant[i]
    frames = system.frames
    rigid_body.jacobian(system.bodies, frames, start.bodies, start.frames, h, h2, Z, values)
    coincide.jacobian(system.coincide, start.coincide, frames, h2, Z, values)
    scalar.joint_jacobian(system.scalar, start.scalar, frames, h2, Z, values)
    step = (h, h2, 0.5 * system.decay.chi)
    beams.jacobian(system.beams, start.beams, frames, step, Z, values)
    forces.isolate_multipliers(system.forces, values)


@apart
def set_reactions(system: System, state: State, start: SystemWorkspace, Z: np.ndarray) -> None:
    """Set the joints' reactions of ``state`` from its multipliers, after the residual at ``Z``."""
    reactions.sum_reactions(
        system.reactions,
        system.scalar,
        start.scalar,
        system.frames,
        start.reaction_arms,
        Z,
        state.force,
        state.reaction,
    )


@apart
def free_acceleration(
    system: System, state: State, start: SystemWorkspace, Z: np.ndarray, F: np.ndarray
) -> None:
    """Set ``F`` (nodes, 3) to the right-hand side of the index-1 problem: forces by mass [m/s^2],
    and minus the constraints' second derivatives at zero accelerations. ``Z`` is zero.
    """
    frames, t = system.frames, state.time[0]
    v, W = start.frames.v, start.frames.W
    rigid_body.free_acceleration(system.bodies, frames, start.bodies, start.frames, F)
    coincide.free_acceleration(system.coincide, start.coincide, W, F)
    scalar.rates(system.scalar, start.scalar, frames, start.frames, Z)
    scalar.free_acceleration(system.scalar, start.scalar, frames, v, W, t, F)
    instant.free_acceleration(system.beams, start.beams, frames, start.frames, F)
    forces.set_time(system.forces, start.forces, t)
    forces.set_compliant_loads(system.forces, start.forces, system.scalar, frames, F)
    forces.add_forces(system.forces, start.forces, system.scalar, frames, state.reaction, F)


@unit
def observe(
    system: System, state: State, start: SystemWorkspace, violation: np.ndarray, rate: np.ndarray
) -> tuple[float, float]:
    """Kinetic and potential energy [J] of the prepared state; elastic energy is part of the second.

    Sets ``violation`` and ``rate`` (k, 3), by the multipliers' nodes, to the constraint violations
    [m or rad] and their rates, from absolute positions.
    """
    coincide.violation(system.coincide, start.coincide, state.x, violation)
    coincide.violation_rate(system.coincide, start.coincide, start.frames, rate)
    scalar.observe(system.scalar, start.scalar, start.frames, state.time[0], violation, rate)
    instant.observe(system.beams, start.beams, start.frames, violation, rate)
    elastic = forces.elastic_energy(system.forces, start.forces, system.scalar)
    elastic += instant.energy(system.beams, start.beams)
    kinetic, potential = rigid_body.energy(system.bodies, state.x, state.v, state.w)
    return kinetic, potential + elastic


@kernel
def add_force_derivatives(
    system: System, state: State, start: SystemWorkspace, out: Derivatives
) -> None:
    """Add the derivatives of the forces in ``free_acceleration``, after it, to ``out``."""
    frames, motion = system.frames, start.frames
    scalar.differentiate(system.scalar, start.scalar, frames, out.still)
    rigid_body.add_derivatives(
        system.bodies, frames, start.bodies, motion, out.by_place, out.by_rate
    )
    group = system.forces
    forces.add_derivatives(group, start.forces, system.scalar, frames, state.reaction, out)
    forces.add_compliant_derivatives(group, start.forces, system.scalar, frames, out)


class Evaluation(NamedTuple):
    """A system at one configuration, in plain units; n coordinates, c constraint equations."""

    coordinate: np.ndarray  # (n,) number of each coordinate among the flat unknowns, 3 node + axis
    equation: np.ndarray  # (c,) likewise of each constraint equation
    mass: np.ndarray  # (n, n) M
    force: np.ndarray  # (n,) Q
    force_by_place: np.ndarray  # (n, n) dQ/dq
    force_by_rate: np.ndarray  # (n, n) dQ/dv
    violation: np.ndarray  # (c,) g; 0 of an equation between rates
    violation_rate: np.ndarray  # (c,) dg/dt
    constraint_jacobian: np.ndarray  # (c, n) G, of an equation between rates its derivative by v


def evaluate_at(system: System, state: State) -> Evaluation:
    """Evaluate ``system`` at the configuration of ``state``; matrices are dense."""
    state = state._replace(angle=state.angle.copy(), strain=state.strain.copy())
    start, Z = new_system_workspace(system, state), np.zeros((node_count(system), 3))
    rows, violation, rate = Z.copy(), np.zeros_like(state.force), np.zeros_like(state.force)
    by_place, by_rate, scratch = (np.zeros_like(system.constant) for _ in range(3))
    out = Derivatives(by_place, by_rate, scratch, Z)
    prepare(system, state, start)
    scalar.count_rotations(system.scalar, start.scalar, state.angle)
    instant.set_strains(system.beams, start.beams)
    free_acceleration(system, state, start, Z, rows)
    add_force_derivatives(system, state, start, out)
    observe(system, state, start, violation, rate)
    force_scale, place_scale = _scales(system)
    coordinate, equation = _coordinates(system), _equations(system)
    first = 3 * first_multiplier(system.frames)
    square, across = np.ix_(coordinate, coordinate), np.ix_(equation, coordinate)
    scale = force_scale[:, None] * place_scale
    G = dense_matrix(system, jacobian_at_rest(system, state)) * place_scale
    return Evaluation(
        coordinate=coordinate,
        equation=equation,
        mass=_mass(system, start)[square],
        force=(rows.reshape(-1) * force_scale)[coordinate],
        force_by_place=(dense_matrix(system, out.by_place) * scale)[square],
        force_by_rate=(dense_matrix(system, out.by_rate) * scale)[square],
        violation=violation.reshape(-1)[equation - first],
        violation_rate=rate.reshape(-1)[equation - first],
        constraint_jacobian=G[across] / _equation_scale(system).reshape(-1)[equation - first, None],
    )


def jacobian_at_rest(system: System, state: State) -> np.ndarray:
    """Return the block values of the index-1 problem's matrix in the configuration of ``state``."""
    rest = state._replace(v=np.zeros_like(state.v), w=np.zeros_like(state.w))
    start, size = new_system_workspace(system, rest), moving_count(system.frames)
    by_size(prepare, size)(system, rest, start)
    values, Z = np.zeros_like(system.constant), np.zeros((node_count(system), 3))
    if system.scalar:
        by_size(coordinates.evaluate, size)(
            system.scalar.coordinates, start.scalar.coordinates, system.frames, Z
        )
    # With h^2 = 2 an acceleration of 1 m/s^2 is a displacement of 1 m over the step.
    by_size(joint_jacobian, size)(system, start, math.sqrt(2.0), Z, values)
    instant.determine_resultants(system.beams, values)
    return values


def dense_matrix(system: System, values: np.ndarray) -> np.ndarray:
    """Return the (3 nodes, 3 nodes) matrix of block ``values``."""
    nodes = node_count(system)
    matrix = np.zeros((nodes, 3, nodes, 3))
    for (row, column), block in zip(
        system.blocks[1:].tolist(), values.reshape(-1, 3, 3)[1:], strict=True
    ):
        matrix[row, :, column, :] = block
    return matrix.reshape(3 * nodes, 3 * nodes)


def _coordinates(system: System) -> np.ndarray:
    """(n,) flat numbers of the coordinates of all frames that can move."""
    moving = slice(moving_count(system.frames))
    nodes = np.sort([*system.frames.displacement[moving], *system.frames.rotation[moving]])
    flat: np.ndarray = (3 * nodes[:, None] + np.arange(3)).reshape(-1)
    return flat


def _equations(system: System) -> np.ndarray:
    """(c,) flat numbers of all constraint equations."""
    first, points = first_multiplier(system.frames), system.coincide.a.size
    flat = list(range(3 * first, 3 * (first + points)))
    if system.scalar:
        flat += [3 * (first + node) + slot for node, slot in system.scalar.equations.place.tolist()]
    return np.array(flat, dtype=np.int64)


def _scales(system: System) -> tuple[np.ndarray, np.ndarray]:
    """(3 nodes,) force over acceleration in an equation, and unknown over coordinate."""
    frames = system.frames
    moving = slice(moving_count(frames))
    force, place = np.ones((2, node_count(system), 3))
    force[frames.displacement[moving]] = 1.0 / frames.inverse_mass[moving, None]
    force[frames.rotation[moving]] = (frames.length[moving] / frames.inverse_mass[moving])[:, None]
    place[frames.rotation] = frames.length[:, None]
    return force.reshape(-1), place.reshape(-1)


def _equation_scale(system: System) -> np.ndarray:
    """(k, 3) factor by which constraint equations in radians are multiplied [m], 1 for others."""
    scale = np.ones((system.multipliers.node.size, 3))
    if system.scalar:
        rows = system.scalar.equations
        scale[rows.place[:, 0], rows.place[:, 1]] = rows.scale
    return scale


def _mass(system: System, start: SystemWorkspace) -> np.ndarray:
    """(3 nodes, 3 nodes) mass matrix of all rigid bodies, inertial axes."""
    nodes, bodies = node_count(system), system.bodies
    M = np.zeros((nodes, 3, nodes, 3))
    for b, f in enumerate(bodies.frame.tolist()):
        u, theta = system.frames.displacement[f], system.frames.rotation[f]
        M[u, :, u, :] = np.eye(3) / bodies.inverse_mass[b]
        M[theta, :, theta, :] = start.bodies.J[b]
    return M.reshape(3 * nodes, 3 * nodes)
