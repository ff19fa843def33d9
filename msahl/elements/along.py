"""All that acts along quantities: rows of joints, couplings and motions, springs, friction.

A scene of points and nothing else (``joints.coincide``) has none of it: ``along`` is then None, and
the step compiled for such scenes holds none of this code.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws
from msahl.elements.constraints import coordinates, equations
from msahl.elements.constraints.coordinates import Derivatives, Quantities, QuantityStart
from msahl.elements.constraints.equations import Rows
from msahl.elements.frames import Frames, FramesWorkspace, first_multiplier
from msahl.jit.kernel import kernel


class Along(NamedTuple):
    """The groups that share quantities, and the columns of work they enter theirs in."""

    quantities: Quantities
    rows: Rows
    laws: Laws
    row_column: np.ndarray  # (r,) -1 for a row without a law


class AlongStart(NamedTuple):
    """Quantities at the start of the step and what of them has been computed since."""

    quantities: QuantityStart
    rate: np.ndarray  # (q,) rates at the start


@kernel
def prepare(
    along: Along | None,
    x: np.ndarray,
    R: np.ndarray,
    angle: np.ndarray,
    start: AlongStart,
) -> None:
    """Evaluate the quantities of the accepted state."""
    if along is None:
        return
    coordinates.prepare(along.quantities, x, R, angle, start.quantities)


@kernel
def residual(
    along: Along | None,
    start: AlongStart,
    frames: Frames,
    violation: np.ndarray,
    t: float,
    h: float,
    dt2: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the rows of the constraint equations and begin the loads along coordinates with their
    multipliers'.
    """
    if along is None:
        return
    q = start.quantities
    coordinates.evaluate(along.quantities, q, frames, Z)
    equations.residual(along.rows, along.laws, q, frames, violation, t, h, dt2, Z, F)


