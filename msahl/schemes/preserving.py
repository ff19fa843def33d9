"""The energy-preserving time element: Hamilton's weak principle at lowest order.

    x1 - x0 = h (v0 + v1)/2                    (a)   used up: v1 = 2 u/h - v0
    Q       = h (W0 + W1)/2  in body axes      (b)   used up: w1 = 2 R0^T Q/h - w0
    momentum balances of every body            (c), (d)   ``bodies.rigid``
    joints closed at the end of the step       (e)        ``joints.coincide``

Unknowns of a step are lengths [m]: the displacements u, the turns l Q, the multipliers lam h^2/2m;
rows are lengths too. So the Jacobian tends to a limit as h -> 0, and a residual is judged against
the size of the step's own motion. Forces act with mean arms: a conservative scene keeps its energy
to the residual, at any h. Source: Hainge 2010, chapter II; Borri, Mello, Atluri 1991;
Bottasso, Dopico, Trainelli, On the optimal scaling of index three DAEs, Multibody Syst. Dyn. 19
(2008), for the scaling.
"""

import numpy as np

from msahl.bodies import rigid
from msahl.forces import concentrated
from msahl.joints import coincide
from msahl.kernel import kernel
from msahl.rotation import compose, from_step_turn, turn_change
from msahl.system.arrays import Start, State, System, Tables
from msahl.vector import add, at, axpy, matrix_at, put, scale, sub, times, transpose


@kernel
def prepare(system: System, state: State, start: Start) -> None:
    """Fill ``start`` from the accepted ``state``."""
    rigid.prepare(system.bodies, state.p, state.v, state.w, start.bodies)
    coincide.prepare(system.coincide, start.bodies.R, start.coincide)
    concentrated.prepare(system.loads, start.bodies.R, start.loads)


@kernel
def predict(system: System, state: State, start: Start, h: float, Z: np.ndarray) -> None:
    """First guess of the unknowns: accelerations and joint forces go on as they changed last."""
    half_h2 = 0.5 * h * h
    bodies = system.bodies
    g = (bodies.gravity[0], bodies.gravity[1], bodies.gravity[2])
    for b in range(bodies.inverse_mass.size - 1):
        # Exact where nothing but gravity acts: that displacement need not be solved for.
        a = g if bodies.ballistic[b] else add(at(state.a, b), at(state.a_trend, b))
        put(Z, 2 * b, axpy(h, at(start.bodies.v, b), scale(half_h2, a)))
        alpha = add(at(state.alpha, b), at(state.alpha_trend, b))
        turn = axpy(h, at(start.bodies.W, b), scale(half_h2, alpha))
        put(Z, 2 * b + 1, scale(bodies.length[b], turn))
    for k in range(system.coincide.a.size):
        force = add(at(state.force, k), at(state.force_trend, k))
        put(Z, system.coincide.row[k], scale(half_h2 / system.coincide.mass[k], force))


@kernel
def residual(system: System, start: Start, h: float, Z: np.ndarray, F: np.ndarray) -> None:
    """Set ``F`` (nodes, 3) to the rows of the step's equations at ``Z`` [m]."""
    half_h2 = 0.5 * h * h
    rigid.residual(system.bodies, start.bodies, h, Z, F)
    coincide.residual(system.coincide, start.coincide, system.bodies, half_h2, Z, F)
    concentrated.residual(system.loads, start.loads, system.bodies, half_h2, Z, F)


@kernel
def jacobian(system: System, start: Start, h: float, Z: np.ndarray, values: np.ndarray) -> None:
    """Set the block ``values`` to the derivative of the rows by the unknowns."""
    half_h2 = 0.5 * h * h
    for i in range(values.size):
        values[i] = system.constant[i]
    rigid.jacobian(system.bodies, start.bodies, h, Z, values)
    coincide.jacobian(system.coincide, start.coincide, system.bodies, half_h2, Z, values)
    concentrated.jacobian(system.loads, start.loads, system.bodies, half_h2, Z, values)


