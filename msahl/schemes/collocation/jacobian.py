"""Evaluates the Jacobian of a collocation step: the derivative of ``equations`` by the stages.

An entry of the Jacobian of the lowest order becomes a block (s, s), by stage of the unknown and of
the equation: the derivative by position or by rate at a time node, times the basis polynomials of
the unknown and the weights of the equation.
"""

import numpy as np

from msahl.algebra.vector import (
    IDENTITY,
    ZERO,
    Matrix,
    add,
    at,
    axpy,
    combine,
    matrix_at,
    multiple,
    product,
    put,
    put_matrix,
    scale,
    skew,
    times,
    transpose,
)
from msahl.elements.beams import stage as beams
from msahl.elements.constraints import coincide, scalar
from msahl.elements.constraints.products import PARTS, Q_A
from msahl.elements.signals import inputs, results, states
from msahl.elements.signals.group import Signals
from msahl.formulations.absolute import local_rotation
from msahl.formulations.absolute.equations import add_block
from msahl.formulations.absolute.frames import first_multiplier, rotation_node
from msahl.jit.kernel import apart, kernel, optional, unit
from msahl.ports import forces, sliding
from msahl.schemes.collocation.workspace import (
    BODY,
    FORCE,
    MULTIPLIER,
    VIOLATION,
    StageArrays,
    moment_for_parameters,
)
from msahl.system.arrays import System, SystemWorkspace


@kernel
def clear(system: System, stages: StageArrays) -> None:
    """Set the Jacobian to its constant part: each displacement in its own equation."""
    values = stages.values
    for e in range(values.shape[0]):
        for k in range(values.shape[1]):
            for j in range(values.shape[2]):
                values[e, k, j] = 0.0
            if stages.block_kind[e] == BODY:
                values[e, k, k] = system.constant[stages.needed[e]]


@unit
def add_constraints(system: System, stages: StageArrays, h: float, row: int, k: int) -> None:
    """Add the constraint equations of stage ``row`` and the constraint forces of stage ``k``."""
    _differentiate_constraints(system, stages)
    _convert_to_parameters(system, stages, False)
    _enter_constraints(stages, h, row, k)


@unit
def add_forces(
    system: System, start: SystemWorkspace, stages: StageArrays, h: float, i: int
) -> None:
    """Add the rotational inertia and the forces at c_i."""
    _add_rotational_inertia(system, start, stages, h, i)
    if not stages.gravity_only:
        _differentiate_forces(system, stages, h, i)
        _convert_to_parameters(system, stages, True)
        _enter_forces(system, stages, h, i)
        _enter_other_stages(system.forces.signals, system, stages, h, i)


@kernel
def _differentiate_constraints(system: System, stages: StageArrays) -> None:
    """Set ``by_position`` to the derivatives of the constraints and of the accelerations by the
    multipliers: by positions and by multipliers over mass.
    """
    values, node, frames = stages.by_position, stages.start, system.frames
    for e in range(values.size):
        values[e] = stages.linear[e]
    coincide.add_derivatives(system.coincide, node.coincide, frames, stages.at_rest, values)
    scalar.add_constraint_derivatives(system.scalar, node.scalar, frames, stages.at_rest, values)
    beams.add_rigid_derivatives(system.beams, node.beams, frames, stages.at_rest, values)


@kernel
def _differentiate_forces(system: System, stages: StageArrays, h: float, i: int) -> None:
    """Set ``by_position`` and ``by_rate`` to the derivatives of the accelerations by the forces."""
    position, rate, node, frames = stages.by_position, stages.by_rate, stages.start, system.frames
    for e in range(position.size):
        position[e], rate[e] = 0.0, 0.0
    group, out = system.scalar, stages.derivatives
    states.take_slopes(system.forces.signals, node.forces.signals, stages.signals, i, i)
    scalar.differentiate(group, node.scalar, frames, out.still)
    forces.add_derivatives(system.forces, node.forces, group, frames, stages.reaction[i], out)
    sliding.add_derivatives(
        *(system.forces.sliding, group, node.scalar, stages.reaction[i]),
        *(frames, node.frames, out),
    )
    forces.add_stage_derivatives(system.forces, node.forces, group, frames, h, out)
    scalar.add_rate_derivatives(group, node.scalar, frames, node.frames, out)
    beams.add_elastic_derivatives(
        system.beams, node.beams, frames, node.frames, h, stages.at_rest, (position, rate)
    )


