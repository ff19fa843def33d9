"""Scalar constraints: coordinates between two frames and the constraint equations between them.

Joints other than coinciding points, couplings and prescribed motions are made of them; springs and
friction act along the same coordinates (``ports``). ``coordinates`` has the coordinates,
``equations`` one equation; here are the functions that the schemes call.

A system of coinciding points alone (``coincide``) has no scalar constraints: the group is None.
Every function here is marked ``optional``: it does nothing for None, and the kernels compiled for
such a system hold none of its code.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws, evaluate
from msahl.elements.constraints import coordinate_jacobians, coordinates, curves, segments, sums
from msahl.elements.constraints.coordinate_jacobians import add_spring, rate_gradient
from msahl.elements.constraints.coordinate_kinds import (
    RADIUS,
    Coordinates,
    CoordinatesWorkspace,
    Derivatives,
    kink_of_box,
)
from msahl.elements.constraints.coordinates import coordinate_acceleration, row_factor
from msahl.elements.constraints.equations import (
    ConstraintEquations,
    add_load,
    coefficients,
    law_change,
    law_round_off,
)
from msahl.elements.constraints.products import PARTS
from msahl.elements.constraints.segments import SEGMENTS
from msahl.elements.constraints.sums import Sums
from msahl.formulations.absolute.frames import Frames, FramesWorkspace
from msahl.formulations.absolute.multipliers import by_unknown, multiplier, place_of
from msahl.jit.kernel import kernel, optional


class ScalarConstraints(NamedTuple):
    """The coordinates, and the equations between them."""

    coordinates: Coordinates
    equations: ConstraintEquations
    laws: Laws
    equation_column: np.ndarray  # (r,) of the table of work, of each equation; -1 without a motion
    sums: Sums | None = None


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
    coordinates.evaluate(scalar.coordinates, start.coordinates, frames, Z)
    _add_loads(scalar, start, frames, dt2, Z)
    _set_equations(scalar, start, frames, violation, (t, h), F)


@kernel
def _add_loads(
    scalar: ScalarConstraints, start: ScalarWorkspace, frames: Frames, factor: float, Z: np.ndarray
) -> None:
    """Add the multipliers, in ``Z`` times ``factor`` by mass, to the coordinates' loads."""
    rows = scalar.equations
    for r in range(rows.function.size):
        lam = multiplier(rows, frames, Z, factor, r)
        add_load(rows, scalar.laws, start.coordinates, r, lam)
    sums.add_loads(scalar.sums, rows, start.coordinates, frames, factor, Z)


@kernel
def _set_equations(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    violation: np.ndarray,
    interval: tuple[float, float],
    F: np.ndarray,
) -> None:
    """Set the equations to the ``violation`` (k, 3) and its change over the ``interval`` (t, h)."""
    rows, laws, q, (t, h) = scalar.equations, scalar.laws, start.coordinates, interval
    for r in range(rows.function.size):
        total = -law_change(rows, laws, r, t, h)
        for side in range(2):
            if rows.coordinate[r, side] >= 0:
                change, _, _, _ = coefficients(rows, laws, q, r, side)
                total += change
        node, slot = place_of(rows, frames, r)
        F[node, slot] = violation[rows.place[r, 0], slot] + rows.scale[r] * total
        q.term_size[node] = max(q.term_size[node], law_round_off(rows, laws, q, r, t, h))
    sums.add_changes(scalar.sums, rows, q, frames, F)


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
    coordinates.differentiate(scalar.coordinates, start.coordinates, frames, Z)
    _add_blocks(scalar, start, frames, -dt2, values)
    _add_curves(scalar, start, frames, (-dt2, 1.0), Z, values)


