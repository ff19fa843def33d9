"""Rigid body: Hamilton's weak principle over one step, its energy, its free acceleration.

Over a step of size h the body is displaced by u and turned by Q (inertial axes); its equations,
with the end values of velocity used up, are

    m (2 u/h - 2 v0)                    = h F                     mean force, inertial axes
    R(Q) L - J0 W0                      = h T ,   L = J0 (2 Q/h - W0)      mean moment about G

    J0 = R0 J R0^T    inertia about G at the start, inertial axes [kg m^2]
    W0 = R0 w0        angular velocity at the start, inertial axes [rad/s]

F and T come from gravity and from the elements at the body. Multiplied by h/(2 m) and h/(2 m l),
l a length of the body, both rows are in metres whatever the step; so are the unknowns u and l Q.
Derivative of the second row (times h/2) by Q: R J0 - [R L h/2] D, with D of ``rotation``.

Turns by the angle have psi Q in place of Q in L, and psi times the left side of the second row, psi
= 2 atan(|Q|/2)/|Q|: h times the mean angular velocity is then the turn itself.

A decaying scheme (``schemes.Decay``) has u/h = (v0 + v1)/2 + chi/2 y, y = v1 - v0 - s, with

    s' = pole s + (1 - pole) (v1 - v0)                 smoothed change of v, handed on
    v1 = v0 + (u/h - v_go)/share ,   v_go = v0 - chi/2 s ,   share = (1 + chi)/2

and the same for the turn, in body axes; share h takes the place of h/2. As m (v1 - v0) = h F, the
body loses chi/2 m y.(v1 - v0) a step, which is never negative in sum: with S = chi m s.s/(4 (1 -
pole)), it is the rise of S plus chi m (1 + pole) y.y/4.
Source: Borri, Mello, Atluri, Primal and mixed forms of Hamilton's principle for constrained rigid
body systems, Comput. Mech. 7 (1991); the turn as increment is ours.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import angle_share, matrix, turn_change, turn_tangent
from msahl.algebra.vector import (
    ZERO,
    Matrix,
    Vector,
    accumulate,
    add,
    at,
    axpy,
    cross,
    dot,
    matrix_at,
    multiple,
    product,
    put,
    put_matrix,
    scale,
    skew,
    sub,
    times,
    transpose,
)
from msahl.jit.kernel import kernel
from msahl.model.scheme import Decay


class Bodies(NamedTuple):
    """All bodies, the ground last with index n: it has no equations, its inverse mass is zero."""

    inverse_mass: np.ndarray  # (n+1,) [1/kg]
    inertia: np.ndarray  # (n+1, 3, 3) about G, body axes [kg m^2]
    r_BG: np.ndarray  # (n+1, 3) from the reference point B to the mass centre G, body axes [m]
    length: np.ndarray  # (n+1,) l, the length that makes a turn a displacement [m]
    exponential: bool | None  # whether h times the mean W is the turn itself; None where it is Q
    ballistic: np.ndarray  # (n+1,) whether nothing but gravity acts on it
    moves: np.ndarray  # (2, 3) 0 for components of u and v, of Q and W, that are zero for ever; 1
    gravity: np.ndarray  # (3,) inertial axes [m/s^2]
    block: np.ndarray  # (n+1,) where the derivative of the moment by the turn starts


class BodyStart(NamedTuple):
    """What the step's equations need of its start, in inertial axes."""

    R: np.ndarray  # (n+1, 3, 3) body to inertial axes
    J: np.ndarray  # (n+1, 3, 3) [kg m^2]
    v: np.ndarray  # (n+1, 3) of G [m/s]
    W: np.ndarray  # (n+1, 3) [rad/s]
    v_go: np.ndarray  # (n+1, 3) with which it would go on if no force acted [m/s]
    W_go: np.ndarray  # (n+1, 3) likewise [rad/s]
    v_offset: np.ndarray  # (n+1, 3) its part by the loads' first moments, d/h [m/s]
    W_offset: np.ndarray  # (n+1, 3) likewise [rad/s]


@kernel
def moving(bodies: Bodies, kind: int, a: Vector) -> Vector:
    """A displacement or velocity ``a`` (``kind`` 0), or one of rotation (1), without the components
    that a planar system does not have.

    Nobody solves for these. Left to themselves they would start as round-off and be multiplied by
    every extrapolation from one step to the next.
    """
    moves = bodies.moves
    return (moves[kind, 0] * a[0], moves[kind, 1] * a[1], moves[kind, 2] * a[2])


@kernel
def turn_of(bodies: Bodies, Z: np.ndarray, b: int) -> Vector:
    """The step turn Q of body ``b`` in the unknowns ``Z`` (which hold l Q)."""
    return scale(1.0 / bodies.length[b], at(Z, 2 * b + 1))


@kernel
def mean(bodies: Bodies, Z: np.ndarray, b: int, a: Vector) -> Vector:
    """Mean over the step of a vector fixed in body ``b`` that starts as ``a``."""
    return axpy(0.5, turn_change(turn_of(bodies, Z, b), a), a)


