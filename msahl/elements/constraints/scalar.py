"""Scalar constraints: coordinates between two frames and the constraint equations between them.

Joints other than coinciding points, couplings and prescribed motions are made of them; springs and
friction act along the same coordinates (``ports``). ``coordinates`` has the coordinates,
``equations`` the equations; here are the functions that the schemes call.

A system of coinciding points alone (``coincide``) has no scalar constraints: the group is None.
Every function here is marked ``optional``: it does nothing for None, and the kernels compiled for
such a system hold none of its code.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws
from msahl.elements.constraints import coordinate_jacobians, coordinates, equations
from msahl.elements.constraints.coordinate_kinds import (
    Coordinates,
    CoordinatesWorkspace,
    Derivatives,
)
from msahl.elements.constraints.equations import ConstraintEquations
from msahl.formulations.absolute.frames import Frames, FramesWorkspace, first_multiplier
from msahl.jit.kernel import optional


class ScalarConstraints(NamedTuple):
    """The coordinates, and the equations between them."""

    coordinates: Coordinates
    equations: ConstraintEquations
    laws: Laws
    equation_column: np.ndarray  # (r,) of the table of work, of each equation; -1 without a motion


class ScalarWorkspace(NamedTuple):
    """Values of the coordinates at the start of the step, and what is computed of them."""

    coordinates: CoordinatesWorkspace
    rate: np.ndarray  # (q,) rates at the start


@optional()
def prepare(
    scalar: ScalarConstraints,
    x: np.ndarray,
    R: np.ndarray,
    angle: np.ndarray,
    start: ScalarWorkspace,
) -> None:
    """Evaluate the coordinates in a configuration; ``angle`` (q,) are the angles counted so far."""
    coordinates.prepare(scalar.coordinates, x, R, angle, start.coordinates)


@optional()
def residual(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    violation: np.ndarray,
    t: float,
    h: float,
    dt2: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the constraint equations of a step at ``Z``, and the loads along coordinates to those of
    the multipliers.
    """
    q = start.coordinates
    coordinates.evaluate(scalar.coordinates, q, frames, Z)
    equations.residual(scalar.equations, scalar.laws, q, frames, violation, t, h, dt2, Z, F)


