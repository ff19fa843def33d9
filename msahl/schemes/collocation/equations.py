"""Evaluates the equations of a collocation step: Hamilton's principle with polynomials of degree s.

The nodes are those of a ``Tableau``, the only difference between the gauss and the radau scheme:
t_j where constraints hold, c_i where forces and inertia act, and where constraint forces act. For
each body and j = 1..s

    z_j - h t_j v0 + h^2 sum_i alpha_ji a_i + h^2 sum_k chi_jk G_k^T lam_k / m          = 0
    (h (sum_i beta_ji pi_i - t_j (L0 + E)) + h^2 sum_i alpha_ji (dT/dc + H^T M)_i
                                     + h^2 sum_k chi_jk H_k^T M_k(lam_k)) / (m l)       = 0
    constraints at t_1 ... t_s = 1;   those between rates at c_1 ... c_s

    z = (u, l c)   displacement from the start of the step, and l times the rotation parameters c
                   of ``local_rotation`` [m]
    a = F/m        acceleration by the forces [m/s^2]         M       their moment [N m]
    pi, T, H       momentum of c, kinetic energy, tangent: see ``local_rotation``
    lam_k, G_k     multipliers at node k, derivative of the constraints there
    L0             angular momentum at the start, inertial axes [kg m^2/s]
    E              term due to the change of the orientation from which c counts
                   (``_set_base_change``)

All equations are in metres, with multipliers as in ``midpoint.equations``. The momenta at the end
are those at the start plus E and all impulses; lam_s makes the velocities at the end satisfy the
constraints.

The above is a variational scheme (gauss). Radau's is not: it balances the angular momentum itself,
with L = R J R^T W for pi, M for dT/dc + H^T M, and without E.

Forces are evaluated at one configuration at a time. A law of time enters by its moments over the
step (``ports.concentrated``), not by its values at the nodes.

Source: see ``tableau``; the rotation parameters, the scaling and the treatment of constraints
between rates (at c_i, with their forces where those of the others are) are ours.
"""

import numpy as np

from msahl.algebra.rotation import compose, matrix
from msahl.algebra.vector import (
    ZERO,
    Vector,
    accumulate,
    add,
    at,
    axpy,
    matrix_at,
    outer,
    put,
    put_matrix,
    scale,
    skew,
    sub,
    times,
    transpose,
)
from msahl.elements.beams import instant
from msahl.elements.beams import stage as beams
from msahl.elements.constraints import coincide, scalar
from msahl.elements.signals import states
from msahl.elements.signals.group import Signals
from msahl.formulations.absolute import local_rotation
from msahl.formulations.absolute.frames import (
    Frames,
    displacement,
    displacement_node,
    first_multiplier,
    frame_count,
    moving_count,
    rotation_increment,
    rotation_node,
)
from msahl.jit.kernel import kernel, optional, unit
from msahl.ports import forces, sliding
from msahl.schemes.collocation import jacobian
from msahl.schemes.collocation.workspace import StageArrays, moment_for_parameters, set_node
from msahl.schemes.common.criteria import step_length
from msahl.system.arrays import State, System, SystemWorkspace
from msahl.system.evaluate import prepare