@kernel
def joint_jacobian(
    along: Along | None,
    start: AlongStart,
    frames: Frames,
    dt2: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the blocks of the rows, after ``residual`` at ``Z``."""
    if along is None:
        return
    q = start.quantities
    coordinates.differentiate(along.quantities, q, frames, Z)
    equations.jacobian(along.rows, along.laws, along.quantities, q, frames, dt2, Z, values)


@kernel
def accept(
    along: Along | None,
    start: AlongStart,
    frames: Frames,
    t: float,
    h: float,
    dt2: float,
    Z: np.ndarray,
    angle: np.ndarray,
    work: np.ndarray,
) -> None:
    """Count the angles on and add the work of the prescribed motions."""
    if along is None:
        return
    q = start.quantities
    equations.work(along.rows, along.laws, frames, t, h, dt2, Z, along.row_column, work)
    for k in range(angle.size):
        angle[k] = q.value[k] + q.change[k]


@kernel
def count_turns(along: Along | None, start: AlongStart, angle: np.ndarray) -> None:
    """Bring the counted angles (q,) to those of the prepared state, less than half a turn away."""
    if along is None:
        return
    coordinates.count_turns(along.quantities, start.quantities, angle)


@kernel
def relief(along: Along | None, start: AlongStart, node: int, step: float) -> float:
    """By how much a row of ``node`` may be worse than one of the size ``step`` [m], as a factor:
    loads along quantities, such as stiff springs, may be larger, and no row is known better than
    its largest part. After ``residual``.
    """
    if along is None:
        return 1.0
    return step / max(step, start.quantities.pull[node])


@kernel
def follow(
    along: Along | None, reaction: np.ndarray, trend: np.ndarray, old: float, new: float
) -> None:
    """Set the reactions' ``trend`` (j, 6) to ``old`` times itself and ``new`` times them."""
    if along is None:
        return
    for j in range(reaction.shape[0]):
        for i in range(6):
            trend[j, i] = old * trend[j, i] + new * reaction[j, i]


@kernel
def free_acceleration(
    along: Along | None,
    start: AlongStart,
    frames: Frames,
    v: np.ndarray,
    W: np.ndarray,
    t: float,
    F: np.ndarray,
) -> None:
    """Set the rows of the constraint equations in the acceleration problem, after ``rates``."""
    if along is None:
        return
    equations.free_acceleration(
        along.rows, along.laws, along.quantities, start.quantities, frames, start.rate, v, W, t, F
    )


@kernel
def rates(
    along: Along | None,
    start: AlongStart,
    frames: Frames,
    motion: FramesWorkspace,
    still: np.ndarray,
) -> None:
    """Evaluate the coordinates and their rates at one configuration; ``still`` is a step without
    motion.
    """
    if along is None:
        return
    coordinates.evaluate(along.quantities, start.quantities, frames, still)
    coordinates.rates(along.quantities, start.quantities, motion.v, motion.W, start.rate)


@kernel
def differentiate(
    along: Along | None, start: AlongStart, frames: Frames, still: np.ndarray
) -> None:
    """Fill the derivatives of the coordinates at one configuration, after ``rates``."""
    if along is None:
        return
    coordinates.differentiate(along.quantities, start.quantities, frames, still)


@kernel
def roll_jacobian(
    along: Along | None,
    start: AlongStart,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Add the derivatives of ``roll`` over h, after ``differentiate``."""
    if along is None:
        return
    equations.roll_jacobian(along.rows, along.quantities, start.quantities, frames, motion, out)


@kernel
def close(
    along: Along | None,
    start: AlongStart,
    frames: Frames,
    violation: np.ndarray,
    interval: tuple[float, float],
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the rows of the constraint equations to the ``violation`` (k, 3) and its change by the
    displacements ``Z`` over the ``interval`` (t, h).
    """
    if along is None:
        return
    q = start.quantities
    coordinates.evaluate(along.quantities, q, frames, Z)
    equations.set_violation(along.rows, along.laws, q, frames, violation, interval, F)


@kernel
def add_joint_forces(
    along: Along | None, start: AlongStart, frames: Frames, Z: np.ndarray, F: np.ndarray
) -> None:
    """Add the forces of the constraint equations by mass at one configuration to the rows of the
    frames; ``Z`` holds the multipliers by mass, and displacements that are zero.
    """
    if along is None:
        return
    q = start.quantities
    coordinates.evaluate(along.quantities, q, frames, Z)
    equations.add_loads(along.rows, along.laws, q, frames, Z)
    coordinates.push(along.quantities, q, frames, 1.0, F)


@kernel
def add_joint_derivatives(
    along: Along | None, start: AlongStart, frames: Frames, Z: np.ndarray, values: np.ndarray
) -> None:
    """Add the derivatives of ``add_joint_forces``, after it at the same ``Z``, and those of the
    rows.
    """
    if along is None:
        return
    q, quantities = start.quantities, along.quantities
    coordinates.differentiate(quantities, q, frames, Z)
    equations.add_derivatives(along.rows, along.laws, quantities, q, frames, Z, values)
    # The unit forces' mean over a step changes by half as much as the forces themselves.
    coordinates.stiffness(quantities, q, frames, 2.0, Z, values)


@kernel
def strain(along: Along | None, start: AlongStart, c: float, pull: np.ndarray) -> None:
    """Raise ``pull`` (nodes,) to ``c`` times the largest parts of the loads last pushed."""
    if along is None:
        return
    for node in range(pull.size):
        pull[node] = max(pull[node], c * start.quantities.pull[node])


@kernel
def roll(along: Along | None, start: AlongStart, frames: Frames, h: float, F: np.ndarray) -> None:
    """Set the rows that are of rates alone to ``h`` times them, after ``rates``."""
    if along is None:
        return
    equations.roll(along.rows, start.rate, first_multiplier(frames), h, F)


@kernel
def settle(along: Along | None, violation: np.ndarray) -> None:
    """Take from the ``gap`` (k, 3) left by a step what is of rows between rates: they have none."""
    if along is None:
        return
    for r in range(along.rows.function.size):
        if not along.rows.holonomic[r]:
            violation[along.rows.place[r, 0], along.rows.place[r, 1]] = 0.0


@kernel
def motion_work(
    along: Along | None, frames: Frames, t: float, dt: float, Z: np.ndarray, work: np.ndarray
) -> None:
    """Add the work [J] of the drives over a time ``dt`` at the rates of ``t``; the multipliers in
    ``Z`` are by mass.
    """
    if along is None:
        return
    equations.motion_work(along.rows, along.laws, frames, t, dt, Z, along.row_column, work)


@kernel
def values(
    along: Along | None,
    start: AlongStart,
    frames: FramesWorkspace,
    value: np.ndarray,
    rate: np.ndarray,
) -> None:
    """Set ``value`` and ``rate`` (q,) to those of the quantities in the prepared state."""
    if along is None:
        return
    q = start.quantities
    coordinates.slopes(along.quantities, q)
    coordinates.rates(along.quantities, q, frames.v, frames.W, rate)
    for k in range(value.size):
        value[k] = q.value[k]


@kernel
def observe(
    along: Along | None,
    start: AlongStart,
    frames: FramesWorkspace,
    t: float,
    violation: np.ndarray,
    violation_rate: np.ndarray,
) -> None:
    """Fill in gaps and rates of the rows."""
    if along is None:
        return
    q = start.quantities
    coordinates.slopes(along.quantities, q)
    coordinates.rates(along.quantities, q, frames.v, frames.W, start.rate)
    equations.observe(along.rows, along.laws, q, start.rate, t, violation, violation_rate)


@kernel
def in_metres(along: Along | None, violation: np.ndarray, violation_rate: np.ndarray) -> None:
    """Multiply the gaps of rows in radians by their length, so that they compare with others."""
    if along is None:
        return
    for r in range(along.rows.function.size):
        node, slot = along.rows.place[r, 0], along.rows.place[r, 1]
        violation[node, slot] *= along.rows.scale[r]
        violation_rate[node, slot] *= along.rows.scale[r]
