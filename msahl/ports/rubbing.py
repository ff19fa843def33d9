"""Friction of compliant contacts: Coulomb's law, regularised, by the force of the same contact.

    T_i = -mu N tanh(|s|/w) s_i/|s|         on the child, the opposite on the parent          [N]
    s           slip: rates of two tangential coordinates, over a step their mean             [m/s]
    N           force with which the contact pushes (``laws.contact``), over a step its mean  [N]
    mu, w       coefficient of friction; slip at which three quarters of it act          [-, m/s]

A contact that gives way along its normal has no constraint that could hold it across it: so it
creeps, with w artanh(T/(mu N)), as the friction of joints does (``laws.friction``). Over a step of
the midpoint element the work is T . s h exactly.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws
from msahl.algebra.vector import Vector, axpy
from msahl.elements.constraints.coordinate_jacobians import add_outer, rate_gradient
from msahl.elements.constraints.coordinate_kinds import Coordinates, Derivatives
from msahl.elements.constraints.scalar import ScalarWorkspace
from msahl.formulations.absolute.frames import Frames, FramesWorkspace
from msahl.jit.kernel import kernel, optional
from msahl.laws.contact import SIDE
from msahl.ports.coordinate import (
    AlongForces,
    by_place,
    elongation,
    law_resistance,
    mean_tension,
    tension,
)
from msahl.ports.sliding import across, factors, parts_of

SMALL = 1e-4
"""Slip over w below which a series takes the place of a quotient; its error is the fourth power."""


class Rubbing(NamedTuple):
    """The compliant contacts with friction."""

    normal: np.ndarray  # (k,) number of their forces among those along coordinates
    along: np.ndarray  # (k, 2) coordinates whose rates are the slip
    friction: np.ndarray  # (k,) mu
    width: np.ndarray  # (k,) w
    column: np.ndarray  # (k,) of the table of work


Parts = tuple[Vector, Vector, Vector, Vector]
Force = tuple[float, float, float]
"""N, and its derivatives by the coordinate of the normal and by its rate."""


@kernel
def drag(mu: float, w: float, s_1: float, s_2: float) -> tuple[float, float]:
    """Return c of T = -c N s, and (dc/d|s|)/|s|."""
    speed = math.sqrt(s_1 * s_1 + s_2 * s_2)
    x = speed / w
    if x < SMALL:
        return mu / w * (1.0 - x * x / 3.0), -2.0 * mu / (3.0 * w**3)
    t = math.tanh(x)
    c = mu * t / speed
    return c, (mu * (1.0 - t * t) / w - c) / (speed * speed)


@kernel
def pushes(group: Rubbing, along: AlongForces, laws: Laws, place: ScalarWorkspace, k: int) -> Force:
    """Return the force of contact ``k`` at one configuration."""
    s = group.normal[k]
    T, slope = tension(along, laws, s, elongation(along, place.coordinates, s))
    rate = place.rate[along.coordinate[s]]
    R, by_rate = law_resistance(along.law[s], along.constants[s], rate, abs(T))
    return _as_pushing(along, s, T, slope, R, by_rate)


@kernel
def pushes_over(
    group: Rubbing, along: AlongForces, laws: Laws, place: ScalarWorkspace, k: int, h: float
) -> Force:
    """Return the mean force of contact ``k`` over a step ``h``, and its derivatives by the change
    of the coordinate and of its mean rate.
    """
    s, q = group.normal[k], place.coordinates
    dq = q.change[along.coordinate[s]]
    T, slope = mean_tension(along, laws, s, elongation(along, q, s), dq)
    R, by_rate = law_resistance(along.law[s], along.constants[s], dq / h, abs(T))
    return _as_pushing(along, s, T, slope, R, by_rate)


@kernel
def _as_pushing(
    along: AlongForces, s: int, T: float, slope: float, R: float, by_rate: float
) -> Force:
    side = along.constants[s, SIDE]
    return (
        -side * (T + R),
        -side * (slope + by_place(along, s, R, T, slope)),
        -side * by_rate,
    )


@kernel
def _resist(group: Rubbing, k: int, N: float, s: tuple[float, float], load: np.ndarray) -> None:
    """Add the friction of contact ``k`` at the slip ``s`` to the coordinates' loads."""
    c, _ = drag(group.friction[k], group.width[k], s[0], s[1])
    load[group.along[k, 0]] -= c * N * s[0]
    load[group.along[k, 1]] -= c * N * s[1]


@optional(0.0)
def slip(group: Rubbing, rate: np.ndarray, k: int) -> float:
    """Return the amount of the slip of contact ``k`` at the coordinates' ``rate`` (q,) [m/s]."""
    s_1, s_2 = rate[group.along[k, 0]], rate[group.along[k, 1]]
    return math.sqrt(s_1 * s_1 + s_2 * s_2)


@optional()
def add_loads(group: Rubbing, along: AlongForces, laws: Laws, place: ScalarWorkspace) -> None:
    """Add the friction to the coordinates' loads, after ``scalar.rates``."""
    load = place.coordinates.load
    for k in range(group.normal.size):
        N, _, _ = pushes(group, along, laws, place, k)
        s = place.rate[group.along[k, 0]], place.rate[group.along[k, 1]]
        _resist(group, k, N, s, load)


@optional()
def add_power(
    group: Rubbing,
    along: AlongForces,
    laws: Laws,
    place: ScalarWorkspace,
    dt: float,
    work: np.ndarray,
) -> None:
    """Add ``dt`` times the power of friction [W] to its columns of ``work`` [J]."""
    for k in range(group.normal.size):
        N, _, _ = pushes(group, along, laws, place, k)
        s_1, s_2 = place.rate[group.along[k, 0]], place.rate[group.along[k, 1]]
        c, _ = drag(group.friction[k], group.width[k], s_1, s_2)
        work[group.column[k]] -= c * N * (s_1 * s_1 + s_2 * s_2) * dt


