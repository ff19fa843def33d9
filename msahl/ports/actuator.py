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

from msahl.algebra.vector import at, put, scale
from msahl.elements.constraints.coordinates import row_factor
from msahl.elements.constraints.products import PARTS
from msahl.elements.constraints.scalar import ScalarWorkspace
from msahl.elements.signals.group import SignalsWorkspace
from msahl.formulations.absolute.frames import Frames
from msahl.jit.kernel import optional


class Actuators(NamedTuple):
    """The group of all actuators; actuator a has the result a of the signals."""

    coordinate: np.ndarray  # (a,)
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
def set_rows(
    group: Actuators,
    scalar: Any,  # ScalarConstraints
    place: ScalarWorkspace,
    frames: Frames,
    factor: float,
    a: int,
    row: np.ndarray,
) -> None:
    """Set ``row`` (4, 3) to what a unit load of actuator ``a`` adds to the equations of the four
    parts of its coordinate: ``factor`` times the unit force by mass. Nothing for other results.
    """
    if a >= group.coordinate.size:
        return
    q = group.coordinate[a]
    for part in range(PARTS):
        c = row_factor(scalar.coordinates, frames, factor, q, part)
        put(row, part, scale(c, at(place.coordinates.force[q], part)))


@optional()
def publish_power(
    group: Actuators,
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    table: np.ndarray,
    row: int,
) -> None:
    """Write the power [W] of each actuator, by the rates of the coordinates, into the last columns
    of a ``row`` of the table.
    """
    first = table.shape[1] - group.coordinate.size
    for a in range(group.coordinate.size):
        table[row, first + a] = start.result[a] * place.rate[group.coordinate[a]]


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
