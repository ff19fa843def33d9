"""Friction of contacts that slide: Coulomb's law by the normal force of the same instant.

    F = -mu N d         on the child, the opposite on the parent, at the point of contact   [N]
    d = s/|s|           direction of the slip s = (rates of two tangential coordinates)     [-]
    mu, N               coefficient of friction; multiplier of the gap                      [-, N]
                        both are negative where the gap is the limit less the coordinate

Forces that depend on N change the matrix of the index-1 problem: the multiplier of a gap pushes
along n - mu d and not along n. So N is that of the accelerations, without an iteration. A
collocation step takes it at its nodes c_i; a step of the midpoint element has its own multiplier
and the mean slip over the step, so that the work is -mu N |change| exactly.

A step may pass through the end of the slip, which is an event at which it is taken again. For such
a trial

    d = (|s . d0| d0 + s - (s . d0) d0)/|s|         d0 the direction at the start of the step

goes on along the same line, where s/|s| jumps. Where |s| is too small to have one, d is d0: for s
above stands s + d0 e^3/(s . s + e^2), with e 1e-10 of the largest speed. A direction that jumped
from d0 to s/|s| would be none for slips that begin, which pass e within a step.

A slip that begins is that small at first, and its direction is known from the solution only. Then

    d = s/sqrt(s . s + w^2)

with a ``width`` w is solved first. While w is much larger than |s| this friction is viscous, which
any start leads to; the slip is along the forces that the friction does not hold. From there w is
made smaller and smaller, to 1e-12 of the largest speed so far: the solution's direction hardly
changes on this path. Friction is less than mu N by (w/|s|)^2/2 of it then, which is round-off but
for the very beginning of a slip.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import Vector, at, axpy, scale
from msahl.elements.constraints import surfaces
from msahl.elements.constraints.coordinate_jacobians import add_outer, rate_gradient
from msahl.elements.constraints.coordinate_kinds import Coordinates, Derivatives
from msahl.elements.constraints.coordinates import row_factor
from msahl.elements.constraints.products import PARTS, Q_A, Q_B, U_A, U_B
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace, values
from msahl.formulations.absolute.frames import Frames, FramesWorkspace
from msahl.formulations.absolute.multipliers import by_unknown, multiplier
from msahl.jit.kernel import kernel, optional

WIDEST, NARROWER, WIDTHS = 1e10, 0.25, 21
"""The largest width over the slip that is too small to have a direction, which is the largest speed
so far; the ratio of a width to the one before; and how many there are, to 1e-12 of that."""
ROTATED = 0.99
"""Cosine of the rotation of a slip's direction from step to step that counts as none."""


class Sliding(NamedTuple):
    """The contacts with friction; ``toward``, ``friction``, ``still`` and ``width`` change during a
    run."""

    row: np.ndarray  # (k,) equation of the gap
    tangent: np.ndarray  # (k, 2) equations between the slips, of contacts that stick
    along: np.ndarray  # (k, 2) coordinates whose rates are the slip
    reaction: np.ndarray  # (k,) row of its forces N, T_1, T_2 behind the joints' reactions
    friction: np.ndarray  # (k,) mu while it slides, else 0; times the sign of N
    grip: np.ndarray  # (k,) coefficient of static friction, times the sign of N
    toward: np.ndarray  # (k, 2) d0
    still: np.ndarray  # (k,) slip that is too small to have a direction [m/s]
    width: np.ndarray  # (1,) w, 0 but on the way to a solution [m/s]
    column: np.ndarray  # (k,) of the table of work


@kernel
def direction(group: Sliding, k: int, s_1: float, s_2: float) -> tuple[float, float, float]:
    """Return d of contact ``k`` at the slip ``s``, and what s is divided by; 0 where it has no
    direction.
    """
    if group.width[0] > 0.0:
        speed = math.sqrt(s_1 * s_1 + s_2 * s_2 + group.width[0] * group.width[0])
        return s_1 / speed, s_2 / speed, speed
    t_1, t_2, still = group.toward[k, 0], group.toward[k, 1], group.still[k]
    along, square = s_1 * t_1 + s_2 * t_2, s_1 * s_1 + s_2 * s_2 + still * still
    if square == 0.0:
        return t_1, t_2, 0.0
    if along < 0.0:
        s_1, s_2 = s_1 - 2.0 * along * t_1, s_2 - 2.0 * along * t_2
    part = still * still * still / square
    s_1, s_2 = s_1 + part * t_1, s_2 + part * t_2
    speed = math.sqrt(s_1 * s_1 + s_2 * s_2)
    return s_1 / speed, s_2 / speed, speed