@kernel
def _add_blocks(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    factor: float,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the equations by the places, and ``factor`` times those of the
    accelerations by the multipliers' unknowns, which are |factor| times the multipliers by mass.
    """
    rows, coords, q_start = scalar.equations, scalar.coordinates, start.coordinates
    for r in range(rows.function.size):
        slot = rows.place[r, 1]
        for side in range(2):
            q = rows.coordinate[r, side]
            if q < 0 or coords.idle[q]:
                continue
            _, c, slope, _ = coefficients(rows, scalar.laws, q_start, r, side)
            for part in range(PARTS):
                down, right = rows.force_block[r, side, part], rows.constraint_block[r, side, part]
                if down <= 0:
                    continue
                own = c * by_unknown(rows, factor, r)
                by_lam = own * row_factor(coords, frames, factor, q, part)
                for i in range(3):
                    values[down + 3 * i + slot] += by_lam * q_start.force[q, part, i]
                    of_equation = rows.scale[r] * slope * q_start.slope[q, part, i]
                    values[right + 3 * slot + i] += of_equation
    sums.add_blocks(scalar.sums, rows, coords, q_start, frames, factor, values)


@kernel
def _add_curves(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: Frames,
    factors: tuple[float, float],
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the loads by the functions' curvature, the first of the ``factors``
    times: ``Z`` holds as much times the multipliers by mass. The second is 1 over a step, where a
    coefficient changes by half as much as at one configuration, and 2 there.
    """
    rows, (factor, share) = scalar.equations, factors
    for r in range(rows.function.size):
        if rows.function[r] >= 0:
            lam = multiplier(rows, frames, Z, abs(factor), r)
            curve = share * coefficients(rows, scalar.laws, start.coordinates, r, 1)[3]
            q = rows.coordinate[r, 1]
            add_spring(
                scalar.coordinates, start.coordinates, frames, factor, q, lam * curve, values
            )


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
    rows, q = scalar.equations, start.coordinates
    for r in range(rows.function.size):
        if rows.law[r] >= 0:
            lam = multiplier(rows, frames, Z, dt2, r)
            work[scalar.equation_column[r]] += lam * law_change(rows, scalar.laws, r, t, h)
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
    """Set the constraint equations of the index-1 problem, minus their second derivatives at zero
    accelerations, after ``rates``, with unknowns 0: ``curves`` are then half of the second
    derivatives.
    """
    rows, laws, q_start = scalar.equations, scalar.laws, start.coordinates
    for r in range(rows.function.size):
        total = 0.0
        if rows.law[r] >= 0:
            total = -evaluate(laws, rows.law[r], t)[2]
        for side in range(2):
            q = rows.coordinate[r, side]
            if q < 0 or scalar.coordinates.idle[q]:
                continue
            second = coordinate_acceleration(scalar.coordinates, q_start, v, W, q)
            if side == 1 and rows.function[r] >= 0:
                _, slope, curve = evaluate(laws, rows.function[r], q_start.value[q])
                second = slope * second + curve * start.rate[q] ** 2
            total += rows.coefficient[r, side] * second
        node, slot = place_of(rows, frames, r)
        F[node, slot] = -rows.scale[r] * total
    sums.add_free_acceleration(scalar.sums, rows, scalar.coordinates, q_start, frames, (v, W), F)


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
    rows, coords, q_start = scalar.equations, scalar.coordinates, start.coordinates
    for r in range(rows.function.size):
        if rows.holonomic[r]:
            continue
        c, q = rows.scale[r] * rows.coefficient[r, 0], rows.coordinate[r, 0]
        half = rate_gradient(coords, q_start, frames, motion, q, out)
        for part in range(PARTS):
            right = rows.constraint_block[r, 0, part]
            if right > 0:
                for i in range(3):
                    place = right + 3 * rows.place[r, 1] + i
                    out.by_rate[place] += c * q_start.slope[q, part, i]
                    out.by_place[place] += 2.0 * c * half[part][i]


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
    coordinates.evaluate(scalar.coordinates, start.coordinates, frames, Z)
    _set_equations(scalar, start, frames, violation, interval, F)


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
    _add_loads(scalar, start, frames, 1.0, Z)
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
    _add_blocks(scalar, start, frames, 1.0, values)
    # Coefficients and unit forces change over a step by half as much as at its end.
    _add_curves(scalar, start, frames, (1.0, 2.0), Z, values)
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
    rows = scalar.equations
    for r in range(rows.function.size):
        if not rows.holonomic[r]:
            c = h * rows.scale[r] * rows.coefficient[r, 0]
            node, slot = place_of(rows, frames, r)
            F[node, slot] = c * start.rate[rows.coordinate[r, 0]]


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
    rows = scalar.equations
    for r in range(rows.function.size):
        if rows.law[r] >= 0:
            lam = multiplier(rows, frames, Z, 1.0, r)
            work[scalar.equation_column[r]] += lam * law_rate(scalar, r, t) * dt


@kernel
def law_rate(scalar: ScalarConstraints, r: int, t: float) -> float:
    """Return the rate of the law of time of an equation."""
    return evaluate(scalar.laws, scalar.equations.law[r], t)[1]


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


@optional(0.0)
def kink(scalar: ScalarConstraints, start: ScalarWorkspace, q: int) -> float:
    """Return the kink of a distance from a box or a curve, or between segments, in the prepared
    state.
    """
    own, m = scalar.coordinates, start.coordinates.products.value
    k = own.first[q]
    if own.kind[q] == SEGMENTS:
        return segments.kink(own.ends, q, m, k)
    if own.kind[q] == RADIUS:
        return kink_of_box(own, start.coordinates, q)
    return curves.kink(own.curves, q, m[k], m[k + 1])


@optional()
def observe(
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    frames: FramesWorkspace,
    t: float,
    violation: np.ndarray,
    violation_rate: np.ndarray,
) -> None:
    """Set ``violation`` [m or rad] and ``violation_rate`` (k, 3), by the equations' places. An
    equation between rates has no violation.
    """
    q = start.coordinates
    coordinates.slopes(scalar.coordinates, q)
    coordinates.rates(scalar.coordinates, q, frames.v, frames.W, start.rate)
    rows, laws = scalar.equations, scalar.laws
    for r in range(rows.function.size):
        total, total_rate = -rows.offset[r], 0.0
        if rows.law[r] >= 0:
            value, slope, _ = evaluate(laws, rows.law[r], t)
            total, total_rate = total - value, -slope
        for side in range(2):
            k = rows.coordinate[r, side]
            if k >= 0:
                value, slope = q.value[k], 1.0
                if side == 1 and rows.function[r] >= 0:
                    value, slope, _ = evaluate(laws, rows.function[r], value)
                total += rows.coefficient[r, side] * value
                total_rate += rows.coefficient[r, side] * slope * start.rate[k]
        node, slot = rows.place[r, 0], rows.place[r, 1]
        violation[node, slot] = total if rows.holonomic[r] else 0.0
        violation_rate[node, slot] = total_rate
    sums.add_violations(scalar.sums, rows, q, start.rate, violation, violation_rate)


@optional()
def in_metres(scalar: ScalarConstraints, violation: np.ndarray, violation_rate: np.ndarray) -> None:
    """Multiply violations in radians by a length of the body, so that all are in metres."""
    for r in range(scalar.equations.function.size):
        node, slot = scalar.equations.place[r, 0], scalar.equations.place[r, 1]
        violation[node, slot] *= scalar.equations.scale[r]
        violation_rate[node, slot] *= scalar.equations.scale[r]
