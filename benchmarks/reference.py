"""Converged mass centres in minimal coordinates, by an explicit method of order 8.

Chain of n bodies in the x-z plane, th_i the angle of body i from z towards x, L its length:

    e_i = (sin th_i, cos th_i),  n_i = de_i/dth_i,  x_i = L (e_1 + ... + e_i)
    m (a_i - g)  = f_i - f_(i+1)          f_i  force of joint i on body i
    J th_i''     = -L n_i . f_i           f_i acts at x_i - L e_i
    a_i - a_(i-1) = L th_i'' n_i - L th_i'^2 e_i

Elimination of a and th'' leaves a block tridiagonal system in f: the cost is O(n). Top: turn about
the pivot, J_p w' = (J_p w) x w + r x m R^T g and the quaternion's rate, all in body axes.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import solve_banded

from msahl.model import Model

TOLERANCE = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}


def converged_positions(model: Model, t: np.ndarray) -> np.ndarray:
    """(rows, n, 3) mass centres at the times ``t``, the first of which is 0."""
    turning = any(any(body.angular_velocity) for body in model.bodies)
    return _top(model, t) if turning else _chain(model, t)


def _chain(model: Model, t: np.ndarray) -> np.ndarray:
    body, n = model.bodies[0], len(model.bodies)
    L = -model.joints[0].child_point[2]
    m, J, g = body.mass, body.inertia[1][1], model.gravity[2]
    angle = np.arctan2(body.position[0], body.position[2])
    start = np.concatenate([np.full(n, angle), np.zeros(n)])

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[n:], _chain_accelerations(y[:n], y[n:], m, J, L, g)])

    angles = solve_ivp(rate, (0.0, t[-1]), start, t_eval=t, **TOLERANCE).y[:n].T
    x = np.zeros((len(t), n, 3))
    x[..., 0] = L * np.cumsum(np.sin(angles), axis=1)
    x[..., 2] = L * np.cumsum(np.cos(angles), axis=1)
    return x


def _chain_accelerations(
    th: np.ndarray, th_dot: np.ndarray, m: float, J: float, L: float, g: float
) -> np.ndarray:
    e = np.stack([np.sin(th), np.cos(th)], axis=1)
    n = np.stack([e[:, 1], -e[:, 0]], axis=1)
    # Diagonal blocks (2 or, for the first body, 1)/m + L^2/J n n^T; next to them -1/m.
    c = L * L / J
    band = np.zeros((5, 2 * len(th)))
    band[2] = 2.0 / m + c * (n * n).ravel()
    band[2, :2] -= 1.0 / m
    band[1, 1::2] = c * n[:, 0] * n[:, 1]
    band[3, 0::2] = band[1, 1::2]
    band[0, 2:] = band[4, :-2] = -1.0 / m
    right = -L * th_dot[:, None] ** 2 * e
    right[0, 1] -= g
    f = solve_banded((2, 2), band, right.ravel()).reshape(-1, 2)
    return -(L / J) * np.einsum("bi,bi->b", n, f)


def _top(model: Model, t: np.ndarray) -> np.ndarray:
    body = model.bodies[0]
    r = -np.array(model.joints[0].child_point)
    J = np.array(body.inertia) + body.mass * (r @ r * np.eye(3) - np.outer(r, r))
    gravity = np.array(model.gravity)
    tilt = np.arctan2(body.position[0], body.position[2])
    start = np.array([np.cos(tilt / 2), 0.0, np.sin(tilt / 2), 0.0, *body.angular_velocity])

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        q0, q, w = y[0], y[1:4], y[4:]
        moment = body.mass * np.cross(r, _turned(y[:4], gravity, inverse=True))
        w_dot = np.linalg.solve(J, np.cross(J @ w, w) + moment)
        return np.array([-0.5 * q @ w, *(0.5 * (q0 * w + np.cross(q, w))), *w_dot])

    y = solve_ivp(rate, (0.0, t[-1]), start, t_eval=t, **TOLERANCE).y.T
    return np.array([_turned(row[:4], r) for row in y])[:, None, :]


def _turned(quaternion: np.ndarray, a: np.ndarray, inverse: bool = False) -> np.ndarray:
    """``a`` turned by a quaternion whose length may have drifted in its last digits."""
    q0, q = quaternion[0], quaternion[1:] * (-1.0 if inverse else 1.0)
    turned = a + 2.0 * np.cross(q, np.cross(q, a) + q0 * a) / (quaternion @ quaternion)
    return turned
