"""Which of the contacts that touch stay closed, which of these stick, and where to others slide.

Of the contacts whose gaps are zero and stay so to first order, those stay closed whose forces are
positive in the solution of

    b + W f >= 0,    f >= 0,    complementary           b   accelerations of the gaps for f = 0

or, with friction, in that of ``friction``, by the accelerations of the slips as well: those whose
slips are zero stick if their forces are in the cone of the static coefficient.
"""

import math

import numpy as np

from msahl.contact import friction, sharing
from msahl.contact.complementarity import solve
from msahl.contact.cones import Cones, of_contacts
from msahl.contact.friction import Jammed
from msahl.contact.response import Response, stopping
from msahl.contact.state import STILL, UNSEEN, After, Cause, ContactState

USED = 1e-6
"""Share of the grip that is none, where that of another contact is used up: those of an edge slip
together."""
SLIPS = 1e-9
"""Acceleration of a slip, over the largest one, that is not zero; likewise of a force at the edge
of its cone."""


def follow(
    contacts: ContactState, response: Response, speed: np.ndarray, stays: np.ndarray, cause: Cause
) -> After:
    """Find the forces of the contacts whose gaps may stay zero."""
    b, size = contacts.accelerations(response)
    b = np.where(np.abs(b) <= STILL * size, 0.0, b)
    contacts.fastest = max(contacts.fastest, float(np.sqrt(contacts.length * size)))
    count = stays.size
    rests = np.flatnonzero((speed[:count] == 0.0) & stays)
    force, toward = np.zeros(speed.size), np.zeros((count, 2))
    if speed.size == count:
        force[rests] = solve(response.W[np.ix_(rests, rests)], b[rests])
        sticks = np.zeros(count, dtype=bool)
    else:
        force, sticks, toward = _with_friction(contacts, response, b, speed, rests, cause)
    after, together = b + response.W @ force, np.zeros(count, dtype=bool)
    together[rests] = np.abs(after[rests]) <= STILL * size
    if contacts.shares:
        _share(contacts, response, force, np.flatnonzero(together & ~sticks), toward)
    own = force[:count] * np.diag(response.W)[:count]
    force[:count][own <= STILL * size] = 0.0
    return After(speed, force, after, sticks & (force[:count] > 0.0), toward, together)


def _share(
    contacts: ContactState, response: Response, force: np.ndarray, k: np.ndarray, toward: np.ndarray
) -> None:
    """Let the contacts ``k`` that stay together have, in ``force`` (m,), the least multipliers by
    which all move as they do: the direction ``toward`` (k, 2) of a slip is that of its friction.
    """
    t = response.tangent[k]
    rough = t[:, 0] >= 0
    given = ~(rough & np.isnan(toward[k, 0]))  # a direction, or none is needed
    k, t, rough = k[given], t[given], rough[given]
    mu = contacts.contacts.friction[response.which[k]]
    E = np.zeros((force.size, k.size))
    E[k, np.arange(k.size)] = response.unit[k]
    E[t[rough].T, np.flatnonzero(rough)] = (-mu[:, None] * toward[k] * response.unit[k, None])[
        rough
    ].T
    y = sharing.least(response.W @ E, force[k] / response.unit[k])
    force[k], force[t[rough]] = response.unit[k] * y, (E @ y)[t[rough]]