@unit
def evaluate(
    system: System, state: State, start: SystemWorkspace, stages: StageArrays, h: float, fresh: bool
) -> float:
    """Set ``stages.F`` to the equations of the step at ``stages.Z``, and impulses and work; where
    ``fresh``, set ``stages.values`` to their derivative as well. Return the length of the step [m],
    its largest term, relative to which a residual is judged.

    The derivative omits the change of friction's normal force with position.
    """
    _clear(system, start, stages, h)
    forces.node_factors(system.forces, state.time[0], h, stages.tableau.from_moments, stages.factor)
    if fresh:
        jacobian.clear(system, stages)
    _solve_auxiliary_states(system.forces.signals, system, state, stages, h, fresh)
    tableau = stages.tableau
    for n in range(tableau.node_time.size):
        row, k, i = tableau.constraint_stage[n], tableau.multiplier_stage[n], tableau.force_stage[n]
        if n == 0 or tableau.node_time[n] != tableau.node_time[n - 1]:
            set_node(system, state, stages, h, n)
            if not (stages.gravity_only and i >= 0):
                _set_strains(system, start, stages)
        if i < 0:
            _enter_violations(system, state, start, stages, h, row)
            _set_constraint_accelerations(
                system, stages, h, max(k, 0), tableau.multiplier_weight[k] if k >= 0 else 0.0
            )
        else:
            set_force_accelerations(system, stages, h, i)
            _enter_rotational_inertia(system, start, stages, h, i)
        if k >= 0 or i >= 0:
            _enter_accelerations(system, stages, h, k, i)
        if fresh and i < 0:
            jacobian.add_constraints(system, stages, h, row, k)
        elif fresh:
            jacobian.add_forces(system, start, stages, h, i)
    states.refuse(system.forces.signals, stages.signals, stages.F[0])
    length = 0.0
    for k in range(tableau.force_weight.size):
        length = max(length, step_length(system, start, h, stages.Z[k]))
    return length


@kernel
def _set_strains(system: System, start: SystemWorkspace, stages: StageArrays) -> None:
    """Set the strains of beams, and the elongations of springs in the compliance form, to those
    after the increments since the start of the step.
    """
    state, increments, frames = stages.state, stages.increments, system.frames
    beams.set_strains(system.beams, start.beams, frames, increments, state.strain)
    forces.set_stage_elongations(
        system.forces, start.forces, system.scalar, frames, increments, state.elongation
    )


@kernel
def _clear(system: System, start: SystemWorkspace, stages: StageArrays, h: float) -> None:
    """Set the equations to their terms without forces, and clear the sums."""
    frames, bodies, F = system.frames, system.bodies, stages.F
    for node in range(stages.impulse.shape[0]):
        # A load that decreases over the step has the rounding error of its value at the start.
        stages.load_scale[node] = h * h * stages.last_load_scale[node]
        put(stages.impulse, node, ZERO)
    for w in range(stages.work.size):
        stages.work[w] = 0.0
    for j in range(F.shape[0]):
        dt = h * stages.tableau.constraint_time[j]
        for f in range(moving_count(frames)):
            u = displacement(frames, stages.Z[j], f)
            put(F[j], displacement_node(frames, f), axpy(-dt, at(start.frames.v, f), u))
        for b in range(bodies.frame.size):
            node = rotation_node(frames, bodies.frame[b])
            put(F[j], node, scale(-dt, scaled_momentum(system, start.bodies.J, start.frames.W, b)))


@kernel
def scaled_momentum(system: System, J: np.ndarray, W: np.ndarray, b: int) -> Vector:
    """Angular momentum J W of body ``b``, divided by the mass and the length of its frame [m/s]."""
    f = system.bodies.frame[b]
    return scale(moment_scale(system, b), times(matrix_at(J, b), at(W, f)))


@kernel
def moment_scale(system: System, b: int) -> float:
    """1/(m l) of the frame of body ``b``, by which moments are divided [1/(kg m)]."""
    f = system.bodies.frame[b]
    return system.frames.inverse_mass[f] / system.frames.length[f]


@optional()
def _solve_auxiliary_states(
    group: Signals, system: System, state: State, stages: StageArrays, h: float, fresh: bool
) -> None:
    """Set the auxiliary states at the nodes c_i, which depend on the motion at all of them, and
    where ``fresh`` the derivatives.
    """
    if group.rate.size == 0:
        return
    own = stages.start.forces.signals
    for n in range(stages.tableau.force_stage.size):
        i = stages.tableau.force_stage[n]
        if i >= 0:
            set_node(system, state, stages, h, n)
            forces.set_signal_inputs(
                group, stages.start.forces, system.scalar, system.frames, stages.at_rest
            )
            states.save_inputs(group, own, stages.signals, i)
            if fresh:
                jacobian.save_input_derivatives(group, system, stages, i)
    states.solve(group, own, stages.signals, state.auxiliary, h)
    if fresh:
        states.set_slopes(group, own, stages.signals, h)