@kernel
def direction_slope(
    group: Sliding, k: int, d: tuple[float, float], s: tuple[float, float], i: int
) -> tuple[float, float]:
    """Return the derivative of component ``i`` of the direction ``d`` by s, times what s is divided
    by.
    """
    if group.width[0] > 0.0:
        return (1.0 if i == 0 else 0.0) - d[i] * d[0], (0.0 if i == 0 else 1.0) - d[i] * d[1]
    t_1, t_2, still = group.toward[k, 0], group.toward[k, 1], group.still[k]
    along, square = s[0] * t_1 + s[1] * t_2, s[0] * s[0] + s[1] * s[1] + still * still
    row_1, row_2 = -d[1], d[0]
    if along < 0.0:
        across = row_1 * t_1 + row_2 * t_2
        row_1, row_2 = row_1 - 2.0 * across * t_1, row_2 - 2.0 * across * t_2
    part = 2.0 * still * still * still * (d[0] * t_2 - d[1] * t_1) / (square * square)
    row_1, row_2 = row_1 - part * s[0], row_2 - part * s[1]
    across_d = -d[1] if i == 0 else d[0]
    return across_d * row_1, across_d * row_2


@optional(False)
def any_slides(group: Sliding) -> bool:
    """Whether a contact slides."""
    found = False
    for k in range(group.row.size):
        found = found or group.friction[k] != 0.0
    return found


@optional(0.0)
def widest(group: Sliding) -> float:
    """Return the width from which to solve a step with friction [m/s]; 0 where nothing slides."""
    found = 0.0
    for k in range(group.row.size):
        if group.friction[k] != 0.0:
            found = max(found, WIDEST * group.still[k])
    return found


@optional()
def set_width(group: Sliding, width: float) -> None:
    """Let friction be viscous for slips below a ``width`` [m/s]."""
    group.width[:] = width


@kernel
def slip_of(group: Sliding, k: int, rate: np.ndarray) -> tuple[float, float]:
    """Return the slip of contact ``k`` from the coordinates' rates (q,)."""
    return rate[group.along[k, 0]], rate[group.along[k, 1]]


@optional()
def update_directions(
    group: Sliding,
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    motion: FramesWorkspace,
    value: np.ndarray,
    rate: np.ndarray,
    known: np.ndarray,
) -> None:
    """Set ``toward`` to the directions at the start of a step; ``value`` and ``rate`` (q,) receive
    the coordinates. Where one has rotated, ``known`` (1,) becomes nan.
    """
    assert scalar is not None
    m = scalar.coordinates.products
    if surfaces.choose_axes(m.surfaces, m, start.coordinates.products):
        known[0] = math.nan
    values(scalar, start, motion, value, rate)
    for k in range(group.row.size):
        s_1, s_2 = slip_of(group, k, rate)
        speed = math.sqrt(s_1 * s_1 + s_2 * s_2)
        if group.friction[k] == 0.0 or speed <= group.still[k]:
            continue
        s_1, s_2 = s_1 / speed, s_2 / speed
        if s_1 * group.toward[k, 0] + s_2 * group.toward[k, 1] < ROTATED:
            known[0] = math.nan
        group.toward[k, 0], group.toward[k, 1] = s_1, s_2


@optional(0.0)
def margin(
    group: Sliding,
    scalar: ScalarConstraints | None,
    k: int,
    rate: np.ndarray,
    force: np.ndarray,
    unit: np.ndarray,
) -> float:
    """Return what is left until contact ``k`` changes: of one that slides the slip along d0, of one
    that sticks the grip that is left, mu_s N - |T|; ``force`` (n, 3) are multipliers over their
    ``unit``.
    """
    assert scalar is not None
    if group.friction[k] != 0.0:
        s_1, s_2 = slip_of(group, k, rate)
        return s_1 * group.toward[k, 0] + s_2 * group.toward[k, 1]
    N = load_of(scalar, group.row[k], force, unit)
    T_1 = load_of(scalar, group.tangent[k, 0], force, unit)
    T_2 = load_of(scalar, group.tangent[k, 1], force, unit)
    return group.grip[k] * N - math.sqrt(T_1 * T_1 + T_2 * T_2)


@kernel
def load_of(scalar: ScalarConstraints, r: int, force: np.ndarray, unit: np.ndarray) -> float:
    """Return the multiplier of equation ``r``."""
    node, slot = scalar.equations.place[r, 0], scalar.equations.place[r, 1]
    return force[node, slot] * unit[node, slot]


@optional()
def set_forces(
    group: Sliding, scalar: ScalarConstraints | None, force: np.ndarray, reaction: np.ndarray
) -> None:
    """Set the contacts' rows of ``reaction`` (j + k, 6) from the multipliers (n, 3)."""
    assert scalar is not None
    place = scalar.equations.place
    for k in range(group.row.size):
        row = reaction[group.reaction[k]]
        row[0] = force[place[group.row[k], 0], place[group.row[k], 1]]
        for i in range(2):
            r = group.tangent[k, i]
            row[1 + i] = force[place[r, 0], place[r, 1]]