def _with_friction(
    contacts: ContactState,
    response: Response,
    b: np.ndarray,
    speed: np.ndarray,
    rests: np.ndarray,
    cause: Cause,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the forces (m,) by accelerations ``b`` (m,) of the contacts that may stay closed,
    which of all stick (k,), and where to the others slip (k, 2).
    """
    count, t = response.which.size, response.tangent
    rough = t[:, 0] >= 0
    slip = np.where(rough[:, None], speed[t], 0.0)
    length = np.hypot(*slip.T)
    still = rough & (length == 0.0)
    toward = np.divide(slip, length[:, None], where=length[:, None] > 0.0, out=slip * np.nan)
    broken = _break(contacts, response, still, cause, toward)
    while True:
        cones = contacts.cones(response, still & ~broken, grips=True)
        assert cones is not None
        cones = cones._replace(toward=toward)
        force = _solve_forces(response, b, cones, rests)
        radius = cones.friction * force[:count]
        sticks = still & ~broken & (force[:count] > 0.0)
        T = np.hypot(*np.where(rough[:, None], force[t], 0.0).T)
        a = b + response.W @ force
        moves = np.hypot(*np.where(rough[:, None], a[t], 0.0).T)
        size = float(np.abs(response.W * force).max(initial=0.0)) + float(np.abs(b).max())
        back = still & broken & (np.einsum("ki,ki->k", a[t], toward) < -SLIPS * size)
        if back.any() and cause.slips >= 0 and not back[cause.slips]:
            broken[back], toward[back] = False, math.nan
            continue
        slips = sticks & (moves > SLIPS * size) & ((1.0 - SLIPS) * radius <= T)
        broken |= slips
        grips = cones.friction > contacts.contacts.friction[response.which]
        if not (slips.any() and grips.any()):
            begins = broken & np.isnan(toward[:, 0])
            toward[begins] = a[t[begins]] / moves[begins, None]
            return force, sticks & ~slips, toward


def _break(
    contacts: ContactState, response: Response, still: np.ndarray, cause: Cause, toward: np.ndarray
) -> np.ndarray:
    """Return which of the contacts that are ``still`` (k,) have used up their grip, with their
    directions in ``toward`` (k, 2).

    One that has done so before, and does not move, is held by others with a part of theirs left: it
    does not stick again.
    """
    broken = np.zeros(still.size, dtype=bool)
    if cause.slips < 0:
        return broken
    for k in map(int, np.flatnonzero(still)):
        if k == cause.slips or _grip_left(contacts, response, k) <= USED:
            broken[k], toward[k] = True, _impending(contacts, response, k)
    held = still & cause.slid & ~broken
    group = contacts.system.forces.sliding
    assert group is not None
    toward[held] = group.toward[contacts.contacts.sliding[response.which[held]]]
    return broken | held


def _held_by(contacts: ContactState, response: Response, k: int) -> tuple[np.ndarray, float]:
    """Return the force (2,) that holds contact ``k``, and the largest one that can."""
    group = contacts.system.forces.sliding
    assert group is not None
    own = contacts.contacts.sliding[response.which[k]]
    N, *T = contacts.state.reaction[group.reaction[own], :3]
    return np.array(T), float(group.grip[own] * N)


def _grip_left(contacts: ContactState, response: Response, k: int) -> float:
    """Return the share of the grip of contact ``k`` that is not used."""
    T, most = _held_by(contacts, response, k)
    return 1.0 - float(np.hypot(*T)) / most if most > 0.0 else math.inf


def _impending(contacts: ContactState, response: Response, k: int) -> np.ndarray:
    """Return the direction (2,) in which contact ``k`` begins to slip: against its force."""
    T, _ = _held_by(contacts, response, k)
    return -T / float(np.hypot(*T))


def _solve_forces(response: Response, b: np.ndarray, cones: Cones, rests: np.ndarray) -> np.ndarray:
    """Return the forces (m,) of the contacts ``rests``."""
    used, own = of_contacts(cones, rests)
    force = np.zeros(b.size)
    if (b[rests] < 0.0).any() or not np.isnan(cones.toward[rests]).all():
        try:
            force[used] = friction.solve(response.W[np.ix_(used, used)], b[used], own)
        except Jammed as error:
            raise Jammed(int(rests[error.contact]), *error.args[1:]) from error
    return force


def hold(
    contacts: ContactState,
    response: Response,
    after: After,
    unseen: np.ndarray,
    given: tuple[np.ndarray, Cause],
) -> After:
    """Keep those rates (m,) zero that are ``unseen``, with those that are zero and stay so: where
    several rock, the impact of one lifts the others without an end, and a slip may be over before
    a step can tell.
    """
    rests = (after.speed[: after.together.size] == 0.0) & (after.force[: after.together.size] > 0.0)
    zero = unseen.copy()
    zero[: rests.size] |= after.speed[: rests.size] == 0.0
    own = response.tangent[rests & after.sticks]
    zero[own.reshape(-1)] = True
    k = np.flatnonzero(zero)
    push = np.zeros(after.speed.size)
    push[k] = stopping(response.W[np.ix_(k, k)], after.speed[k])
    contacts.push(response, push, after.speed)
    speed = after.speed + response.W @ push
    speed[k] = 0.0
    return follow(contacts, response, contacts.rounded(speed), *given)


def ending_slips(response: Response, after: After, round_off: np.ndarray) -> np.ndarray:
    """(m,) which rates are slips that end on a way too small to be resolved, of contacts whose
    positions have this ``round_off`` (k,).
    """
    found = np.zeros(after.speed.size, dtype=bool)
    slides = (response.tangent[:, 0] >= 0) & after.together & ~after.sticks
    for k in map(int, np.flatnonzero(slides)):
        t = response.tangent[k]
        s = after.speed[t]
        # By s^2/(2 a) with the acceleration -a along the slip: a = -s . s'/|s|.
        ends = -float(s @ after.acceleration[t])
        found[t] = float(s @ s) ** 1.5 <= 2.0 * ends * UNSEEN * round_off[k] and s.any()
    return found
