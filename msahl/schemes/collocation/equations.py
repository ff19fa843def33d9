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
from msahl.elements import along, forces
from msahl.elements.constraints import coincide
from msahl.elements.rigid_body import Bodies
from msahl.jit.kernel import kernel
from msahl.schemes.collocation import jacobian, local_rotation
from msahl.schemes.collocation.workspace import Stages, go, moment_in_chart
from msahl.schemes.midpoint import equations
from msahl.system.arrays import Start, State, System


@kernel
def evaluate(
    system: System, state: State, start: Start, stages: Stages, h: float, fresh: bool
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
            _turn(system.bodies, start, stages, h, i)
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
def _begin(system: System, start: Start, stages: Stages, h: float) -> None:
    """Set the rows to what they are without any force, and clear what is summed up."""
    bodies, F = system.bodies, stages.F
    for node in range(stages.impulse.shape[0]):
        # A load that the step relaxes is known no better than what it begins with.
        stages.pull[node] = h * h * stages.pulled[node]
        put(stages.impulse, node, ZERO)
    for w in range(stages.work.size):
        stages.work[w] = 0.0
    for j in range(F.shape[0]):
        way = h * stages.rule.closing[j]
        for b in range(bodies.inverse_mass.size - 1):
            put(F[j], 2 * b, axpy(-way, at(start.bodies.v, b), at(stages.Z[j], 2 * b)))
            put(F[j], 2 * b + 1, scale(-way, spin(bodies, start, b)))


@kernel
def spin(bodies: Bodies, start: Start, b: int) -> Vector:
    """Angular momentum of body ``b`` at the start, by mass and length [m/s]."""
    L = times(matrix_at(start.bodies.J, b), at(start.bodies.W, b))
    return scale(bodies.inverse_mass[b] / bodies.length[b], L)


@kernel
def _close(system: System, state: State, start: Start, stages: Stages, h: float, k: int) -> None:
    """Set the rows of the joints, the ``k``-th, to their gaps, by increments from the start."""
    if k < 0:
        return
    bodies, violation = system.bodies, stages.violation
    t, dt = state.time[0], h * stages.rule.closing[k]
    coincide.close(system.coincide, start.coincide, bodies, stages.moved, violation)
    along.hold(system.along, start.along, bodies, state.violation, t, dt, stages.moved, violation)
    along.strain(system.along, start.along, 1.0, stages.pull)
    for node in range(2 * bodies.inverse_mass.size, violation.shape[0]):
        put(stages.F[k], node, at(violation, node))


@kernel
def _hold(system: System, stages: Stages, h: float, k: int, weight: float) -> None:
    """Set ``stages.row`` to the accelerations by the multipliers of node ``k``; add the drives'
    work, over a ``weight`` of the step.
    """
    bodies, row, node = system.bodies, stages.row, stages.start
    first = 2 * bodies.inverse_mass.size
    for n in range(row.shape[0]):
        put(row, n, ZERO)
    for n in range(first, row.shape[0]):
        # The kernels of the lowest order make a force of an unknown by unit/reach; here reach = -1.
        put(stages.still, n, scale(-2.0 / (h * h), at(stages.Z[k], n)))
    coincide.hold(system.coincide, node.coincide, bodies, -1.0, stages.still, row)
    violation, t = stages.state.violation, stages.state.time[0]
    along.hold(system.along, node.along, bodies, violation, 0.0, 0.0, stages.still, row)
    along.motion_work(system.along, bodies, t, -h * weight, stages.still, stages.work)


@kernel
def _act(system: System, stages: Stages, h: float, i: int) -> None:
    """Set ``stages.row`` to the accelerations by the loads at c_i; also the rows between rates, and
    add the loads' work.
    """
    bodies, row, node = system.bodies, stages.row, stages.start
    g = (bodies.gravity[0], bodies.gravity[1], bodies.gravity[2])
    for b in range(bodies.inverse_mass.size):
        put(row, 2 * b, g)
        put(row, 2 * b + 1, ZERO)
    motion, dt = node.bodies, h * stages.rule.weight[i]
    group, reaction = system.along, stages.reaction[i]
    along.rates(group, node.along, bodies, motion.v, motion.W, stages.still)
    forces.set_node(system.forces, node.forces, stages.factor[i], motion.R)
    forces.add_forces(system.forces, node.forces, group, node.along, bodies, motion, reaction, row)
    forces.add_power(
        system.forces, node.forces, group, node.along, motion, reaction, dt, stages.work
    )
    along.roll(system.along, node.along, bodies, h, stages.F[i])


@kernel
def _enter(system: System, stages: Stages, h: float, k: int, i: int) -> None:
    """Add the accelerations by joint forces ``k`` or, if that is negative, by the loads at c_i,
    turned into the chart, to the rows and the impulses.
    """
    bodies, rule, s = system.bodies, stages.rule, stages.rule.weight.size
    weights, share = rule.chi[:, k], h * rule.push[k]
    if k < 0:
        weights, share = rule.alpha[:, i], h * rule.weight[i]
    along.strain(system.along, stages.start.along, h * h, stages.pull)
    for b in range(bodies.inverse_mass.size - 1):
        a = at(stages.row, 2 * b)
        alpha = moment_in_chart(stages, b)
        for j in range(s):
            accumulate(stages.F[j], 2 * b, scale(h * h * weights[j], a))
            accumulate(stages.F[j], 2 * b + 1, scale(h * h * weights[j], alpha))
        accumulate(stages.impulse, 2 * b, scale(share, a))
        accumulate(stages.impulse, 2 * b + 1, scale(share, alpha))


@kernel
def _turn(bodies: Bodies, start: Start, stages: Stages, h: float, i: int) -> None:
    """Enter the inertia of the turns at c_i; keep the velocities there."""
    rule = stages.rule
    for b in range(bodies.inverse_mass.size - 1):
        put(stages.rate[i], 2 * b, at(stages.state.v, b))
        put(stages.rate[i], 2 * b + 1, at(stages.start.bodies.W, b))
        if not rule.varied:
            L = times(matrix_at(stages.start.bodies.J, b), at(stages.start.bodies.W, b))
            L = scale(bodies.inverse_mass[b] / bodies.length[b], L)
            for j in range(rule.weight.size):
                accumulate(stages.F[j], 2 * b + 1, scale(h * rule.beta[j, i], L))
            continue
        c, c_dot = at(stages.turn, b), at(stages.turning, b)
        z = times(matrix_at(start.bodies.J, b), local_rotation.rate(c, c_dot))
        z = scale(bodies.inverse_mass[b] / bodies.length[b], z)
        pi = local_rotation.momentum(c, z)
        force = times(transpose(local_rotation.rate_slope(c, c_dot)), z)
        _bow(bodies, stages, h, i, b)
        moved = scale(h, times(matrix_at(stages.bow, b), add(force, moment_in_chart(stages, b))))
        moved = add(moved, times(matrix_at(stages.bow_rate, b), pi))
        for j in range(rule.weight.size):
            row = axpy(h * rule.beta[j, i], pi, scale(h * h * rule.alpha[j, i], force))
            row = axpy(-h * rule.closing[j] * rule.weight[i], moved, row)
            accumulate(stages.F[j], 2 * b + 1, row)
        impulse = scale(rule.weight[i], axpy(h, force, moved))
        accumulate(stages.impulse, 2 * b + 1, impulse)


@kernel
def _bow(bodies: Bodies, stages: Stages, h: float, i: int, b: int) -> None:
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
        c_k = scale(1.0 / bodies.length[b], at(stages.Z[k], 2 * b + 1))
        bow = outer(-rule.value[i, k], c_k, c_k, bow)
        rate = outer(-rule.slope[i, k], c_k, c_k, rate)
    put_matrix(stages.bow, b, local_rotation.square(bow))
    put_matrix(stages.bow_rate, b, local_rotation.square(rate))


@kernel
def accept(system: System, state: State, start: Start, stages: Stages, h: float) -> None:
    """Advance ``state`` by the solved step, evaluated last; velocities still open the joints."""
    bodies, s = system.bodies, stages.rule.weight.size
    for w in range(state.work.size):
        state.work[w] += stages.work[w]
    for node in range(stages.pulled.size):
        stages.pulled[node] = 0.0
    along.strain(system.along, stages.start.along, 1.0, stages.pulled)
    for b in range(bodies.inverse_mass.size - 1):
        u = at(stages.Z[s - 1], 2 * b)
        c = scale(1.0 / bodies.length[b], at(stages.Z[s - 1], 2 * b + 1))
        pi = add(spin(bodies, start, b), at(stages.impulse, 2 * b + 1))
        L = local_rotation.moment(c, pi) if stages.rule.varied else pi
        L = scale(bodies.length[b] / bodies.inverse_mass[b], L)
        for i in range(3):
            total = state.x[b, i] + (u[i] + state.x_low[b, i])
            state.x_low[b, i] += u[i] - (total - state.x[b, i])
            state.x[b, i] = total
        p = compose(c, at(state.p, b))
        put(state.p, b, p)
        put(state.v, b, add(at(start.bodies.v, b), at(stages.impulse, 2 * b)))
        put(state.w, b, times(matrix_at(stages.mobility, b), times(transpose(matrix(p)), L)))
        for i in range(s):
            put(stages.before[i], 2 * b, at(stages.rate[i], 2 * b))
            put(stages.before[i], 2 * b + 1, at(stages.rate[i], 2 * b + 1))
        put(stages.before[s], 2 * b, at(start.bodies.v, b))
        put(stages.before[s], 2 * b + 1, at(start.bodies.W, b))
    first = 2 * bodies.inverse_mass.size
    for k in range(state.violation.shape[0]):
        put(state.violation, k, at(stages.F[s - 1], first + k))
        for i in range(3):
            force = stages.Z[s - 1, first + k, i] * system.unit[k, i]
            state.force[k, i] = 2.0 / (h * h) * force
    along.settle(system.along, state.violation)
    # From the last velocities before the end, for a step of another size.
    late = stages.rule.late
    rest = 1.0 / (h * (1.0 - (stages.rule.acting[late] if late >= 0 else 0.0)))
    for b in range(bodies.inverse_mass.size - 1):
        v, W = at(start.bodies.v, b), at(start.bodies.W, b)
        if late >= 0:
            v, W = at(stages.rate[late], 2 * b), at(stages.rate[late], 2 * b + 1)
        put(state.a, b, scale(rest, sub(at(state.v, b), v)))
        end = times(matrix(at(state.p, b)), at(state.w, b))
        put(state.alpha, b, scale(rest, sub(end, W)))
    stages.known[0], stages.known[1] = state.time[0], h
    state.time[0] += h
    equations.prepare(system, state, start)
    along.count_turns(system.along, start.along, state.angle)
