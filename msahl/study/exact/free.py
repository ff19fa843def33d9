"""Free flight: the mass centre on its parabola, the body turning without moment (Euler, Jacobi).

    w1 = w1m cn,  w2 = +- w2m sn,  w3 = +- w3m dn         of lam t + u0, principal axes
    lam^2 = (L^2 - 2 T J1)(J3 - J2) / (J1 J2 J3)
    m = (2 T J3 - L^2)(J2 - J1) / ((L^2 - 2 T J1)(J3 - J2))
    phi_dot = L/J3 + L (J3 - J1)/(J1 J3) / (1 - n sn^2),   1 - n = J2 (J3 - J1)/(J1 (J3 - J2))

Axis 3 is the one that the spin goes round: the largest moment if L^2 > 2 T J2, else the smallest.
phi turns about the angular momentum L, which stays where it is. All differences are sums of terms
of one sign in the first spin, so none cancels. Source: Landau and Lifshitz, Mechanics, art. 37.
"""

from dataclasses import dataclass

import numpy as np

from msahl.study.exact.elliptic import first_kind, jacobi, third_kind
from msahl.study.exact.motion import Motion, Scene, about, parallel

SEPARATRIX = 1e-12
"""1 - m below which the period is not defined by the numbers given."""


@dataclass(frozen=True)
class Free:
    """Ballistic flight with the turning motion ``spinning`` (None: about a fixed axis)."""

    scene: Scene
    spinning: "Spinning | None"
    words = "free flight, parabola and Euler's motion by elliptic functions"

    def motion(self, t: np.ndarray) -> Motion:
        """The body at the times ``t``."""
        scene, time = self.scene, t[:, None]
        x = scene.x + scene.v * time + 0.5 * scene.gravity * time**2
        v = scene.v + scene.gravity * time
        a = np.broadcast_to(scene.gravity, v.shape)
        if self.spinning is not None:
            return Motion(x, *self._turning(t, self.spinning, v), a)
        rate = float(np.linalg.norm(scene.W))
        axis = scene.W / rate if rate else np.eye(3)[2]
        return Motion(x, about(axis, rate * t) @ scene.R, v, np.tile(scene.W, (len(t), 1)), a)

    def _turning(
        self, t: np.ndarray, spinning: "Spinning", v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        E, w = spinning.turn(t)
        first, _ = spinning.turn(np.zeros(1))
        R = (self.scene.R @ spinning.axes @ first[0].T) @ E @ spinning.axes.T
        return R, v, np.einsum("mij,jk,mk->mi", R, spinning.axes, w)


@dataclass(frozen=True)
class Spinning:
    """Principal ``axes`` (columns, body axes), moments J, and the first spin w along them."""

    axes: np.ndarray
    J: np.ndarray
    w: np.ndarray

    @property
    def parts(self) -> tuple[float, float, float]:
        """2 T J3 - L^2, L^2 - 2 T J1 and L^2 - 2 T J2, negative all three if J3 is the smallest."""
        (J1, J2, J3), (w1, w2, w3) = self.J, self.w
        above = J1 * (J3 - J1) * w1**2 + J2 * (J3 - J2) * w2**2
        below = J2 * (J2 - J1) * w2**2 + J3 * (J3 - J1) * w3**2
        between = J3 * (J3 - J2) * w3**2 - J1 * (J2 - J1) * w1**2
        return float(above), float(below), float(between)

    @property
    def m1(self) -> float:
        """1 - m."""
        _, below, between = self.parts
        J1, J2, J3 = self.J
        return float(between * (J3 - J1) / (below * (J3 - J2)))

    def turn(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(m, 3, 3) principal axes in axes fixed to L, and (m, 3) spins."""
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


def recognise(scene: Scene) -> Free | None:
    """The flight that ``scene`` is, or None."""
    if scene.joint is not None or scene.loads:
        return None
    spin = scene.R.T @ scene.W
    inertia = np.array(scene.body.inertia)
    if parallel(inertia @ spin, spin):
        return Free(scene, None)
    J, axes = np.linalg.eigh(inertia)
    axes[:, 2] *= np.linalg.det(axes)
    spinning = Spinning(axes, J, axes.T @ spin)
    if spinning.parts[2] < 0.0:
        axes = np.stack([axes[:, 2], axes[:, 1], -axes[:, 0]], axis=1)
        spinning = Spinning(axes, J[::-1], axes.T @ spin)
    return Free(scene, spinning) if spinning.m1 > SEPARATRIX else None