@kernel
def end_tangent(bodies: Bodies, Z: np.ndarray, b: int, a: Vector) -> Matrix:
    """``T`` with ``d(R(Q) a) = -T d(l Q)``."""
    Q = turn_of(bodies, Z, b)
    T = product(skew(add(a, turn_change(Q, a))), turn_tangent(Q))
    c = 1.0 / bodies.length[b]
    return multiple(c, T)


@kernel
def push(bodies: Bodies, dt2: float, F: np.ndarray, b: int, force: Vector, moment: Vector) -> None:
    """Take a mean ``force`` and a mean ``moment`` about G from the rows of body ``b``."""
    c = dt2 * bodies.inverse_mass[b]
    accumulate(F, 2 * b, scale(-c, force))
    accumulate(F, 2 * b + 1, scale(-c / bodies.length[b], moment))


@kernel
def add_force_by_mass(bodies: Bodies, F: np.ndarray, b: int, force: Vector, moment: Vector) -> None:
    """Add a ``force`` by mass and a ``moment`` about G by mass and length to the rows of body ``b``
    [m/s^2].
    """
    c = bodies.inverse_mass[b]
    accumulate(F, 2 * b, scale(c, force))
    accumulate(F, 2 * b + 1, scale(c / bodies.length[b], moment))


@kernel
def prepare(
    bodies: Bodies,
    p: np.ndarray,
    v: np.ndarray,
    w: np.ndarray,
    v_rise: np.ndarray,
    w_rise: np.ndarray,
    chi: float,
    start: BodyStart,
) -> None:
    """Carry velocities and inertias of the accepted state into inertial axes."""
    for b in range(bodies.inverse_mass.size):
        R = matrix(at(p, b))
        put_matrix(start.R, b, R)
        put_matrix(start.J, b, product(product(R, matrix_at(bodies.inertia, b)), transpose(R)))
        put(start.v, b, moving(bodies, 0, at(v, b)))
        put(start.W, b, moving(bodies, 1, times(R, at(w, b))))
        put(start.v_go, b, at(start.v, b))
        put(start.W_go, b, at(start.W, b))
        if chi > 0.0:
            v_go = axpy(-0.5 * chi, at(v_rise, b), at(v, b))
            w_go = axpy(-0.5 * chi, at(w_rise, b), at(w, b))
            put(start.v_go, b, moving(bodies, 0, v_go))
            put(start.W_go, b, moving(bodies, 1, times(R, w_go)))
        put(start.v_offset, b, ZERO)
        put(start.W_offset, b, ZERO)


@kernel
def offset(start: BodyStart, b: int, dv: Vector, dW: Vector) -> None:
    """Let body ``b`` go on by ``dv`` and ``dW`` more than without the loads' first moments."""
    put(start.v_go, b, add(at(start.v_go, b), sub(dv, at(start.v_offset, b))))
    put(start.W_go, b, add(at(start.W_go, b), sub(dW, at(start.W_offset, b))))
    put(start.v_offset, b, dv)
    put(start.W_offset, b, dW)


@kernel
def lost(bodies: Bodies, start: BodyStart, h: float, a: np.ndarray, alpha: np.ndarray) -> float:
    """Work [J] that all forces together do not do in the offsets of a step: M (v1 - v0) . d/h."""
    total = 0.0
    for b in range(bodies.inverse_mass.size - 1):
        spun = times(matrix_at(start.J, b), at(alpha, b))
        total += dot(at(a, b), at(start.v_offset, b)) / bodies.inverse_mass[b]
        total += dot(spun, at(start.W_offset, b))
    return h * total


@kernel
def residual(
    bodies: Bodies, start: BodyStart, h: float, dt2: float, Z: np.ndarray, F: np.ndarray
) -> None:
    """Set the rows of every body to inertia minus gravity [m]; ``reach`` is share h^2."""
    g = (bodies.gravity[0], bodies.gravity[1], bodies.gravity[2])
    for b in range(bodies.inverse_mass.size - 1):
        put(F, 2 * b, sub(at(Z, 2 * b), axpy(h, at(start.v_go, b), scale(dt2, g))))
        Q = turn_of(bodies, Z, b)
        J = matrix_at(start.J, b)
        psi = angle_share(Q)[0] if bodies.exponential is not None else 1.0
        forced = axpy(-h, at(start.W_go, b), scale(psi, Q))
        L = times(J, axpy(dt2 / h, at(start.W, b), forced))
        change = scale(psi, add(times(J, forced), turn_change(Q, L)))
        put(F, 2 * b + 1, scale(bodies.inverse_mass[b] / bodies.length[b], change))