@optional()
def joint_jacobian(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    dt2: float,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the constraint equations and of the multipliers' forces, after
    ``residual`` at ``Z``.
    """
    q = start.coordinates
    coordinates.differentiate(scalar.coordinates, q, frames, Z)
    equations.jacobian(scalar.equations, scalar.laws, scalar.coordinates, q, frames, dt2, Z, values)


@optional()
def accept(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    t: float,
    h: float,
    dt2: float,
    Z: np.ndarray,
    angle: np.ndarray,
    work: np.ndarray,
) -> None:
    """Add the changes over the solved step to the counted ``angle`` (q,), the work of prescribed
    motions [J] to its columns of ``work``.
    """
    q = start.coordinates
    equations.work(
        scalar.equations, scalar.laws, frames, t, h, dt2, Z, scalar.equation_column, work
    )
    for k in range(angle.size):
        angle[k] = q.value[k] + q.change[k]


@optional()
def count_rotations(scalar: ScalarConstraints, start: ScalarWorkspace, angle: np.ndarray) -> None:
    """Set the counted angles (q,) to those of the configuration, half a revolution away at most."""
    coordinates.count_rotations(scalar.coordinates, start.coordinates, angle)


@optional(1.0)
def tolerance_factor(
    scalar: ScalarConstraints, start: ScalarWorkspace, node: int, step: float
) -> float:
    """Return ``step`` over the largest term in the equations of ``node``, at most 1, after
    ``residual``; both are lengths [m].

    An equation is known no better than the round-off of its largest term. The force of a stiff
    spring can be much larger than the motion in a step, by which residuals are judged otherwise.
    """
    size = start.coordinates.term_size[node]
    return 1.0 if size <= step else step / max(step, size)


@optional()
def update_reaction_trend(
    scalar: ScalarConstraints,
    reaction: np.ndarray,
    trend: np.ndarray,
    old: float,
    new: float,
) -> None:
    """Set ``trend`` (j, 6) to ``old`` times itself plus ``new`` times ``reaction`` (j, 6)."""
    for j in range(reaction.shape[0]):
        for i in range(6):
            trend[j, i] = old * trend[j, i] + new * reaction[j, i]


@optional()
def free_acceleration(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    v: np.ndarray,
    W: np.ndarray,
    t: float,
    F: np.ndarray,
) -> None:
    """Set the constraint equations of the index-1 problem, after ``rates``."""
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


@optional()
def rates(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    still: np.ndarray,
) -> None:
    """Evaluate the coordinates and their rates at one configuration; ``still`` is a step without
    motion.
    """
    coordinates.evaluate(scalar.coordinates, start.coordinates, frames, still)
    coordinates.rates(scalar.coordinates, start.coordinates, motion.v, motion.W, start.rate)


@optional()
def differentiate(
    scalar: ScalarConstraints, start: ScalarWorkspace, frames: Frames, still: np.ndarray
) -> None:
    """Set the derivatives of the coordinates at one configuration, after ``rates``."""
    coordinates.differentiate(scalar.coordinates, start.coordinates, frames, still)


@optional()
def add_rate_derivatives(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Add the derivatives of ``set_rate_equations`` over h, after ``differentiate``."""
    equations.add_rate_derivatives(
        scalar.equations, scalar.coordinates, start.coordinates, frames, motion, out
    )


@optional()
def set_violations(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    violation: np.ndarray,
    interval: tuple[float, float],
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the constraint equations to the ``violation`` (k, 3) and its change by the
    displacements ``Z`` over the ``interval`` (t, h).
    """
    q = start.coordinates
    coordinates.evaluate(scalar.coordinates, q, frames, Z)
    equations.set_violation(scalar.equations, scalar.laws, q, frames, violation, interval, F)


@optional()
def add_constraint_forces(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Add the forces of the constraint equations by mass at one configuration to the frames'
    equations; ``Z`` holds the multipliers by mass, and displacements that are zero.
    """
    q = start.coordinates
    coordinates.evaluate(scalar.coordinates, q, frames, Z)
    equations.add_loads(scalar.equations, scalar.laws, q, frames, Z)
    coordinates.push(scalar.coordinates, q, frames, 1.0, F)


@optional()
def add_constraint_derivatives(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of ``add_constraint_forces``, after it at the same ``Z``, and those of
    the constraint equations.
    """
    q, coords = start.coordinates, scalar.coordinates
    coordinates.differentiate(coords, q, frames, Z)
    equations.add_derivatives(scalar.equations, scalar.laws, coords, q, frames, Z, values)
    # The unit forces' mean over a step changes by half as much as the forces themselves.
    coordinate_jacobians.stiffness(coords, q, frames, 2.0, Z, values)


@optional()
def raise_term_sizes(
    scalar: ScalarConstraints, start: ScalarWorkspace, c: float, term_size: np.ndarray
) -> None:
    """Raise ``term_size`` (nodes,) to ``c`` times the largest terms of the last evaluation."""
    for node in range(term_size.size):
        term_size[node] = max(term_size[node], c * start.coordinates.term_size[node])


@optional()
def set_rate_equations(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    h: float,
    F: np.ndarray,
) -> None:
    """Set the equations between rates to ``h`` times these, after ``rates``."""
    equations.set_rate_equations(scalar.equations, start.rate, first_multiplier(frames), h, F)


@optional()
def clear_rate_violations(scalar: ScalarConstraints, violation: np.ndarray) -> None:
    """Set the ``violation`` (k, 3) of equations between rates to 0: they constrain no position."""
    for r in range(scalar.equations.function.size):
        if not scalar.equations.holonomic[r]:
            violation[scalar.equations.place[r, 0], scalar.equations.place[r, 1]] = 0.0


@optional()
def motion_work(
    scalar: ScalarConstraints,
    frames: Frames,
    t: float,
    dt: float,
    Z: np.ndarray,
    work: np.ndarray,
) -> None:
    """Add the work [J] of prescribed motions over a time ``dt`` at their rates at ``t``; ``Z``
    holds the multipliers by mass.
    """
    equations.motion_work(
        scalar.equations, scalar.laws, frames, t, dt, Z, scalar.equation_column, work
    )


@optional()
def values(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: FramesWorkspace,
    value: np.ndarray,
    rate: np.ndarray,
) -> None:
    """Set ``value`` and ``rate`` (q,) to those of the coordinates in the prepared state."""
    q = start.coordinates
    coordinates.slopes(scalar.coordinates, q)
    coordinates.rates(scalar.coordinates, q, frames.v, frames.W, rate)
    for k in range(value.size):
        value[k] = q.value[k]


@optional()
def observe(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: FramesWorkspace,
    t: float,
    violation: np.ndarray,
    violation_rate: np.ndarray,
) -> None:
    """Set violations and their rates of the constraint equations."""
    q = start.coordinates
    coordinates.slopes(scalar.coordinates, q)
    coordinates.rates(scalar.coordinates, q, frames.v, frames.W, start.rate)
    equations.observe(scalar.equations, scalar.laws, q, start.rate, t, violation, violation_rate)


@optional()
def in_metres(scalar: ScalarConstraints, violation: np.ndarray, violation_rate: np.ndarray) -> None:
    """Multiply violations in radians by a length of the body, so that all are in metres."""
    for r in range(scalar.equations.function.size):
        node, slot = scalar.equations.place[r, 0], scalar.equations.place[r, 1]
        violation[node, slot] *= scalar.equations.scale[r]
        violation_rate[node, slot] *= scalar.equations.scale[r]
