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

Elements are asked at one place at a time: a step of the lowest order that does not move has as
discrete gradients the gradients themselves, and half their derivatives as its Jacobian.
Source: see ``schemes.rule``; the chart of the rotation, the scaling and the treatment of equations
between rates (at c_i, with their forces where those of the others are) are ours.
"""

from typing import NamedTuple

import numpy as np

from msahl.bodies.rigid import Bodies
from msahl.forces import concentrated, drag
from msahl.joints import along, coincide
from msahl.joints.measure import add_block
from msahl.kernel import kernel
from msahl.rotation import compose, matrix, to_step_turn
from msahl.schemes import chart, preserving
from msahl.schemes.rule import Rule
from msahl.system.arrays import Start, State, System, body_count, new_start, node_count
from msahl.system.unknowns import Unknowns
from msahl.vector import (
    IDENTITY,
    ZERO,
    Matrix,
    Vector,
    accumulate,
    add,
    at,
    axpy,
    combine,
    dot,
    matrix_at,
    product,
    put,
    put_matrix,
    scale,
    skew,
    sub,
    times,
    transpose,
)

NOBODY, BODY, FORCE, GAP, BETWEEN = range(5)
"""Kinds of a block: nobody's; body by body, body by multiplier, gap by body, gap by multiplier."""


class Stages(NamedTuple):
    """Room for a step of degree s; nodes as in ``system.arrays``."""

    rule: Rule
    sort: np.ndarray  # (m,) kind of each block
    linear: np.ndarray  # (9 m,) constant part of the joints' derivatives
    rolling: np.ndarray  # (9 m,) whether the entry's row is one between rates
    needed: np.ndarray  # (k,) entries of the Jacobian that the unknowns have
    wanted: np.ndarray  # (9 m,) which of all entries these are
    idle: bool  # whether nothing acts at c_i but gravity and inertia
    mobility: np.ndarray  # (n+1, 3, 3) inverse inertia, body axes
    state: State  # of one node of time
    start: Start  # likewise
    turn: np.ndarray  # (n+1, 3) c at that node
    turning: np.ndarray  # (n+1, 3) its rate
    tangent: np.ndarray  # (n+1, 3, 3) H there
    bow: np.ndarray  # (n+1, 3, 3) see ``_bow``
    bow_rate: np.ndarray  # (n+1, 3, 3)
    still: np.ndarray  # (nodes, 3) no displacement, the node's multipliers
    moved: np.ndarray  # (nodes, 3) u and l Q up to the node, no multipliers
    row: np.ndarray  # (nodes, 3) what acts at the node
    gap: np.ndarray  # (nodes, 3) how open the joints are there
    by_place: np.ndarray  # (9 m,) derivatives at the node
    by_rate: np.ndarray  # (9 m,)
    room: np.ndarray  # (9 m,)
    Z: np.ndarray  # (s, nodes, 3) z_1..z_s, multipliers 0..s-1
    F: np.ndarray  # (s, nodes, 3) rows
    impulse: np.ndarray  # (nodes, 3) change of momentum over the step, by mass
    work: np.ndarray  # (w,) over the step [J]
    values: np.ndarray  # (9 m, s, s) the Jacobian
    pull: np.ndarray  # (nodes,) largest part of a load along a quantity in the rows of a node [m]
    pulled: np.ndarray  # (nodes,) such parts near the end of the last step, by h^2
    rate: np.ndarray  # (s, nodes, 3) velocities at c_i, inertial axes
    before: np.ndarray  # (s, nodes, 3) those of the polynomials that the next guess follows
    reaction: np.ndarray  # (s, j, 6) joints' reactions at c_i
    known: np.ndarray  # (2,) start and size [s] of the step of those polynomials; no size: none
    window: np.ndarray  # (2,) the same as seen from the present step, in parts of it
    seen: np.ndarray  # (s, s + 1) weights by which velocities at c_i follow from them and from ours
    pushed: np.ndarray  # (s, s) likewise joint forces, which are ours with h^2
    level: np.ndarray  # (1,) energy balance at the start of the run [J]