@kernel
def _enter_violations(
    system: System, state: State, start: SystemWorkspace, stages: StageArrays, h: float, k: int
) -> None:
    """Set the constraint equations of stage ``k`` to their violation after the increments."""
    if k < 0:
        return
    frames, violation = system.frames, stages.violation
    t, dt = state.time[0], h * stages.tableau.constraint_time[k]
    coincide.set_violations(system.coincide, start.coincide, frames, stages.increments, violation)
    scalar.set_violations(
        system.scalar, start.scalar, frames, state.violation, (t, dt), stages.increments, violation
    )
    beams.set_violations(system.beams, stages.start.beams, frames, violation)
    scalar.raise_term_sizes(system.scalar, start.scalar, 1.0, stages.load_scale)
    for node in range(first_multiplier(frames), violation.shape[0]):
        put(stages.F[k], node, at(violation, node))
    # The equations of elastic strains are at c_i.


@kernel
def _set_constraint_accelerations(
    system: System, stages: StageArrays, h: float, k: int, weight: float
) -> None:
    """Set ``stages.accelerations`` to those by the multipliers of stage ``k``; add the work of
    prescribed motions over the fraction ``weight`` of the step.
    """
    frames, row, node = system.frames, stages.accelerations, stages.start
    first = first_multiplier(frames)
    for n in range(row.shape[0]):
        put(row, n, ZERO)
    for n in range(first, row.shape[0]):
        # The multiplier by mass: unknowns are h^2/2 times it.
        put(stages.at_rest, n, scale(2.0 / (h * h), at(stages.Z[k], n)))
    coincide.add_force(system.coincide, node.coincide, frames, stages.at_rest, row)
    scalar.add_constraint_forces(system.scalar, node.scalar, frames, stages.at_rest, row)
    beams.add_rigid_forces(system.beams, node.beams, frames, stages.at_rest, row)
    t = stages.state.time[0]
    scalar.motion_work(system.scalar, frames, t, h * weight, stages.at_rest, stages.work)


@unit
def set_force_accelerations(system: System, stages: StageArrays, h: float, i: int) -> None:
    """Set ``stages.accelerations`` to those by the forces at c_i; set the constraint equations
    between rates, and add the work of the forces.
    """
    frames, row, node = system.frames, stages.accelerations, stages.start
    gravity = system.bodies.gravity
    g = (gravity[0], gravity[1], gravity[2])
    for b in range(frame_count(frames)):
        put(row, displacement_node(frames, b), g)
        put(row, rotation_node(frames, b), ZERO)
    group, reaction, dt = system.scalar, stages.reaction[i], h * stages.tableau.force_weight[i]
    scalar.rates(group, node.scalar, frames, node.frames, stages.at_rest)
    forces.set_node(system.forces, node.forces, stages.factor[i])
    states.set_state(system.forces.signals, node.forces.signals, stages.signals, i)
    Z, F = stages.Z[i], stages.F[i]
    forces.set_stage_loads(system.forces, node.forces, group, frames, h, Z, F)
    sliding.add_loads(system.forces.sliding, node.scalar, reaction)
    forces.add_forces(system.forces, node.forces, group, frames, reaction, row)
    forces.add_power(system.forces, node.forces, group, reaction, dt, stages.work)
    scalar.set_rate_equations(system.scalar, node.scalar, frames, h, stages.F[i])
    instant.add_power(system.beams, node.beams, node.frames, dt, stages.work)
    beams.set_multipliers(system.beams, frames, h, Z, stages.at_rest)
    beams.add_elastic_forces(system.beams, node.beams, frames, stages.at_rest, row)
    beams.set_elastic_equations(system.beams, node.beams, frames, node.frames, h, Z, F)


