"""Evaluates the step equations of order 2: Hamilton's weak principle with linear polynomials.

    x1 - x0 = h (v0 + v1)/2                    (a)   eliminates v1 = 2 u/h - v0
    Q       = h (W0 + W1)/2  in body axes      (b)   eliminates w1 = 2 R0^T Q/h - w0
    momentum balances of every body            (c), (d)   ``formulations.absolute.rigid_body``
    constraints at the end of the step         (e)        ``elements.constraints``

    x, v       position and velocity of the mass centre, inertial axes [m], [m/s]
    R, W, w    orientation; angular velocity in inertial axes and in body axes [rad/s]
    u = x1 - x0   displacement [m];   Q   rotation increment [rad];   0, 1   start and end
    h          size of the step [s]

Unknowns of a step are lengths [m]: the displacements u, the rotations l Q, the multipliers
lam h^2/(2 m), with the length l and the mass m of a frame. Equations are lengths too. So the
Jacobian tends to a limit as h -> 0, and a residual is judged relative to the motion of the step.
Forces are discrete gradients: a conservative system conserves its energy to the residual, for any
h. In the decaying scheme (``Decay``), (a), (b) and the springs take energy from vibrations that are
fast relative to the step (``absolute.rigid_body``, ``ports.coordinate``), dt2 is more than
h^2/2, and the energy taken is the last of the state's works.

Source: Hainge 2010, chapter II; M. Borri, F. Mello, S. N. Atluri 1991; C. L. Bottasso, D. Dopico,
L. Trainelli, On the optimal scaling of index three DAEs, Multibody Syst. Dyn. 19 (2008), for the
scaling; the decay is ours.
"""

import numpy as np

from msahl.algebra.rotation import angle_share, compose, from_increment, of_angle
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
from msahl.elements.beams import midpoint as beams
from msahl.elements.constraints import coincide, scalar
from msahl.elements.signals import results
from msahl.formulations.absolute import rigid_body
from msahl.formulations.absolute.frames import (
    displacement_node,
    first_multiplier,
    moving_count,
    put_rotation,
    restrict,
    rotation_increment,
    rotation_node,
)
from msahl.jit.kernel import apart, kernel, unit
from msahl.ports import forces
from msahl.system.arrays import State, System, SystemWorkspace
from msahl.system.evaluate import dt2, joint_jacobian, set_reactions

BY_THREE_CHANGES, BY_LAST_CHANGE, BY_LAST_STEP = 1.0, 0.0, -1.0
"""Values of ``State.prediction``: the next accelerations follow from the last three changes of them
or from the last one; or they are not predicted, since the last step's motion is nearer."""


@kernel
def set_loads(system: System, state: State, start: SystemWorkspace, h: float) -> bool:
    """Set the loads to their means over a step ``h``, and what signals are at its start; return
    whether loads have first moments.
    """
    forces.begin_signals(system.forces.signals, start.forces, system.scalar)
    return forces.over_step(system.forces, start.forces, state.time[0], h)


@apart
def predict(system: System, state: State, start: SystemWorkspace, h: float, Z: np.ndarray) -> None:
    """Set ``Z`` to the predicted unknowns, by extrapolated accelerations and constraint forces.

    The velocity offsets by the loads' first moments are omitted, as the length of the solved step
    is compared with that of the prediction.
    """
    h2 = dt2(system, h)
    frames, gravity = system.frames, system.bodies.gravity
    g = (gravity[0], gravity[1], gravity[2])
    for b in range(moving_count(frames)):
        # Exact where only gravity acts: that displacement is not solved for.
        a = g
        if not frames.ballistic[b]:
            a = add(at(state.a, b), expected_change(state, state.a_trend, b))
        v = sub(at(start.frames.v_go, b), at(start.frames.v_offset, b))
        W = sub(at(start.frames.W_go, b), at(start.frames.W_offset, b))
        put(Z, displacement_node(frames, b), restrict(frames, 0, axpy(h, v, scale(h2, a))))
        alpha = add(at(state.alpha, b), expected_change(state, state.alpha_trend, b))
        Q = axpy(h, W, scale(h2, alpha))
        Q = of_angle(Q) if frames.exponential else Q
        put_rotation(frames, Z, b, restrict(frames, 1, Q))
    first = first_multiplier(frames)
    for k in range(state.force.shape[0]):
        guess = add(at(state.force, k), expected_change(state, state.force_trend, k))
        for i in range(3):
            Z[first + k, i] = guess[i] * h2 / system.unit[k, i]


