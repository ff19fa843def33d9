"""The time element: Hamilton's weak principle at lowest order.

    x1 - x0 = h (v0 + v1)/2                    (a)   used up: v1 = 2 u/h - v0
    Q       = h (W0 + W1)/2  in body axes      (b)   used up: w1 = 2 R0^T Q/h - w0
    momentum balances of every body            (c), (d)   ``bodies.rigid``
    joints closed at the end of the step       (e)        ``joints.coincide``, ``joints.rows``

Unknowns of a step are lengths [m]: the displacements u, the turns l Q, the multipliers lam h^2/2m;
rows are lengths too. So the Jacobian tends to a limit as h -> 0, and a residual is judged against
the size of the step's own motion. Forces are discrete gradients: a conservative scene keeps its
energy to the residual, at any h. With a ``Decay`` (a), (b) and the springs take energy from what is
quick against the step (``bodies.rigid``, ``forces.spring``), h^2/2 becomes ``reach``, and what has
been taken is the last of the state's work. Source: Hainge 2010, chapter II; Borri, Mello, Atluri
1991; Bottasso, Dopico, Trainelli, On the optimal scaling of index three DAEs, Multibody Syst. Dyn.
19 (2008), for the scaling; the decay is ours.
"""

import numpy as np

from msahl.algebra.rotation import angle_share, compose, from_step_turn, of_angle
from msahl.algebra.vector import (
    Vector,
    add,
    at,
    axpy,
    dot,
    matrix_at,
    put,
    scale,
    sub,
    times,
    transpose,
)
from msahl.elements import forces, reactions, rigid_body
from msahl.elements.constraints import coincide, scalar
from msahl.elements.frames import (
    displacement_node,
    first_multiplier,
    moving_count,
    restrict,
    rotation_increment,
    rotation_node,
)
from msahl.jit.kernel import kernel
from msahl.system.arrays import State, System, SystemWorkspace, Tables
from msahl.system.evaluate import dt2, joint_jacobian, set_reactions


@kernel
def load(system: System, state: State, start: SystemWorkspace, h: float) -> bool:
    """Set the loads to their means over a step ``h``; whether they have first moments, too."""
    t, R = state.time[0], start.frames.R
    return forces.over_step(system.forces, start.forces, t, h, R)


@kernel
def predict(system: System, state: State, start: SystemWorkspace, h: float, Z: np.ndarray) -> None:
    """First guess of the unknowns: accelerations and joint forces go on as they changed last.

    Offsets by the loads are not in it: a step is judged by how far it leads beyond its guess.
    """
    h2 = dt2(system, h)
    frames, gravity = system.frames, system.bodies.gravity
    g = (gravity[0], gravity[1], gravity[2])
    for b in range(moving_count(frames)):
        # Exact where nothing but gravity acts: that displacement need not be solved for.
        a = g if frames.ballistic[b] else add(at(state.a, b), expected(state, state.a_trend, b))
        v = sub(at(start.frames.v_go, b), at(start.frames.v_offset, b))
        W = sub(at(start.frames.W_go, b), at(start.frames.W_offset, b))
        put(Z, displacement_node(frames, b), restrict(frames, 0, axpy(h, v, scale(h2, a))))
        alpha = add(at(state.alpha, b), expected(state, state.alpha_trend, b))
        turn = axpy(h, W, scale(h2, alpha))
        turn = of_angle(turn) if frames.exponential is not None else turn
        put(Z, rotation_node(frames, b), scale(frames.length[b], restrict(frames, 1, turn)))
    first = first_multiplier(frames)
    for k in range(state.force.shape[0]):
        guess = add(at(state.force, k), expected(state, state.force_trend, k))
        for i in range(3):
            Z[first + k, i] = guess[i] * h2 / system.unit[k, i]


@kernel
def expected(state: State, trend: np.ndarray, k: int) -> Vector:
    """The next change of a quantity: by its last three, unless the last one tells better."""
    return by_three(trend, k) if state.foresight[0] > 0.0 else at(trend[0], k)


@kernel
def by_three(trend: np.ndarray, k: int) -> Vector:
    """The next change of what goes on as a parabola, and of what alternates from step to step, as
    means over a step do where the scheme keeps all that is quicker than it.
    """
    return sub(add(at(trend[0], k), at(trend[1], k)), at(trend[2], k))


@kernel
def gain(trend: np.ndarray, k: int, change: Vector) -> float:
    """By how much (squared) the last three changes tell this one better than the last does."""
    by_last, rest = sub(change, at(trend[0], k)), sub(change, by_three(trend, k))
    return dot(by_last, by_last) - dot(rest, rest)


@kernel
def keep(trend: np.ndarray, k: int, change: Vector) -> None:
    """Make ``change`` the last of the quantity ``k``."""
    put(trend[2], k, at(trend[1], k))
    put(trend[1], k, at(trend[0], k))
    put(trend[0], k, change)


@kernel
def residual(
    system: System, state: State, start: SystemWorkspace, h: float, Z: np.ndarray, F: np.ndarray
) -> None:
    """Set ``F`` (nodes, 3) to the rows of the step's equations at ``Z`` [m]."""
    h2 = dt2(system, h)
    frames, t = system.frames, state.time[0]
    rigid_body.residual(system.bodies, frames, start.bodies, start.frames, h, h2, Z, F)
    coincide.residual(system.coincide, start.coincide, frames, h2, Z, F)
    scalar.residual(system.scalar, start.scalar, frames, state.violation, t, h, h2, Z, F)
    forces.mean_residual(
        system.forces, start.forces, system.scalar, start.scalar, frames, h, h2, Z, F
    )


