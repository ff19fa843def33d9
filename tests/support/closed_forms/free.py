"""Compute free flight: the mass centre on a parabola, rotation without moment (Euler, Jacobi).

    w1 = w1m cn,  w2 = +- w2m sn,  w3 = +- w3m dn         of lam t + u0, principal axes
    lam^2 = (L^2 - 2 T J1)(J3 - J2) / (J1 J2 J3)
    m = (2 T J3 - L^2)(J2 - J1) / ((L^2 - 2 T J1)(J3 - J2))
    phi_dot = L/J3 + L (J3 - J1)/(J1 J3) / (1 - n sn^2),   1 - n = J2 (J3 - J1)/(J1 (J3 - J2))

Axis 3 is the one about which the angular velocity w circles: that of the largest moment of inertia
if L^2 > 2 T J2, else of the smallest. phi is the angle of rotation about the constant angular
momentum L. All differences are sums of terms of one sign in the initial angular velocity, so no
digits cancel. Source: Landau and Lifshitz, Mechanics, art. 37.
"""

from dataclasses import dataclass

import numpy as np

from tests.support.closed_forms.elliptic import first_kind, jacobi, third_kind
from tests.support.closed_forms.motion import Motion, SingleBody, about, parallel

SEPARATRIX = 1e-12
"""If 1 - m is below this value, the period is not defined by the given numbers."""


@dataclass(frozen=True)
class Free:
    """Ballistic flight with the rotation ``spinning`` (None: about a fixed axis)."""

    single: SingleBody
    spinning: "Spinning | None"
    description = "free flight, parabola and Euler's motion by elliptic functions"

    def motion(self, t: np.ndarray) -> Motion:
        """Return the motion at the times ``t``."""
        single, time = self.single, t[:, None]
        x = single.x + single.v * time + 0.5 * single.gravity * time**2
        v = single.v + single.gravity * time
        a = np.broadcast_to(single.gravity, v.shape)
        if self.spinning is not None:
            return Motion(x, *self._rotating(t, self.spinning, v), a)
        rate = float(np.linalg.norm(single.W))
        axis = single.W / rate if rate else np.eye(3)[2]
        return Motion(x, about(axis, rate * t) @ single.R, v, np.tile(single.W, (len(t), 1)), a)

    def _rotating(
        self, t: np.ndarray, spinning: "Spinning", v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        E, w = spinning.rotation(t)
        first, _ = spinning.rotation(np.zeros(1))
        R = (self.single.R @ spinning.axes @ first[0].T) @ E @ spinning.axes.T
        return R, v, np.einsum("mij,jk,mk->mi", R, spinning.axes, w)


@dataclass(frozen=True)
class Spinning:
    """Principal ``axes`` (columns, body axes), moments J, initial angular velocity w along them."""

    axes: np.ndarray
    J: np.ndarray
    w: np.ndarray

    @property
    def parts(self) -> tuple[float, float, float]:
        """Return 2 T J3 - L^2, L^2 - 2 T J1, L^2 - 2 T J2: all negative if J3 is the smallest."""
        (J1, J2, J3), (w1, w2, w3) = self.J, self.w
        above = J1 * (J3 - J1) * w1**2 + J2 * (J3 - J2) * w2**2
        below = J2 * (J2 - J1) * w2**2 + J3 * (J3 - J1) * w3**2
        between = J3 * (J3 - J2) * w3**2 - J1 * (J2 - J1) * w1**2
        return float(above), float(below), float(between)

    @property
    def m1(self) -> float:
        """Return 1 - m."""
        _, below, between = self.parts
        J1, J2, J3 = self.J
        return float(between * (J3 - J1) / (below * (J3 - J2)))

    def rotation(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the principal axes (m, 3, 3) in axes fixed to L, and angular velocities (m, 3)."""
        (J1, J2, J3), (w1, w2, w3) = self.J, self.w
        above, below, _ = self.parts
        most1, most2, most3 = np.sqrt(
            [above / (J1 * (J3 - J1)), above / (J2 * (J3 - J2)), below / (J3 * (J3 - J1))]
        )
        sign3 = np.copysign(1.0, w3)
        sign2 = sign3 * np.sign(J3 - J2)
        rate = np.sqrt(below * (J3 - J2) / (J1 * J2 * J3))
        m1, phase = self.m1, np.arctan2(sign2 * w2 / most2, w1 / most1)
        f = jacobi(rate * t + first_kind(phase, m1), max(1.0 - m1, 0.0), m1)
        w = np.stack([most1 * f.cn, sign2 * most2 * f.sn, sign3 * most3 * f.dn], axis=1)
        L = float(np.linalg.norm(self.J * self.w))
        n1 = float(J2 * (J3 - J1) / (J1 * (J3 - J2)))
        ahead = third_kind(f.am, 1.0 - n1, n1, m1) - third_kind(phase[None], 1.0 - n1, n1, m1)
        phi = L * t / J3 + L * (J3 - J1) / (J1 * J3 * rate) * ahead
        l1, l2, l3 = (self.J * w).T
        x, _, z = np.eye(3)
        theta, psi = np.arctan2(np.hypot(l1, l2), l3), np.arctan2(l1, l2)
        return about(z, phi) @ about(x, theta) @ about(z, psi), w


def recognise(single: SingleBody) -> Free | None:
    """Return the flight of a free body without loads; None for other models."""
    if single.joint is not None or single.loads:
        return None
    spin = single.R.T @ single.W
    inertia = np.array(single.body.inertia)
    if parallel(inertia @ spin, spin):
        return Free(single, None)
    J, axes = np.linalg.eigh(inertia)
    axes[:, 2] *= np.linalg.det(axes)
    spinning = Spinning(axes, J, axes.T @ spin)
    if spinning.parts[2] < 0.0:
        axes = np.stack([axes[:, 2], axes[:, 1], -axes[:, 0]], axis=1)
        spinning = Spinning(axes, J[::-1], axes.T @ spin)
    return Free(single, spinning) if spinning.m1 > SEPARATRIX else None