@apart
def repeat_last(
    system: System, state: State, start: SystemWorkspace, h: float, Z: np.ndarray
) -> None:
    """Set ``Z`` to the motion and the multipliers of the last step.

    Where a step is longer than the vibrations, the velocities at its ends, and with them the
    accelerations, alternate; their means over a step change little.
    """
    frames, h2 = system.frames, dt2(system, h)
    for b in range(moving_count(frames)):
        put(Z, displacement_node(frames, b), scale(h, at(state.mean_v, b)))
        put(Z, rotation_node(frames, b), scale(h * frames.length[b], at(state.mean_w, b)))
    first = first_multiplier(frames)
    for k in range(state.force.shape[0]):
        for i in range(3):
            Z[first + k, i] = state.force[k, i] * h2 / system.unit[k, i]


@kernel
def expected_change(state: State, trend: np.ndarray, k: int) -> Vector:
    """Predicted change: by the last three changes, unless the last one alone predicts better."""
    if state.prediction[0] == BY_THREE_CHANGES:
        return extrapolated_change(trend, k)
    return at(trend[0], k)


@kernel
def extrapolated_change(trend: np.ndarray, k: int) -> Vector:
    """Next change of a value that follows a parabola, or that alternates from step to step, as
    means over a step do where a scheme without damping cannot resolve a vibration.
    """
    return sub(add(at(trend[0], k), at(trend[1], k)), at(trend[2], k))


@kernel
def extrapolation_gain(trend: np.ndarray, k: int, change: Vector) -> float:
    """Squared error of predicting ``change`` by the last one, minus that by the last three."""
    by_last, rest = sub(change, at(trend[0], k)), sub(change, extrapolated_change(trend, k))
    return dot(by_last, by_last) - dot(rest, rest)


@kernel
def save_change(trend: np.ndarray, k: int, change: Vector) -> None:
    """Enter ``change`` as the last one of value ``k``."""
    put(trend[2], k, at(trend[1], k))
    put(trend[1], k, at(trend[0], k))
    put(trend[0], k, change)


@unit
def residual(
    system: System, state: State, start: SystemWorkspace, h: float, Z: np.ndarray, F: np.ndarray
) -> None:
    """Set ``F`` (nodes, 3) to the equations of the step at the unknowns ``Z`` [m]."""
    h2 = dt2(system, h)
    frames, t = system.frames, state.time[0]
    rigid_body.residual(system.bodies, frames, start.bodies, start.frames, h, h2, Z, F)
    coincide.residual(system.coincide, start.coincide, frames, h2, Z, F)
    scalar.residual(system.scalar, start.scalar, frames, state.violation, t, h, h2, Z, F)
    step = (h, h2, 0.5 * system.decay.chi)
    beams.residual(system.beams, start.beams, frames, step, Z, F)
    forces.mean_residual(system.forces, start.forces, system.scalar, frames, (h, h2), Z, F)


@unit
def jacobian(
    system: System, start: SystemWorkspace, h: float, Z: np.ndarray, values: np.ndarray
) -> None:
    """Set the block ``values`` to the derivative of the equations by the unknowns, after
    ``residual`` at the same ``Z``.
    """
    joint_jacobian(system, start, h, Z, values)
    h2 = dt2(system, h)
    forces.mean_jacobian(
        system.forces, start.forces, system.scalar, system.frames, (h, h2), Z, values
    )


