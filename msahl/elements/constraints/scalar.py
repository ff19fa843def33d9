"""All that acts along quantities: rows of joints, couplings and motions, springs, friction.

A scene of points and nothing else (``joints.coincide``) has none of it: ``along`` is then None, and
the step compiled for such scenes holds none of this code.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws
from msahl.elements.constraints import coordinates, equations
from msahl.elements.constraints.coordinates import Coordinates, CoordinatesWorkspace
from msahl.elements.constraints.equations import ConstraintEquations
from msahl.elements.frames import Frames, FramesWorkspace, first_multiplier
from msahl.jit.kernel import kernel


class ScalarConstraints(NamedTuple):
    """The groups that share quantities, and the columns of work they enter theirs in."""

    coordinates: Coordinates
    equations: ConstraintEquations
    laws: Laws
    equation_column: np.ndarray  # (r,) -1 for a row without a law


class ScalarWorkspace(NamedTuple):
    """Quantities at the start of the step and what of them has been computed since."""

    coordinates: CoordinatesWorkspace
    rate: np.ndarray  # (q,) rates at the start


@kernel
def prepare(
    scalar: ScalarConstraints | None,
    x: np.ndarray,
    R: np.ndarray,
    angle: np.ndarray,
    start: ScalarWorkspace,
) -> None:
    """Evaluate the quantities of the accepted state."""
    if scalar is None:
        return
    coordinates.prepare(scalar.coordinates, x, R, angle, start.coordinates)


@kernel
def residual(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
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
    if scalar is None:
        return
    q = start.coordinates
    coordinates.evaluate(scalar.coordinates, q, frames, Z)
    equations.residual(scalar.equations, scalar.laws, q, frames, violation, t, h, dt2, Z, F)


@kernel
def joint_jacobian(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: Frames,
    dt2: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the blocks of the rows, after ``residual`` at ``Z``."""
    if scalar is None:
        return
    q = start.coordinates
    coordinates.differentiate(scalar.coordinates, q, frames, Z)
    equations.jacobian(scalar.equations, scalar.laws, scalar.coordinates, q, frames, dt2, Z, values)


@kernel
def accept(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: Frames,
    t: float,
    h: float,
    dt2: float,
    Z: np.ndarray,
    angle: np.ndarray,
    work: np.ndarray,
) -> None:
    """Count the angles on and add the work of the prescribed motions."""
    if scalar is None:
        return
    q = start.coordinates
    equations.work(
        scalar.equations, scalar.laws, frames, t, h, dt2, Z, scalar.equation_column, work
    )
    for k in range(angle.size):
        angle[k] = q.value[k] + q.change[k]


@kernel
def count_rotations(
    scalar: ScalarConstraints | None, start: ScalarWorkspace, angle: np.ndarray
) -> None:
    """Bring the counted angles (q,) to those of the prepared state, less than half a turn away."""
    if scalar is None:
        return
    coordinates.count_rotations(scalar.coordinates, start.coordinates, angle)


@kernel
def tolerance_factor(
    scalar: ScalarConstraints | None, start: ScalarWorkspace, node: int, step: float
) -> float:
    """By how much a row of ``node`` may be worse than one of the size ``step`` [m], as a factor:
    loads along quantities, such as stiff springs, may be larger, and no row is known better than
    its largest part. After ``residual``.
    """
    if scalar is None:
        return 1.0
    return step / max(step, start.coordinates.term_size[node])


@kernel
def update_reaction_trend(
    scalar: ScalarConstraints | None,
    reaction: np.ndarray,
    trend: np.ndarray,
    old: float,
    new: float,
) -> None:
    """Set the reactions' ``trend`` (j, 6) to ``old`` times itself and ``new`` times them."""
    if scalar is None:
        return
    for j in range(reaction.shape[0]):
        for i in range(6):
            trend[j, i] = old * trend[j, i] + new * reaction[j, i]


@kernel
def free_acceleration(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: Frames,
    v: np.ndarray,
    W: np.ndarray,
    t: float,
    F: np.ndarray,
) -> None:
    """Set the rows of the constraint equations in the acceleration problem, after ``rates``."""
    if scalar is None:
        return
    equations.free_acceleration(
        scalar.equations,
        scalar.laws,
        scalar.coordinates,
        start.coordinates,
        frames,
        start.rate,
        v,
        W,
        t,
        F,
    )


@kernel
def rates(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: Frames,
    v: np.ndarray,
    W: np.ndarray,
    Z: np.ndarray,
) -> None:
    """Evaluate the coordinates and their rates at one configuration; ``Z`` is zero."""
    if scalar is None:
        return
    coordinates.evaluate(scalar.coordinates, start.coordinates, frames, Z)
    coordinates.rates(scalar.coordinates, start.coordinates, v, W, start.rate)