def new_stages(system: System, unknowns: Unknowns, state: State, rule: Rule) -> Stages:
    """Room for steps by ``rule`` from ``state``."""
    degree = rule.weight.size
    n, nodes = body_count(system), (node_count(system), 3)
    stages, vectors = (degree, *nodes), (n, 3)
    node_state = State(*(array.copy() for array in state))
    rolling = _rolling(system)
    of_body = system.blocks < 2 * n
    sort = np.select(
        [of_body.all(axis=1), of_body[:, 0], of_body[:, 1]], [BODY, FORCE, GAP], BETWEEN
    )
    sort[0] = NOBODY
    needed = np.union1d(unknowns.elimination.source, unknowns.dense_from)
    mobility = np.zeros((n, 3, 3))
    mobility[:-1] = np.linalg.inv(system.bodies.inertia[:-1])
    return Stages(
        rule=rule,
        sort=sort.astype(np.int64),
        linear=np.where(np.repeat(sort, 9) == BODY, 0.0, system.constant),
        rolling=rolling,
        needed=needed,
        wanted=np.isin(np.arange(9 * len(sort)), needed),
        idle=system.along is None and not system.loads.body.size and not system.drags.body.size,
        mobility=mobility,
        state=node_state,
        start=new_start(system, node_state),
        turn=np.zeros(vectors),
        turning=np.zeros(vectors),
        tangent=np.zeros((*vectors, 3)),
        bow=np.zeros((*vectors, 3)),
        bow_rate=np.zeros((*vectors, 3)),
        still=np.zeros(nodes),
        moved=np.zeros(nodes),
        row=np.zeros(nodes),
        gap=np.zeros(nodes),
        by_place=np.zeros_like(system.constant),
        by_rate=np.zeros_like(system.constant),
        room=np.zeros_like(system.constant),
        Z=np.zeros(stages),
        F=np.zeros(stages),
        impulse=np.zeros(nodes),
        work=np.zeros_like(state.work),
        values=np.zeros((system.constant.size, degree, degree)),
        pull=np.zeros(nodes[0]),
        pulled=np.zeros(nodes[0]),
        rate=np.zeros(stages),
        before=np.zeros(stages),
        reaction=np.zeros((degree, *state.reaction.shape)),
        known=np.zeros(2),
        window=np.zeros(2),
        seen=np.zeros((degree, degree + 1)),
        pushed=np.zeros((degree, degree)),
        level=np.zeros(1),
    )


def _rolling(system: System) -> np.ndarray:
    """(9 m,) entries of the Jacobian in rows between rates."""
    rows = np.zeros((node_count(system), 3), dtype=bool)
    if system.along:
        group = system.along.rows
        place = group.place[~group.holonomic]
        rows[2 * body_count(system) + place[:, 0], place[:, 1]] = True
    return np.repeat(rows[system.blocks[:, 0]].reshape(-1), 3)


@kernel
def evaluate(
    system: System,
    state: State,
    start: Start,
    stages: Stages,
    h: float,
    new: bool,
    fresh: bool,
) -> float:
    """Set ``stages.F`` to the rows of the step at ``stages.Z``, which is guessed if it is ``new``,
    and impulses and work; where ``fresh``, ``stages.values`` to their derivative as well. Returns
    the step's own length [m], by which a residual is judged: its largest term.

    What a change of place does to the normal force of friction is left out of the derivative.
    """
    s = stages.rule.weight.size
    if new:
        predict(system, state, start, stages, h)
    _begin(system, start, stages, h, fresh)
    rule = stages.rule
    for n in range(rule.time.size):
        row, k, i = rule.closes[n], rule.pushes[n], rule.acts[n]
        held = i < 0
        if n == 0 or rule.time[n] != rule.time[n - 1]:
            go(system, state, stages, h, n)
        if held:
            _close(system, state, start, stages, h, row)
            _hold(system, stages, h, max(k, 0), rule.push[k] if k >= 0 else 0.0)
        else:
            _act(system, stages, h, i)
            _turn(system.bodies, start, stages, h, i)
        if k >= 0 or i >= 0:
            _enter(system, stages, h, k, i)
        if fresh and held:
            _hold_jacobian(system, stages)
            _into_chart(system, stages, False)
            _add_held(stages, h, row, k)
        elif fresh:
            _add_turning(system.bodies, start, stages, h, i)
            if not stages.idle:
                _act_jacobian(system, stages, i)
                _into_chart(system, stages, True)
                _add_acting(system, stages, h, i)
    length = 0.0
    for k in range(s):
        length = max(length, preserving.step_size(system, start, h, stages.Z[k]))
    return length


