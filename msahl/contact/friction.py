"""Complementarity problems of contacts with Coulomb's friction, several at once.

    w = W z + q                              along the normal n and two tangents t of each contact
    w_n >= 0,  z_n >= least,                 complementary
    |z_t| <= mu z_n,  z_t = -mu z_n w_t/|w_t| where w_t is not zero           (a circular cone)

z are impulses and w rates, or z forces and w accelerations. Of a contact that slides already the
direction d of z_t = -mu z_n d is given. The equations

    z_n = max(least, z_n - r w_n),    z_t = the nearest to z_t - r w_t in the disk of radius mu z_n

are solved by Newton's method on their pieces. It begins where all stick with the least forces, then
at zero, then where a projected gradient (``gradient``) leads; what is left is approached from
matrices that are softened less and less, from the problems of one contact after the other
(``cone``), by friction raised from none, from each choice of open, sticking and sliding contacts if
they are few, and from scattered values. A solution is one only if it satisfies the equations to
round-off. Source: P. Alart, A. Curnier, A mixed
formulation for frictional contact problems prone to Newton like solution methods, Comput. Methods
Appl. Mech. Engrg. 92 (1991).
"""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from msahl.contact.complementarity import NoSolution
from msahl.contact.cone import solve_one
from msahl.contact.cones import Cones, of_contacts
from msahl.contact.gradient import approach
from msahl.contact.independent import groups

EXACT = 1e-12
"""Residual, relative to the largest term, of a solution."""
NEAR = 1e-4
"""Change in a round of the contacts, relative to the largest, from which Newton's method begins."""
ROUNDS, NEWTON, STALLED = 20, 30, 8
"""Rounds of the contacts, steps of Newton's method, and steps of it that come no nearer, before
another start is tried.
"""
LARGEST, SOLVED = 1e10, 1e-10
"""Size of a solution, and its residual, from which on a matrix counts as singular."""
FEW = 4
"""Contacts of which every choice of states is tried."""
SOFTEST, SOFTENINGS, SOFT = 10.0, 44, 0.05
"""Part of the identity, over the mean of the diagonal, that makes the problem easy; how often it is
halved, down to round-off; and the part below which a solution leads to that without it.
"""
LEAST_RAISE = 1.0 / 512.0
"""Least step of the share of the friction."""
SCATTERED = 100
"""Random values about those of one contact after the other (of a fixed seed) from which it is
tried last.
"""


class Jammed(NoSolution):
    """The normal force of a sliding contact presses its own gap closed (Painleve)."""

    def __init__(self, contact: int, coefficient: float, without: float) -> None:
        super().__init__(contact, coefficient, without)
        self.contact, self.coefficient, self.without = contact, coefficient, without


def solve(W: np.ndarray, q: np.ndarray, cones: Cones) -> np.ndarray:
    """Return z (m,), of each group of contacts that act on each other by itself. Raises
    ``NoSolution``.
    """
    refuse_jammed(W, cones)
    z = np.zeros(q.size)
    for k in groups(W, cones.normal, cones.tangent):
        used, own = of_contacts(cones, k)
        z[used] = _solve_group(W[np.ix_(used, used)], q[used], own)
    return z


def _solve_group(W: np.ndarray, q: np.ndarray, cones: Cones) -> np.ndarray:
    """Return z (m,) of contacts that all act on each other. Raises ``NoSolution``."""
    size = _sizes(W, cones)
    scaled, right = W / np.outer(size, size), q / size
    given = cones._replace(least=cones.least * size[cones.normal])
    # Where all can stick in many ways this is the least of them, whatever round-off is.
    z = _start_of(scaled, right, given, (1,) * cones.normal.size)
    if _left(scaled, right, z, _residual(scaled, right, given, z)[0]) <= EXACT:
        return z / size
    for start in _starts(scaled, right, given):
        found = _newton(scaled, right, given, start)
        if found is not None:
            return found / size
    raise NoSolution


