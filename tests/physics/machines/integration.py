"""Integration of equations of motion in minimal coordinates by scipy, and rotations by numpy."""

from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

RTOL, ATOL = 1e-12, 1e-13


def integrate(rates, start, times, rtol=RTOL):
    """(times, unknowns) solution of y' = rates(t, y) from ``start`` at t = 0.

    The integration ends at every output time, since interpolation between its own steps has a
    larger error.
    """
    stops = np.unique([0.0, *times])
    y = np.array(start, dtype=float)
    known = {0.0: y}
    for t0, t1 in pairwise(stops):
        found = solve_ivp(
            rates, (t0, t1), y, "DOP853", rtol=rtol, atol=rtol * ATOL / RTOL, t_eval=[t1]
        )
        assert found.success, found.message
        y = found.y[:, -1]
        known[float(t1)] = y
    return np.array([known[float(t)] for t in times])


def rotation(axis, angle):
    """Matrix (3, 3) of the rotation by an angle about a unit axis, by Rodrigues."""
    K = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
