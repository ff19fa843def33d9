"""Finds singular positions of a prescribed motion between its instants, and names them.

At a singular position the constraint equations lose rank: some bodies can move infinitesimally
though all motions are prescribed, and loads of motions and joints balance each other without bound.
G has r singular values but for those that redundant equations make zero. Seen in the singular
vectors U, V of an instant nearby,

    s(t) = det(U^T G(t) V) / (sigma_1 ... sigma_(r-1))

is a smooth function, about as large as the smallest singular value, and changes its sign where an
odd number of these pass through zero. Where an even number does, sigma_r^2 has a minimum of zero.
Zeros are found from both sides by Chebyshev interpolation, since positions near to them are not
known well: of s, or of the derivative of sigma_r^2.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from msahl.analysis.kinematics.configuration import EPSILON
from msahl.analysis.kinematics.follow import Follower, Instant

NODES = 8
"""Nodes of an interpolation; an even number, so that none lies in the middle."""
SHRINK = 0.125
"""Width of the next interval around a zero, relative to that before."""
MOST_ROUNDS = 5
TOUCHING = 1e-5
"""Smallest singular value in a minimum, relative to that at the ends of the interval, that is
zero."""
ALIKE = 10.0
"""Ratio of singular values near a singular position that pass through zero together."""
CLOSE = 1e-6
"""Smallest singular value, relative to the largest, of a position that cannot be told from a
singular one: positions are known to the root of machine epsilons there."""


class Singular(NamedTuple):
    """A singular position."""

    time: float  # [s]
    uncertainty: float  # of the time [s]
    limit: bool  # whether the motion ends there
    motion: np.ndarray  # (n,) sizes of displacements and rotations that remain possible
    loads: np.ndarray  # (c,) sizes of multipliers in equilibrium


def singular_positions(follower: Follower, passed: Sequence[Instant]) -> list[Singular]:
    """Return the singular positions between the instants ``passed``, in the order of time."""
    found = []
    for before, after in pairwise(passed):
        if sign_between(before, after) < 0.0:
            found.append(_refined(follower, before, after, _crossing))
    for before, middle, after in zip(passed, passed[1:], passed[2:], strict=False):
        sigma = [i.sigma for i in (before, middle, after)]
        steep = sigma[1] < sigma[0] and sigma[1] <= sigma[2] and sigma[1] < 0.5 * max(sigma)
        no_sign = sign_between(before, middle) > 0.0 < sign_between(middle, after)
        if steep and no_sign:
            touching = _refined(follower, before, after, _minimum)
            if _touches(follower, touching, before, after):
                found.append(touching)
    return sorted(found)


def sign_between(a: Instant, b: Instant) -> float:
    """Return 1 if an even number of singular values passes zero from ``a`` to ``b``, else -1."""
    r = a.rank
    sign, _ = np.linalg.slogdet(a.solved.left[:, :r].T @ b.G @ a.solved.right[:r].T)
    return float(sign)


Root = Callable[[Instant, np.ndarray, list[Instant]], float]


def _refined(follower: Follower, before: Instant, after: Instant, root: Root) -> Singular:
    """Return the singular position between two instants, by smaller and smaller intervals.

    These have smaller errors of interpolation and larger ones of the positions, which are known to
    machine epsilon over the smallest singular value; it ends where both are alike.
    """
    known, seen = [before, after], [before, after]
    half, centre = 0.5 * (after.time - before.time), 0.5 * (before.time + after.time)
    time, uncertainty = centre, half
    for _ in range(MOST_ROUNDS):
        nodes = centre + half * np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)[::-1]
        instants = [_at(follower, known, float(t)) for t in nodes]
        if any(i is None for i in instants):
            break
        complete = [i for i in instants if i is not None]
        tried = root(before, nodes, complete)
        noise = _noise(follower, complete, tried)
        error = max(abs(tried - time), noise)
        if not abs(tried - centre) <= half or error > uncertainty:
            break
        seen, known = complete, known + complete
        time, uncertainty = tried, error
        if noise > 0.01 * abs(tried - centre):
            break
        centre, half = tried, SHRINK * half
    motion, loads = _null_vectors(seen, time)
    return Singular(float(time), float(uncertainty), False, motion, loads)


def _noise(follower: Follower, instants: Sequence[Instant], time: float) -> float:
    """Error of a zero [s] by the round-off of the positions."""
    sigma = np.array([i.sigma for i in instants])
    slope = float(np.max(sigma / np.abs([i.time - time for i in instants])))
    return 4.0 * EPSILON / (float(sigma.min()) * slope) + 4.0 * EPSILON * follower.end


def _at(follower: Follower, known: Sequence[Instant], time: float) -> Instant | None:
    """Return the instant at a ``time``, by Newton's method from the nearest one that is known."""
    base = min(known, key=lambda i: abs(i.time - time))
    return follower.instant(base.state, time - base.time, near=False, time=time)


