"""The time element of degree s: Hamilton's principle with polynomials of degree s over a step.

The nodes are those of a rule (``schemes.rule``), which is all that tells the gauss from the radau
scheme: t_j where the joints close, c_i where forces and inertia are summed, and where joint forces
push. Of each body and j = 1..s

    z_j - h t_j v0 + h^2 sum_i alpha_ji a_i + h^2 sum_k chi_jk G_k^T lam_k / m          = 0
    (h (sum_i beta_ji pi_i - t_j (L0 + E)) + h^2 sum_i alpha_ji (dT/dc + H^T M)_i
                                     + h^2 sum_k chi_jk H_k^T M_k(lam_k)) / (m l)       = 0
    joints closed at t_1 ... t_s = 1;   those between rates at c_1 ... c_s

with a = F/m, z = (u, l c): displacement from the start of the step and turn by the parameters c of
``schemes.chart``; E is what the beginning of that chart adds (``_bow``), of the turns alone. All is
in metres, multipliers as in ``schemes.preserving``. The momenta at the end are those at the start
with E and all impulses; lam_s makes their velocities keep the joints closed.

That is for parameters that are varied. Where they are not (radau), the balance of turns is that of
the angular momentum itself: R J R^T W for pi, M for dT/dc + H^T M, and no E.

Forces are evaluated at one configuration at a time. A law of time enters by its moments over the
step (``elements.forces.concentrated``), not by its values at the nodes. Joint forces are those of a
midpoint step without motion: its discrete gradients are the gradients themselves, its Jacobian has
half of their derivatives.

Source: see ``schemes.rule``; the chart of the rotation, the scaling and the treatment of equations
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
from msahl.elements import forces
from msahl.elements.constraints import coincide, scalar
from msahl.elements.frames import (
    Frames,
    displacement,
    displacement_node,
    first_multiplier,
    frame_count,
    moving_count,
    rotation_node,
)
from msahl.jit.kernel import kernel
from msahl.schemes.collocation import jacobian, local_rotation
from msahl.schemes.collocation.workspace import Stages, go, moment_in_chart
from msahl.schemes.midpoint import equations
from msahl.system.arrays import State, System, SystemWorkspace
from msahl.system.evaluate import prepare


@kernel
def evaluate(
    system: System, state: State, start: SystemWorkspace, stages: Stages, h: float, fresh: bool
) -> float:
    """Set ``stages.F`` to the rows of the step at ``stages.Z``, and impulses and work; where
    ``fresh``, ``stages.values`` to their derivative as well. Returns the step's own length [m], by
    which a residual is judged: its largest term.

    What a change of place does to the normal force of friction is left out of the derivative.
    """
    _begin(system, start, stages, h)
    forces.node_factors(system.forces, state.time[0], h, stages.rule.from_moments, stages.factor)
    if fresh:
        jacobian.clear(system, stages)
    rule = stages.rule
    for n in range(rule.time.size):
        row, k, i = rule.closes[n], rule.pushes[n], rule.acts[n]
        if n == 0 or rule.time[n] != rule.time[n - 1]:
            go(system, state, stages, h, n)
        if i < 0:
            _close(system, state, start, stages, h, row)
            _hold(system, stages, h, max(k, 0), rule.push[k] if k >= 0 else 0.0)
        else:
            _act(system, stages, h, i)
            _turn(system, start, stages, h, i)
        if k >= 0 or i >= 0:
            _enter(system, stages, h, k, i)
        if fresh and i < 0:
            jacobian.hold(system, stages, h, row, k)
        elif fresh:
            jacobian.act(system, start, stages, h, i)
    length = 0.0
    for k in range(rule.weight.size):
        length = max(length, equations.step_size(system, start, h, stages.Z[k]))
    return length


@kernel
def _begin(system: System, start: SystemWorkspace, stages: Stages, h: float) -> None:
    """Set the rows to what they are without any force, and clear what is summed up."""
    frames, bodies, F = system.frames, system.bodies, stages.F
    for node in range(stages.impulse.shape[0]):
        # A load that the step relaxes is known no better than what it begins with.
        stages.pull[node] = h * h * stages.pulled[node]
        put(stages.impulse, node, ZERO)
    for w in range(stages.work.size):
        stages.work[w] = 0.0
    for j in range(F.shape[0]):
        way = h * stages.rule.closing[j]
        for f in range(moving_count(frames)):
            u = displacement(frames, stages.Z[j], f)
            put(F[j], displacement_node(frames, f), axpy(-way, at(start.frames.v, f), u))
        for b in range(bodies.frame.size):
            node = rotation_node(frames, bodies.frame[b])
            put(F[j], node, scale(-way, spin(system, start.bodies.J, start.frames.W, b)))


@kernel
def spin(system: System, J: np.ndarray, W: np.ndarray, b: int) -> Vector:
    """Angular momentum J W of body ``b``, divided by the mass and the length of its frame [m/s]."""
    f = system.bodies.frame[b]
    return scale(moment_scale(system, b), times(matrix_at(J, b), at(W, f)))


@kernel
def moment_scale(system: System, b: int) -> float:
    """1/(m l) of the frame of body ``b``, by which moments are divided [1/(kg m)]."""
    f = system.bodies.frame[b]
    return float(system.frames.inverse_mass[f] / system.frames.length[f])


@kernel
def _close(
    system: System, state: State, start: SystemWorkspace, stages: Stages, h: float, k: int
) -> None:
    """Set the rows of the joints, the ``k``-th, to their gaps, by increments from the start."""
    if k < 0:
        return
    frames, violation = system.frames, stages.violation
    t, dt = state.time[0], h * stages.rule.closing[k]
    coincide.set_violations(system.coincide, start.coincide, frames, stages.moved, violation)
    scalar.add_constraint_forces(
        system.scalar, start.scalar, frames, state.violation, t, dt, stages.moved, violation
    )
    scalar.raise_term_sizes(system.scalar, start.scalar, 1.0, stages.pull)
    for node in range(first_multiplier(frames), violation.shape[0]):
        put(stages.F[k], node, at(violation, node))


@kernel
def _hold(system: System, stages: Stages, h: float, k: int, weight: float) -> None:
    """Set ``stages.row`` to the accelerations by the multipliers of node ``k``; add the drives'
    work, over a ``weight`` of the step.
    """
    frames, row, node = system.frames, stages.row, stages.start
    first = first_multiplier(frames)
    for n in range(row.shape[0]):
        put(row, n, ZERO)
    for n in range(first, row.shape[0]):
        # The kernels of the lowest order make a force of an unknown by unit/reach; here reach = -1.
        put(stages.still, n, scale(-2.0 / (h * h), at(stages.Z[k], n)))
    coincide.subtract_forces(system.coincide, node.coincide, frames, -1.0, stages.still, row)
    violation, t = stages.state.violation, stages.state.time[0]
    scalar.add_constraint_forces(
        system.scalar, node.scalar, frames, violation, 0.0, 0.0, stages.still, row
    )
    scalar.motion_work(system.scalar, frames, t, -h * weight, stages.still, stages.work)


@kernel
def _act(system: System, stages: Stages, h: float, i: int) -> None:
    """Set ``stages.row`` to the accelerations by the loads at c_i; also the rows between rates, and
    add the loads' work.
    """
    frames, row, node = system.frames, stages.row, stages.start
    gravity = system.bodies.gravity
    g = (gravity[0], gravity[1], gravity[2])
    for b in range(frame_count(frames)):
        put(row, displacement_node(frames, b), g)
        put(row, rotation_node(frames, b), ZERO)
    motion, dt = node.frames, h * stages.rule.weight[i]
    group, reaction = system.scalar, stages.reaction[i]
    scalar.rates(group, node.scalar, frames, motion.v, motion.W, stages.still)
    forces.set_node(system.forces, node.forces, stages.factor[i], motion.R)
    forces.add_forces(system.forces, node.forces, group, node.scalar, frames, motion, reaction, row)
    forces.add_power(
        system.forces, node.forces, group, node.scalar, motion, reaction, dt, stages.work
    )
    scalar.set_rate_equations(system.scalar, node.scalar, frames, h, stages.F[i])


@kernel
def _enter(system: System, stages: Stages, h: float, k: int, i: int) -> None:
    """Add the accelerations by joint forces ``k`` or, if that is negative, by the loads at c_i,
    turned into the chart, to the rows and the impulses.
    """
    frames, rule, s = system.frames, stages.rule, stages.rule.weight.size
    weights, share = rule.chi[:, k], h * rule.push[k]
    if k < 0:
        weights, share = rule.alpha[:, i], h * rule.weight[i]
    scalar.raise_term_sizes(system.scalar, stages.start.scalar, h * h, stages.pull)
    for b in range(moving_count(frames)):
        a = at(stages.row, displacement_node(frames, b))
        alpha = moment_in_chart(frames, stages, b)
        for j in range(s):
            accumulate(stages.F[j], displacement_node(frames, b), scale(h * h * weights[j], a))
            accumulate(stages.F[j], rotation_node(frames, b), scale(h * h * weights[j], alpha))
        accumulate(stages.impulse, displacement_node(frames, b), scale(share, a))
        accumulate(stages.impulse, rotation_node(frames, b), scale(share, alpha))


@kernel
def _turn(system: System, start: SystemWorkspace, stages: Stages, h: float, i: int) -> None:
    """Enter the inertia of the turns at c_i; keep the velocities there."""
    rule, frames, node_start = stages.rule, system.frames, stages.start
    for f in range(moving_count(frames)):
        put(stages.rate[i], displacement_node(frames, f), at(stages.state.v, f))
        put(stages.rate[i], rotation_node(frames, f), at(node_start.frames.W, f))
    for b in range(system.bodies.frame.size):
        f = system.bodies.frame[b]
        node = rotation_node(frames, f)
        if not rule.varied:
            L = spin(system, node_start.bodies.J, node_start.frames.W, b)
            for j in range(rule.weight.size):
                accumulate(stages.F[j], node, scale(h * rule.beta[j, i], L))
            continue
        c, c_dot = at(stages.turn, f), at(stages.turning, f)
        z = times(matrix_at(start.bodies.J, b), local_rotation.rate(c, c_dot))
        z = scale(moment_scale(system, b), z)
        pi = local_rotation.momentum(c, z)
        force = times(transpose(local_rotation.rate_slope(c, c_dot)), z)
        _bow(frames, stages, h, i, f)
        moment = add(force, moment_in_chart(frames, stages, f))
        moved = scale(h, times(matrix_at(stages.bow, f), moment))
        moved = add(moved, times(matrix_at(stages.bow_rate, f), pi))
        for j in range(rule.weight.size):
            row = axpy(h * rule.beta[j, i], pi, scale(h * h * rule.alpha[j, i], force))
            row = axpy(-h * rule.closing[j] * rule.weight[i], moved, row)
            accumulate(stages.F[j], node, row)
        impulse = scale(rule.weight[i], axpy(h, force, moved))
        accumulate(stages.impulse, node, impulse)


@kernel
def _bow(frames: Frames, stages: Stages, h: float, i: int, b: int) -> None:
    """Set by how much a path moves at c_i as the place where its chart begins turns by
    eta and the other nodes stay: a matrix times eta, symmetric, and its derivative by t/h.

    The parameters at the nodes change by -B eta; between them by the polynomial of that in place of
    -B eta itself. The error of interpolating B(c(t)) is that of its part quadratic in c. Without
    it the step would not be symplectic: its chart depends on where it begins.
    """
    rule, c, c_dot = stages.rule, at(stages.turn, b), at(stages.turning, b)
    bow = outer(1.0, c, c, skew(ZERO))
    rate = outer(h, c, c_dot, outer(h, c_dot, c, skew(ZERO)))
    for k in range(rule.weight.size):
        c_k = scale(1.0 / frames.length[b], at(stages.Z[k], rotation_node(frames, b)))
        bow = outer(-rule.value[i, k], c_k, c_k, bow)
        rate = outer(-rule.slope[i, k], c_k, c_k, rate)
    put_matrix(stages.bow, b, local_rotation.square(bow))
    put_matrix(stages.bow_rate, b, local_rotation.square(rate))


@kernel
def accept(system: System, state: State, start: SystemWorkspace, stages: Stages, h: float) -> None:
    """Advance ``state`` by the solved step, evaluated last; velocities still open the joints."""
    frames, bodies, s = system.frames, system.bodies, stages.rule.weight.size
    for w in range(state.work.size):
        state.work[w] += stages.work[w]
    for node in range(stages.pulled.size):
        stages.pulled[node] = 0.0
    scalar.raise_term_sizes(system.scalar, stages.start.scalar, 1.0, stages.pulled)
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        u_node, turn_node = displacement_node(frames, f), rotation_node(frames, f)
        u = at(stages.Z[s - 1], u_node)
        c = scale(1.0 / frames.length[f], at(stages.Z[s - 1], turn_node))
        pi = add(spin(system, start.bodies.J, start.frames.W, b), at(stages.impulse, turn_node))
        L = local_rotation.moment(c, pi) if stages.rule.varied else pi
        L = scale(frames.length[f] / frames.inverse_mass[f], L)
        for i in range(3):
            total = state.x[f, i] + (u[i] + state.x_low[f, i])
            state.x_low[f, i] += u[i] - (total - state.x[f, i])
            state.x[f, i] = total
        p = compose(c, at(state.p, f))
        put(state.p, f, p)
        put(state.v, f, add(at(start.frames.v, f), at(stages.impulse, u_node)))
        put(state.w, f, times(matrix_at(stages.mobility, b), times(transpose(matrix(p)), L)))
        for i in range(s):
            put(stages.before[i], u_node, at(stages.rate[i], u_node))
            put(stages.before[i], turn_node, at(stages.rate[i], turn_node))
        put(stages.before[s], u_node, at(start.frames.v, f))
        put(stages.before[s], turn_node, at(start.frames.W, f))
    first = first_multiplier(frames)
    for k in range(state.violation.shape[0]):
        put(state.violation, k, at(stages.F[s - 1], first + k))
        for i in range(3):
            force = stages.Z[s - 1, first + k, i] * system.unit[k, i]
            state.force[k, i] = 2.0 / (h * h) * force
    scalar.clear_rate_violations(system.scalar, state.violation)
    # From the last velocities before the end, for a step of another size.
    late = stages.rule.late
    rest = 1.0 / (h * (1.0 - (stages.rule.acting[late] if late >= 0 else 0.0)))
    for b in range(moving_count(frames)):
        v, W = at(start.frames.v, b), at(start.frames.W, b)
        if late >= 0:
            v = at(stages.rate[late], displacement_node(frames, b))
            W = at(stages.rate[late], rotation_node(frames, b))
        put(state.a, b, scale(rest, sub(at(state.v, b), v)))
        end = times(matrix(at(state.p, b)), at(state.w, b))
        put(state.alpha, b, scale(rest, sub(end, W)))
    stages.known[0], stages.known[1] = state.time[0], h
    state.time[0] += h
    prepare(system, state, start)
    scalar.count_rotations(system.scalar, start.scalar, state.angle)