@kernel
def _convert_to_parameters(system: System, stages: StageArrays, rated: bool) -> None:
    """Convert the derivatives by and of rotations from inertial axes to the rotation parameters:
    H^T (.) H, and the terms by which H changes the moments of ``stages.accelerations`` and, where
    ``rated``, the rates.
    """
    frames, bodies = system.frames, system.bodies
    first = first_multiplier(frames)
    for m in stages.blocks:
        row, column = system.blocks[m, 0], system.blocks[m, 1]
        rotates_row = row < first and frames.rotates[row]
        rotates_column = column < first and frames.rotates[column]
        if not (rotates_row or rotates_column):
            continue
        rotates_row = rotates_row and stages.tableau.is_variational
        H_row = matrix_at(stages.tangent, frames.of_node[row]) if rotates_row else IDENTITY
        H_column = matrix_at(stages.tangent, frames.of_node[column]) if rotates_column else IDENTITY
        position = product(product(transpose(H_row), block_at(stages.by_position, m)), H_column)
        if rated:
            rate = product(transpose(H_row), block_at(stages.by_rate, m))
            if rotates_column:
                f = frames.of_node[column]
                c, c_dot = at(stages.parameters, f), at(stages.parameter_rates, f)
                position = combine(
                    1.0, product(rate, local_rotation.momentum_slope(c, c_dot)), position
                )
            put_block(stages.by_rate, m, product(rate, H_column))
        put_block(stages.by_position, m, position)
    if not stages.tableau.is_variational:
        return
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        moment = at(stages.accelerations, rotation_node(frames, f))
        slope = local_rotation.rate_slope(at(stages.parameters, f), moment)
        add_block(stages.by_position, bodies.block[b], 1.0 / frames.length[f], slope)


@kernel
def block_at(values: np.ndarray, m: int) -> Matrix:
    """Return block ``m``."""
    e = 9 * m
    return (
        (values[e], values[e + 1], values[e + 2]),
        (values[e + 3], values[e + 4], values[e + 5]),
        (values[e + 6], values[e + 7], values[e + 8]),
    )


@kernel
def put_block(values: np.ndarray, m: int, M: Matrix) -> None:
    """Set block ``m``."""
    for i in range(3):
        for j in range(3):
            values[9 * m + 3 * i + j] = M[i][j]


@kernel
def _enter_constraints(stages: StageArrays, h: float, row: int, k: int) -> None:
    """Add the derivatives of the constraint equations of stage ``row`` and of the constraint forces
    of stage ``k`` to the Jacobian.
    """
    values, chi = stages.values, stages.tableau.chi
    for e in range(values.shape[0]):
        kind, value = stages.block_kind[e], stages.by_position[stages.needed[e]]
        if value == 0.0:
            continue
        if kind == VIOLATION:
            if row >= 0 and not stages.is_rate_row[e]:
                values[e, row, row] = value
        elif k >= 0 and (kind != BODY or row >= 0):
            column, share = (row, h * h) if kind == BODY else (k, 2.0)
            for j in range(chi.shape[0]):
                values[e, column, j] += share * chi[j, k] * value


@kernel
def _enter_forces(system: System, stages: StageArrays, h: float, i: int) -> None:
    """Add the derivatives of the forces at c_i to the Jacobian."""
    values, tableau, position, rate = (
        stages.values,
        stages.tableau,
        stages.by_position,
        stages.by_rate,
    )
    s = tableau.force_weight.size
    for e in range(values.shape[0]):
        entry = stages.needed[e]
        m, p, q = entry // 9, entry % 9 // 3, entry % 3
        by_place, by_rate, base_position, base_rate = position[entry], rate[entry], 0.0, 0.0
        if (
            tableau.is_variational
            and (stages.block_kind[e] == BODY or stages.block_kind[e] == FORCE)
            and system.frames.rotates[system.blocks[m, 0]]
        ):
            for r in range(3):
                base_change = stages.base_change[system.frames.of_node[system.blocks[m, 0]], p, r]
                base_position += base_change * position[9 * m + 3 * r + q]
                base_rate += base_change * rate[9 * m + 3 * r + q]
        if by_place == by_rate == base_position == base_rate == 0.0:
            continue
        if stages.block_kind[e] == FORCE or stages.block_kind[e] == MULTIPLIER:
            _enter_multiplier(stages, e, i, by_place, base_position)
            continue
        for k in range(s):
            phi, slope = h * h * tableau.basis[i, k], h * tableau.basis_rate[i, k]
            total, base_term = (
                phi * by_place + slope * by_rate,
                phi * base_position + slope * base_rate,
            )
            if stages.block_kind[e] == VIOLATION:
                values[e, k, i] += total / h
            else:
                for j in range(s):
                    values[e, k, j] += tableau.alpha[j, i] * total
                    values[e, k, j] -= (
                        tableau.constraint_time[j] * tableau.force_weight[i] * base_term
                    )