@kernel
def jacobian(
    bodies: Bodies, start: BodyStart, h: float, dt2: float, Z: np.ndarray, values: np.ndarray
) -> None:
    """Add the derivative of the moment rows by l Q; that of the force rows is constant."""
    for b in range(bodies.inverse_mass.size - 1):
        Q = turn_of(bodies, Z, b)
        J = matrix_at(start.J, b)
        psi, g = angle_share(Q) if bodies.exponential is not None else (1.0, 0.0)
        forced = axpy(-h, at(start.W_go, b), scale(psi, Q))
        L = times(J, axpy(dt2 / h, at(start.W, b), forced))
        K = skew(add(L, turn_change(Q, L)))
        JQ, change = times(J, Q), add(times(J, forced), turn_change(Q, L))
        D = turn_tangent(Q)
        c = bodies.inverse_mass[b] / (bodies.length[b] * bodies.length[b])
        for j in range(3):
            Jj = (J[0][j], J[1][j], J[2][j])
            Dj = (D[0][j], D[1][j], D[2][j])
            if bodies.exponential is not None:
                Jj = axpy(g * Q[j], JQ, scale(psi, Jj))
            column = sub(add(Jj, turn_change(Q, Jj)), times(K, Dj))
            if bodies.exponential is not None:
                column = axpy(g * Q[j], change, scale(psi, column))
            for i in range(3):
                values[bodies.block[b] + 3 * i + j] += c * column[i]


@kernel
def smooth(
    bodies: Bodies,
    decay: Decay,
    b: int,
    dv: Vector,
    dw: Vector,
    v_rise: np.ndarray,
    w_rise: np.ndarray,
) -> float:
    """Take the changes of a body's velocities into the smoothed ones; the energy it lost [J]."""
    y_v, y_w = sub(dv, at(v_rise, b)), sub(dw, at(w_rise, b))
    put(v_rise, b, axpy(decay.pole, at(v_rise, b), scale(1.0 - decay.pole, dv)))
    put(w_rise, b, axpy(decay.pole, at(w_rise, b), scale(1.0 - decay.pole, dw)))
    turning = dot(y_w, times(matrix_at(bodies.inertia, b), dw))
    return 0.5 * decay.chi * (dot(y_v, dv) / bodies.inverse_mass[b] + turning)


@kernel
def free_acceleration(bodies: Bodies, start: BodyStart, F: np.ndarray) -> None:
    """Set the rows of every body to the forces no element gives: gravity and gyroscopic moment."""
    g = (bodies.gravity[0], bodies.gravity[1], bodies.gravity[2])
    for b in range(bodies.inverse_mass.size - 1):
        W = at(start.W, b)
        moment = cross(times(matrix_at(start.J, b), W), W)
        put(F, 2 * b, g)
        put(F, 2 * b + 1, scale(bodies.inverse_mass[b] / bodies.length[b], moment))


@kernel
def energy(bodies: Bodies, x: np.ndarray, v: np.ndarray, w: np.ndarray) -> tuple[float, float]:
    """Kinetic and potential energy [J] (Hainge 2010, eq. 3.5-3.9; the potential is -m g.x_G)."""
    kinetic = 0.0
    potential = 0.0
    for b in range(bodies.inverse_mass.size - 1):
        m = 1.0 / bodies.inverse_mass[b]
        vb, wb, xb = at(v, b), at(w, b), at(x, b)
        kinetic += 0.5 * (m * dot(vb, vb) + dot(wb, times(matrix_at(bodies.inertia, b), wb)))
        for i in range(3):
            potential -= m * bodies.gravity[i] * xb[i]
    return kinetic, potential


@kernel
def publish(
    bodies: Bodies,
    x: np.ndarray,
    p: np.ndarray,
    start: BodyStart,
    w: np.ndarray,
    table: np.ndarray,
    row: int,
) -> None:
    """Write the published state of every body into a row of ``table``: 12 numbers, of point B."""
    for b in range(bodies.inverse_mass.size - 1):
        R = matrix_at(start.R, b)
        r = at(bodies.r_BG, b)
        w_b = at(w, b)
        place = 12 * b
        v_B = sub(times(transpose(R), at(start.v, b)), cross(w_b, r))
        for i, values in enumerate((sub(at(x, b), times(R, r)), at(p, b), v_B, w_b)):
            for j in range(3):
                table[row, place + 3 * i + j] = values[j]


@kernel
def recall(
    bodies: Bodies,
    table: np.ndarray,
    row: int,
    x: np.ndarray,
    p: np.ndarray,
    v: np.ndarray,
    w: np.ndarray,
) -> None:
    """Set the state of every body to what ``publish`` wrote into a row of ``table``."""
    for b in range(bodies.inverse_mass.size - 1):
        place = 12 * b
        P, spin = three(table, row, place + 3), three(table, row, place + 9)
        R = matrix(P)
        r = at(bodies.r_BG, b)
        put(x, b, add(three(table, row, place), times(R, r)))
        put(p, b, P)
        put(v, b, times(R, add(three(table, row, place + 6), cross(spin, r))))
        put(w, b, spin)


@kernel
def three(table: np.ndarray, row: int, column: int) -> Vector:
    """Three numbers of a ``row`` of ``table`` from ``column`` on."""
    return (table[row, column], table[row, column + 1], table[row, column + 2])