@kernel
def step_size(system: System, start: Start, h: float, Z: np.ndarray) -> float:
    """The step's own length [m], by which a residual is judged: its largest term."""
    largest = 0.0
    for i in range(3):
        largest = max(largest, 0.5 * h * h * abs(system.bodies.gravity[i]))
    for b in range(system.bodies.inverse_mass.size - 1):
        for i in range(3):
            largest = max(largest, h * abs(start.bodies.v[b, i]))
            largest = max(largest, h * abs(start.bodies.W[b, i]) * system.bodies.length[b])
    for node in range(Z.shape[0]):
        for i in range(3):
            largest = max(largest, abs(Z[node, i]))
    return largest


@kernel
def accept(
    system: System, state: State, start: Start, h: float, Z: np.ndarray, F: np.ndarray
) -> None:
    """Advance ``state`` by the solved step; ``F`` is the residual at ``Z``."""
    bodies = system.bodies
    for b in range(bodies.inverse_mass.size - 1):
        u = at(Z, 2 * b)
        Q = rigid.turn_of(bodies, Z, b)
        v0, W0 = at(start.bodies.v, b), at(start.bodies.W, b)
        v1 = sub(scale(2.0 / h, u), v0)
        W1 = sub(scale(2.0 / h, Q), W0)
        W1 = add(W1, turn_change(Q, W1))
        q = times(transpose(matrix_at(start.bodies.R, b)), Q)
        for i in range(3):
            total = state.x[b, i] + (u[i] + state.x_low[b, i])
            state.x_low[b, i] += u[i] - (total - state.x[b, i])
            state.x[b, i] = total
        put(state.p, b, compose(from_step_turn(Q), at(state.p, b)))
        put(state.v, b, v1)
        put(state.w, b, sub(scale(2.0 / h, q), at(state.w, b)))
        a, alpha = scale(1.0 / h, sub(v1, v0)), scale(1.0 / h, sub(W1, W0))
        put(state.a_trend, b, sub(a, at(state.a, b)))
        put(state.alpha_trend, b, sub(alpha, at(state.alpha, b)))
        put(state.a, b, a)
        put(state.alpha, b, alpha)
    for k in range(system.coincide.a.size):
        row = system.coincide.row[k]
        force = scale(2.0 * system.coincide.mass[k] / (h * h), at(Z, row))
        put(state.force_trend, k, sub(force, at(state.force, k)))
        put(state.force, k, force)
        put(state.gap, k, at(F, row))
    concentrated.work(system.loads, start.loads, bodies, Z, state.work)


@kernel
def free_acceleration(system: System, start: Start, F: np.ndarray) -> None:
    """Set the rows to what accelerations must balance, for ``jacobian`` at rest with h^2 = 2."""
    rigid.free_acceleration(system.bodies, start.bodies, F)
    coincide.free_gap_acceleration(system.coincide, start.coincide, start.bodies.W, F)
    concentrated.free_acceleration(system.loads, start.loads, system.bodies, F)


@kernel
def publish(
    system: System, state: State, start: Start, force: np.ndarray, tables: Tables, row: int
) -> None:
    """Write a row of results: the accepted, prepared state and the joint ``force`` before it."""
    rigid.publish(system.bodies, state.x, state.p, start.bodies, state.w, tables.states, row)
    for k in range(system.coincide.a.size):
        for i in range(3):
            tables.reactions[row, 3 * k + i] = force[k, i]
    for k in range(system.loads.body.size):
        tables.work[row, k] = state.work[k]


@kernel
def observe(
    system: System, state: State, start: Start, gap: np.ndarray, rate: np.ndarray
) -> tuple[float, float]:
    """Kinetic and potential energy [J]; fills the joints' gaps [m] and gap rates [m/s] (k, 3)."""
    coincide.gap(system.coincide, start.coincide, state.x, gap)
    coincide.gap_rate(system.coincide, start.coincide, start.bodies, rate)
    return rigid.energy(system.bodies, state.x, state.v, state.w)