@kernel
def _enter_multiplier(stages: StageArrays, e: int, i: int, value: float, base_term: float) -> None:
    """Add the derivatives by an elastic multiplier of c_i: of the equations of bodies, or of its
    own equation, to entry ``e``.
    """
    tableau = stages.tableau
    if stages.block_kind[e] == MULTIPLIER:
        stages.values[e, i, i] += value
        return
    for j in range(tableau.force_weight.size):
        total = tableau.alpha[j, i] * value
        total -= tableau.constraint_time[j] * tableau.force_weight[i] * base_term
        stages.values[e, i, j] += 2.0 * total


@optional()
def save_input_derivatives(group: Signals, system: System, stages: StageArrays, i: int) -> None:
    """Save the derivatives of the signals' inputs at c_i, by the rotation parameters as
    ``_convert_to_parameters`` has them.
    """
    node, frames = stages.start.forces, system.frames
    forces.differentiate_signal_inputs(group, node, system.scalar, frames, stages.derivatives)
    for j in range(group.kind.size):
        for part in range(PARTS):
            place = at(node.signals.by_place[j], part)
            rate = at(node.signals.by_rate[j], part)
            f = inputs.frame_of_part(group, system.scalar, j, part)
            if f >= 0 and part % 2 == Q_A % 2:
                H = transpose(matrix_at(stages.tangent, f))
                c, c_dot = at(stages.parameters, f), at(stages.parameter_rates, f)
                by_c = times(transpose(local_rotation.momentum_slope(c, c_dot)), rate)
                place, rate = add(times(H, place), by_c), times(H, rate)
            put(stages.signals.by_place[i, j], part, place)
            put(stages.signals.by_rate[i, j], part, rate)


@optional()
def _enter_other_stages(
    group: Signals, system: System, stages: StageArrays, h: float, i: int
) -> None:
    """Add the derivatives of the signals' results at c_i by the motion at the other nodes, on which
    they depend by the auxiliary states.
    """
    own = stages.start.forces.signals
    for m in range(stages.tableau.force_weight.size if group.rate.size > 0 else 0):
        if m == i:
            continue
        states.take_slopes(group, own, stages.signals, i, m)
        for r in range(group.result.size):
            results.set_gradient(group, own, r)
            forces.set_result_row(
                system.forces, stages.start.forces, system.scalar, system.frames, 1.0, r, own.row
            )
            for part in range(PARTS):
                _enter_result(group, stages, h, (i, m), r, part)


@apart
def _enter_result(
    group: Signals, stages: StageArrays, h: float, at_stages: tuple[int, int], r: int, part: int
) -> None:
    """Add the derivative of a result at one stage, times what it adds to a ``part``, by the motion
    at another one.
    """
    own, first = stages.start.forces.signals, group.first_column[r]
    row, base = at(own.row, part), ZERO
    if part % 2 == Q_A % 2 and stages.tableau.is_variational:
        f = group.acting[r, part]
        row = times(transpose(matrix_at(stages.tangent, f)), row)
        base = times(matrix_at(stages.base_change, f), row)
    for c in range(group.first_column[r + 1] - first):
        block = group.block[first + c, part]
        by_place, by_rate = at(own.gradient, c), at(own.gradient_rate, c)
        for p in range(3):
            for q in range(3):
                e = stages.slot[block + 3 * p + q] if block > 0 else -1
                if e >= 0:
                    _enter_product(
                        stages, h, at_stages, e, (row[p], base[p]), (by_place[q], by_rate[q])
                    )


@kernel
def _enter_product(
    stages: StageArrays,
    h: float,
    at_stages: tuple[int, int],
    e: int,
    row: tuple[float, float],
    column: tuple[float, float],
) -> None:
    """Add the product of a ``row`` (force, base-change term) at one stage and of a ``column``
    (derivative by place, by rate) at another one to entry ``e``.
    """
    tableau, (i, m) = stages.tableau, at_stages
    for k in range(tableau.force_weight.size):
        slope = h * h * tableau.basis[m, k] * column[0] + h * tableau.basis_rate[m, k] * column[1]
        for j in range(tableau.force_weight.size):
            force = tableau.alpha[j, i] * row[0]
            base_term = tableau.constraint_time[j] * tableau.force_weight[i] * row[1]
            stages.values[e, k, j] += slope * (force - base_term)


