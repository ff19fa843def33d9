"""Satellite with three reaction wheels: a gyrostat in body axes.

The wheels' mass centres are on their axes and the wheels are bodies of revolution, so the inertia I
of the complete satellite about its mass centre is constant in body axes. With the wheels' torques u
(from the bus on the wheel), spins W relative to the bus and axial inertias S:

    I w' + sum_i S a_i W_i' + w x (I w + sum_i S a_i W_i) = 0 ,    S (a_i.w' + W_i') = u_i
    q' = q (0, w)/2
"""

import numpy as np

from tests.physics.machines.integration import integrate, rotation

M_BUS = 80.0
J_BUS = np.array([[9.0, 0.3, -0.2], [0.3, 11.0, 0.4], [-0.2, 0.4, 7.0]])
M_WHEEL, J_SPIN, J_ACROSS = 8.0, 0.10, 0.055
PLACES = np.array([[0.30, 0.0, 0.05], [0.0, 0.28, -0.05], [-0.04, 0.0, 0.35]])
"""Wheels' mass centres from that of the bus [m]; wheel i rotates about axis i."""
K_P, K_D = 0.8, 3.5
"""Gains: N m, and N m s/rad."""
AXIS, ANGLE = np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0), np.radians(150.0)
QUATERNION = np.array([np.cos(ANGLE / 2), *(np.sin(ANGLE / 2) * AXIS)])
RATE = np.array([0.05, -0.02, 0.03])
"""Orientation and angular velocity (body axes) of the bus at the start; the wheels do not spin."""


def constants():
    """Inertia about the mass centre of all (3, 3), and that mass centre from the bus's (3,)."""
    mass = M_BUS + 3.0 * M_WHEEL
    centre = M_WHEEL * PLACES.sum(axis=0) / mass
    total = J_BUS + M_BUS * about(centre)
    for i, place in enumerate(PLACES):
        own = np.full(3, J_ACROSS)
        own[i] = J_SPIN
        total = total + np.diag(own) + M_WHEEL * about(place - centre)
    return total, centre


def about(r):
    """Inertia of a unit mass at r about the origin (3, 3)."""
    return (r @ r) * np.eye(3) - np.outer(r, r)


def product(p, q):
    """Product of two quaternions, scalar first."""
    return np.concatenate(
        [[p[0] * q[0] - p[1:] @ q[1:]], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])]
    )


def motion(times, rtol=1e-12):
    """(times, 13) quaternion and angular velocity of the bus, spins and angles of the wheels."""
    total, _ = constants()
    without = total - J_SPIN * np.eye(3)

    def rates(_, y):
        q, w, spins = y[:4], y[4:7], y[7:10]
        q = q / np.linalg.norm(q)
        # The bus gets -u; the controller wants -K_P q - K_D w on it.
        u = K_P * q[1:] + K_D * w
        momentum = total @ w + J_SPIN * spins
        dw = np.linalg.solve(without, -u - np.cross(w, momentum))
        dq = 0.5 * product(q, np.concatenate([[0.0], w]))
        return np.concatenate([dq, dw, u / J_SPIN - dw, spins])

    start = np.concatenate([QUATERNION, RATE, np.zeros(6)])
    return integrate(rates, start, times, rtol)


def matrix(q):
    """Body axes to inertial axes (3, 3) of a quaternion."""
    q = q / np.linalg.norm(q)
    K = np.array([[0.0, -q[3], q[2]], [q[3], 0.0, -q[1]], [-q[2], q[1], 0.0]])
    return np.eye(3) + 2.0 * q[0] * K + 2.0 * K @ K


def places(y, t):
    """Position and axes of each body by its name, from what ``motion`` gives for ``t``.

    The bus is at the origin at the start, without velocity; the mass centre of all moves uniformly.
    """
    _, centre = constants()
    R0, R = matrix(QUATERNION), matrix(y[:4])
    at = R0 @ (centre + np.cross(RATE, centre) * t) - R @ centre
    found = {"Bus": (at, R)}
    for name, place, axis, angle in zip("XYZ", PLACES, np.eye(3), y[10:], strict=True):
        found[f"Wheel {name}"] = (at + R @ place, R @ rotation(axis, angle))
    return found
