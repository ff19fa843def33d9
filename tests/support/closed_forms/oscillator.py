"""Compute a harmonic oscillator: a body on a linear spring and damper, along a line or an angle.

    M q_ddot + c q_dot + k (q - q_rest) = 0                     M: mass, or inertia about the axis
    q - q_rest = e^(-d t) (y C + (y_dot + d y) S) ,    d = c/2M,  y = q - q_rest at t = 0

    C, S = cos(w t), sin(w t)/w     w^2 = k/M - d^2 > 0
           1,        t              w = 0: critical
           cosh(b t), sinh(b t)/b   w^2 = -b^2 < 0: overdamped

Along a line: a prismatic joint on the ground with a spring along its displacement, under any
gravity; or a spring between a point of the ground and the mass centre of a body that does not
rotate and moves along the spring, as gravity does. About an axis: a revolute joint on the ground
with a spring on its angle, if gravity has no moment about the axis.
"""

from dataclasses import dataclass

import numpy as np

from msahl.model.loads import JointSpring, SpringDamper
from tests.support.closed_forms.motion import SAME, Motion, SingleBody, about, parallel


@dataclass(frozen=True)
class Oscillator:
    """``q`` and ``rate`` are those at t = 0; at ``rest`` spring and weight are in equilibrium. A
    displacement is along ``axis``, and ``point`` is None; a rotation is about the ``axis`` through
    ``point``.
    """

    single: SingleBody
    axis: np.ndarray
    point: np.ndarray | None
    mass: float  # [kg], or inertia about the axis [kg m^2]
    stiffness: float
    damping: float
    rest: float
    q: float
    rate: float
    pulls: bool  # whether the spring's load is a force on the mass centre
    description = "harmonic oscillator, spring and damper"

    def motion(self, t: np.ndarray) -> Motion:
        """Return the motion at the times ``t``."""
        q, q_dot, q_ddot = self.swing(t)
        single = self.single
        if self.point is None:
            moved, v, a = (f[:, None] * self.axis for f in (q - self.q, q_dot, q_ddot))
            R, W = np.tile(single.R, (len(t), 1, 1)), np.zeros_like(v)
            pull = -self.stiffness * (q - self.rest) - self.damping * q_dot
            load = pull[:, None] * self.axis - single.body.mass * self._weight()
            return Motion(single.x + moved, R, v, W, a, load if self.pulls else None)
        R = about(self.axis, q - self.q)
        W, alpha = q_dot[:, None] * self.axis, q_ddot[:, None] * self.axis
        r = R @ (single.x - self.point)
        v = np.cross(W, r)
        a = np.cross(alpha, r) + np.cross(W, v)
        return Motion(self.point + r, R @ single.R, v, W, a)

    def _weight(self) -> np.ndarray:
        """Return the component of gravity along the axis [m/s^2], which the spring carries."""
        along: np.ndarray = (self.axis @ self.single.gravity) * self.axis
        return along

    def swing(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q and its first two derivatives."""
        d, square = 0.5 * self.damping / self.mass, self.stiffness / self.mass
        y, b2 = self.q - self.rest, d * d - square
        if abs(b2) <= SAME * square:
            fade, C, S = np.exp(-d * t), np.ones_like(t), t
        elif b2 < 0.0:
            w = np.sqrt(-b2)
            fade, C, S = np.exp(-d * t), np.cos(w * t), np.sin(w * t) / w
        else:
            # e^(-d t) cosh(b t) without overflow, and d - b without cancellation.
            b = np.sqrt(b2)
            gone = np.exp(-2.0 * b * t)
            fade, C, S = np.exp(-square / (d + b) * t), 0.5 * (1.0 + gone), 0.5 * (1.0 - gone) / b
        q_dot = fade * (self.rate * C - (d * self.rate + square * y) * S)
        out = fade * (y * C + (self.rate + d * y) * S)
        return self.rest + out, q_dot, -2.0 * d * q_dot - square * out


def recognise(single: SingleBody) -> Oscillator | None:
    """Return the oscillator of a body with one linear spring; None for other models."""
    if len(single.loads) != 1:
        return None
    (spring,) = single.loads
    if not isinstance(spring, JointSpring | SpringDamper) or spring.table is not None:
        return None
    if not spring.stiffness > 0.0:
        return None
    if isinstance(spring, SpringDamper):
        return _stretched(single, spring)
    joint = single.joint
    if joint is None or joint.child != single.body.name:
        return None
    axis = np.array(joint.parent_axes[2])
    if joint.kind == "prismatic":
        mass, point, rate = single.body.mass, None, float(axis @ single.v)
        weight = float(axis @ single.gravity) * mass
    elif joint.kind == "revolute":
        point = np.array(joint.parent_point)
        r = single.x - point
        mass = float(axis @ single.J @ axis) + single.body.mass * float(
            np.sum(np.cross(axis, r) ** 2)
        )
        weight, rate = 0.0, float(axis @ single.W)
        if not (parallel(axis, single.gravity) or parallel(axis, r)):
            return None
    else:
        return None
    rest = spring.free + (weight - spring.preload) / spring.stiffness
    numbers = (mass, spring.stiffness, spring.damping, rest, 0.0, rate)
    return Oscillator(single, axis, point, *numbers, pulls=point is None)


def _stretched(single: SingleBody, spring: SpringDamper) -> Oscillator | None:
    """Return the oscillator of a free body on a spring between the ground and its mass centre."""
    if single.joint is not None or np.any(single.W) or spring.child != single.body.name:
        return None
    if np.abs(np.subtract(spring.child_point, single.body.r_BG)).max() > 0.0:
        return None
    D = single.x - np.array(spring.parent_point)
    length = float(np.linalg.norm(D))
    axis = D / length
    if not (parallel(axis, single.v) and parallel(axis, single.gravity)):
        return None
    free = length if spring.free_length is None else spring.free_length
    weight = float(axis @ single.gravity) * single.body.mass
    rest = free + (weight - spring.preload) / spring.stiffness
    rate = float(axis @ single.v)
    numbers = (single.body.mass, spring.stiffness, spring.damping, rest, length, rate)
    own = Oscillator(single, axis, None, *numbers, pulls=False)
    # If the length passes zero, the spring's direction reverses.
    swing = np.hypot(length - rest, rate / np.sqrt(spring.stiffness / single.body.mass))
    return own if rest - swing > SAME * length else None