def _crossing(reference: Instant, nodes: np.ndarray, instants: list[Instant]) -> float:
    """Return the zero of s(t) in the interval of the ``nodes``; NaN without one."""
    r, solved = reference.rank, reference.solved
    logs = np.log(solved.values[: r - 1]).sum()
    values = []
    for i in instants:
        sign, log = np.linalg.slogdet(solved.left[:, :r].T @ i.G @ solved.right[:r].T)
        values.append(sign * np.exp(log - logs))
    return _zero(nodes, np.array(values))


def _minimum(reference: Instant, nodes: np.ndarray, instants: list[Instant]) -> float:
    """Return where sigma_r^2 is least in the interval of the ``nodes``; NaN without a minimum."""
    return _zero(nodes, np.array([i.sigma**2 for i in instants]), derivative=True)


def _zero(nodes: np.ndarray, values: np.ndarray, derivative: bool = False) -> float:
    """Return the zero nearest to the middle of the polynomial through ``values``, or of its
    derivative; NaN without one.
    """
    centre, half = 0.5 * (nodes[0] + nodes[-1]), 0.5 * (nodes[-1] - nodes[0])
    series = np.polynomial.Chebyshev.fit((nodes - centre) / half, values, NODES - 1, (-1.0, 1.0))
    roots = (series.deriv() if derivative else series).roots()
    real = roots[np.abs(roots.imag) <= 1e-6].real
    real = real[np.abs(real) <= 1.2]
    if not real.size:
        return float("nan")
    return float(centre + half * real[np.argmin(np.abs(real))])


def _touches(follower: Follower, found: Singular, before: Instant, after: Instant) -> bool:
    """Return whether the smallest singular value is zero in its minimum, as far as can be told."""
    at = _at(follower, [before, after], found.time)
    least = 0.0 if at is None else at.sigma
    return least <= TOUCHING * max(before.sigma, after.sigma)


def limit_position(follower: Follower, passed: Sequence[Instant]) -> Singular | None:
    """Return the singular position at which the motion ends behind the last of the instants
    ``passed``; None if their smallest singular value does not fall to zero.

    It falls with the square root of the time that is left.
    """
    if len(passed) < 3:
        return None
    largest = max(i.sigma for i in passed)
    a, b = passed[-2:]
    if b.sigma > 1e-3 * largest or b.sigma >= a.sigma:
        return None
    left = b.sigma**2 * (b.time - a.time) / (a.sigma**2 - b.sigma**2)
    motion, loads = _null_vectors([b], b.time)
    uncertainty = max(left, 64.0 * float(np.finfo(float).eps) * follower.end)
    return Singular(b.time + left, float(uncertainty), True, motion, loads)


def _null_vectors(instants: Sequence[Instant], time: float) -> tuple[np.ndarray, np.ndarray]:
    """Sizes (n,) and (c,) of what the singular vectors of values near to zero contain, at the
    instant nearest to ``time``.
    """
    nearest = min(instants, key=lambda i: abs(i.time - time))
    r, solved = nearest.rank, nearest.solved
    zero = np.flatnonzero(solved.values[:r] <= ALIKE * solved.values[r - 1])
    motion = np.linalg.norm(solved.right[zero], axis=0)
    return motion, np.linalg.norm(solved.left[:, zero], axis=1)
