"""Momentum of a subsystem without external forces other than gravity.

P(t) = sum m v = P(0) + M g t
L(t) = sum m (x - x_M) x (v - v_M) + J W   stays,   M the subsystem's mass centre
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.formulations.absolute.frames import moving_count
from msahl.ports import forces
from msahl.system.arrays import State, System, SystemWorkspace


class Momentum(NamedTuple):
    """Linear and angular momentum, inertial axes, and the sizes of what they are sums of."""

    P: np.ndarray  # (3,) [kg m/s]
    L: np.ndarray  # (3,) about the mass centre [kg m^2/s]
    P_size: float
    L_size: float
    mass: float  # [kg]
    inertia: float  # sum of m |x - x_M|^2 and of the largest moments of inertia [kg m^2]


def is_alone(system: System) -> bool:
    """Return whether no element connects the subsystem to the ground and no load acts on it."""
    ground = moving_count(system.frames)
    ends = [system.coincide.a, system.coincide.b]
    if system.scalar is not None:
        ends += [system.scalar.coordinates.products.a, system.scalar.coordinates.products.b]
    tied = any(bool((end == ground).any()) for end in ends)
    return not (tied or forces.acts_at_points(system.forces))


def momentum(system: System, state: State, start: SystemWorkspace) -> Momentum:
    """Of the prepared ``state``."""
    bodies = system.bodies
    m = 1.0 / bodies.inverse_mass[:, None]
    x, v, W = (motion[bodies.frame] for motion in (state.x, start.frames.v, start.frames.W))
    spins = np.einsum("bij,bj->bi", start.bodies.J, W)
    x_M, v_M = (m * x).sum(axis=0) / m.sum(), (m * v).sum(axis=0) / m.sum()
    orbits = np.cross(x - x_M, m * (v - v_M))
    largest = np.linalg.norm(start.bodies.J, 2, axis=(1, 2))
    return Momentum(
        P=(m * v).sum(axis=0),
        L=(orbits + spins).sum(axis=0),
        P_size=float(np.linalg.norm(m * v, axis=1).sum()),
        L_size=float(np.linalg.norm([*orbits, *spins], axis=1).sum()),
        mass=float(m.sum()),
        inertia=float((m * (x - x_M) ** 2).sum() + largest.sum()),
    )


def drift(
    system: System, before: Momentum, now: Momentum, time: float, energy: float
) -> tuple[float, float]:
    """Parts of the linear and the angular momentum lost since ``before``, ``time`` [s] ago. They
    are at least as large as the largest kinetic ``energy`` [J] since then makes them, by Cauchy and
    Schwarz: the bodies may have been at rest at both times.
    """
    impulse = system.bodies.gravity * (time / system.bodies.inverse_mass).sum()
    linear = np.linalg.norm(now.P - before.P - impulse)
    angular = np.linalg.norm(now.L - before.L)
    fastest = math.sqrt(2.0 * energy)
    P_size = max(before.P_size, now.P_size, float(np.linalg.norm(impulse)))
    P_size = max(P_size, fastest * math.sqrt(now.mass))
    L_size = max(before.L_size, now.L_size, fastest * math.sqrt(now.inertia))
    return float(linear / P_size) if P_size else 0.0, float(angular / L_size) if L_size else 0.0