@kernel
def _enter_accelerations(system: System, stages: StageArrays, h: float, k: int, i: int) -> None:
    """Add ``stages.accelerations`` to equations and impulses: by the multipliers of stage ``k`` or,
    if that is negative, by the forces at c_i.
    """
    frames, tableau, s = system.frames, stages.tableau, stages.tableau.force_weight.size
    weights, share = tableau.chi[:, k], h * tableau.multiplier_weight[k]
    if k < 0:
        weights, share = tableau.alpha[:, i], h * tableau.force_weight[i]
    scalar.raise_term_sizes(system.scalar, stages.start.scalar, h * h, stages.load_scale)
    for b in range(moving_count(frames)):
        a = at(stages.accelerations, displacement_node(frames, b))
        alpha = moment_for_parameters(frames, stages, b)
        for j in range(s):
            accumulate(stages.F[j], displacement_node(frames, b), scale(h * h * weights[j], a))
            accumulate(stages.F[j], rotation_node(frames, b), scale(h * h * weights[j], alpha))
        accumulate(stages.impulse, displacement_node(frames, b), scale(share, a))
        accumulate(stages.impulse, rotation_node(frames, b), scale(share, alpha))


@kernel
def _enter_rotational_inertia(
    system: System, start: SystemWorkspace, stages: StageArrays, h: float, i: int
) -> None:
    """Add the rotational inertia at c_i to the equations; save the velocities there."""
    tableau, frames, node_start = stages.tableau, system.frames, stages.start
    for f in range(moving_count(frames)):
        put(stages.rate[i], displacement_node(frames, f), at(stages.state.v, f))
        put(stages.rate[i], rotation_node(frames, f), at(node_start.frames.W, f))
    for b in range(system.bodies.frame.size):
        f = system.bodies.frame[b]
        node = rotation_node(frames, f)
        if not tableau.is_variational:
            L = scaled_momentum(system, node_start.bodies.J, node_start.frames.W, b)
            for j in range(tableau.force_weight.size):
                accumulate(stages.F[j], node, scale(h * tableau.beta[j, i], L))
            continue
        c, c_dot = at(stages.parameters, f), at(stages.parameter_rates, f)
        z = times(matrix_at(start.bodies.J, b), local_rotation.rate(c, c_dot))
        z = scale(moment_scale(system, b), z)
        pi = local_rotation.momentum(c, z)
        force = times(transpose(local_rotation.rate_slope(c, c_dot)), z)
        _set_base_change(frames, stages, h, i, f)
        moment = add(force, moment_for_parameters(frames, stages, f))
        base_term = scale(h, times(matrix_at(stages.base_change, f), moment))
        base_term = add(base_term, times(matrix_at(stages.base_change_rate, f), pi))
        for j in range(tableau.force_weight.size):
            row = axpy(h * tableau.beta[j, i], pi, scale(h * h * tableau.alpha[j, i], force))
            row = axpy(-h * tableau.constraint_time[j] * tableau.force_weight[i], base_term, row)
            accumulate(stages.F[j], node, row)
        impulse = scale(tableau.force_weight[i], axpy(h, force, base_term))
        accumulate(stages.impulse, node, impulse)


@kernel
def _set_base_change(frames: Frames, stages: StageArrays, h: float, i: int, b: int) -> None:
    """Set the matrix by which the path moves at c_i if the orientation at the start of the step is
    rotated by eta and those at the other nodes stay, and its derivative by t/h. It is symmetric.

    The parameters at the nodes change by -B eta, and between them by the polynomial through these
    instead of -B eta itself. The error of interpolating B(c(t)) is that of its part quadratic in c.
    Without this term the step would not be symplectic, as c counts from the start of the step.
    """
    tableau, c, c_dot = stages.tableau, at(stages.parameters, b), at(stages.parameter_rates, b)
    change = outer(1.0, c, c, skew(ZERO))
    rate = outer(h, c, c_dot, outer(h, c_dot, c, skew(ZERO)))
    for k in range(tableau.force_weight.size):
        c_k = rotation_increment(frames, stages.Z[k], b)
        change = outer(-tableau.basis[i, k], c_k, c_k, change)
        rate = outer(-tableau.basis_rate[i, k], c_k, c_k, rate)
    put_matrix(stages.base_change, b, local_rotation.square(change))
    put_matrix(stages.base_change_rate, b, local_rotation.square(rate))