def refuse_jammed(W: np.ndarray, cones: Cones) -> None:
    """Raise ``Jammed`` where the reduced normal coefficient of a sliding contact is negative, or
    zero.
    """
    for k, n in enumerate(cones.normal):
        if math.isnan(cones.toward[k, 0]) or cones.friction[k] == 0.0:
            continue
        reduced = W[n, n] - cones.friction[k] * float(W[n, cones.tangent[k]] @ cones.toward[k])
        if reduced <= 0.0:
            raise Jammed(k, reduced, float(W[n, n]))


def _sizes(W: np.ndarray, cones: Cones) -> np.ndarray:
    """Return by what the unknowns (m,) are multiplied, the same for all of a contact."""
    size = np.ones(len(W))
    for n, t in zip(cones.normal, cones.tangent, strict=True):
        own = math.sqrt(abs(float(W[n, n]))) or 1.0
        size[n] = own
        if t[0] >= 0:
            size[t] = own
    return size


def _residual(
    W: np.ndarray, q: np.ndarray, cones: Cones, z: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the equations (m,) at ``z``, and their derivative (m, m)."""
    w, F, J = W @ z + q, z.copy(), np.eye(z.size)
    closed = z[cones.normal] - cones.least - w[cones.normal] > 0.0
    n = cones.normal[closed]
    F[cones.normal] -= cones.least
    F[n], J[n] = w[n], W[n]
    rubs = cones.tangent[:, 0] >= 0
    if rubs.any():
        _add_friction(W, w, z, Cones(*(of[rubs] for of in cones)), F, J)
    return F, J


def _add_friction(
    W: np.ndarray, w: np.ndarray, z: np.ndarray, cones: Cones, F: np.ndarray, J: np.ndarray
) -> None:
    """Put the equations of the tangential parts, all of contacts with friction, into ``F``, which
    is z there, and their derivative into ``J``, which is the identity.
    """
    n, t, mu = cones.normal, cones.tangent, cones.friction
    radius = mu * np.maximum(z[n], 0.0)
    r = 1.0 / np.maximum(0.5 * (W[t[:, 0], t[:, 0]] + W[t[:, 1], t[:, 1]]), 1e-300)
    y = z[t] - r[:, None] * w[t]
    length = np.hypot(y[:, 0], y[:, 1])
    given = ~np.isnan(cones.toward[:, 0])
    sticks = ~given & (length <= radius) & (radius > 0.0)
    free = ~given & (length > radius) & (radius > 0.0)
    e = np.where(given[:, None], -cones.toward, y / np.where(length > 0.0, length, 1.0)[:, None])
    slides = given | free
    F[t[slides]] -= radius[slides, None] * e[slides]
    J[t[slides], n[slides, None]] -= (mu * (z[n] > 0.0))[slides, None] * e[slides]
    own = t[sticks]
    F[own], J[own] = r[sticks, None] * w[own], r[sticks, None, None] * W[own]
    own, e = t[free], e[free]
    rotated = np.eye(2) - e[:, :, None] * e[:, None, :]
    by_z = -r[free, None, None] * W[own]
    by_z[np.arange(len(own))[:, None], [0, 1], own] += 1.0
    J[own] -= (radius[free] / length[free])[:, None, None] * (rotated @ by_z)


def _left(W: np.ndarray, q: np.ndarray, z: np.ndarray, F: np.ndarray) -> float:
    """Return the residual ``F`` (m,) at ``z`` relative to the largest term."""
    size = max(float(np.abs(q).max()), float(np.abs(W * z).max()), 1e-300)
    return float(np.abs(F).max()) / size


def _newton(W: np.ndarray, q: np.ndarray, cones: Cones, z: np.ndarray) -> np.ndarray | None:
    """Return the solution that Newton's method finds from ``z``, or None."""
    best: tuple[float, int, np.ndarray] | None = None
    for step in range(NEWTON):
        F, J = _residual(W, q, cones, z)
        left = _left(W, q, z, F)
        if not math.isfinite(left):
            return None
        if best is None or left < best[0]:
            best = left, step, z
        elif best[0] <= EXACT or step - best[1] > STALLED:
            break
        if left == 0.0:
            break
        z = z - _solved(J, F)
    assert best is not None
    return best[2] if best[0] <= EXACT else None


def _solved(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the solution of A x = b, the least one where A is singular to round-off."""
    try:
        x: np.ndarray = np.linalg.solve(A, b)
        if np.abs(x).max() < LARGEST and np.abs(A @ x - b).max() <= SOLVED * np.abs(b).max():
            return x
    except np.linalg.LinAlgError:
        pass
    return np.linalg.lstsq(A, b, rcond=1e-13)[0]


def _starts(W: np.ndarray, q: np.ndarray, cones: Cones) -> Iterator[np.ndarray]:
    """Yield values from which Newton's method begins, those that lead somewhere more often first.

    None of them does always: a problem that one misses is solved by the next.
    """
    z = np.zeros(q.size)
    z[cones.normal] = cones.least
    yield z
    yield from approach(W, q, cones, z)
    yield from _softened(W, q, cones, z)
    near = _project(W, q, cones, z.copy())
    yield near
    yield from _raised(W, q, cones, z)
    if cones.normal.size <= FEW:
        for states in itertools.product(range(3), repeat=cones.normal.size):
            yield _start_of(W, q, cones, states)
    scatter, size = np.random.default_rng(0), float(np.abs(near).max()) or 1.0
    for _ in range(SCATTERED):
        yield near + size * scatter.normal(size=q.size)


def _softened(W: np.ndarray, q: np.ndarray, cones: Cones, z: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the solutions with a part of the identity added to ``W``, less and less of it."""
    own = float(np.diag(W).mean()) * np.eye(q.size)
    for part in SOFTEST * 0.5 ** np.arange(SOFTENINGS):
        solution = _newton(W + part * own, q, cones, z)
        if solution is not None:
            z = solution
            if part < SOFT:
                yield z


def _raised(W: np.ndarray, q: np.ndarray, cones: Cones, z: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the solution with as much of the friction as can be reached from none, step by step."""
    reached, step = 0.0, 0.0
    while reached < 1.0:
        share = min(1.0, reached + step)
        solution = _newton(W, q, cones._replace(friction=share * cones.friction), z)
        if solution is not None:
            z, reached, step = solution, share, max(1.5 * step, 0.125)
        elif step > 2.0 * LEAST_RAISE:
            step /= 2.0
        else:
            break
    yield z


def _project(W: np.ndarray, q: np.ndarray, cones: Cones, z: np.ndarray) -> np.ndarray:
    """Return ``z`` after the problems of one contact after the other, each with the rest given."""
    for _ in range(ROUNDS):
        last = z.copy()
        for n, t, mu, least, d in zip(*cones, strict=True):
            if t[0] < 0:
                z[n] = max(least, z[n] - (W[n] @ z + q[n]) / W[n, n])
                continue
            own = np.array([n, *t])
            block = W[np.ix_(own, own)]
            rest = W[own] @ z + q[own] - block @ z[own]
            found = solve_one(block, rest, mu, least, None if math.isnan(d[0]) else d)
            if found is not None:
                z[own] = found
        if np.abs(z - last).max() <= NEAR * np.abs(z).max():
            break
    return z


def _start_of(W: np.ndarray, q: np.ndarray, cones: Cones, states: tuple[int, ...]) -> np.ndarray:
    """Return z where the contacts are open (0), stick (1) or slide (2), along what q has."""
    A, b = np.eye(q.size), np.zeros(q.size)
    for k, (n, t, mu, least, d) in enumerate(zip(*cones, strict=True)):
        b[n] = least
        if states[k] > 0:
            A[n], b[n] = W[n], -q[n]
        if t[0] < 0:
            continue
        if states[k] == 1 and math.isnan(d[0]):
            A[t], b[t] = W[t], -q[t]
        elif states[k] == 2 or not math.isnan(d[0]):
            along = d if not math.isnan(d[0]) else q[t] / (math.hypot(*q[t]) or 1.0)
            A[t, n] += mu * along
    return np.linalg.lstsq(A, b, rcond=1e-13)[0]
