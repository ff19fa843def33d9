"""Harmonic oscillator: a body on a linear spring and damper, along a line or about an axis.

    M q_ddot + c q_dot + k (q - q_rest) = 0                     M: mass, or inertia about the axis
    q - q_rest = e^(-d t) (y C + (y_dot + d y) S) ,    d = c/2M,  y = q - q_rest at t = 0

    C, S = cos(w t), sin(w t)/w     w^2 = k/M - d^2 > 0
           1,        t              w = 0: critical
           cosh(b t), sinh(b t)/b   w^2 = -b^2 < 0: overdamped

Along a line: a prismatic joint on the ground with a spring on its slide under any gravity, or a
spring between a point of the ground and the mass centre of a body without spin that moves along
it, gravity being along it as well. About an axis: a revolute joint on the ground with a spring on
its angle, if gravity has no moment about the axis.
"""

from dataclasses import dataclass

import numpy as np

from msahl.model.loads import JointSpring, SpringDamper
from msahl.study.exact.motion import SAME, Motion, Scene, about, parallel


@dataclass(frozen=True)
class Oscillator:
    """``q`` and ``rate`` at t = 0; ``rest`` is where spring and weight balance. A slide has
    ``axis`` for its direction and no ``point``; a turn goes about the ``axis`` through ``point``.
    """

    scene: Scene
    axis: np.ndarray
    point: np.ndarray | None
    mass: float  # [kg], or inertia about the axis [kg m^2]
    stiffness: float
    damping: float
    rest: float
    q: float
    rate: float
    pulls: bool  # whether the spring's load is a force on the mass centre
    words = "harmonic oscillator, spring and damper"

    def motion(self, t: np.ndarray) -> Motion:
        """The body at the times ``t``."""
        q, q_dot, q_ddot = self.swing(t)
        scene = self.scene
        if self.point is None:
            way, v, a = (f[:, None] * self.axis for f in (q - self.q, q_dot, q_ddot))
            still = np.tile(scene.R, (len(t), 1, 1)), np.zeros_like(v)
            pull = -self.stiffness * (q - self.rest) - self.damping * q_dot
            load = pull[:, None] * self.axis - scene.body.mass * self._weight()
            return Motion(scene.x + way, still[0], v, still[1], a, load if self.pulls else None)
        R = about(self.axis, q - self.q)
        W, alpha = q_dot[:, None] * self.axis, q_ddot[:, None] * self.axis
        r = R @ (scene.x - self.point)
        v = np.cross(W, r)
        a = np.cross(alpha, r) + np.cross(W, v)
        return Motion(self.point + r, R @ scene.R, v, W, a)

    def _weight(self) -> np.ndarray:
        """Part of gravity along the axis [m/s^2]: the spring bears it at rest."""
        along: np.ndarray = (self.axis @ self.scene.gravity) * self.axis
        return along

    def swing(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q and its first two derivatives."""
        d, square = 0.5 * self.damping / self.mass, self.stiffness / self.mass
        y, b2 = self.q - self.rest, d * d - square
        if abs(b2) <= SAME * square:
            fade, C, S = np.exp(-d * t), np.ones_like(t), t
        elif b2 < 0.0:
            w = np.sqrt(-b2)
            fade, C, S = np.exp(-d * t), np.cos(w * t), np.sin(w * t) / w
        else:
            # e^(-d t) cosh(b t) in numbers that stay small, d - b without cancellation.
            b = np.sqrt(b2)
            gone = np.exp(-2.0 * b * t)
            fade, C, S = np.exp(-square / (d + b) * t), 0.5 * (1.0 + gone), 0.5 * (1.0 - gone) / b
        q_dot = fade * (self.rate * C - (d * self.rate + square * y) * S)
        out = fade * (y * C + (self.rate + d * y) * S)
        return self.rest + out, q_dot, -2.0 * d * q_dot - square * out


def recognise(scene: Scene) -> Oscillator | None:
    """The oscillator that ``scene`` is, or None."""
    if len(scene.loads) != 1:
        return None
    (spring,) = scene.loads
    if not isinstance(spring, JointSpring | SpringDamper) or spring.table is not None:
        return None
    if not spring.stiffness > 0.0:
        return None
    if isinstance(spring, SpringDamper):
        return _stretched(scene, spring)
    joint = scene.joint
    if joint is None or joint.child != scene.body.name:
        return None
    axis = np.array(joint.parent_axes[2])
    if joint.kind == "prismatic":
        mass, point, rate = scene.body.mass, None, float(axis @ scene.v)
        weight = float(axis @ scene.gravity) * mass
    elif joint.kind == "revolute":
        point = np.array(joint.parent_point)
        r = scene.x - point
        mass = float(axis @ scene.J @ axis) + scene.body.mass * float(
            np.sum(np.cross(axis, r) ** 2)
        )
        weight, rate = 0.0, float(axis @ scene.W)
        if not (parallel(axis, scene.gravity) or parallel(axis, r)):
            return None
    else:
        return None
    rest = spring.free + (weight - spring.preload) / spring.stiffness
    numbers = (mass, spring.stiffness, spring.damping, rest, 0.0, rate)
    return Oscillator(scene, axis, point, *numbers, pulls=point is None)


def _stretched(scene: Scene, spring: SpringDamper) -> Oscillator | None:
    """A free body on a spring between the ground and its mass centre."""
    if scene.joint is not None or np.any(scene.W) or spring.child != scene.body.name:
        return None
    if np.abs(np.subtract(spring.child_point, scene.body.r_BG)).max() > 0.0:
        return None
    D = scene.x - np.array(spring.parent_point)
    length = float(np.linalg.norm(D))
    axis = D / length
    if not (parallel(axis, scene.v) and parallel(axis, scene.gravity)):
        return None
    free = length if spring.free_length is None else spring.free_length
    weight = float(axis @ scene.gravity) * scene.body.mass
    rest = free + (weight - spring.preload) / spring.stiffness
    rate = float(axis @ scene.v)
    numbers = (scene.body.mass, spring.stiffness, spring.damping, rest, length, rate)
    own = Oscillator(scene, axis, None, *numbers, pulls=False)
    # Where the length would pass zero the line turns round.
    swing = np.hypot(length - rest, rate / np.sqrt(spring.stiffness / scene.body.mass))
    return own if rest - swing > SAME * length else None