@kernel
def differentiate(
    scalar: ScalarConstraints | None, start: ScalarWorkspace, frames: Frames, Z: np.ndarray
) -> None:
    """Fill the derivatives of the coordinates, after ``rates``; ``Z`` is zero."""
    if scalar is None:
        return
    coordinates.differentiate(scalar.coordinates, start.coordinates, frames, Z)


@kernel
def add_rate_derivatives(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: Frames,
    v: np.ndarray,
    W: np.ndarray,
    Z: np.ndarray,
    room: np.ndarray,
    by_place: np.ndarray,
    by_rate: np.ndarray,
) -> None:
    """Add the derivatives of ``roll`` over h, after ``differentiate``; ``Z`` is zero."""
    if scalar is None:
        return
    equations.add_rate_derivatives(
        scalar.equations,
        scalar.coordinates,
        start.coordinates,
        frames,
        v,
        W,
        Z,
        room,
        by_place,
        by_rate,
    )


@kernel
def add_constraint_forces(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: Frames,
    violation: np.ndarray,
    t: float,
    h: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """As ``residual`` of the rows alone, with a reach of -1: their forces are added, by mass."""
    if scalar is None:
        return
    q = start.coordinates
    coordinates.evaluate(scalar.coordinates, q, frames, Z)
    equations.residual(scalar.equations, scalar.laws, q, frames, violation, t, h, -1.0, Z, F)
    coordinates.push(scalar.coordinates, q, frames, 1.0, F)


@kernel
def add_constraint_derivatives(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: Frames,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivative of ``hold``, after it at the same ``Z``."""
    if scalar is None:
        return
    joint_jacobian(scalar, start, frames, -1.0, Z, values)
    coordinates.stiffness(scalar.coordinates, start.coordinates, frames, 1.0, Z, values)


@kernel
def raise_term_sizes(
    scalar: ScalarConstraints | None, start: ScalarWorkspace, c: float, term_size: np.ndarray
) -> None:
    """Raise ``pull`` (nodes,) to ``c`` times the largest parts of the loads last pushed."""
    if scalar is None:
        return
    for node in range(term_size.size):
        term_size[node] = max(term_size[node], c * start.coordinates.term_size[node])


@kernel
def set_rate_equations(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: Frames,
    h: float,
    F: np.ndarray,
) -> None:
    """Set the rows that are of rates alone to ``h`` times them, after ``rates``."""
    if scalar is None:
        return
    equations.set_rate_equations(scalar.equations, start.rate, first_multiplier(frames), h, F)


@kernel
def clear_rate_violations(scalar: ScalarConstraints | None, violation: np.ndarray) -> None:
    """Take from the ``gap`` (k, 3) left by a step what is of rows between rates: they have none."""
    if scalar is None:
        return
    for r in range(scalar.equations.function.size):
        if not scalar.equations.holonomic[r]:
            violation[scalar.equations.place[r, 0], scalar.equations.place[r, 1]] = 0.0


@kernel
def motion_work(
    scalar: ScalarConstraints | None,
    frames: Frames,
    t: float,
    dt: float,
    Z: np.ndarray,
    work: np.ndarray,
) -> None:
    """Add the work [J] of the drives over a time ``dt`` at the rates of ``t``; the multipliers in
    ``Z`` are by mass.
    """
    if scalar is None:
        return
    equations.motion_work(
        scalar.equations, scalar.laws, frames, t, dt, Z, scalar.equation_column, work
    )


@kernel
def values(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: FramesWorkspace,
    value: np.ndarray,
    rate: np.ndarray,
) -> None:
    """Set ``value`` and ``rate`` (q,) to those of the quantities in the prepared state."""
    if scalar is None:
        return
    q = start.coordinates
    coordinates.slopes(scalar.coordinates, q)
    coordinates.rates(scalar.coordinates, q, frames.v, frames.W, rate)
    for k in range(value.size):
        value[k] = q.value[k]


@kernel
def observe(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: FramesWorkspace,
    t: float,
    violation: np.ndarray,
    violation_rate: np.ndarray,
) -> None:
    """Fill in gaps and rates of the rows."""
    if scalar is None:
        return
    q = start.coordinates
    coordinates.slopes(scalar.coordinates, q)
    coordinates.rates(scalar.coordinates, q, frames.v, frames.W, start.rate)
    equations.observe(scalar.equations, scalar.laws, q, start.rate, t, violation, violation_rate)


@kernel
def in_metres(
    scalar: ScalarConstraints | None, violation: np.ndarray, violation_rate: np.ndarray
) -> None:
    """Multiply the gaps of rows in radians by their length, so that they compare with others."""
    if scalar is None:
        return
    for r in range(scalar.equations.function.size):
        node, slot = scalar.equations.place[r, 0], scalar.equations.place[r, 1]
        violation[node, slot] *= scalar.equations.scale[r]
        violation_rate[node, slot] *= scalar.equations.scale[r]
