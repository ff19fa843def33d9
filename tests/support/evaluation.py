"""A system at one configuration in plain units, with dense matrices:

    Q(q, v, t)     generalised forces: gravity, gyroscopic moments and all forces  [N, N m]
    dQ/dq, dQ/dv   their derivatives                    [N/m, ..., N s/m, ...]
    M              mass matrix                          [kg, kg m^2]
    g(q, t), G     constraint violations [m or rad] and their derivative by q

Coordinates are those of the nodes of the frames (``Frames``): a displacement [m] and a rotation
vector [rad] of each frame, both along inertial axes; rates are v [m/s] and W [rad/s], inertial
axes. A derivative by a rotation is that at a rotation of zero from the configuration, on the left:
the frame's axes become exp(dtheta) R, while v and W stay what they are.
"""

from typing import NamedTuple

import numpy as np

from msahl.analysis.linearised.plain_units import (
    coordinate_numbers,
    equation_scale,
    joint_equation_numbers,
    scales,
)
from msahl.elements.beams import instant
from msahl.elements.constraints import scalar
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.formulations.absolute.frames import first_multiplier
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace, node_count
from msahl.system.evaluate import (
    add_force_derivatives,
    free_acceleration,
    jacobian_at_rest,
    observe,
    prepare,
)


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
    force_scale, place_scale = scales(system)
    coordinate, equation = coordinate_numbers(system), joint_equation_numbers(system)
    first = 3 * first_multiplier(system.frames)
    square, across = np.ix_(coordinate, coordinate), np.ix_(equation, coordinate)
    scale = force_scale[:, None] * place_scale
    G = dense_matrix(system, jacobian_at_rest(system, state)) * place_scale
    equation_scales = equation_scale(system).reshape(-1)[equation - first, None]
    return Evaluation(
        coordinate=coordinate,
        equation=equation,
        mass=_mass(system, start)[square],
        force=(rows.reshape(-1) * force_scale)[coordinate],
        force_by_place=(dense_matrix(system, out.by_place) * scale)[square],
        force_by_rate=(dense_matrix(system, out.by_rate) * scale)[square],
        violation=violation.reshape(-1)[equation - first],
        violation_rate=rate.reshape(-1)[equation - first],
        constraint_jacobian=G[across] / equation_scales,
    )


def dense_matrix(system: System, values: np.ndarray) -> np.ndarray:
    """Return the (3 nodes, 3 nodes) matrix of block ``values``."""
    nodes = node_count(system)
    matrix = np.zeros((nodes, 3, nodes, 3))
    for (row, column), block in zip(
        system.blocks[1:].tolist(), values.reshape(-1, 3, 3)[1:], strict=True
    ):
        matrix[row, :, column, :] = block
    return matrix.reshape(3 * nodes, 3 * nodes)


def _mass(system: System, start: SystemWorkspace) -> np.ndarray:
    """(3 nodes, 3 nodes) mass matrix of all rigid bodies, inertial axes."""
    nodes, bodies = node_count(system), system.bodies
    M = np.zeros((nodes, 3, nodes, 3))
    for b, f in enumerate(bodies.frame.tolist()):
        u, theta = system.frames.displacement[f], system.frames.rotation[f]
        M[u, :, u, :] = np.eye(3) / bodies.inverse_mass[b]
        M[theta, :, theta, :] = start.bodies.J[b]
    return M.reshape(3 * nodes, 3 * nodes)
