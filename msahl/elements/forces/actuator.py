"""Actuator: a force or torque along a coordinate, whose value is an expression of the motion.

At one configuration

    load = u(y, s)                                      [N, or N m along an angle]
    d load/dz = sum_j du/dy_j dy_j/dz                   z: places and rates of the frames
    P = u q_dot                                         power [W]

u is an expression of signals y and auxiliary states s (``elements.signals``), q the coordinate: an
angle or displacement of a joint, or the distance of two points. The load acts with equal size and
opposite sense on the two bodies; a positive one does positive work where q increases.

Over a step of the midpoint element u is evaluated once, at the means of y and s, and its work is
u dq, exactly what the equations of the bodies contain. The Jacobian couples the bodies on which the
actuator acts with all those that its signals depend on.
"""

from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.vector import at
from msahl.elements import signals
from msahl.elements.constraints.coordinate_kinds import (
    Coordinates,
    CoordinatesWorkspace,
    Derivatives,
)
from msahl.elements.constraints.coordinates import row_factor
from msahl.elements.constraints.products import PARTS
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace
from msahl.elements.frames import Frames
from msahl.elements.signals import SignalsWorkspace
from msahl.jit.kernel import apart, optional


class Actuators(NamedTuple):
    """The group of all actuators; actuator a has the result a of the signals."""

    coordinate: np.ndarray  # (a,)
    block: np.ndarray  # (c, 4) starts of the blocks: by the results' columns, by the parts of q
    column: np.ndarray  # (a,) of the table of work


@optional()
def add_load(
    group: Actuators,
    start: SignalsWorkspace,
    place: ScalarWorkspace,
) -> None:
    """Add the actuators' loads, of a step or a configuration, to those of the coordinates."""
    for a in range(group.coordinate.size):
        q = group.coordinate[a]
        place.coordinates.load[q] += start.result[a]
        place.coordinates.size[q] += start.result_size[a]


@optional()
def mean_jacobian(
    group: Actuators,
    scalar: ScalarConstraints,
    results: Any,  # Signals
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    frames: Frames,
    dt2: float,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the mean loads over a step by the unknowns."""
    for a in range(group.coordinate.size):
        signals.set_gradient(results, start, a)
        add_rows(
            group,
            results,
            scalar.coordinates,
            place.coordinates,
            frames,
            -dt2,
            a,
            start.gradient,
            values,
        )


@optional()
def add_derivatives(
    group: Actuators,
    scalar: ScalarConstraints,
    results: Any,  # Signals
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    frames: Frames,
    out: Derivatives,
) -> None:
    """Add the derivatives of the loads by mass by the places and by the rates."""
    coords, q = scalar.coordinates, place.coordinates
    for a in range(group.coordinate.size):
        signals.set_gradient(results, start, a)
        add_rows(group, results, coords, q, frames, 1.0, a, start.gradient, out.by_place)
        add_rows(group, results, coords, q, frames, 1.0, a, start.gradient_rate, out.by_rate)


@apart
def add_rows(
    group: Actuators,
    results: Any,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    factor: float,
    a: int,
    gradient: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add ``factor`` times the unit force by mass of actuator ``a`` times the ``gradient`` of its
    load by the columns.
    """
    q, first = group.coordinate[a], results.first_column[a]
    for c in range(results.first_column[a + 1] - first):
        row = at(gradient, c)
        for part in range(PARTS):
            block = group.block[first + c, part]
            if block > 0:
                weight = row_factor(coords, frames, factor, q, part)
                for i in range(3):
                    for j in range(3):
                        values[block + 3 * i + j] += weight * start.force[q, part, i] * row[j]


@optional()
def mean_work(
    group: Actuators,
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    total: np.ndarray,
) -> None:
    """Add the work [J] of each actuator over the solved step to its column of ``total``."""
    for a in range(group.coordinate.size):
        total[group.column[a]] += start.result[a] * place.coordinates.change[group.coordinate[a]]


@optional()
def add_power(
    group: Actuators,
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    dt: float,
    total: np.ndarray,
) -> None:
    """Add ``dt`` times the power [W] of each actuator to its column of ``total`` [J]."""
    for a in range(group.coordinate.size):
        total[group.column[a]] += start.result[a] * place.rate[group.coordinate[a]] * dt