@optional()
def add_loads(group: Sliding, place: ScalarWorkspace, reaction: np.ndarray) -> None:
    """Add the friction by the normal forces in ``reaction`` to the coordinates' loads, after
    ``scalar.rates``.
    """
    for k in range(group.row.size):
        if group.friction[k] != 0.0:
            d_1, d_2, _ = direction(group, k, *slip_of(group, k, place.rate))
            limit = group.friction[k] * reaction[group.reaction[k], 0]
            place.coordinates.load[group.along[k, 0]] -= limit * d_1
            place.coordinates.load[group.along[k, 1]] -= limit * d_2


@optional()
def add_power(
    group: Sliding, place: ScalarWorkspace, reaction: np.ndarray, dt: float, work: np.ndarray
) -> None:
    """Add ``dt`` times the power of friction [W] to its columns of ``work`` [J]."""
    for k in range(group.row.size):
        if group.friction[k] != 0.0:
            s_1, s_2 = slip_of(group, k, place.rate)
            d_1, d_2, _ = direction(group, k, s_1, s_2)
            limit = group.friction[k] * reaction[group.reaction[k], 0]
            work[group.column[k]] -= limit * (d_1 * s_1 + d_2 * s_2) * dt


@kernel
def across(
    parts_1: tuple[Vector, Vector, Vector, Vector],
    parts_2: tuple[Vector, Vector, Vector, Vector],
    c_1: float,
    c_2: float,
) -> tuple[Vector, Vector, Vector, Vector]:
    """Return ``c_1`` times one set of parts plus ``c_2`` times another."""
    return (
        axpy(c_1, parts_1[0], scale(c_2, parts_2[0])),
        axpy(c_1, parts_1[1], scale(c_2, parts_2[1])),
        axpy(c_1, parts_1[2], scale(c_2, parts_2[2])),
        axpy(c_1, parts_1[3], scale(c_2, parts_2[3])),
    )


@kernel
def parts_of(vectors: np.ndarray) -> tuple[Vector, Vector, Vector, Vector]:
    """Return the four parts (4, 3) of a coordinate."""
    return at(vectors, U_A), at(vectors, Q_A), at(vectors, U_B), at(vectors, Q_B)


@kernel
def factors(
    coords: Coordinates, frames: Frames, factor: float, q: int, load: float
) -> tuple[float, float, float, float]:
    """Return what ``load`` along coordinate ``q`` adds to the rows of its parts."""
    return (
        load * row_factor(coords, frames, factor, q, U_A),
        load * row_factor(coords, frames, factor, q, Q_A),
        load * row_factor(coords, frames, factor, q, U_B),
        load * row_factor(coords, frames, factor, q, Q_B),
    )


