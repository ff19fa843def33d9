"""The derivative of the rows of ``schemes.element`` by the stages."""

import numpy as np

from msahl.algebra.vector import (
    IDENTITY,
    ZERO,
    Matrix,
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
from msahl.elements import forces
from msahl.elements.constraints import coincide, scalar
from msahl.elements.constraints.products import add_block
from msahl.elements.frames import first_multiplier, rotation_node
from msahl.jit.kernel import kernel
from msahl.schemes.collocation import local_rotation
from msahl.schemes.collocation.workspace import BODY, GAP, Stages, moment_in_chart
from msahl.system.arrays import System, SystemWorkspace


@kernel
def clear(system: System, stages: Stages) -> None:
    """Set the Jacobian to what does not change: a displacement is its own row's."""
    values = stages.values
    for e in range(values.shape[0]):
        for k in range(values.shape[1]):
            for j in range(values.shape[2]):
                values[e, k, j] = 0.0
            if stages.sort[e] == BODY:
                values[e, k, k] = system.constant[stages.needed[e]]


@kernel
def hold(system: System, stages: Stages, h: float, row: int, k: int) -> None:
    """Add what the joints' ``row``-th gaps and ``k``-th forces contribute."""
    _hold(system, stages)
    _into_chart(system, stages, False)
    _enter_held(stages, h, row, k)


@kernel
def act(system: System, start: SystemWorkspace, stages: Stages, h: float, i: int) -> None:
    """Add what the inertia of the turns and the loads at c_i contribute."""
    _add_turning(system, start, stages, h, i)
    if not stages.idle:
        _act(system, stages, i)
        _into_chart(system, stages, True)
        _enter_acting(system, stages, h, i)


@kernel
def _hold(system: System, stages: Stages) -> None:
    """Set ``by_place`` to the derivative of ``element._hold``, halved where bodies meet bodies, and
    of the gaps.
    """
    values, node, frames = stages.by_place, stages.start, system.frames
    for e in range(values.size):
        values[e] = stages.linear[e]
    coincide.jacobian(system.coincide, node.coincide, frames, -1.0, stages.still, values)
    scalar.add_constraint_derivatives(system.scalar, node.scalar, frames, stages.still, values)


@kernel
def _act(system: System, stages: Stages, i: int) -> None:
    """Set ``by_place`` and ``by_rate`` to the derivatives of ``equations._act``."""
    place, rate, node, frames = stages.by_place, stages.by_rate, stages.start, system.frames
    for e in range(place.size):
        place[e], rate[e] = 0.0, 0.0
    group, still, room = system.scalar, stages.still, stages.room
    v, W = node.frames.v, node.frames.W
    scalar.differentiate(group, node.scalar, frames, still)
    forces.add_derivatives(
        system.forces,
        node.forces,
        group,
        node.scalar,
        frames,
        node.frames,
        stages.reaction[i],
        still,
        room,
        place,
        rate,
    )
    scalar.add_rate_derivatives(group, node.scalar, frames, v, W, still, room, place, rate)


@kernel
def _into_chart(system: System, stages: Stages, rated: bool) -> None:
    """Bring the derivatives by and of turns from inertial axes into the chart: H^T (.) H, and what
    the change of H does to the moments of ``stages.row`` and, where ``rated``, to the rates. Those
    of joint forces, not ``rated``, are halved.
    """
    frames, bodies = system.frames, system.bodies
    first = first_multiplier(frames)
    for m in range(1, system.blocks.shape[0]):
        row, column = system.blocks[m, 0], system.blocks[m, 1]
        turned_row = row < first and frames.rotates[row]
        turned_column = column < first and frames.rotates[column]
        if not (turned_row or turned_column):
            continue
        turned_row = turned_row and stages.rule.varied
        H_row = matrix_at(stages.tangent, frames.of_node[row]) if turned_row else IDENTITY
        H_column = matrix_at(stages.tangent, frames.of_node[column]) if turned_column else IDENTITY
        place = product(product(transpose(H_row), block_at(stages.by_place, m)), H_column)
        if rated:
            rate = product(transpose(H_row), block_at(stages.by_rate, m))
            if turned_column:
                f = frames.of_node[column]
                c, c_dot = at(stages.turn, f), at(stages.turning, f)
                place = combine(1.0, product(rate, local_rotation.momentum_slope(c, c_dot)), place)
            put_block(stages.by_rate, m, product(rate, H_column))
        put_block(stages.by_place, m, place)
    if not stages.rule.varied:
        return
    share = 1.0 if rated else 0.5
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        moment = at(stages.row, rotation_node(frames, f))
        slope = local_rotation.rate_slope(at(stages.turn, f), moment)
        add_block(stages.by_place, bodies.block[b], share / frames.length[f], slope)


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
def _enter_held(stages: Stages, h: float, row: int, k: int) -> None:
    """Take the derivatives of the joints' ``row``-th gaps and ``k``-th forces into the Jacobian."""
    values, chi = stages.values, stages.rule.chi
    for e in range(values.shape[0]):
        sort, value = stages.sort[e], stages.by_place[stages.needed[e]]
        if value == 0.0:
            continue
        if sort == GAP:
            if row >= 0 and not stages.rolling[e]:
                values[e, row, row] = value
        elif k >= 0 and (sort != BODY or row >= 0):
            column, share = (row, h * h) if sort == BODY else (k, -1.0)
            for j in range(chi.shape[0]):
                values[e, column, j] += 2.0 * share * chi[j, k] * value


@kernel
def _enter_acting(system: System, stages: Stages, h: float, i: int) -> None:
    """Take the derivatives of the loads at c_i into the Jacobian."""
    values, rule, place, rate = stages.values, stages.rule, stages.by_place, stages.by_rate
    s = rule.weight.size
    for e in range(values.shape[0]):
        entry = stages.needed[e]
        m, p, q = entry // 9, entry % 9 // 3, entry % 3
        by_place, by_rate, bent_place, bent_rate = place[entry], rate[entry], 0.0, 0.0
        if rule.varied and stages.sort[e] == BODY and system.frames.rotates[system.blocks[m, 0]]:
            for r in range(3):
                bow = stages.bow[system.frames.of_node[system.blocks[m, 0]], p, r]
                bent_place += bow * place[9 * m + 3 * r + q]
                bent_rate += bow * rate[9 * m + 3 * r + q]
        if by_place == by_rate == bent_place == bent_rate == 0.0:
            continue
        for k in range(s):
            phi, slope = h * h * rule.value[i, k], h * rule.slope[i, k]
            total, bent = phi * by_place + slope * by_rate, phi * bent_place + slope * bent_rate
            if stages.sort[e] == GAP:
                values[e, k, i] += total / h
            else:
                for j in range(s):
                    values[e, k, j] += rule.alpha[j, i] * total
                    values[e, k, j] -= rule.closing[j] * rule.weight[i] * bent


@kernel
def _add_turning(system: System, start: SystemWorkspace, stages: Stages, h: float, i: int) -> None:
    """Take the derivatives of the inertia of the turns at c_i into the Jacobian."""
    rule, frames = stages.rule, system.frames
    if not rule.varied:
        _add_spinning(system, stages, h, i)
        return
    for b in range(system.bodies.frame.size):
        f = system.bodies.frame[b]
        c, c_dot = at(stages.turn, f), at(stages.turning, f)
        J, H = matrix_at(start.bodies.J, b), matrix_at(stages.tangent, f)
        z = times(J, local_rotation.rate(c, c_dot))
        by_c = local_rotation.rate_slope(c, c_dot)
        mass = product(H, product(J, transpose(H)))
        pi_c = combine(1.0, product(H, product(J, by_c)), local_rotation.momentum_slope(c, z))
        force_c = product(transpose(by_c), product(J, by_c))
        force_c = combine(1.0, local_rotation.curvature(c, z, c_dot), force_c)
        bow, bow_rate = matrix_at(stages.bow, f), matrix_at(stages.bow_rate, f)
        pi, force = local_rotation.momentum(c, z), times(transpose(by_c), z)
        moment = moment_in_chart(frames, stages, f)
        force = axpy(frames.length[f] / frames.inverse_mass[f], moment, force)
        # What the bow moves, by c(t) and by c_dot; by c_k in ``_enter_turning``.
        moved_c = combine(
            1.0, product(bow_rate, pi_c), local_rotation.square_slope(c_dot, scale(2 * h, pi))
        )
        moved_c = combine(h, product(bow, force_c), moved_c)
        moved_c = combine(2.0 * h, local_rotation.square_slope(c, force), moved_c)
        moved = combine(
            1.0, product(bow_rate, mass), local_rotation.square_slope(c, scale(2.0 * h, pi))
        )
        moved = combine(h, product(bow, transpose(pi_c)), moved)
        put_matrix(stages.slope, 0, pi_c)
        put_matrix(stages.slope, 1, mass)
        put_matrix(stages.slope, 2, multiple(h, force_c))
        put_matrix(stages.slope, 3, multiple(h, transpose(pi_c)))
        put_matrix(stages.slope, 4, moved_c)
        put_matrix(stages.slope, 5, moved)
        put(stages.push, 0, force)
        put(stages.push, 1, pi)
        _enter_turning(system, stages, h, i, b)


@kernel
def _enter_turning(system: System, stages: Stages, h: float, i: int, b: int) -> None:
    """Add to the Jacobian what ``stages.slope`` and ``stages.push`` say of body ``b`` at c_i."""
    values, rule, slope, Z = stages.values, stages.rule, stages.slope, stages.Z
    force, pi = at(stages.push, 0), at(stages.push, 1)
    frames, f = system.frames, system.bodies.frame[b]
    scaled = h * frames.inverse_mass[f] / frames.length[f] ** 2
    for p in range(3):
        for q in range(3):
            e = stages.slot[system.bodies.block[b] + 3 * p + q]
            if e < 0:
                continue
            for k in range(rule.weight.size):
                phi, rate = scaled * rule.value[i, k], scaled * rule.slope[i, k] / h
                by_pi = phi * slope[0, p, q] + rate * slope[1, p, q]
                by_force = phi * slope[2, p, q] + rate * slope[3, p, q]
                bent = phi * slope[4, p, q] + rate * slope[5, p, q]
                if rule.varied:
                    bend = axpy(rate, pi, scale(phi, force))
                    at_k = scale(-2.0 * h / frames.length[f], at(Z[k], rotation_node(frames, f)))
                    bent += local_rotation.square_slope(at_k, bend)[p][q]
                for j in range(rule.weight.size):
                    total = rule.beta[j, i] * by_pi + rule.alpha[j, i] * by_force
                    total -= rule.closing[j] * rule.weight[i] * bent
                    values[e, k, j] += total


@kernel
def _add_spinning(system: System, stages: Stages, h: float, i: int) -> None:
    """As ``_add_turning`` where the parameters are not varied: of the angular momentum J W."""
    node, bodies = stages.start, system.bodies
    for k in range(stages.slope.shape[0]):
        put_matrix(stages.slope, k, skew(ZERO))
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        J, H, W = matrix_at(node.bodies.J, b), matrix_at(stages.tangent, f), at(node.frames.W, f)
        c, c_dot = at(stages.turn, f), at(stages.turning, f)
        # J turns with the body, W is H c_dot.
        turned = combine(1.0, product(J, skew(W)), skew(scale(-1.0, times(J, W))))
        by_c = combine(1.0, product(turned, H), product(J, local_rotation.momentum_slope(c, c_dot)))
        put_matrix(stages.slope, 0, by_c)
        put_matrix(stages.slope, 1, product(J, H))
        _enter_turning(system, stages, h, i, b)