@kernel
def _add_rotational_inertia(
    system: System, start: SystemWorkspace, stages: StageArrays, h: float, i: int
) -> None:
    """Add the derivatives of the rotational inertia at c_i to the Jacobian.

    ``stages.momentum_slopes``: derivatives by c and c_dot of the momentum (0, 1), of h dT/dc (2, 3)
    and of the term of ``equations._set_base_change`` (4, 5).
    """
    tableau, frames = stages.tableau, system.frames
    if not tableau.is_variational:
        _add_angular_momentum(system, stages, h, i)
        return
    for b in range(system.bodies.frame.size):
        f = system.bodies.frame[b]
        c, c_dot = at(stages.parameters, f), at(stages.parameter_rates, f)
        J, H = matrix_at(start.bodies.J, b), matrix_at(stages.tangent, f)
        z = times(J, local_rotation.rate(c, c_dot))
        by_c = local_rotation.rate_slope(c, c_dot)
        mass = product(H, product(J, transpose(H)))
        pi_c = combine(1.0, product(H, product(J, by_c)), local_rotation.momentum_slope(c, z))
        force_c = product(transpose(by_c), product(J, by_c))
        force_c = combine(1.0, local_rotation.curvature(c, z, c_dot), force_c)
        change, change_rate = (
            matrix_at(stages.base_change, f),
            matrix_at(stages.base_change_rate, f),
        )
        pi, force = local_rotation.momentum(c, z), times(transpose(by_c), z)
        moment = moment_for_parameters(frames, stages, f)
        force = axpy(frames.length[f] / frames.inverse_mass[f], moment, force)
        # Derivatives of the base-change term by c(t) and c_dot; those by c_k are in
        # ``_enter_rotation``.
        slope = local_rotation.square_slope(c_dot, scale(2 * h, pi))
        base_c = combine(1.0, product(change_rate, pi_c), slope)
        base_c = combine(h, product(change, force_c), base_c)
        base_c = combine(2.0 * h, local_rotation.square_slope(c, force), base_c)
        slope = local_rotation.square_slope(c, scale(2.0 * h, pi))
        base_c_dot = combine(1.0, product(change_rate, mass), slope)
        base_c_dot = combine(h, product(change, transpose(pi_c)), base_c_dot)
        put_matrix(stages.momentum_slopes, 0, pi_c)
        put_matrix(stages.momentum_slopes, 1, mass)
        put_matrix(stages.momentum_slopes, 2, multiple(h, force_c))
        put_matrix(stages.momentum_slopes, 3, multiple(h, transpose(pi_c)))
        put_matrix(stages.momentum_slopes, 4, base_c)
        put_matrix(stages.momentum_slopes, 5, base_c_dot)
        put(stages.momentum_loads, 0, force)
        put(stages.momentum_loads, 1, pi)
        _enter_rotation(system, stages, h, i, b)


@kernel
def _enter_rotation(system: System, stages: StageArrays, h: float, i: int, b: int) -> None:
    """Add ``stages.momentum_slopes`` and ``stages.momentum_loads`` of body ``b`` at c_i."""
    values, tableau, slope, Z = stages.values, stages.tableau, stages.momentum_slopes, stages.Z
    force, pi = at(stages.momentum_loads, 0), at(stages.momentum_loads, 1)
    frames, f = system.frames, system.bodies.frame[b]
    scaled = h * frames.inverse_mass[f] / frames.length[f] ** 2
    for p in range(3):
        for q in range(3):
            e = stages.slot[system.bodies.block[b] + 3 * p + q]
            if e < 0:
                continue
            for k in range(tableau.force_weight.size):
                phi, rate = scaled * tableau.basis[i, k], scaled * tableau.basis_rate[i, k] / h
                by_pi = phi * slope[0, p, q] + rate * slope[1, p, q]
                by_force = phi * slope[2, p, q] + rate * slope[3, p, q]
                base_term = phi * slope[4, p, q] + rate * slope[5, p, q]
                if tableau.is_variational:
                    load = axpy(rate, pi, scale(phi, force))
                    at_k = scale(-2.0 * h / frames.length[f], at(Z[k], rotation_node(frames, f)))
                    base_term += local_rotation.square_slope(at_k, load)[p][q]
                for j in range(tableau.force_weight.size):
                    total = tableau.beta[j, i] * by_pi + tableau.alpha[j, i] * by_force
                    total -= tableau.constraint_time[j] * tableau.force_weight[i] * base_term
                    values[e, k, j] += total


@kernel
def _add_angular_momentum(system: System, stages: StageArrays, h: float, i: int) -> None:
    """As ``_add_rotational_inertia`` for a scheme that is not variational: of the momentum J W."""
    node, bodies = stages.start, system.bodies
    for k in range(stages.momentum_slopes.shape[0]):
        put_matrix(stages.momentum_slopes, k, skew(ZERO))
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        J, H, W = matrix_at(node.bodies.J, b), matrix_at(stages.tangent, f), at(node.frames.W, f)
        c, c_dot = at(stages.parameters, f), at(stages.parameter_rates, f)
        # J rotates with the body, W = H c_dot.
        J_rate = combine(1.0, product(J, skew(W)), skew(scale(-1.0, times(J, W))))
        by_c = combine(1.0, product(J_rate, H), product(J, local_rotation.momentum_slope(c, c_dot)))
        put_matrix(stages.momentum_slopes, 0, by_c)
        put_matrix(stages.momentum_slopes, 1, product(J, H))
        _enter_rotation(system, stages, h, i, b)
