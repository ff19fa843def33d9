"""Evaluate a system at one configuration: forces, constraints, energies and their derivatives.

The configuration is that of a ``State``: places x, rotations p, velocities v, w and the time.
``prepare`` computes what all other functions need of it. ``free_acceleration`` and
``joint_jacobian`` set the right-hand side and the matrix of the index-1 problem

    [ M  -G^T ] [ a   ]   [ forces      ]         M   mass matrix
    [ G    0  ] [ lam ] = [ -dG/dt v    ]         G   derivative of the constraints by the places

divided by masses and lengths as the equations of a step are (``formulations.absolute.frames``);
``set_reactions`` sets the joints' reactions from the multipliers lam, ``observe`` constraint
violations and energies. ``add_force_derivatives`` adds dQ/dq and dQ/dv in the same units;
``analysis.linearised`` has all of it in plain units.
"""

import math

import numpy as np

from msahl.elements import reactions
from msahl.elements.beams import instant
from msahl.elements.beams import midpoint as beams
from msahl.elements.constraints import coincide, coordinates, scalar
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.elements.signals import inputs
from msahl.formulations.absolute import rigid_body
from msahl.formulations.absolute.frames import moving_count
from msahl.formulations.absolute.frames import prepare as prepare_frames
from msahl.jit.by_size import by_size
from msahl.jit.kernel import apart, kernel, unit
from msahl.ports import forces, sliding
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
    """Set the reactions of ``state`` from its multipliers, after the residual at ``Z``."""
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
    sliding.set_forces(system.forces.sliding, system.scalar, state.force, state.reaction)


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
