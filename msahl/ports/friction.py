"""Coulomb friction in a joint: a load against the motion along one of its coordinates.

At one configuration

    load = -mu r N tanh(q_dot/w)                             [N, or N m along an angle]
    d load/d q_dot = -mu r N (1 - tanh^2(q_dot/w))/w
    P = load q_dot                                           [W]

q       displacement or angle of the joint [m or rad]
mu, r   coefficient of friction; lever arm: 1 for a displacement, the bearing's radius for an angle
N       magnitude of the joint's reaction force [N]
w       rate at which friction has risen to three quarters of its limit [m/s or rad/s]; dry friction
        is regularised by it

Discrete form over a step of size h of the midpoint element: (q1 - q0)/h in place of q_dot, work
load (q1 - q0). N is extrapolated there from the last two steps, which is second-order accurate, and
everything else is implicit. The derivatives omit the change of N. Source: Coulomb's law with the
usual regularisation by tanh.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.elements.constraints.coordinate_jacobians import add_damper, add_spring
from msahl.elements.constraints.coordinate_kinds import (
    ANGLE,
    Coordinates,
    CoordinatesWorkspace,
    Derivatives,
)
from msahl.elements.constraints.scalar import ScalarWorkspace
from msahl.elements.frames import Frames, FramesWorkspace
from msahl.jit.kernel import kernel


class Frictions(NamedTuple):
    """The group of all joint frictions."""

    coordinate: np.ndarray  # (f,)
    joint: np.ndarray  # (f,) whose reaction is N
    lever: np.ndarray  # (f,) mu r
    width: np.ndarray  # (f,) w
    column: np.ndarray  # (f,) of the table of work


@kernel
def load(group: Frictions, reactions: np.ndarray, f: int, rate: float) -> tuple[float, float]:
    """Return the load of friction ``f`` at a ``rate`` under the joints' ``reactions`` (j, 6), and
    its derivative by the rate.
    """
    joint = group.joint[f]
    square = reactions[joint, 0] ** 2 + reactions[joint, 1] ** 2 + reactions[joint, 2] ** 2
    limit = group.lever[f] * math.sqrt(square)
    t = math.tanh(rate / group.width[f])
    return -limit * t, -limit * (1.0 - t * t) / group.width[f]


@kernel
def add_load(
    group: Frictions, reactions: np.ndarray, start: CoordinatesWorkspace, rate: np.ndarray
) -> None:
    """Add the frictions at the coordinates' rates ``rate`` (q,) to the coordinates' loads.

    They do not count among the sizes of loads: each is a fraction of a reaction, whose size counts.
    """
    for f in range(group.coordinate.size):
        q = group.coordinate[f]
        start.load[q] += load(group, reactions, f, rate[q])[0]


@kernel
def add_derivatives(
    group: Frictions,
    reactions: np.ndarray,
    coords: Coordinates,
    place: ScalarWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Add the derivatives of the frictions by mass by the places and by the rates."""
    for f in range(group.coordinate.size):
        q = group.coordinate[f]
        slope = load(group, reactions, f, place.rate[q])[1]
        add_damper(coords, place.coordinates, frames, motion, q, slope, out)


@kernel
def add_power(
    group: Frictions, reactions: np.ndarray, rate: np.ndarray, dt: float, total: np.ndarray
) -> None:
    """Add ``dt`` times the power [W] of each friction to its column of ``total`` [J]."""
    for f in range(group.coordinate.size):
        q_dot = rate[group.coordinate[f]]
        total[group.column[f]] += load(group, reactions, f, q_dot)[0] * q_dot * dt


@kernel
def add_mean_load(
    group: Frictions, reactions: np.ndarray, start: CoordinatesWorkspace, h: float
) -> None:
    """Add the mean frictions over the step, under the extrapolated ``reactions``, to the loads."""
    for f in range(group.coordinate.size):
        q = group.coordinate[f]
        press, _ = load(group, reactions, f, start.change[q] / h)
        start.load[q] += press
        start.size[q] += abs(press)


@kernel
def mean_jacobian(
    group: Frictions,
    reactions: np.ndarray,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    step: tuple[float, float],
    values: np.ndarray,
) -> None:
    """Add the derivatives of the mean frictions over the ``step`` (h, dt2) by the unknowns."""
    h, dt2 = step
    for f in range(group.coordinate.size):
        q = group.coordinate[f]
        slope = load(group, reactions, f, start.change[q] / h)[1] / h
        add_spring(coords, start, frames, -dt2, q, slope, values)


@kernel
def mean_work(
    group: Frictions,
    reactions: np.ndarray,
    start: CoordinatesWorkspace,
    h: float,
    total: np.ndarray,
) -> None:
    """Add the work [J] of each mean friction over the step to its column of ``total``."""
    for f in range(group.coordinate.size):
        dq = start.change[group.coordinate[f]]
        total[group.column[f]] += load(group, reactions, f, dq / h)[0] * dq


def unresolved_speed(
    group: Frictions,
    coords: Coordinates,
    frames: Frames,
    reactions: np.ndarray,
    h: float,
) -> float:
    """Return half the largest width w [m/s] that friction under the ``reactions`` (j, 6) passes
    within one step ``h``; 0 if it passes none.
    """
    worst = 0.0
    for f, q in enumerate(group.coordinate):
        first = coords.first[q]
        pair = [coords.products.a[first], coords.products.b[first]]
        moving = [b for b in pair if frames.inverse_mass[b] > 0.0]
        angular = coords.kind[q] == ANGLE
        length = float(frames.length[moving].max()) if angular else 1.0
        limit = float(np.linalg.norm(reactions[group.joint[f], :3])) * group.lever[f]
        change = h * limit * frames.inverse_mass[moving].max() / length**2
        if change > group.width[f]:
            worst = max(worst, 0.5 * float(group.width[f]) * length)
    return worst
