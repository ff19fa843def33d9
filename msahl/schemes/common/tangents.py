"""Tangents of steps: derivatives of the state, and of rows of results, by parameters.

A step takes the state s0 to s1 = A(s0, z, c, h), where z solves F(z; s0, c, h) = 0 and c are the
constant numbers of the system. Along a parameter q,

    J dz = -D F        J = dF/dz,   D F = dF/ds0 ds0 + dF/dc dc + dF/dh dh                     (1)
    ds1  =  D A        D A = dA/ds0 ds0 + dA/dz dz + dA/dc dc + dA/dh dh                       (2)

The directional derivatives D are central differences of order 4 of the compiled functions
themselves, along the given direction,

    D f = (f(-2 e) - 8 f(-e) + 8 f(e) - f(2 e)) / (12 e)                                       (3)

with e such that no state changes by more than ``SHARE`` of its scale: the error is of the size of
SHARE^4 and of rounding errors over SHARE. So whatever a step hands to the next one is
differentiated, and no law has to state its derivative by its numbers.

After (2), D F along the direction with dz is what (1) leaves. If J is not the exact derivative, as
with friction by reactions or relaxed joints, further rounds correct dz by it.

The functions f are those of a second set of arrays, the *member*, whose numbers are those of the
base plus c e times their derivatives. Orientations change by rotations: their derivative is that of
the parameters of ``compose(change, p)``.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, inverse
from msahl.algebra.vector import Vector, dot, scale
from msahl.formulations.absolute.frames import Frames, moving_count
from msahl.jit.kernel import kernel

SHARE = 3e-4
"""Largest change of a state over its scale in the differences: of rotations in rad, of positions
over the longest length of a frame, of velocities over the highest speed, of numbers over the
largest of their kind."""
MEMBERS = 4
ROUNDS = 12
"""Most corrections of dz; with an exact Jacobian there are two."""
EXACT = 1e-9
"""Correction of dz, relative to dz, that ends the rounds."""
FLOOR = 1e-11
"""Change of an unknown by the shift e, relative to that unknown, below which it is rounding error.
"""
IMPROVEMENTS = 3
"""Corrections of the unknowns of a member with redundant joints, before they are made unique."""
FIRST_X, FIRST_P, FIRST_V, FIRST_W, FRAMES, FIRST_MEAN, LAST_MEAN = range(7)
"""Places in ``Tangents.places``: where x, p, v and w begin among the numbers of the state, how many
frames there are, and where the mean forces over a step begin and end."""


class Tangents(NamedTuple):
    """Derivatives by n parameters, and the numbers that are shifted; see the module."""

    number: np.ndarray  # (c,) constant numbers of the member
    given: np.ndarray  # (c,) those of the base
    changed: np.ndarray  # (n, m) numbers that a parameter changes
    change: np.ndarray  # (n, m) their derivatives
    changes: np.ndarray  # (n,) how many there are
    state: np.ndarray  # (s,) state of the member
    base: np.ndarray  # (s,) state of the base
    before: np.ndarray  # (s,) that at the start of the step
    after: np.ndarray  # (s,) and at its end
    slope: np.ndarray  # (n, s) derivatives of the state
    total: np.ndarray  # (s,) sums of (3)
    result: np.ndarray  # (r,) rows of results of the member
    base_result: np.ndarray  # (r,) those of the base
    result_slope: np.ndarray  # (n, r) derivatives of these
    size_slope: np.ndarray  # (n,) derivative of the size of the step
    most: np.ndarray  # (n,) largest e
    places: np.ndarray  # (7,)
    duration: np.ndarray  # (1,) of the run [s]
    step: np.ndarray  # like the unknowns: dz
    rows: np.ndarray  # like the unknowns: D F
    factor: np.ndarray  # factors of J
    worst: np.ndarray  # (n,) largest relative correction that was left


@kernel
def shift_of(k: int) -> float:
    """Return the k-th of the four shifts, in multiples of e."""
    return k - 2.0 if k < 2 else k - 1.0


@kernel
def weight(k: int) -> float:
    """Return the weight of the k-th of the four shifts, times e."""
    return (1.0 if k == 0 else -8.0 if k == 1 else 8.0 if k == 2 else -1.0) / 12.0


@kernel
def vector_at(numbers: np.ndarray, k: int) -> Vector:
    """Return three successive numbers."""
    return numbers[k], numbers[k + 1], numbers[k + 2]


@kernel
def largest_in(numbers: np.ndarray, first: int, count: int) -> float:
    """Return the largest magnitude of vectors among the numbers."""
    largest = 0.0
    for f in range(count):
        a = vector_at(numbers, first + 3 * f)
        largest = max(largest, dot(a, a))
    return math.sqrt(largest)


@kernel
def difference_size(tangents: Tangents, frames: Frames, j: int, h: float) -> float:
    """Return e of parameter ``j`` in the present step ``h``."""
    places, before, slope = tangents.places, tangents.before, tangents.slope[j]
    count, length = places[FRAMES], 0.0
    for f in range(moving_count(frames)):
        length = max(length, frames.length[f])
    speed = max(
        largest_in(before, places[FIRST_V], count),
        length * largest_in(before, places[FIRST_W], count),
        length / tangents.duration[0],
    )
    e = tangents.most[j]
    if abs(tangents.size_slope[j]) * e > SHARE * h:
        e = SHARE * h / abs(tangents.size_slope[j])
    for first, allowed in (
        (places[FIRST_X], length),
        (places[FIRST_P], 1.0),
        (places[FIRST_V], speed),
        (places[FIRST_W], speed / length),
    ):
        changed = largest_in(slope, first, count)
        if changed * e > SHARE * allowed:
            e = SHARE * allowed / changed
    return e


@kernel
def shift(tangents: Tangents, j: int, e: float) -> None:
    """Set the numbers and the state of the member to those of the base plus ``e`` times their
    derivatives by parameter ``j``.
    """
    places, state, before = tangents.places, tangents.state, tangents.before
    for k in range(tangents.changes[j]):
        i = tangents.changed[j, k]
        tangents.number[i] = tangents.given[i] + e * tangents.change[j, k]
    for i in range(state.size):
        state[i] = before[i] + e * tangents.slope[j, i]
    for f in range(places[FRAMES]):
        k = places[FIRST_P] + 3 * f
        change = scale(e, vector_at(tangents.slope[j], k))
        p = compose(change, vector_at(before, k))
        for i in range(3):
            state[k + i] = p[i]


@kernel
def restore_numbers(tangents: Tangents, j: int) -> None:
    """Set the constant numbers of the member to those of the base again."""
    for k in range(tangents.changes[j]):
        i = tangents.changed[j, k]
        tangents.number[i] = tangents.given[i]


@kernel
def clear(tangents: Tangents, j: int, rows: int) -> None:
    """Clear the sums of parameter ``j``; ``rows`` is the number of rows of results."""
    tangents.total[:] = 0.0
    if rows > 0:
        tangents.result_slope[j] = 0.0


@kernel
def enter_state(tangents: Tangents, weighted: float) -> None:
    """Add the state of the member at the end of the step to the sums, with the weight of (3) over
    e.
    """
    places, total, state, after = tangents.places, tangents.total, tangents.state, tangents.after
    first, last = places[FIRST_P], places[FIRST_P] + 3 * places[FRAMES]
    for i in range(total.size):
        if i < first or i >= last:
            total[i] += weighted * (state[i] - after[i])
    for f in range(places[FRAMES]):
        k = first + 3 * f
        change = compose(vector_at(state, k), inverse(vector_at(after, k)))
        for i in range(3):
            total[k + i] += weighted * change[i]


@kernel
def enter_rows(tangents: Tangents, j: int, weighted: float) -> None:
    """Add the rows of results of the member to the derivatives by parameter ``j``, likewise."""
    for i in range(tangents.result.size):
        change = tangents.result[i] - tangents.base_result[i]
        tangents.result_slope[j, i] += weighted * change


@kernel
def ends_rounds(left: float, before: float, k: int) -> bool:
    """Whether no further round follows the ``k``-th, which corrected dz by ``left``; the one before
    it, by ``before``.
    """
    return left <= EXACT or (k > 1 and left > 0.5 * before)


@kernel
def accept(tangents: Tangents, j: int) -> None:
    """Take the sums as the derivatives at the end of the step."""
    for i in range(tangents.total.size):
        tangents.slope[j, i] = tangents.total[i]


@kernel
def match_orientation(table: np.ndarray, base: np.ndarray, row: int, place: int) -> None:
    """Change three parameters of an orientation in a row to the other set of the same orientation,
    if the ``base`` has that: near half a revolution either may be written.
    """
    square, apart = 0.0, 0.0
    for i in range(place, place + 3):
        square += table[row, i] * table[row, i]
        apart += (table[row, i] - base[row, i]) * (table[row, i] - base[row, i])
    if apart > 16.0:
        for i in range(place, place + 3):
            table[row, i] *= -16.0 / square
