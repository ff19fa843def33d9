"""Compute a symmetric top: a body on a fixed point of its axis of symmetry, under gravity.

    u = cos theta = e . up,    e the axis from the fixed point to the mass centre
    u_dot^2 = f(u) = (alpha - beta u)(1 - u^2) - (b - a u)^2,   roots u1 <= u <= u2 < u3
    u = u1 + (u2 - u1) sn^2(lam t + t0, m),  lam^2 = beta (u3 - u1)/4,  m = (u2 - u1)/(u3 - u1)
    phi_dot = (b - a u)/(1 - u^2),   psi_dot = w3 - phi_dot u

beta = 2 M g l/A, a = C w3/A, A the moment of inertia about an axis through the fixed point normal
to the axis of symmetry, C the one about it. f is expanded about the initial u, where its values are
known without cancellation, so the steady precession (u1 = u2) loses no digits; phi and psi are
integrals of the third kind. A top that becomes upright or hangs straight down (1 - u^2 = 0) is not
recognised. Source: Whittaker, Analytical Dynamics, art. 71-72.
"""

from dataclasses import dataclass

import numpy as np

from tests.support.closed_forms.elliptic import Jacobi, first_kind, jacobi, third_kind
from tests.support.closed_forms.motion import SAME, Motion, SingleBody, about, about_pivot

POLE = 1e-7
"""If 1 - |u| is below this value, the angles phi and psi are too ill-conditioned."""


@dataclass(frozen=True)
class Top:
    """Roots relative to the initial u, ``low`` <= 0 <= ``high`` < ``far``; frame of the angles."""

    single: SingleBody
    frame: np.ndarray  # (3, 3) columns: across, across, up
    cosine: float  # u at t = 0
    low: float
    high: float
    far: float
    beta: float
    a: float
    difference: float  # b - a u at t = 0
    spin: float  # w3
    climbing: bool
    description = "symmetric top on a fixed point by elliptic functions"

    def motion(self, t: np.ndarray) -> Motion:
        """Return the motion at the times ``t``."""
        span, total = self.high - self.low, self.far - self.low
        m, m1 = span / total, (self.far - self.high) / total
        rate = 0.5 * np.sqrt(self.beta * total)
        phase = np.arctan2(np.sqrt(-self.low), np.sqrt(self.high)) if span else 0.0
        f = jacobi(rate * t + first_kind(phase if self.climbing else -phase, m1), m, m1)
        bottom = self.cosine + self.low
        below, above = 1.0 + bottom, 1.0 - bottom  # 1 + u and 1 - u at the least u
        start = phase if self.climbing else -phase
        down = (self.difference - self.a * (1.0 - self.cosine)) / (above * rate)
        up = (self.difference + self.a * (1.0 + self.cosine)) / (below * rate)
        P = down * _between(f, start, span / above, (above - span) / above, m1)
        M = up * _between(f, start, -span / below, (below + span) / below, m1)
        phi, psi = 0.5 * (P + M), (self.spin - self.a) * t - 0.5 * (P - M)
        u = bottom + span * f.sn**2
        sine2 = (above - span * f.sn**2) * (below + span * f.sn**2)
        theta = np.arctan2(np.sqrt(sine2), u)
        u_dot = 2.0 * span * rate * f.sn * f.cn * f.dn
        phi_dot = (self.difference - self.a * (u - self.cosine)) / sine2
        theta_dot = -u_dot / np.sqrt(sine2)
        return self._angles(phi, theta, psi, phi_dot, theta_dot)

    def _angles(
        self,
        phi: np.ndarray,
        theta: np.ndarray,
        psi: np.ndarray,
        phi_dot: np.ndarray,
        theta_dot: np.ndarray,
    ) -> Motion:
        y, z = np.eye(3)[1:]
        tilt = self.frame @ about(z, phi) @ about(y, theta)
        first = self.frame @ about(y, np.array([np.arccos(self.cosine)]))[0]
        R = tilt @ about(z, psi) @ (first.T @ self.single.R)
        axis, up = tilt[:, :, 2], self.frame[:, 2]
        across = np.einsum("mij,j->mi", tilt, y)
        psi_dot = self.spin - phi_dot * np.cos(theta)
        W = phi_dot[:, None] * up + theta_dot[:, None] * across + psi_dot[:, None] * axis
        return about_pivot(self.single, R, W)


def _between(f: Jacobi, start: float, n: float, n1: float, m1: float) -> np.ndarray:
    """Return Pi from the initial amplitude to those of ``f``."""
    first = third_kind(np.array([start]), n, n1, m1)[0]
    return np.asarray(third_kind(f.am, n, n1, m1) - first)


def recognise(single: SingleBody) -> Top | None:
    """Return the top of a symmetric body on a fixed point; None for other models."""
    if single.pivot is None or single.loads:
        return None
    if not np.any(single.arm) or not np.any(single.gravity):
        return None
    length, pull = float(np.linalg.norm(single.arm)), float(np.linalg.norm(single.gravity))
    e, up = single.arm / length, -single.gravity / pull
    C = float(e @ single.J @ e)
    across = single.J - C * np.outer(e, e)
    across_moment = 0.5 * float(np.trace(across))
    ideal = across_moment * (np.eye(3) - np.outer(e, e))
    if np.abs(across - ideal).max() > SAME * max(C, across_moment):
        return None
    A = across_moment + single.body.mass * length**2
    u0, spin = float(e @ up), float(single.W @ e)
    e_dot = np.cross(single.W, e)
    sine2 = float(np.sum(np.cross(e, up) ** 2))
    beta, a = 2.0 * single.body.mass * pull * length / A, C * spin / A
    difference, climb, q = float(up @ np.cross(e, e_dot)), float(e_dot @ up), float(e_dot @ e_dot)
    low, high, far = _roots(
        beta,
        -q + 2.0 * u0 * beta - a * a,
        -beta * sine2 - 2.0 * u0 * q + 2.0 * a * difference,
        climb**2,
    )
    if 1.0 - (u0 + high) < POLE or 1.0 + u0 + low < POLE:
        return None
    x = np.cross(np.cross(up, e), up)
    x = x / np.linalg.norm(x)
    frame = np.stack([x, np.cross(up, x), up], axis=1)
    return Top(single, frame, u0, low, high, far, beta, a, difference, spin, climb >= 0.0)


def _roots(f3: float, f2: float, f1: float, f0: float) -> tuple[float, float, float]:
    """Return the real roots low <= 0 <= high < far of f3 d^3 + f2 d^2 + f1 d + f0, with f3 > 0 and
    f0 >= 0."""
    far = 1.0 + max(abs(f2), abs(f1), abs(f0)) / f3  # Cauchy's bound: beyond every root
    for _ in range(200):
        value = ((f3 * far + f2) * far + f1) * far + f0
        step = value / ((3.0 * f3 * far + 2.0 * f2) * far + f1)
        far -= step
        if abs(step) <= 1e-16 * abs(far):
            break
    # Divided by the far root, coefficients from below: small ones keep their digits.
    q = -f0 / (f3 * far)
    p = (q - f1 / f3) / far
    root = -0.5 * (p + np.copysign(np.sqrt(max(p * p - 4.0 * q, 0.0)), p))
    other = q / root if root else 0.0
    return min(root, other, 0.0), max(root, other, 0.0), far
