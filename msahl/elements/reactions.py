"""Reactions of joints from their multipliers, and loads of couplings and prescribed motions.

The reaction is the force of the parent on the child and the moment about the joint's point on the
child, in inertial axes, mean over the step. The load of a prescribed motion times the
rate of its law is its power.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import ZERO, Vector, add, at, axpy, cross, put, sub
from msahl.elements.constraints.coordinate_kinds import CoordinatesWorkspace
from msahl.elements.constraints.equations import coefficients
from msahl.elements.constraints.products import Q_B, U_B
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace, law_rate
from msahl.formulations.absolute.frames import Frames, mean, point_arm
from msahl.jit.kernel import kernel

MOST_ROUNDS, STILL = 40, 1e-14
"""Most iterations for the reactions on which friction depends, and the change, relative to the
largest reaction, at which they end."""


class Shown(NamedTuple):
    """Which numbers of joints, couplings and motions the results contain."""

    moment: np.ndarray  # (j,) whether a joint's moment is written beside its force
    load_equation: (
        np.ndarray
    )  # (e,) equations of couplings and motions, whose multiplier is written


class Reactions(NamedTuple):
    """All joints; the scalar equations of a joint stand together, in order."""

    child: np.ndarray  # (j,) body
    s: np.ndarray  # (j, 3) the joint's point on the child from its mass centre, its axes [m]
    coincide: np.ndarray  # (j,) or -1
    first_equation: np.ndarray  # (j + 1,)


@kernel
def prepare(
    group: Reactions, scalar: ScalarConstraints | None, R: np.ndarray, r: np.ndarray
) -> None:
    """Carry the arms into inertial axes (j, 3); points alone exert no moments."""
    if scalar is None:
        return
    for j in range(group.child.size):
        put(r, j, point_arm(R, group.child[j], at(group.s, j)))


@kernel
def sum_reactions(
    group: Reactions,
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: Frames,
    arms: np.ndarray,
    Z: np.ndarray,
    multipliers: np.ndarray,
    out: np.ndarray,
) -> None:
    """Set ``out`` (j, 6) from the ``multipliers`` (k, 3), by their nodes, of the step solved by
    ``Z``; ``arms`` (j, 3) are those of the joints' points at its start.
    """
    if scalar is None:
        for j in range(group.child.size):
            for i in range(3):
                out[j, i] = multipliers[group.coincide[j], i]
        return
    for j in range(group.child.size):
        force, moment = _of_equations(group, scalar, start, multipliers, j)
        arm = mean(frames, Z, group.child[j], at(arms, j))
        moment = sub(moment, cross(arm, force))
        if group.coincide[j] >= 0:
            force = add(force, at(multipliers, group.coincide[j]))
        for i in range(3):
            out[j, i] = force[i]
            out[j, 3 + i] = moment[i]


@kernel
def _of_equations(
    group: Reactions,
    scalar: ScalarConstraints,
    start: ScalarWorkspace,
    multipliers: np.ndarray,
    j: int,
) -> tuple[Vector, Vector]:
    """Return the force of joint ``j``'s scalar equations on the child, and their moment about its
    mass centre.
    """
    force, moment = ZERO, ZERO
    for r in range(group.first_equation[j], group.first_equation[j + 1]):
        lam = multipliers[scalar.equations.place[r, 0], scalar.equations.place[r, 1]]
        for side in range(2):
            q = scalar.equations.coordinate[r, side]
            if q >= 0:
                c = lam * coefficients(scalar.equations, scalar.laws, start.coordinates, r, side)[1]
                force = axpy(c, _part_force(start.coordinates, q, U_B), force)
                moment = axpy(c, _part_force(start.coordinates, q, Q_B), moment)
    return force, moment


@kernel
def _part_force(start: CoordinatesWorkspace, q: int, part: int) -> Vector:
    """Return the unit force of a coordinate on one part."""
    return (start.force[q, part, 0], start.force[q, part, 1], start.force[q, part, 2])


@kernel
def write_reactions(
    shown: Shown,
    scalar: ScalarConstraints | None,
    reaction: np.ndarray,
    force: np.ndarray,
    t: float,
    table: np.ndarray,
    row: int,
) -> None:
    """Write reactions (j, 6), then loads, and powers at time ``t``, of couplings and motions."""
    column = 0
    for j in range(shown.moment.size):
        for i in range(6 if shown.moment[j] else 3):
            table[row, column] = reaction[j, i]
            column += 1
    if scalar is None:
        return
    for e in range(shown.load_equation.size):
        r = shown.load_equation[e]
        load = force[scalar.equations.place[r, 0], scalar.equations.place[r, 1]]
        table[row, column] = load
        column += 1
        if scalar.equations.law[r] >= 0:
            table[row, column] = load * law_rate(scalar, r, t)
            column += 1


@kernel
def is_unchanged(reaction: np.ndarray, last: np.ndarray) -> bool:
    """Return whether the reactions (j, 6) are those of the ``last`` iteration to round-off."""
    change, size = 0.0, 0.0
    for j in range(reaction.shape[0]):
        for i in range(6):
            change = max(change, abs(reaction[j, i] - last[j, i]))
            size = max(size, abs(reaction[j, i]))
    return change <= STILL * size