@optional()
def add_derivatives(
    group: Rubbing,
    along: AlongForces,
    laws: Laws,
    coords: Coordinates,
    place: ScalarWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Add the derivatives of ``add_loads`` by mass by the places and by the rates."""
    q = place.coordinates
    for k in range(group.normal.size):
        N, by_q, by_rate = pushes(group, along, laws, place, k)
        if N == 0.0:
            continue
        normal = along.coordinate[group.normal[k]]
        slope = _rows(group, k, q.slope, normal)
        half = (
            rate_gradient(coords, q, frames, motion, group.along[k, 0], out),
            rate_gradient(coords, q, frames, motion, group.along[k, 1], out),
            rate_gradient(coords, q, frames, motion, normal, out),
        )
        s = place.rate[group.along[k, 0]], place.rate[group.along[k, 1]]
        for i in range(2):
            a = group.along[k, i]
            weights = _weights(group, k, i, N, s)
            force, c = parts_of(q.force[a]), factors(coords, frames, 1.0, a, -1.0)
            row = _combined(weights, by_rate, slope)
            add_outer(out.by_rate, coords.block, a, c, force, row)
            # ``rate_gradient`` gives half of the derivatives.
            both = 2.0 * weights[0], 2.0 * weights[1], weights[2]
            row = _combined(both, 2.0 * by_rate, half)
            add_outer(out.by_place, coords.block, a, c, force, row)
            row = _combined((0.0, 0.0, weights[2]), by_q, slope)
            add_outer(out.by_place, coords.block, a, c, force, row)


@kernel
def _rows(group: Rubbing, k: int, slope: np.ndarray, normal: int) -> tuple[Parts, Parts, Parts]:
    """Return the derivatives of both slips and of the normal's coordinate by their parts."""
    first, second = group.along[k, 0], group.along[k, 1]
    return parts_of(slope[first]), parts_of(slope[second]), parts_of(slope[normal])


@kernel
def _weights(
    group: Rubbing, k: int, i: int, N: float, s: tuple[float, float]
) -> tuple[float, float, float]:
    """Return the derivatives of -T_i by both slips and by N."""
    c, c_s = drag(group.friction[k], group.width[k], s[0], s[1])
    own = N * c_s * s[i]
    if i == 0:
        return own * s[0] + N * c, own * s[1], c * s[i]
    return own * s[0], own * s[1] + N * c, c * s[i]


@kernel
def _combined(
    weights: tuple[float, float, float], by_normal: float, rows: tuple[Parts, Parts, Parts]
) -> Parts:
    """Return the row of a force by the rows of slips and of the normal's coordinate, by which N has
    the derivative ``by_normal``.
    """
    both, c = across(rows[0], rows[1], weights[0], weights[1]), weights[2] * by_normal
    normal = rows[2]
    return (
        axpy(c, normal[0], both[0]),
        axpy(c, normal[1], both[1]),
        axpy(c, normal[2], both[2]),
        axpy(c, normal[3], both[3]),
    )


@optional()
def add_mean_loads(
    group: Rubbing, along: AlongForces, laws: Laws, place: ScalarWorkspace, h: float
) -> None:
    """Add the friction over a step ``h`` to the loads."""
    change, load = place.coordinates.change, place.coordinates.load
    for k in range(group.normal.size):
        N, _, _ = pushes_over(group, along, laws, place, k, h)
        s = change[group.along[k, 0]] / h, change[group.along[k, 1]] / h
        _resist(group, k, N, s, load)


@optional()
def mean_jacobian(
    group: Rubbing,
    along: AlongForces,
    laws: Laws,
    coords: Coordinates,
    place: ScalarWorkspace,
    frames: Frames,
    step: tuple[float, float],
    out: np.ndarray,
) -> None:
    """Add the derivatives of ``add_mean_loads`` by the unknowns of a ``step`` (h, factor) to the
    block values ``out``.
    """
    (h, factor), q = step, place.coordinates
    for k in range(group.normal.size):
        N, by_q, by_rate = pushes_over(group, along, laws, place, k, h)
        if N == 0.0:
            continue
        slope = _rows(group, k, q.slope, along.coordinate[group.normal[k]])
        s = q.change[group.along[k, 0]] / h, q.change[group.along[k, 1]] / h
        for i in range(2):
            a = group.along[k, i]
            w = _weights(group, k, i, N, s)
            row = _combined((w[0] / h, w[1] / h, w[2]), by_q + by_rate / h, slope)
            c = factors(coords, frames, factor, a, -1.0)
            add_outer(out, coords.block, a, c, parts_of(q.force[a]), row)


@optional()
def mean_work(
    group: Rubbing,
    along: AlongForces,
    laws: Laws,
    place: ScalarWorkspace,
    h: float,
    work: np.ndarray,
) -> None:
    """Add the work of friction over the solved step ``h`` to its columns of ``work`` [J]."""
    change = place.coordinates.change
    for k in range(group.normal.size):
        N, _, _ = pushes_over(group, along, laws, place, k, h)
        d_1, d_2 = change[group.along[k, 0]], change[group.along[k, 1]]
        c, _ = drag(group.friction[k], group.width[k], d_1 / h, d_2 / h)
        work[group.column[k]] -= c * N * (d_1 * d_1 + d_2 * d_2) / h