@kernel
def _begin(system: System, start: Start, stages: Stages, h: float, fresh: bool) -> None:
    """Set the rows to what they are without any force, and clear what is summed up."""
    bodies, F, values = system.bodies, stages.F, stages.values
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
    if fresh:
        for e in stages.needed:
            for j in range(values.shape[1]):
                for k in range(values.shape[2]):
                    values[e, j, k] = 0.0
                if stages.sort[e // 9] == BODY:
                    values[e, j, j] = system.constant[e]


@kernel
def spin(bodies: Bodies, start: Start, b: int) -> Vector:
    """Angular momentum of body ``b`` at the start, by mass and length [m/s]."""
    L = times(matrix_at(start.bodies.J, b), at(start.bodies.W, b))
    return scale(bodies.inverse_mass[b] / bodies.length[b], L)


@kernel
def go(system: System, state: State, stages: Stages, h: float, n: int) -> None:
    """Bring ``stages.start`` to what the rule has as number ``n``; only what inertia needs, where
    nothing else acts there.
    """
    rule = stages.rule
    bare = stages.idle and rule.acts[n] >= 0
    tau, phi, slope = rule.time[n], rule.place[n], rule.rate[n]
    bodies, Z, node = system.bodies, stages.Z, stages.state
    node.time[0] = state.time[0] + h * tau
    for b in range(bodies.inverse_mass.size - 1):
        u, lc, v, lc_dot = ZERO, ZERO, ZERO, ZERO
        for j in range(phi.size):
            u, lc = axpy(phi[j], at(Z[j], 2 * b), u), axpy(phi[j], at(Z[j], 2 * b + 1), lc)
            rate = slope[j] / h
            v, lc_dot = axpy(rate, at(Z[j], 2 * b), v), axpy(rate, at(Z[j], 2 * b + 1), lc_dot)
        c = scale(1.0 / bodies.length[b], lc)
        put(stages.turn, b, c)
        put(stages.turning, b, scale(1.0 / bodies.length[b], lc_dot))
        put_matrix(stages.tangent, b, chart.tangent(c))
        put(node.v, b, v)
        if bare:
            continue
        put(stages.moved, 2 * b, u)
        put(stages.moved, 2 * b + 1, scale(bodies.length[b], to_step_turn(c)))
        put(node.x, b, add(at(state.x, b), u))
        put(node.p, b, compose(c, at(state.p, b)))
    if not bare:
        preserving.prepare(system, node, stages.start)
    for b in range(bodies.inverse_mass.size - 1):
        put(stages.start.bodies.W, b, times(matrix_at(stages.tangent, b), at(stages.turning, b)))
    for q in range(node.angle.size):
        node.angle[q] = state.angle[q]
    along.count_turns(system.along, stages.start.along, node.angle)


@kernel
def _close(system: System, state: State, start: Start, stages: Stages, h: float, k: int) -> None:
    """Set the rows of the joints, the ``k``-th, to their gaps, by increments from the start."""
    if k < 0:
        return
    bodies, gap = system.bodies, stages.gap
    t, dt = state.time[0], h * stages.rule.closing[k]
    coincide.residual(system.coincide, start.coincide, bodies, -1.0, stages.moved, gap)
    along.hold(system.along, start.along, bodies, state.gap, t, dt, stages.moved, gap)
    for node in range(2 * bodies.inverse_mass.size, gap.shape[0]):
        put(stages.F[k], node, at(gap, node))


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
    coincide.residual(system.coincide, node.coincide, bodies, -1.0, stages.still, row)
    gap, t = stages.state.gap, stages.state.time[0]
    along.hold(system.along, node.along, bodies, gap, 0.0, 0.0, stages.still, row)
    along.drive_work(system.along, bodies, t, -h * weight, stages.still, stages.work)


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
    v, W, t, dt = node.bodies.v, node.bodies.W, stages.state.time[0], h * stages.rule.weight[i]
    loads, drags, work = system.loads, system.drags, stages.work
    concentrated.prepare(loads, system.laws, t, node.bodies.R, node.loads)
    concentrated.free_acceleration(loads, node.loads, bodies, row)
    concentrated.free_work(loads, node.loads, v, W, dt, system.load_column, work)
    drag.free_acceleration(drags, node.drag_arms, bodies, v, W, row)
    drag.free_work(drags, node.drag_arms, v, W, dt, system.drag_column, work)
    along.act(
        system.along, node.along, bodies, v, W, stages.reaction[i], dt, stages.still, row, work
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
        z = times(matrix_at(start.bodies.J, b), chart.rate(c, c_dot))
        z = scale(bodies.inverse_mass[b] / bodies.length[b], z)
        pi = chart.momentum(c, z)
        force = times(transpose(chart.rate_slope(c, c_dot)), z)
        for j in range(rule.weight.size):
            accumulate(stages.F[j], 2 * b + 1, scale(h * rule.beta[j, i], pi))
            accumulate(stages.F[j], 2 * b + 1, scale(h * h * rule.alpha[j, i], force))
        accumulate(stages.impulse, 2 * b + 1, scale(h * rule.weight[i], force))
        _bow(bodies, stages, h, i, b)
        moved = scale(h, times(matrix_at(stages.bow, b), add(force, moment_in_chart(stages, b))))
        moved = add(moved, times(matrix_at(stages.bow_rate, b), pi))
        for j in range(rule.weight.size):
            share = -h * rule.closing[j] * rule.weight[i]
            accumulate(stages.F[j], 2 * b + 1, scale(share, moved))
        accumulate(stages.impulse, 2 * b + 1, scale(rule.weight[i], moved))


@kernel
def moment_in_chart(stages: Stages, b: int) -> Vector:
    """The moment in ``stages.row`` as the rows of body ``b`` have it."""
    if not stages.rule.varied:
        return at(stages.row, 2 * b + 1)
    return times(transpose(matrix_at(stages.tangent, b)), at(stages.row, 2 * b + 1))


@kernel
def _bow(bodies: Bodies, stages: Stages, h: float, i: int, b: int) -> None:
    """Set by how much a path moves at c_i as the place where its chart begins turns by
    eta and the other nodes stay: a matrix times eta, symmetric, and its derivative by t/h.

    The parameters at the nodes change by -B eta; between them by the polynomial of that in place of
    -B eta itself. The error of interpolating B(c(t)) is that of its part quadratic in c. Without
    it the step would not be symplectic: its chart depends on where it begins.
    """
    rule, c = stages.rule, at(stages.turn, b)
    bow, rate = chart.square(c, c), chart.square(c, scale(2.0 * h, at(stages.turning, b)))
    for k in range(rule.weight.size):
        c_k = scale(1.0 / bodies.length[b], at(stages.Z[k], 2 * b + 1))
        at_node = chart.square(c_k, c_k)
        bow = combine(-rule.value[i, k], at_node, bow)
        rate = combine(-rule.slope[i, k], at_node, rate)
    put_matrix(stages.bow, b, bow)
    put_matrix(stages.bow_rate, b, rate)


@kernel
def _hold_jacobian(system: System, stages: Stages) -> None:
    """Set ``by_place`` to the derivative of ``_hold``, halved where bodies meet bodies, and of the
    gaps.
    """
    values, node, bodies = stages.by_place, stages.start, system.bodies
    for e in range(values.size):
        values[e] = stages.linear[e]
    coincide.jacobian(system.coincide, node.coincide, bodies, -1.0, stages.still, values)
    along.hold_jacobian(system.along, node.along, bodies, stages.still, values)


@kernel
def _act_jacobian(system: System, stages: Stages, i: int) -> None:
    """Set ``by_place`` to half the derivative of ``_act``, ``by_rate`` to that by the rates."""
    place, rate, node, bodies = stages.by_place, stages.by_rate, stages.start, system.bodies
    for e in range(place.size):
        place[e], rate[e] = 0.0, 0.0
    v, W = node.bodies.v, node.bodies.W
    concentrated.jacobian(system.loads, node.loads, bodies, -1.0, stages.still, place)
    drag.free_jacobian(system.drags, node.drag_arms, bodies, v, W, place, rate)
    along.free_jacobian(
        system.along,
        node.along,
        bodies,
        v,
        W,
        stages.reaction[i],
        stages.still,
        stages.room,
        place,
        rate,
    )


@kernel
def _into_chart(system: System, stages: Stages, rated: bool) -> None:
    """Bring the derivatives by and of turns from inertial axes into the chart: H^T (.) H, and half
    of what the change of H does to the moments of ``stages.row`` and, where ``rated``, to the
    rates.
    """
    first = 2 * system.bodies.inverse_mass.size
    for m in range(1, stages.sort.size):
        row, column = system.blocks[m, 0], system.blocks[m, 1]
        turned_row, turned_column = row < first and row % 2 == 1, column < first and column % 2 == 1
        if not (turned_row or turned_column):
            continue
        turned_row = turned_row and stages.rule.varied
        H_row = matrix_at(stages.tangent, row // 2) if turned_row else IDENTITY
        H_column = matrix_at(stages.tangent, column // 2) if turned_column else IDENTITY
        place = product(product(transpose(H_row), block_at(stages.by_place, m)), H_column)
        if rated:
            rate = product(transpose(H_row), block_at(stages.by_rate, m))
            if turned_column:
                c, c_dot = at(stages.turn, column // 2), at(stages.turning, column // 2)
                place = combine(0.5, product(rate, chart.momentum_slope(c, c_dot)), place)
            put_block(stages.by_rate, m, product(rate, H_column))
        put_block(stages.by_place, m, place)
    if not stages.rule.varied:
        return
    for b in range(system.bodies.inverse_mass.size - 1):
        slope = chart.rate_slope(at(stages.turn, b), at(stages.row, 2 * b + 1))
        block = system.bodies.block[b]
        add_block(stages.by_place, block, 0.5 / system.bodies.length[b], slope)


@kernel
def block_at(values: np.ndarray, m: int) -> Matrix:
    """Block ``m``."""
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
def _add_held(stages: Stages, h: float, row: int, k: int) -> None:
    """Take the derivatives of the joints' ``row``-th gaps and ``k``-th forces into the Jacobian."""
    values, chi = stages.values, stages.rule.chi
    s = chi.shape[0]
    for e in stages.needed:
        sort, value = stages.sort[e // 9], stages.by_place[e]
        if value == 0.0:
            continue
        if sort == GAP:
            if row >= 0 and not stages.rolling[e]:
                values[e, row, row] = value
        elif k >= 0:
            if sort == BODY:
                if row >= 0:
                    for j in range(s):
                        values[e, j, row] += 2.0 * h * h * chi[j, k] * value
            else:
                for j in range(s):
                    values[e, j, k] -= 2.0 * chi[j, k] * value


@kernel
def _add_acting(system: System, stages: Stages, h: float, i: int) -> None:
    """Take the derivatives of the loads at c_i into the Jacobian."""
    values, rule, place, rate = stages.values, stages.rule, stages.by_place, stages.by_rate
    s = rule.weight.size
    for e in stages.needed:
        m, p, q = e // 9, e % 9 // 3, e % 3
        by_place, by_rate, bent_place, bent_rate = place[e], rate[e], 0.0, 0.0
        if rule.varied and stages.sort[m] == BODY and system.blocks[m, 0] % 2 == 1:
            for r in range(3):
                bow = stages.bow[system.blocks[m, 0] // 2, p, r]
                bent_place += bow * place[9 * m + 3 * r + q]
                bent_rate += bow * rate[9 * m + 3 * r + q]
        if by_place == by_rate == bent_place == bent_rate == 0.0:
            continue
        for k in range(s):
            phi, slope = 2.0 * h * h * rule.value[i, k], h * rule.slope[i, k]
            total, bent = phi * by_place + slope * by_rate, phi * bent_place + slope * bent_rate
            if stages.sort[m] == GAP:
                values[e, i, k] += total / h
            else:
                for j in range(s):
                    values[e, j, k] += rule.alpha[j, i] * total
                    values[e, j, k] -= rule.closing[j] * rule.weight[i] * bent


@kernel
def _add_turning(bodies: Bodies, start: Start, stages: Stages, h: float, i: int) -> None:
    """Take the derivatives of the inertia of the turns at c_i into the Jacobian."""
    rule = stages.rule
    if not rule.varied:
        _add_spinning(bodies, stages, h, i)
        return
    for b in range(bodies.inverse_mass.size - 1):
        c, c_dot = at(stages.turn, b), at(stages.turning, b)
        J, H = matrix_at(start.bodies.J, b), matrix_at(stages.tangent, b)
        z = times(J, chart.rate(c, c_dot))
        by_c = chart.rate_slope(c, c_dot)
        mass = product(H, product(J, transpose(H)))
        pi_c = combine(1.0, product(H, product(J, by_c)), chart.momentum_slope(c, z))
        force_c = product(transpose(by_c), product(J, by_c))
        force_c = combine(1.0, chart.curvature(c, z, c_dot), force_c)
        bow, bow_rate = matrix_at(stages.bow, b), matrix_at(stages.bow_rate, b)
        pi, force = chart.momentum(c, z), times(transpose(by_c), z)
        moment = moment_in_chart(stages, b)
        force = axpy(bodies.length[b] / bodies.inverse_mass[b], moment, force)
        # What the bow moves, by c(t) and by c_dot; below by c_k. The matrices are squares of all.
        moved_c = combine(1.0, product(bow_rate, pi_c), chart.square_slope(c_dot, scale(2 * h, pi)))
        moved_c = combine(h, product(bow, force_c), moved_c)
        moved_c = combine(2.0 * h, chart.square_slope(c, force), moved_c)
        moved = combine(1.0, product(bow_rate, mass), chart.square_slope(c, scale(2.0 * h, pi)))
        moved = combine(h, product(bow, transpose(pi_c)), moved)
        scaled = h * bodies.inverse_mass[b] / bodies.length[b] ** 2
        for k in range(rule.weight.size):
            phi, rate = rule.value[i, k], rule.slope[i, k] / h
            pi_k = _sum(scaled * phi, pi_c, scaled * rate, mass)
            force_k = _sum(scaled * h * phi, force_c, scaled * h * rate, transpose(pi_c))
            c_k = scale(-2.0 * h * scaled / bodies.length[b], at(stages.Z[k], 2 * b + 1))
            bent = chart.square_slope(c_k, axpy(rate, pi, scale(phi, force)))
            bent = combine(scaled * rate, moved, combine(scaled * phi, moved_c, bent))
            _enter_turning(stages, bodies.block[b], i, k, pi_k, force_k, bent)


@kernel
def _enter_turning(
    stages: Stages, block: int, i: int, k: int, pi: Matrix, force: Matrix, bent: Matrix
) -> None:
    """Add to a ``block`` the derivatives by z_k of momentum, force and bow at c_i."""
    values, rule = stages.values, stages.rule
    for p in range(3):
        for q in range(3):
            e = block + 3 * p + q
            if stages.wanted[e]:
                for j in range(rule.weight.size):
                    total = rule.beta[j, i] * pi[p][q] + rule.alpha[j, i] * force[p][q]
                    total -= rule.closing[j] * rule.weight[i] * bent[p][q]
                    values[e, j, k] += total


@kernel
def _add_spinning(bodies: Bodies, stages: Stages, h: float, i: int) -> None:
    """As ``_add_turning`` where the parameters are not varied: of the angular momentum J W."""
    rule, node = stages.rule, stages.start.bodies
    for b in range(bodies.inverse_mass.size - 1):
        J, H, W = matrix_at(node.J, b), matrix_at(stages.tangent, b), at(node.W, b)
        c, c_dot = at(stages.turn, b), at(stages.turning, b)
        # J turns with the body, W is H c_dot.
        turned = combine(1.0, product(J, skew(W)), skew(scale(-1.0, times(J, W))))
        by_c = combine(1.0, product(turned, H), product(J, chart.momentum_slope(c, c_dot)))
        by_rate = product(J, H)
        scaled = bodies.inverse_mass[b] / bodies.length[b] ** 2
        for k in range(rule.weight.size):
            L_k = _sum(scaled * h * rule.value[i, k], by_c, scaled * rule.slope[i, k], by_rate)
            nothing = skew(ZERO)
            _enter_turning(stages, bodies.block[b], i, k, L_k, nothing, nothing)


@kernel
def _sum(a: float, M: Matrix, b: float, N: Matrix) -> Matrix:
    """``a M + b N``."""
    return combine(a, M, (scale(b, N[0]), scale(b, N[1]), scale(b, N[2])))


@kernel
def predict(system: System, state: State, start: Start, stages: Stages, h: float) -> None:
    """First guess: velocities and multipliers are those of the known polynomials, of the last step
    or of another that went through here.

    Without any, or for a step far beyond them, the accelerations and multipliers of the ``state``
    stay.
    """
    rule, Z, bodies = stages.rule, stages.Z, system.bodies
    first, s = 2 * bodies.inverse_mass.size, rule.weight.size
    follows = look(stages, state.time[0], h)
    for node in range(first, stages.row.shape[0]):
        for i in range(3):
            force = state.force[node - first, i] * 0.5 * h * h / system.unit[node - first, i]
            for k in range(s):
                # The rows serve as room.
                stages.F[k, node, i] = force
                if follows:
                    stages.F[k, node, i] = 0.0
                    for j in range(s):
                        stages.F[k, node, i] += stages.pushed[k, j] * Z[j, node, i]
            for k in range(s):
                Z[k, node, i] = stages.F[k, node, i]
    for b in range(bodies.inverse_mass.size - 1):
        v, W = at(start.bodies.v, b), at(start.bodies.W, b)
        for i in range(s):
            way = h * rule.acting[i]
            v_i, W_i = axpy(way, at(state.a, b), v), axpy(way, at(state.alpha, b), W)
            if follows:
                v_i, W_i = scale(stages.seen[i, s], v), scale(stages.seen[i, s], W)
                for j in range(s):
                    v_i = axpy(stages.seen[i, j], at(stages.before[j], 2 * b), v_i)
                    W_i = axpy(stages.seen[i, j], at(stages.before[j], 2 * b + 1), W_i)
            put(stages.rate[i], 2 * b, v_i)
            put(stages.rate[i], 2 * b + 1, W_i)
        _integrate(system, start, stages, h, b)


FAR = 1.5
"""Sizes of a step beyond its end up to which its polynomials are worth following."""


@kernel
def look(stages: Stages, t: float, h: float) -> bool:
    """Set the weights by which a step ``h`` from ``t`` follows the known polynomials, if it can."""
    rule, window = stages.rule, stages.window
    s, size = rule.weight.size, stages.known[1] / h
    if not size > 0.0:
        return False
    begin = (stages.known[0] - t) / h
    if abs(begin + size) < 1e-6:
        begin = -size  # it is the step before, but for round-off
    if 1.0 - (begin + size) > FAR * size:
        return False
    if begin == window[0] and size == window[1]:
        return True
    window[0], window[1] = begin, size
    for i in range(s):
        for j in range(s + 1):
            # Velocities of the present place are one more node, and the better one where it is
            # the polynomials' own.
            x, weight = 0.0, 1.0
            if j < s:
                x = begin + size * rule.acting[j]
                weight = 0.0 if abs(x) < 1e-6 else rule.acting[i] / x
            for m in range(s):
                x_m = begin + size * rule.acting[m]
                if m != j and abs(x_m) >= 1e-6:
                    weight *= (rule.acting[i] - x_m) / (x - x_m)
            stages.seen[i, j] = weight
        for j in range(s):
            x, weight = begin + size * rule.pushing[j], 1.0 / (size * size)
            for m in range(s):
                if m != j:
                    x_m = begin + size * rule.pushing[m]
                    weight *= (rule.pushing[i] - x_m) / (x - x_m)
            stages.pushed[i, j] = weight
    return True


SWEEPS = 3
"""Of the guess's turns: each gains a power of the turn over a step."""
WIDEST = 16.0
"""Parameters beyond which a guessed turn is none, 304 degrees: near a whole turn they run away, and
beside a step of their length any residual would be small."""


@kernel
def _integrate(system: System, start: Start, stages: Stages, h: float, b: int) -> None:
    """Set the places z_j of body ``b`` from its velocities at c_i."""
    rule, Z, bodies = stages.rule, stages.Z, system.bodies
    s, length = rule.weight.size, bodies.length[b]
    gravity = (bodies.gravity[0], bodies.gravity[1], bodies.gravity[2])
    for j in range(s):
        put(Z[j], 2 * b + 1, ZERO)
        u = ZERO
        for i in range(s):
            u = axpy(h * rule.integral[j, i], at(stages.rate[i], 2 * b), u)
        if bodies.ballistic[b]:
            # That displacement need not be solved for: here it is what the rows would have.
            u = scale(h * rule.closing[j], at(start.bodies.v, b))
            for i in range(s):
                u = axpy(-h * h * rule.alpha[j, i], gravity, u)
        put(Z[j], 2 * b, u)
    for _ in range(SWEEPS):
        for i in range(s):
            c = ZERO
            for j in range(s):
                c = axpy(rule.value[i, j] / length, at(Z[j], 2 * b + 1), c)
            # The rows serve as room.
            put(stages.F[i], 2 * b, chart.parameter_rate(c, at(stages.rate[i], 2 * b + 1)))
        for j in range(s):
            c = ZERO
            for i in range(s):
                c = axpy(h * length * rule.integral[j, i], at(stages.F[i], 2 * b), c)
            put(Z[j], 2 * b + 1, c)
    for j in range(s):
        c = at(Z[j], 2 * b + 1)
        if not dot(c, c) <= (WIDEST * length) ** 2:
            put(Z[j], 2 * b + 1, ZERO)


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
        L = chart.moment(c, pi) if stages.rule.varied else pi
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
    first = 2 * bodies.inverse_mass.size
    for k in range(state.gap.shape[0]):
        put(state.gap, k, at(stages.F[s - 1], first + k))
        for i in range(3):
            force = stages.Z[s - 1, first + k, i] * system.unit[k, i]
            state.force[k, i] = 2.0 / (h * h) * force
    along.settle(system.along, state.gap)
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
    preserving.prepare(system, state, start)
    along.count_turns(system.along, start.along, state.angle)
