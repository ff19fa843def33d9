"""Inverted pendulum on a cart with state feedback; theta is the angle from the vertical.

(M + m) x'' + m l (theta'' cos(theta) - theta'^2 sin(theta)) = F - b x'
(J + m l^2) theta'' + m l x'' cos(theta) - m g l sin(theta) = 0
"""

import numpy as np
from scipy.linalg import solve_continuous_are

from tests.physics.machines.integration import integrate, rotation

M_CART, M_POLE, LENGTH, G = 1.5, 0.4, 0.6, 9.81
CENTRE = LENGTH / 2.0
J = M_POLE * LENGTH**2 / 12.0
FRICTION = 0.8
"""Of the cart [N s/m]."""
WEIGHTS, EFFORT = np.diag([40.0, 4.0, 20.0, 2.0]), 0.1
GAINS = (20.0, 19.93292, 98.450365, 19.581238)
"""Force over x, x', theta, theta' [N/m, N s/m, N/rad, N s/rad], as the deck has them."""
START = (0.0, 0.0, np.radians(20.0), 0.0)


def masses(theta):
    """Matrix of the accelerations (2, 2)."""
    coupling = M_POLE * CENTRE * np.cos(theta)
    return np.array([[M_CART + M_POLE, coupling], [coupling, J + M_POLE * CENTRE**2]])


def optimal_gains():
    """Gains of the linear-quadratic regulator about the upright position."""
    M = masses(0.0)
    A, B = np.zeros((4, 4)), np.zeros((4, 1))
    A[0, 1] = A[2, 3] = 1.0
    A[[1, 3], 2] = np.linalg.solve(M, [0.0, M_POLE * G * CENTRE])
    A[[1, 3], 1] = np.linalg.solve(M, [-FRICTION, 0.0])
    B[[1, 3], 0] = np.linalg.solve(M, [1.0, 0.0])
    P = solve_continuous_are(A, B, WEIGHTS, [[EFFORT]])
    return -(B.T @ P / EFFORT)[0]


def motion(times, rtol=1e-12):
    """(times, 4) x, x', theta, theta'."""

    def rates(_, y):
        _, v, theta, w = y
        force = np.dot(GAINS, y) - FRICTION * v
        inertia = M_POLE * CENTRE * w * w * np.sin(theta)
        a = np.linalg.solve(masses(theta), [force + inertia, M_POLE * G * CENTRE * np.sin(theta)])
        return np.array([v, a[0], w, a[1]])

    return integrate(rates, START, times, rtol)


def places(y):
    """Position and axes of each body by its name, from one of the times of ``motion``."""
    at = np.array([y[0], 0.0, 0.0])
    return {"Cart": (at, np.eye(3)), "Pole": (at, rotation(np.array([0.0, 1.0, 0.0]), y[2]))}