@apart
def accept(
    system: System, state: State, start: SystemWorkspace, h: float, Z: np.ndarray, F: np.ndarray
) -> None:
    """Advance ``state`` by the solved step; ``F`` is the residual at ``Z``, evaluated last."""
    frames, t, h2 = system.frames, state.time[0], dt2(system, h)
    decay, loss, gained = system.decay, 0.0, 0.0
    forces.mean_work(system.forces, start.forces, system.scalar, frames, (h, h2), Z, state.work)
    results.accept(system.forces.signals, start.forces.signals, state.auxiliary)
    beams.accept(system.beams, start.beams, h, state.strain, state.work)
    forces.accept(system.forces, start.forces, system.scalar)
    scalar.accept(system.scalar, start.scalar, frames, t, h, h2, Z, state.angle, state.work)
    for b in range(moving_count(frames)):
        dissipated, by_a, by_alpha = _accept_frame(system, state, start, h, Z, b)
        loss += dissipated
        gained += by_a
        gained += by_alpha
    if forces.has_first(start.forces):
        deficit = rigid_body.offset_deficit(
            system.bodies, start.bodies, start.frames, h, state.a, state.alpha
        )
        forces.work_of_first(
            system.forces, start.forces, h, state.a, state.alpha, deficit, state.work
        )
    if state.prediction[0] != BY_LAST_STEP:
        state.prediction[0] = BY_THREE_CHANGES if gained >= 0.0 else BY_LAST_CHANGE
    if decay.chi > 0.0:
        loss += forces.smooth(system.forces, start.forces, system.scalar, decay.pole)
        loss += beams.smooth(system.beams, start.beams, 0.5 * decay.chi, decay.pole)
        state.work[state.work.size - 1] -= loss
    _accept_multipliers(system, state, start, h, Z, F)
    state.time[0] += h


@kernel
def _accept_frame(
    system: System, state: State, start: SystemWorkspace, h: float, Z: np.ndarray, b: int
) -> tuple[float, float, float]:
    """Advance frame ``b``; return the energy that a decaying scheme takes [J], and by how much
    three changes predicted its accelerations better than one, of a and of l alpha.
    """
    frames, decay, h2 = system.frames, system.decay, dt2(system, h)
    dissipated, per_step = 0.0, h / h2
    u = at(Z, displacement_node(frames, b))
    Q = rotation_increment(frames, Z, b)
    put(state.mean_v, b, scale(1.0 / h, u))
    put(state.mean_w, b, scale(1.0 / h, Q))
    v0 = at(start.frames.v, b)
    v1 = add(v0, scale(per_step, axpy(-h, at(start.frames.v_go, b), u)))
    theta = scale(angle_share(Q)[0], Q) if frames.exponential else Q
    gained_angle = axpy(-h, at(start.frames.W_go, b), theta)
    dw = scale(per_step, times(transpose(matrix_at(start.frames.R, b)), gained_angle))
    for i in range(3):
        total = state.x[b, i] + (u[i] + state.x_low[b, i])
        state.x_low[b, i] += u[i] - (total - state.x[b, i])
        state.x[b, i] = total
    put(state.p, b, compose(from_increment(Q), at(state.p, b)))
    put(state.v, b, v1)
    put(state.w, b, add(at(state.w, b), dw))
    if decay.chi > 0.0 and frames.owner[b] >= 0:
        dv, body = sub(v1, v0), frames.owner[b]
        dissipated = rigid_body.smooth(
            system.bodies, decay, body, dv, dw, state.v_rise, state.w_rise
        )
    # As the prediction has it: the change of W without that by the rotation of the frame itself.
    a, alpha = scale(1.0 / h, sub(v1, v0)), scale(1.0 / h2, gained_angle)
    da, dalpha = sub(a, at(state.a, b)), sub(alpha, at(state.alpha, b))
    by_a = extrapolation_gain(state.a_trend, b, da)
    by_alpha = frames.length[b] ** 2 * extrapolation_gain(state.alpha_trend, b, dalpha)
    save_change(state.a_trend, b, da)
    save_change(state.alpha_trend, b, dalpha)
    put(state.a, b, a)
    put(state.alpha, b, alpha)
    return dissipated, by_a, by_alpha


@kernel
def _accept_multipliers(
    system: System, state: State, start: SystemWorkspace, h: float, Z: np.ndarray, F: np.ndarray
) -> None:
    """Set constraint forces, reactions and violations of the state from the solution."""
    first = first_multiplier(system.frames)
    for k in range(state.force.shape[0]):
        before = at(state.force, k)
        for i in range(3):
            state.force[k, i] = Z[first + k, i] * system.unit[k, i] / dt2(system, h)
            state.violation[k, i] = F[first + k, i]
        save_change(state.force_trend, k, sub(at(state.force, k), before))
    scalar.update_reaction_trend(system.scalar, state.reaction, state.reaction_trend, 0.0, -1.0)
    set_reactions(system, state, start, Z)
    scalar.update_reaction_trend(system.scalar, state.reaction, state.reaction_trend, 1.0, 1.0)
