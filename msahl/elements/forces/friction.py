"""Coulomb friction in a joint: a load against the motion along its free quantity.

    load = -mu r N tanh( (dq/dt) / width )

N is the magnitude of the joint's reaction, r a lever arm (the bearing's radius for an angle, 1 for
a slide), ``width`` the rate at which friction has risen to three quarters: dry friction
regularised. N is carried over from the last steps (linearly, so to second order); the rest is
implicit.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.elements.constraints.coordinates import Quantities, QuantityStart, add_damper, add_spring
from msahl.elements.frames import Frames
from msahl.jit.kernel import kernel


class Frictions(NamedTuple):
    """All joint frictions."""

    quantity: np.ndarray  # (f,)
    joint: np.ndarray  # (f,) whose reaction presses
    lever: np.ndarray  # (f,) mu r
    width: np.ndarray  # (f,) rate [m/s or rad/s]


@kernel
def load(frictions: Frictions, reactions: np.ndarray, f: int, rate: float) -> tuple[float, float]:
    """Load of friction ``f`` at a ``rate``, and its derivative by the rate."""
    joint = frictions.joint[f]
    square = reactions[joint, 0] ** 2 + reactions[joint, 1] ** 2 + reactions[joint, 2] ** 2
    limit = frictions.lever[f] * math.sqrt(square)
    t = math.tanh(rate / frictions.width[f])
    return -limit * t, -limit * (1.0 - t * t) / frictions.width[f]


@kernel
def residual(frictions: Frictions, reactions: np.ndarray, start: QuantityStart, h: float) -> None:
    """Add the frictions, under the predicted ``reactions`` (j, 6), to their quantities' loads."""
    for f in range(frictions.quantity.size):
        q = frictions.quantity[f]
        press, _ = load(frictions, reactions, f, start.change[q] / h)
        start.load[q] += press
        start.size[q] += abs(press)


@kernel
def free_load(
    frictions: Frictions, reactions: np.ndarray, start: QuantityStart, rate: np.ndarray
) -> None:
    """Add the frictions at the start, with the quantities' rates there, to the loads."""
    for f in range(frictions.quantity.size):
        q = frictions.quantity[f]
        start.load[q] += load(frictions, reactions, f, rate[q])[0]


@kernel
def free_jacobian(
    frictions: Frictions,
    reactions: np.ndarray,
    quantities: Quantities,
    start: QuantityStart,
    rate: np.ndarray,
    frames: Frames,
    v: np.ndarray,
    W: np.ndarray,
    Z: np.ndarray,
    room: np.ndarray,
    by_place: np.ndarray,
    by_rate: np.ndarray,
) -> None:
    """Add half the derivative of ``free_load`` by the places, and all of it by the rates."""
    for f in range(frictions.quantity.size):
        q = frictions.quantity[f]
        slope = load(frictions, reactions, f, rate[q])[1]
        add_damper(quantities, start, frames, v, W, Z, q, slope, room, by_place, by_rate)


@kernel
def free_work(
    frictions: Frictions,
    reactions: np.ndarray,
    rate: np.ndarray,
    dt: float,
    column: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work [J] at these rates over a time ``dt`` to their ``column`` of ``total``."""
    for f in range(frictions.quantity.size):
        q_rate = rate[frictions.quantity[f]]
        total[column[f]] += load(frictions, reactions, f, q_rate)[0] * q_rate * dt


@kernel
def jacobian(
    frictions: Frictions,
    reactions: np.ndarray,
    quantities: Quantities,
    start: QuantityStart,
    frames: Frames,
    h: float,
    dt2: float,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the loads."""
    for f in range(frictions.quantity.size):
        q = frictions.quantity[f]
        slope = load(frictions, reactions, f, start.change[q] / h)[1] / h
        add_spring(quantities, start, frames, dt2, q, slope, values)


@kernel
def work(
    frictions: Frictions,
    reactions: np.ndarray,
    start: QuantityStart,
    h: float,
    column: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work [J] over the step to its ``column`` of ``total``."""
    for f in range(frictions.quantity.size):
        dq = start.change[frictions.quantity[f]]
        total[column[f]] += load(frictions, reactions, f, dq / h)[0] * dq
