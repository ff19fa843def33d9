"""Compute a planar pendulum: a body on a fixed point that moves in one vertical plane.

    theta_ddot = -W0^2 sin theta,  W0^2 = m g a / I      theta: of the arm, from straight down
    k^2 = sin^2(theta_0/2) + (theta_dot_0 / 2 W0)^2

    k < 1, oscillating   sin(theta/2) = k sn(W0 t + u0, k^2),   theta_dot = 2 k W0 cn
    k > 1, circulating   theta/2 = am(k W0 t + u0, 1/k^2),      theta_dot = 2 k W0 dn

a is the length of the arm from the fixed point to the mass centre, I the moment of inertia about
the fixed point and the plane's normal, which is a principal axis of the body and the axis of its
angular velocity, and remains both. Source: Whittaker, Analytical Dynamics, art. 44.
"""

from dataclasses import dataclass

import numpy as np

from tests.support.closed_forms.elliptic import first_kind, jacobi
from tests.support.closed_forms.motion import Motion, SingleBody, about, about_pivot, parallel


@dataclass(frozen=True)
class Pendulum:
    """The sense of ``normal`` makes the initial angular velocity ``spin`` about it non-negative."""

    single: SingleBody
    normal: np.ndarray
    rate: float  # W0 [rad/s]
    angle: float  # theta at t = 0
    spin: float  # theta_dot at t = 0 [rad/s]
    description = "planar pendulum by elliptic functions"

    def motion(self, t: np.ndarray) -> Motion:
        """Return the motion at the times ``t``."""
        angle, spin = self.swing(t)
        R = about(self.normal, angle - self.angle) @ self.single.R
        return about_pivot(self.single, R, spin[:, None] * self.normal)

    def swing(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return theta and theta_dot."""
        s, c = np.sin(0.5 * self.angle), np.cos(0.5 * self.angle)
        push = 0.5 * self.spin / self.rate
        square, left = s * s + push * push, c * c - push * push
        k = np.sqrt(square)
        if left >= 0.0:
            first = first_kind(np.arctan2(s, push), left) if k else 0.0
            f = jacobi(self.rate * t + first, square, left)
            return 2.0 * np.arctan2(k * f.sn, f.dn), 2.0 * k * self.rate * f.cn
        first = first_kind(0.5 * self.angle, -left / square)
        f = jacobi(k * self.rate * t + first, 1.0 / square, -left / square)
        return 2.0 * f.am, 2.0 * k * self.rate * f.dn


def recognise(single: SingleBody) -> Pendulum | None:
    """Return the pendulum of a body on a fixed point in planar motion; None for other models."""
    if single.pivot is None or single.loads:
        return None
    if not np.any(single.arm) or not np.any(single.gravity):
        return None
    arm, g = single.arm, single.gravity
    across = np.cross(arm, g)
    normal = single.W if np.any(single.W) else across
    if parallel(arm, g) and not np.any(single.W):
        normal = _any_principal_across(single)
    size = np.linalg.norm(normal)
    if not size:
        return None
    n = normal / size
    flat = abs(n @ arm) <= 1e-12 * np.linalg.norm(arm) and abs(n @ g) <= 1e-12 * np.linalg.norm(g)
    if not flat or not parallel(single.J @ n, n):
        return None
    a = float(np.linalg.norm(arm))
    inertia = float(n @ single.J @ n) + single.body.mass * a * a
    rate = float(np.sqrt(single.body.mass * np.linalg.norm(g) * a / inertia))
    angle = float(np.arctan2(n @ np.cross(g, arm), g @ arm))
    return Pendulum(single, n, rate, angle, float(n @ single.W))


def _any_principal_across(single: SingleBody) -> np.ndarray:
    """Return a principal axis normal to the arm of a body at rest; zero if there is none."""
    _, axes = np.linalg.eigh(single.J)
    across = [
        axis for axis in axes.T if abs(axis @ single.arm) <= 1e-9 * np.linalg.norm(single.arm)
    ]
    return across[0] if across else np.zeros(3)
