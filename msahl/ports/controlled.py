"""Concentrated load whose factor is an expression of the motion.

The law is that of ``ports.concentrated`` with c = u(y, s), an expression of signals and
auxiliary states (``elements.signals``), in place of a law of time. Over a step of the midpoint
element u is evaluated once, at the means, so the load does the work of the concentrated load with
the constant factor C = u. Its derivative has one more part: the load with factor 1 times du/dz.
"""

from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.vector import at, put, scale
from msahl.elements.constraints.products import Q_A, U_A
from msahl.elements.signals.group import SignalsWorkspace
from msahl.formulations.absolute.equations import force_factor, moment_factor
from msahl.formulations.absolute.frames import Frames, FramesWorkspace, direction, mean
from msahl.jit.kernel import kernel, optional
from msahl.ports import concentrated
from msahl.ports.concentrated import ConcentratedLoads, ConcentratedWorkspace, moment


class ControlledLoads(NamedTuple):
    """The group of all such loads; they have the results of the signals after the actuators'."""

    loads: ConcentratedLoads
    first_result: int


class ControlledWorkspace(NamedTuple):
    """Loads multiplied by their factors, and with factor 1; inertial axes."""

    loads: ConcentratedWorkspace
    force: np.ndarray  # (k, 3) [N]
    moment: np.ndarray  # (k, 3) about the mass centre [N m]


def new_workspace(group: ControlledLoads | None) -> Any:
    """Return the work arrays; None without group."""
    if group is None:
        return None
    vectors = group.loads.f.shape
    loads = concentrated.new_workspace(group.loads)
    return ControlledWorkspace(loads, np.zeros(vectors), np.zeros(vectors))


@kernel
def set_factors(
    group: ControlledLoads, start: ControlledWorkspace, signals_start: SignalsWorkspace
) -> None:
    """Set the factors to the results of the signals."""
    for k in range(group.loads.frame.size):
        start.loads.factor[k] = signals_start.result[group.first_result + k]


@optional()
def add_force(
    group: ControlledLoads,
    start: ControlledWorkspace,
    signals_start: SignalsWorkspace,
    frames: Frames,
    R: np.ndarray,
    F: np.ndarray,
) -> None:
    """Add the loads at one configuration by mass to the rows of their bodies."""
    loads = group.loads
    set_factors(group, start, signals_start)
    concentrated.prepare(loads, start.loads.factor, R, start.loads)
    concentrated.add_force(loads, start.loads, frames, F)
    for k in range(loads.frame.size):
        f = direction(R, loads.f_axes[k], at(loads.f, k))
        m = direction(R, loads.m_axes[k], at(loads.m, k))
        put(start.force, k, f)
        put(start.moment, k, moment(at(start.loads.r, k), f, m))


@optional()
def add_derivatives(
    group: ControlledLoads, start: ControlledWorkspace, frames: Frames, by_place: np.ndarray
) -> None:
    """Add the derivatives by the rotations at constant factors."""
    concentrated.add_derivatives(group.loads, start.loads, frames, by_place)


@optional()
def add_power(
    group: ControlledLoads,
    start: ControlledWorkspace,
    motion: FramesWorkspace,
    dt: float,
    total: np.ndarray,
) -> None:
    """Add ``dt`` times the power [W] of each load to its column of ``total`` [J]."""
    concentrated.add_power(group.loads, start.loads, motion, dt, total)


@optional()
def mean_residual(
    group: ControlledLoads,
    start: ControlledWorkspace,
    signals_start: SignalsWorkspace,
    motion: FramesWorkspace,
    step: tuple[Frames, float],
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Add a factor times the mean loads by mass to the rows of their bodies; ``step`` is (frames,
    factor).
    """
    loads, (frames, factor), R = group.loads, step, motion.R
    set_factors(group, start, signals_start)
    concentrated.prepare(loads, start.loads.factor, R, start.loads)
    concentrated.mean_residual(loads, start.loads, frames, factor, Z, F)
    for k in range(loads.frame.size):
        f_axes, m_axes = loads.f_axes[k], loads.m_axes[k]
        f = mean(frames, Z, f_axes, direction(R, f_axes, at(loads.f, k)))
        m = mean(frames, Z, m_axes, direction(R, m_axes, at(loads.m, k)))
        r = mean(frames, Z, loads.frame[k], at(start.loads.r, k))
        put(start.force, k, f)
        put(start.moment, k, moment(r, f, m))


@optional()
def mean_jacobian(
    group: ControlledLoads,
    start: ControlledWorkspace,
    frames: Frames,
    factor: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of ``mean_residual`` by the rotation increments at constant factors."""
    concentrated.mean_jacobian(group.loads, start.loads, frames, factor, Z, values)


@optional()
def mean_work(
    group: ControlledLoads,
    start: ControlledWorkspace,
    frames: Frames,
    Z: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the work [J] of each mean load over the solved step to its column of ``total``."""
    concentrated.mean_work(group.loads, start.loads, frames, Z, total)


@optional()
def set_rows(
    group: ControlledLoads,
    start: ControlledWorkspace,
    frames: Frames,
    factor: float,
    r: int,
    row: np.ndarray,
) -> None:
    """Set ``row`` (4, 3) to what a factor of 1 of the result ``r`` adds to the equations of its
    body: ``factor`` times the load by mass. Nothing for a result of an actuator.
    """
    k = r - group.first_result
    if k < 0:
        return
    b = group.loads.frame[k]
    put(row, U_A, scale(force_factor(frames, factor, b), at(start.force, k)))
    put(row, Q_A, scale(moment_factor(frames, factor, b), at(start.moment, k)))
