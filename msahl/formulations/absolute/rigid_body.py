"""Rigid body, a mass element: its balance of momentum over a step, energy and gyroscopic moment.

Over a step of size h the mass centre is displaced by u and the body rotates by the rotation
increment Q (inertial axes). By Hamilton's weak principle its equations,
with the end values of velocity used up, are

    m (2 u/h - 2 v0)                    = h F                     mean force, inertial axes
    R(Q) L - J0 W0                      = h T ,   L = J0 (2 Q/h - W0)      mean moment about G

    J0 = R0 J R0^T    inertia about G at the start, inertial axes [kg m^2]
    W0 = R0 w0        angular velocity at the start, inertial axes [rad/s]

F and T come from gravity and from the elements at the body. Multiplied by h/(2 m) and h/(2 m l),
l a length of the body, both equations are in metres whatever the step; so are the unknowns u and
l Q. The derivative of the second equation (times h/2) by Q is R J0 - [R L h/2] D, with D of
``algebra.rotation``.

The exponential-map update has psi Q in place of Q in L, and psi times the left side of the second
equation, psi = 2 atan(|Q|/2)/|Q|: h times the mean angular velocity is then the rotation vector.

A decaying scheme (``model.scheme.Decay``) has u/h = (v0 + v1)/2 + chi/2 y, y = v1 - v0 - s, with

    s' = pole s + (1 - pole) (v1 - v0)                 smoothed change of v, handed on
    v1 = v0 + (u/h - v_go)/share ,   v_go = v0 - chi/2 s ,   share = (1 + chi)/2

and the same for the rotation, in body axes; share h takes the place of h/2. As m (v1 - v0) = h F,
the body loses chi/2 m y.(v1 - v0) a step, which is never negative in sum: with S = chi m s.s/
(4 (1 - pole)), it is the rise of S plus chi m (1 + pole) y.y/4.
Source: Borri, Mello, Atluri, Primal and mixed forms of Hamilton's principle for constrained rigid
body systems, Comput. Mech. 7 (1991); the rotation increment as unknown is ours.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import angle_share, matrix, rotation_change, rotation_tangent
from msahl.algebra.vector import (
    Vector,
    add,
    at,
    axpy,
    combine,
    cross,
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
from msahl.formulations.absolute.frames import (
    Frames,
    FramesWorkspace,
    displacement,
    displacement_node,
    rotation_increment,
    rotation_node,
)
from msahl.jit.kernel import kernel
from msahl.model.scheme import Decay

STATE_SIZE, ACCELERATION_SIZE = 12, 6
"""Columns of a body in the table of states (position, orientation, velocity, angular velocity) and
in that of accelerations (linear, angular)."""


class RigidBodies(NamedTuple):
    """All rigid bodies."""

    frame: np.ndarray  # (n,) frame at the mass centre, with the body's axes
    inverse_mass: np.ndarray  # (n,) [1/kg]
    inertia: np.ndarray  # (n, 3, 3) about the mass centre G, body axes [kg m^2]
    r_BG: np.ndarray  # (n, 3) from the reference point B to G, body axes [m]
    gravity: np.ndarray  # (3,) inertial axes [m/s^2]
    block: np.ndarray  # (n,) where the derivative of the moment by the rotation starts
    column: np.ndarray  # (n,) first of its ``STATE_SIZE`` columns in the table of states


class RigidBodiesWorkspace(NamedTuple):
    """What the equations need of the start of the step."""

    J: np.ndarray  # (n, 3, 3) inertia, inertial axes [kg m^2]


@kernel
def prepare(bodies: RigidBodies, R: np.ndarray, start: RigidBodiesWorkspace) -> None:
    """Carry the inertias into inertial axes; ``R`` (f, 3, 3) are the frames' axes."""
    for b in range(bodies.frame.size):
        R_b = matrix_at(R, bodies.frame[b])
        J = product(product(R_b, matrix_at(bodies.inertia, b)), transpose(R_b))
        put_matrix(start.J, b, J)


@kernel
def offset_deficit(
    bodies: RigidBodies,
    start: RigidBodiesWorkspace,
    motion: FramesWorkspace,
    h: float,
    a: np.ndarray,
    alpha: np.ndarray,
) -> float:
    """Work [J] that all forces together do not do in the offsets of a step: M (v1 - v0) . d/h."""
    total = 0.0
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        spun = times(matrix_at(start.J, b), at(alpha, f))
        total += dot(at(a, f), at(motion.v_offset, f)) / bodies.inverse_mass[b]
        total += dot(spun, at(motion.W_offset, f))
    return h * total