@kernel
def jacobian(
    system: System, start: SystemWorkspace, h: float, Z: np.ndarray, values: np.ndarray
) -> None:
    """Set the block ``values`` to the derivative of the rows by the unknowns, after ``residual``
    at the same ``Z``.
    """
    joint_jacobian(system, start, h, Z, values)
    h2 = dt2(system, h)
    forces.mean_jacobian(
        system.forces, start.forces, system.scalar, start.scalar, system.frames, h, h2, Z, values
    )


@kernel
def step_size(system: System, start: SystemWorkspace, h: float, Z: np.ndarray) -> float:
    """The step's own length [m], by which a residual is judged: its largest term."""
    largest = 0.0
    for i in range(3):
        largest = max(largest, dt2(system, h) * abs(system.bodies.gravity[i]))
    for b in range(moving_count(system.frames)):
        for i in range(3):
            largest = max(largest, h * abs(start.frames.v[b, i]))
            largest = max(largest, h * abs(start.frames.W[b, i]) * system.frames.length[b])
    for node in range(Z.shape[0]):
        for i in range(3):
            largest = max(largest, abs(Z[node, i]))
    return largest


@kernel
def accept(
    system: System, state: State, start: SystemWorkspace, h: float, Z: np.ndarray, F: np.ndarray
) -> None:
    """Advance ``state`` by the solved step; ``F`` is the residual at ``Z``, evaluated last."""
    frames, bodies, t, h2 = system.frames, system.bodies, state.time[0], dt2(system, h)
    decay, per_step = system.decay, h / dt2(system, h)
    loss, gained = 0.0, 0.0
    forces.mean_work(
        system.forces, start.forces, system.scalar, start.scalar, frames, h, Z, state.work
    )
    scalar.accept(system.scalar, start.scalar, frames, t, h, h2, Z, state.angle, state.work)
    for b in range(moving_count(frames)):
        u = at(Z, displacement_node(frames, b))
        Q = rotation_increment(frames, Z, b)
        v0 = at(start.frames.v, b)
        v1 = add(v0, scale(per_step, axpy(-h, at(start.frames.v_go, b), u)))
        turn = scale(angle_share(Q)[0], Q) if frames.exponential is not None else Q
        turned = axpy(-h, at(start.frames.W_go, b), turn)
        dw = scale(per_step, times(transpose(matrix_at(start.frames.R, b)), turned))
        for i in range(3):
            total = state.x[b, i] + (u[i] + state.x_low[b, i])
            state.x_low[b, i] += u[i] - (total - state.x[b, i])
            state.x[b, i] = total
        put(state.p, b, compose(from_step_turn(Q), at(state.p, b)))
        put(state.v, b, v1)
        put(state.w, b, add(at(state.w, b), dw))
        if decay.chi > 0.0 and frames.owner[b] >= 0:
            dv, body = sub(v1, v0), frames.owner[b]
            loss += rigid_body.smooth(bodies, decay, body, dv, dw, state.v_rise, state.w_rise)
        # As the guess has it: the change of W that is not the body's own turning.
        a, alpha = scale(1.0 / h, sub(v1, v0)), scale(1.0 / h2, turned)
        da, dalpha = sub(a, at(state.a, b)), sub(alpha, at(state.alpha, b))
        gained += gain(state.a_trend, b, da)
        gained += frames.length[b] ** 2 * gain(state.alpha_trend, b, dalpha)
        keep(state.a_trend, b, da)
        keep(state.alpha_trend, b, dalpha)
        put(state.a, b, a)
        put(state.alpha, b, alpha)
    if forces.has_first(start.forces):
        lost = rigid_body.lost(bodies, start.bodies, start.frames, h, state.a, state.alpha)
        forces.work_of_first(system.forces, start.forces, h, state.a, state.alpha, lost, state.work)
    state.foresight[0] = 1.0 if gained >= 0.0 else 0.0
    if decay.chi > 0.0:
        loss += forces.smooth(system.forces, start.forces, system.scalar, start.scalar, decay.pole)
        state.work[state.work.size - 1] -= loss
    _enter_multipliers(system, state, start, h, Z, F)
    state.time[0] += h


@kernel
def _enter_multipliers(
    system: System, state: State, start: SystemWorkspace, h: float, Z: np.ndarray, F: np.ndarray
) -> None:
    """Set joint forces, reactions and gaps of the state from the solution."""
    first = first_multiplier(system.frames)
    for k in range(state.force.shape[0]):
        before = at(state.force, k)
        for i in range(3):
            state.force[k, i] = Z[first + k, i] * system.unit[k, i] / dt2(system, h)
            state.violation[k, i] = F[first + k, i]
        keep(state.force_trend, k, sub(at(state.force, k), before))
    scalar.update_reaction_trend(system.scalar, state.reaction, state.reaction_trend, 0.0, -1.0)
    set_reactions(system, state, start, Z)
    scalar.update_reaction_trend(system.scalar, state.reaction, state.reaction_trend, 1.0, 1.0)


@kernel
def publish(
    system: System,
    state: State,
    start: SystemWorkspace,
    h: float,
    mean_reaction: np.ndarray,
    mean_force: np.ndarray,
    tables: Tables,
    row: int,
) -> None:
    """Write a row of results: the accepted, observed state, joints over the step ``h`` before."""
    rigid_body.write_states(
        system.bodies, state.x, state.p, start.frames, state.w, tables.states, row
    )
    reactions.write_reactions(
        system.shown,
        system.scalar,
        mean_reaction,
        mean_force,
        state.time[0] - 0.5 * h,
        tables.reactions,
        row,
    )
    for k in range(state.work.size):
        tables.work[row, k] = state.work[k]
    for k in range(state.work.size, tables.work.shape[1]):
        tables.work[row, k] = 0.0
    forces.publish_energy(system.forces, start.forces, state.work.size, tables.work, row)
