"""The woodpecker toy by Moreau's time stepping, of first order, with the geometry of its deck.

Coordinates are the height of the sleeve and the tilts of sleeve and bird. Source: J. J. Moreau,
Numerical aspects of the sweeping process, Comput. Methods Appl. Mech. Engrg. 177 (1999).
"""

import numpy as np

G, SPRING, FRICTION, POLE = 9.81, 0.0056, 0.3, 0.0025
MASSES, ARMS = (0.0003, 0.0045), (0.010, 0.015)
INERTIA = np.diag([MASSES[0], 5e-9, 7e-7])
HOLE, HALF = 0.0031, 0.0058
POINTS = (
    (((ARMS[0], 0.0), (ARMS[1] - 0.0201, 0.02)), 0.5),
    (((HOLE, -HALF),), 0.0),
    (((HOLE, HALF),), 0.0),
)
"""The beak and the edges of the sleeve: arms along and across each body up to the point, and the
restitution."""


def _point(q, arms):
    """Return the horizontal place of a point, and the Jacobian (2, 3) of both its places."""
    place, J = 0.0, np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    for k, (x, y) in enumerate(arms, 1):
        sin, cos = np.sin(q[k]), np.cos(q[k])
        place += x * cos - y * sin
        J[:, k] = -x * sin - y * cos, x * cos - y * sin
    return place, J


def _dynamics(q, u):
    """Return the inverse of the mass matrix and the loads."""
    _, J = _point(q, [(length, 0.0) for length in ARMS])
    inward = ARMS * u[1:] ** 2
    pull = np.array([inward @ np.cos(q[1:]), inward @ np.sin(q[1:])])
    twist = SPRING * (q[1] - q[2])
    load = np.array([-MASSES[0] * G, -twist, twist])
    load += MASSES[1] * J.T @ (pull - np.array([0.0, G]))
    return np.linalg.inv(INERTIA + MASSES[1] * J.T @ J), load


def _after(near, inverse, before, u):
    """Return the velocities after impulses at the points ``near``, one after the other in rounds,
    and the impulses along the normals; ``before`` are those at the start of the step.
    """
    P = np.zeros((len(near), 2))
    for _ in range(500):
        last = u
        for (W, e), p in zip(near, P, strict=True):
            A = np.einsum("ij,jk,ik->i", W, inverse, W)
            normal = max(0.0, p[0] - W[0] @ (u + e * before) / A[0])
            u = u + inverse @ W[0] * (normal - p[0])
            rubs = np.clip(p[1] - W[1] @ u / A[1], -FRICTION * normal, FRICTION * normal)
            u = u + inverse @ W[1] * (rubs - p[1])
            p[:] = normal, rubs
        if np.abs(u - last).max() <= 1e-13:
            break
    return u, P[:, 0]


def strikes(h, end):
    """Return the times up to ``end`` at which the beak strikes, by steps of ``h``."""
    tilt = np.arctan(HALF / HOLE) - np.arccos(POLE / np.hypot(HALF, HOLE))
    q, u, found = np.array([0.0, tilt, -0.2788]), np.array([-0.3411, 0.0, -7.4583]), []
    for step in range(round(end / h)):
        q = q + 0.5 * h * u
        inverse, load = _dynamics(q, u)
        points = [(*_point(q, arms), e) for arms, e in POINTS]
        near = [k for k, (place, _, _) in enumerate(points) if place <= POLE]
        u, P = _after([points[k][1:] for k in near], inverse, u, u + h * inverse @ load)
        if any(k == 0 and p > 0.0 for k, p in zip(near, P, strict=True)):
            found.append(step * h)
        q = q + 0.5 * h * u
    times = np.array(found)
    return times[np.diff(times, prepend=0.0) > 0.01]  # an impact may take some steps