@kernel
def residual(
    bodies: RigidBodies,
    frames: Frames,
    start: RigidBodiesWorkspace,
    motion: FramesWorkspace,
    h: float,
    dt2: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the equations of every body's frame to inertia minus gravity [m]."""
    g = (bodies.gravity[0], bodies.gravity[1], bodies.gravity[2])
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        forced_u = axpy(h, at(motion.v_go, f), scale(dt2, g))
        put(F, displacement_node(frames, f), sub(displacement(frames, Z, f), forced_u))
        Q = rotation_increment(frames, Z, f)
        J = matrix_at(start.J, b)
        psi = angle_share(Q)[0] if frames.exponential else 1.0
        forced = axpy(-h, at(motion.W_go, f), scale(psi, Q))
        L = times(J, axpy(dt2 / h, at(motion.W, f), forced))
        change = scale(psi, add(times(J, forced), rotation_change(Q, L)))
        c = bodies.inverse_mass[b] / frames.length[f]
        put(F, rotation_node(frames, f), scale(c, change))


@kernel
def jacobian(
    bodies: RigidBodies,
    frames: Frames,
    start: RigidBodiesWorkspace,
    motion: FramesWorkspace,
    h: float,
    dt2: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivative of the moment equations by l Q; that of the force equations by u is the
    unit matrix, which the constant part of the Jacobian has.
    """
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        Q = rotation_increment(frames, Z, f)
        J = matrix_at(start.J, b)
        psi, g = angle_share(Q) if frames.exponential else (1.0, 0.0)
        forced = axpy(-h, at(motion.W_go, f), scale(psi, Q))
        L = times(J, axpy(dt2 / h, at(motion.W, f), forced))
        K = skew(add(L, rotation_change(Q, L)))
        JQ, change = times(J, Q), add(times(J, forced), rotation_change(Q, L))
        D = rotation_tangent(Q)
        c = bodies.inverse_mass[b] / (frames.length[f] * frames.length[f])
        for j in range(3):
            Jj = (J[0][j], J[1][j], J[2][j])
            Dj = (D[0][j], D[1][j], D[2][j])
            if frames.exponential:
                Jj = axpy(g * Q[j], JQ, scale(psi, Jj))
            column = sub(add(Jj, rotation_change(Q, Jj)), times(K, Dj))
            if frames.exponential:
                column = axpy(g * Q[j], change, scale(psi, column))
            for i in range(3):
                values[bodies.block[b] + 3 * i + j] += c * column[i]


@kernel
def smooth(
    bodies: RigidBodies,
    decay: Decay,
    b: int,
    dv: Vector,
    dw: Vector,
    v_rise: np.ndarray,
    w_rise: np.ndarray,
) -> float:
    """Enter the changes of the velocities of body ``b`` into the smoothed ones; return the energy
    it lost [J].
    """
    f = bodies.frame[b]
    y_v, y_w = sub(dv, at(v_rise, f)), sub(dw, at(w_rise, f))
    put(v_rise, f, axpy(decay.pole, at(v_rise, f), scale(1.0 - decay.pole, dv)))
    put(w_rise, f, axpy(decay.pole, at(w_rise, f), scale(1.0 - decay.pole, dw)))
    rotational = dot(y_w, times(matrix_at(bodies.inertia, b), dw))
    return 0.5 * decay.chi * (dot(y_v, dv) / bodies.inverse_mass[b] + rotational)


@kernel
def free_acceleration(
    bodies: RigidBodies,
    frames: Frames,
    start: RigidBodiesWorkspace,
    motion: FramesWorkspace,
    F: np.ndarray,
) -> None:
    """Set the equations of every body's frame to gravity [m/s^2] and the gyroscopic moment over m l
    [m/s^2].
    """
    g = (bodies.gravity[0], bodies.gravity[1], bodies.gravity[2])
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        W = at(motion.W, f)
        moment = cross(times(matrix_at(start.J, b), W), W)
        put(F, displacement_node(frames, f), g)
        c = bodies.inverse_mass[b] / frames.length[f]
        put(F, rotation_node(frames, f), scale(c, moment))


@kernel
def add_derivatives(
    bodies: RigidBodies,
    frames: Frames,
    start: RigidBodiesWorkspace,
    motion: FramesWorkspace,
    by_place: np.ndarray,
    by_rate: np.ndarray,
) -> None:
    """Add the derivatives of the gyroscopic moment (J W) x W in ``free_acceleration`` to the block
    values: by l times the rotation, d(J W) = dtheta x (J W) - J (dtheta x W), and by l times W.
    """
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        W, J = skew(at(motion.W, f)), matrix_at(start.J, b)
        L = skew(times(J, at(motion.W, f)))
        WJ = product(W, J)
        by_W = combine(-1.0, WJ, L)
        by_theta = combine(-1.0, product(WJ, W), product(W, L))
        c = bodies.inverse_mass[b] / (frames.length[f] * frames.length[f])
        for i in range(3):
            for j in range(3):
                by_place[bodies.block[b] + 3 * i + j] += c * by_theta[i][j]
                by_rate[bodies.block[b] + 3 * i + j] += c * by_W[i][j]


@kernel
def energy(bodies: RigidBodies, x: np.ndarray, v: np.ndarray, w: np.ndarray) -> tuple[float, float]:
    """Kinetic and potential energy [J] (Hainge 2010, eq. 3.5-3.9; the potential is -m g.x_G)."""
    kinetic = 0.0
    potential = 0.0
    for b in range(bodies.frame.size):
        f, m = bodies.frame[b], 1.0 / bodies.inverse_mass[b]
        vb, wb, xb = at(v, f), at(w, f), at(x, f)
        kinetic += 0.5 * (m * dot(vb, vb) + dot(wb, times(matrix_at(bodies.inertia, b), wb)))
        for i in range(3):
            potential -= m * bodies.gravity[i] * xb[i]
    return kinetic, potential


@kernel
def write_states(
    bodies: RigidBodies,
    x: np.ndarray,
    p: np.ndarray,
    motion: FramesWorkspace,
    w: np.ndarray,
    table: np.ndarray,
    row: int,
) -> None:
    """Write position, orientation and velocities of the reference point B of every body into a row
    of ``table``: ``STATE_SIZE`` numbers each.
    """
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        R = matrix_at(motion.R, f)
        r = at(bodies.r_BG, b)
        w_b = at(w, f)
        place = bodies.column[b]
        v_B = sub(times(transpose(R), at(motion.v, f)), cross(w_b, r))
        for i, values in enumerate((sub(at(x, f), times(R, r)), at(p, f), v_B, w_b)):
            for j in range(3):
                table[row, place + 3 * i + j] = values[j]


@kernel
def write_accelerations(
    bodies: RigidBodies,
    motion: FramesWorkspace,
    w: np.ndarray,
    a: np.ndarray,
    alpha: np.ndarray,
    table: np.ndarray,
    row: int,
) -> None:
    """Write the acceleration of the reference point B of every body and its angular acceleration,
    both in its own axes, into a row of ``table``; ``a`` and ``alpha`` (f, 3) are those of the mass
    centres, inertial axes.
    """
    for b in range(bodies.frame.size):
        f = bodies.frame[b]
        R = transpose(matrix_at(motion.R, f))
        r, w_b = at(bodies.r_BG, b), at(w, f)
        alpha_b = times(R, at(alpha, f))
        to_G = add(cross(alpha_b, r), cross(w_b, cross(w_b, r)))
        a_B = sub(times(R, at(a, f)), to_G)
        place = ACCELERATION_SIZE * (bodies.column[b] // STATE_SIZE)
        for j in range(3):
            table[row, place + j] = a_B[j]
            table[row, place + 3 + j] = alpha_b[j]


@kernel
def read_states(
    bodies: RigidBodies,
    table: np.ndarray,
    row: int,
    x: np.ndarray,
    p: np.ndarray,
    v: np.ndarray,
    w: np.ndarray,
) -> None:
    """Set the state of every body's frame from a row of ``table``: inverse of ``write_states``."""
    for b in range(bodies.frame.size):
        f, place = bodies.frame[b], bodies.column[b]
        P, spin = three(table, row, place + 3), three(table, row, place + 9)
        R = matrix(P)
        r = at(bodies.r_BG, b)
        put(x, f, add(three(table, row, place), times(R, r)))
        put(p, f, P)
        put(v, f, times(R, add(three(table, row, place + 6), cross(spin, r))))
        put(w, f, spin)


@kernel
def three(table: np.ndarray, row: int, column: int) -> Vector:
    """Three numbers of a ``row`` of ``table`` from ``column`` on."""
    return (table[row, column], table[row, column + 1], table[row, column + 2])
