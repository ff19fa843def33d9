"""Motions known without msahl: closed forms, and differential equations of another derivation."""

from itertools import pairwise

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipj, ellipk, ellipkinc

TIGHT = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13}
"""About where the round-off of an eighth-order method lies."""


def pendulum_angle(t, phi, m=2.0, L=5.0, inertia=0.008, g=9.80665):
    """Angle from hanging of a pendulum dropped from ``phi``: sin(th/2) = k sn(K - w0 t, k)."""
    k = np.sin(phi / 2)
    w0 = np.sqrt(m * g * L / (m * L**2 + inertia))
    sn, *_ = ellipj(ellipk(k**2) - w0 * np.asarray(t), k**2)
    return 2 * np.arcsin(k * sn)


def pendulum_path(t, phi, **numbers):
    """(n, 3) positions of the bob; z is down."""
    angle, L = pendulum_angle(t, phi, **numbers), numbers.get("L", 5.0)
    return L * np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)


class PendulumChain:
    """Lagrange's equations of n plane pendulums in a chain, in their angles from hanging.

    sum_j (mu_ij L^2 cos(a_i - a_j) + I d_ij) a_j'' = - sum_j mu_ij L^2 sin(a_i - a_j) a_j'^2
                                                      - mu_ii g L sin a_i
    with mu_ij the mass at and beyond the outer of i and j.
    """

    def __init__(self, n, m=2.0, L=5.0, inertia=0.008, g=9.80665):
        outer = np.maximum.outer(np.arange(n), np.arange(n))
        self.n, self.m, self.L, self.inertia, self.g = n, m, L, inertia, g
        self.mu = m * (n - outer)

    def accelerations(self, a, rate):
        d = a[:, None] - a[None, :]
        M = self.mu * self.L**2 * np.cos(d) + self.inertia * np.eye(self.n)
        right = -(self.mu * self.L**2 * np.sin(d)) @ rate**2
        return np.linalg.solve(M, right - np.diag(self.mu) * self.g * self.L * np.sin(a))

    def angles(self, phi, t):
        """(times, n) when all are dropped from ``phi``."""
        n = self.n

        def f(_, y):
            return np.concatenate([y[n:], self.accelerations(y[:n], y[n:])])

        start = np.concatenate([np.full(n, phi), np.zeros(n)])
        return solve_ivp(f, (0.0, t[-1]), start, t_eval=t, **TIGHT).y[:n].T

    def path(self, phi, t):
        """(times, n, 3) positions of the bobs; z is down."""
        angles = self.angles(phi, np.asarray(t, dtype=float))
        arms = np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=-1)
        return self.L * np.cumsum(arms, axis=1)

    def first_reactions(self, phi):
        """(n, 3) joint forces on the child, when all are dropped from ``phi``."""
        alpha = self.accelerations(np.full(self.n, phi), np.zeros(self.n))
        tangent = np.array([np.cos(phi), 0.0, -np.sin(phi)])
        a = self.L * np.cumsum(alpha)[:, None] * tangent
        force = self.m * (a - [0.0, 0.0, self.g])
        return np.cumsum(force[::-1], axis=0)[::-1]


def top_path(t, tilt, spin, m=1.0, L=0.2, across=0.4, along=0.75, g=3.0):
    """Mass centre of the thesis's top at one time ``t``, z up.

    ``spin`` = (0, w2, w3) in body axes, tilted about y. With u = cos(tilt) and both momenta about
    the vertical, b, and the axis, a, over the inertia A about the pivot:
    u'^2 = (1 - u^2) (alpha - beta u) - (b - a u)^2, so u = u1 + (u2 - u1) sn^2; the azimuth is the
    quadrature of (b - a u)/(1 - u^2). (Goldstein, Classical Mechanics, section 5.7.)
    """
    A = across + m * L**2
    u0, w2, w3 = np.cos(tilt), spin[1], spin[2]
    a, b = along * w3 / A, along * w3 * u0 / A
    beta = 2 * m * g * L / A
    alpha = w2**2 + ((b - a * u0) / np.sin(tilt)) ** 2 + beta * u0
    u1, u2, u3 = np.sort(np.roots([beta, -(alpha + a * a), 2 * a * b - beta, alpha - b * b]).real)
    modulus = (u2 - u1) / (u3 - u1)
    rate = 0.5 * np.sqrt(beta * (u3 - u1))
    share = (u0 - u1) / (u2 - u1)
    if w2 == 0.0:  # starts at a turning point, where the phase loses half the digits of the share
        share = np.round(share)
    # w2 > 0 tilts further: u falls at the start.
    phase = (-1.0 if w2 > 0 else 1.0) * ellipkinc(np.arcsin(np.sqrt(share)), modulus)

    def height(s):
        return u1 + (u2 - u1) * ellipj(rate * s + phase, modulus)[0] ** 2

    def precession(s):
        u = height(s)
        return (b - a * u) / (1 - u * u)

    pieces = np.linspace(0.0, t, 41)  # one sweep of the quadrature each, far below a nutation
    azimuth = sum(
        quad(precession, p, q, epsabs=1e-14, epsrel=1e-13)[0] for p, q in pairwise(pieces)
    )
    u = height(t)
    radius = np.sqrt(1 - u * u)
    return L * np.array([radius * np.cos(azimuth), radius * np.sin(azimuth), u])


def euler_motion(J, w0, R0, t, moment=lambda R: np.zeros(3)):
    """Spins (times, 3) and matrices (times, 3, 3) of a body by Euler's equations.

    ``J`` about a fixed point (or the mass centre), ``moment`` about it, in body axes.
    """
    J = np.asarray(J)

    def f(_, y):
        w, R = y[:3], y[3:].reshape(3, 3)
        w_dot = np.linalg.solve(J, np.cross(J @ w, w) + moment(R))
        return np.concatenate([w_dot, np.cross(R, w).reshape(-1)])

    # Rows of R: (R [w])_i = R_i x w.
    start = np.concatenate([w0, np.asarray(R0).reshape(-1)])
    y = solve_ivp(f, (0.0, t[-1]), start, t_eval=t, **TIGHT).y.T
    return y[:, :3], y[:, 3:].reshape(-1, 3, 3)