@optional()
def add_derivatives(
    group: Sliding,
    scalar: ScalarConstraints | None,
    place: ScalarWorkspace,
    reaction: np.ndarray,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Add the derivatives of ``add_loads`` by mass at the same N, after ``scalar.differentiate``:
    the direction rotates by the slip across it.
    """
    assert scalar is not None
    coords, q = scalar.coordinates, place.coordinates
    for k in range(group.row.size):
        s_1, s_2 = slip_of(group, k, place.rate)
        d_1, d_2, speed = direction(group, k, s_1, s_2)
        if group.friction[k] == 0.0 or speed == 0.0:
            continue
        first, second = group.along[k, 0], group.along[k, 1]
        load = -group.friction[k] * reaction[group.reaction[k], 0] / speed
        c = factors(coords, frames, 1.0, first, load)
        half_c = factors(coords, frames, 2.0, first, load)
        half_1 = rate_gradient(coords, q, frames, motion, first, out)
        half_2 = rate_gradient(coords, q, frames, motion, second, out)
        for i in range(2):
            row_1, row_2 = direction_slope(group, k, (d_1, d_2), (s_1, s_2), i)
            force = parts_of(q.force[group.along[k, i]])
            row = across(parts_of(q.slope[first]), parts_of(q.slope[second]), row_1, row_2)
            add_outer(out.by_rate, coords.block, first, c, force, row)
            row = across(half_1, half_2, row_1, row_2)
            add_outer(out.by_place, coords.block, first, half_c, force, row)


@kernel
def add_columns(
    group: Sliding,
    scalar: ScalarConstraints,
    place: ScalarWorkspace,
    frames: Frames,
    factor: float,
    d: tuple[int, float, float],
    out: np.ndarray,
) -> None:
    """Add the derivatives of the friction of a contact, along its direction ``d`` (contact, d_1,
    d_2), by the multiplier of its gap to the block values ``out``.
    """
    k, d_1, d_2 = d
    rows, coords, q = scalar.equations, scalar.coordinates, place.coordinates
    r, first, second = group.row[k], group.along[k, 0], group.along[k, 1]
    slot, own = rows.place[r, 1], -group.friction[k] * by_unknown(rows, factor, r)
    for part in range(PARTS):
        down = rows.force_block[r, 0, part]
        if down > 0:
            c = own * row_factor(coords, frames, factor, first, part)
            for i in range(3):
                along = d_1 * q.force[first, part, i] + d_2 * q.force[second, part, i]
                out[down + 3 * i + slot] += c * along


@optional()
def add_to_matrix(
    group: Sliding,
    scalar: ScalarConstraints | None,
    place: ScalarWorkspace,
    frames: Frames,
    dt2: float,
    out: np.ndarray,
) -> None:
    """Add friction to the matrix ``out`` of the index-1 problem, of a step whose displacement by
    acceleration is ``dt2``, after ``scalar.rates``.
    """
    assert scalar is not None
    for k in range(group.row.size):
        if group.friction[k] != 0.0:
            d_1, d_2, _ = direction(group, k, *slip_of(group, k, place.rate))
            add_columns(group, scalar, place, frames, -dt2, (k, d_1, d_2), out)


@kernel
def mean_direction(
    group: Sliding, place: ScalarWorkspace, k: int, h: float
) -> tuple[float, float, float]:
    """Return d of contact ``k`` and |s| over a step ``h``."""
    change = place.coordinates.change
    return direction(group, k, change[group.along[k, 0]] / h, change[group.along[k, 1]] / h)


@optional()
def add_mean_loads(
    group: Sliding,
    scalar: ScalarConstraints,
    place: ScalarWorkspace,
    frames: Frames,
    step: tuple[float, float],
    Z: np.ndarray,
) -> None:
    """Add the friction over a ``step`` (h, dt2) by its multipliers in ``Z`` to the loads."""
    h, dt2 = step
    for k in range(group.row.size):
        if group.friction[k] != 0.0:
            d_1, d_2, _ = mean_direction(group, place, k, h)
            N = multiplier(scalar.equations, frames, Z, dt2, group.row[k])
            place.coordinates.load[group.along[k, 0]] -= group.friction[k] * N * d_1
            place.coordinates.load[group.along[k, 1]] -= group.friction[k] * N * d_2


@optional()
def mean_jacobian(
    group: Sliding,
    scalar: ScalarConstraints,
    place: ScalarWorkspace,
    frames: Frames,
    step: tuple[float, float],
    Z: np.ndarray,
    out: np.ndarray,
) -> None:
    """Add the derivatives of ``add_mean_loads`` by the unknowns to the block values ``out``."""
    h, dt2 = step
    coords, q = scalar.coordinates, place.coordinates
    for k in range(group.row.size):
        if group.friction[k] == 0.0:
            continue
        d_1, d_2, speed = mean_direction(group, place, k, h)
        add_columns(group, scalar, place, frames, -dt2, (k, d_1, d_2), out)
        if speed == 0.0:
            continue
        first, second = group.along[k, 0], group.along[k, 1]
        N = multiplier(scalar.equations, frames, Z, dt2, group.row[k])
        c = factors(coords, frames, -dt2, first, -group.friction[k] * N / (h * speed))
        s = q.change[first] / h, q.change[second] / h
        for i in range(2):
            row_1, row_2 = direction_slope(group, k, (d_1, d_2), s, i)
            force = parts_of(q.force[group.along[k, i]])
            row = across(parts_of(q.slope[first]), parts_of(q.slope[second]), row_1, row_2)
            add_outer(out, coords.block, first, c, force, row)


@optional()
def mean_work(
    group: Sliding,
    scalar: ScalarConstraints,
    place: ScalarWorkspace,
    frames: Frames,
    step: tuple[float, float],
    Z: np.ndarray,
    work: np.ndarray,
) -> None:
    """Add the work of friction over the solved ``step`` (h, dt2) to its columns of ``work`` [J]."""
    h, dt2 = step
    change = place.coordinates.change
    for k in range(group.row.size):
        if group.friction[k] != 0.0:
            d_1, d_2, _ = mean_direction(group, place, k, h)
            N = multiplier(scalar.equations, frames, Z, dt2, group.row[k])
            along = d_1 * change[group.along[k, 0]] + d_2 * change[group.along[k, 1]]
            work[group.column[k]] -= group.friction[k] * N * along


def reaction_count(group: Sliding | None, joints: int) -> int:
    """Return the rows of reactions: those of ``joints``, and one for each contact with friction."""
    return joints if group is None else joints + group.row.size