@kernel
def accept(
    system: System, state: State, start: SystemWorkspace, stages: StageArrays, h: float
) -> None:
    """Advance ``state`` by the solved step, evaluated last; its velocities may still violate the
    constraints.
    """
    frames, bodies, s = system.frames, system.bodies, stages.tableau.force_weight.size
    for w in range(state.work.size):
        state.work[w] += stages.work[w]
    states.accept(system.forces.signals, stages.signals, state.auxiliary)
    for node in range(stages.last_load_scale.size):
        stages.last_load_scale[node] = 0.0
    scalar.raise_term_sizes(system.scalar, stages.start.scalar, 1.0, stages.last_load_scale)
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        u_node, Q_node = displacement_node(frames, f), rotation_node(frames, f)
        u = at(stages.Z[s - 1], u_node)
        c = scale(1.0 / frames.length[f], at(stages.Z[s - 1], Q_node))
        pi = add(
            scaled_momentum(system, start.bodies.J, start.frames.W, b),
            at(stages.impulse, Q_node),
        )
        L = local_rotation.moment(c, pi) if stages.tableau.is_variational else pi
        L = scale(frames.length[f] / frames.inverse_mass[f], L)
        for i in range(3):
            total = state.x[f, i] + (u[i] + state.x_low[f, i])
            state.x_low[f, i] += u[i] - (total - state.x[f, i])
            state.x[f, i] = total
        p = compose(c, at(state.p, f))
        put(state.p, f, p)
        put(state.v, f, add(at(start.frames.v, f), at(stages.impulse, u_node)))
        put(state.w, f, times(matrix_at(stages.inverse_inertia, b), times(transpose(matrix(p)), L)))
        for i in range(s):
            put(stages.last_rates[i], u_node, at(stages.rate[i], u_node))
            put(stages.last_rates[i], Q_node, at(stages.rate[i], Q_node))
        put(stages.last_rates[s], u_node, at(start.frames.v, f))
        put(stages.last_rates[s], Q_node, at(start.frames.W, f))
    beams.accept(
        system.beams, start.beams, frames, stages.Z[s - 1], stages.increments, state.strain
    )
    forces.accept_stage(
        system.forces, start.forces, system.scalar, frames, stages.Z[s - 1], stages.increments
    )
    _accept_multipliers(system, state, stages, h)
    _set_end_accelerations(system, state, start, stages, h)
    stages.last_step[0], stages.last_step[1] = state.time[0], h
    state.time[0] += h
    prepare(system, state, start)
    scalar.count_rotations(system.scalar, start.scalar, state.angle)


@kernel
def _accept_multipliers(system: System, state: State, stages: StageArrays, h: float) -> None:
    """Set constraint forces and violations of the state from the last stage."""
    s, first = stages.tableau.force_weight.size, first_multiplier(system.frames)
    for k in range(state.violation.shape[0]):
        put(state.violation, k, at(stages.F[s - 1], first + k))
        for i in range(3):
            force = stages.Z[s - 1, first + k, i] * system.unit[k, i]
            state.force[k, i] = 2.0 / (h * h) * force
    scalar.clear_rate_violations(system.scalar, state.violation)


@kernel
def _set_end_accelerations(
    system: System, state: State, start: SystemWorkspace, stages: StageArrays, h: float
) -> None:
    """Set the accelerations of the state to the mean ones since the last c_i before the end, for
    the prediction of a step of another size.
    """
    frames = system.frames
    inner = stages.tableau.last_inner
    rest = 1.0 / (h * (1.0 - (stages.tableau.force_time[inner] if inner >= 0 else 0.0)))
    for b in range(moving_count(frames)):
        v, W = at(start.frames.v, b), at(start.frames.W, b)
        if inner >= 0:
            v = at(stages.rate[inner], displacement_node(frames, b))
            W = at(stages.rate[inner], rotation_node(frames, b))
        put(state.a, b, scale(rest, sub(at(state.v, b), v)))
        end = times(matrix(at(state.p, b)), at(state.w, b))
        put(state.alpha, b, scale(rest, sub(end, W)))
