"""Forces of contacts at rest or in motion, in one configuration: who presses, sticks or slides.

w = W f + b         accelerations along the m directions of k contacts; see ``touching``
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.contact import friction
from msahl.contact.complementarity import solve
from msahl.contact.cones import Cones
from msahl.contact.response import Response
from msahl.start.redundancy import INDEPENDENT
from msahl.system.arrays import System
from msahl.system.contacts import Contacts

SAME = 1e-9
"""Acceleration, over the largest number that it is a sum of, that is none."""
SIDES = 16
"""Sides of the polygon that stands for the circle of friction, inside of it, where forces are
sought of all contacts that may press."""
LEAST = 1e-6
"""Force, over the one that each of them is sought with, that is more than round-off."""


class Held(NamedTuple):
    """What k contacts do, along m directions."""

    force: np.ndarray  # (m,)
    presses: np.ndarray  # (k,)
    sticks: np.ndarray  # (k,)
    toward: np.ndarray  # (k, 2) directions of those slips that are not zero, else nan
    unique: bool  # whether there are no other forces


def held(
    system: System,
    contacts: Contacts,
    response: Response,
    free: tuple[np.ndarray, float],
    moving: tuple[np.ndarray, float],
) -> Held:
    """Return what the contacts of a ``response`` do by the accelerations that they are ``free`` to
    have, (m,) and the largest number of which these are sums; ``moving`` are the rates (m,) along
    the directions, and the largest that is none. Raises ``NoSolution``.
    """
    (b, size), (rate, still) = free, moving
    b, k = np.where(np.abs(b) <= SAME * size, 0.0, b), response.which.size
    cones = cones_of(system, contacts, response, rate, still)
    rough = response.tangent[:, 0] >= 0
    force = np.zeros(b.size)
    if not rough.any():
        force = solve(response.W, b)
    elif (b[:k] < 0.0).any():
        force = friction.solve(response.W, b, cones)
    w = b + response.W @ force
    size += float(np.abs(response.W * force).max(initial=0.0))
    slips = np.hypot(*np.where(rough[:, None], w[response.tangent], 0.0).T)
    rests = np.abs(w[:k]) <= SAME * size
    sticks = rests & rough & np.isnan(cones.toward[:, 0]) & (slips <= SAME * size)
    presses = rests & (force[:k] > 0.0)
    if force.any() and (rests & ~presses).any():
        presses |= _may_press(response, force, cones, rests)
    own = np.flatnonzero(presses)
    directions = np.concatenate([own, response.tangent[presses & sticks].reshape(-1)])
    unique = _is_regular(response.W, directions)
    return Held(force, presses, sticks & presses, cones.toward, unique)


def cones_of(
    system: System, contacts: Contacts, response: Response, rate: np.ndarray, still: float
) -> Cones:
    """Return the cones of friction: of the static coefficient where a slip is not more than
    ``still``, else that of sliding, with the direction of the slip.
    """
    which, group, tangent = response.which, system.forces.sliding, response.tangent
    mu, toward = contacts.friction[which].copy(), np.full((which.size, 2), math.nan)
    for k in np.flatnonzero(tangent[:, 0] >= 0):
        assert group is not None
        slip = rate[tangent[k]]
        speed = float(np.hypot(*slip))
        if speed > still:
            toward[k] = slip / speed
        else:
            mu[k] = group.grip[contacts.sliding[which[k]]]
    return Cones(np.arange(which.size), tangent, mu, np.zeros(which.size), toward)


def _is_regular(W: np.ndarray, directions: np.ndarray) -> bool:
    """Return whether forces along these ``directions`` are unique."""
    own = W[np.ix_(directions, directions)]
    scale = np.sqrt(np.maximum(np.diag(own), np.finfo(float).tiny))
    own = own / np.outer(scale, scale)
    return not own.size or bool(np.linalg.matrix_rank(own, tol=INDEPENDENT) == directions.size)


def _may_press(
    response: Response, force: np.ndarray, cones: Cones, rests: np.ndarray
) -> np.ndarray:
    """(k,) which contacts that ``rests`` says press in some solution with the accelerations of the
    ``force`` (m,): by a linear problem, with polygons for circles of friction.

        max sum t,    0 <= t <= share,    f_n >= t,    W f = W f_0
    """
    from scipy.optimize import linprog  # which few models need

    k, m = rests.size, force.size
    size = float(np.abs(force).max())
    share = np.where(rests, size / (10.0 * k), 0.0)
    scale = np.sqrt(np.maximum(np.diag(response.W), np.finfo(float).tiny))
    right = (response.W @ force) / (scale * size)
    left = response.W / scale[:, None]
    rows = []
    for i in range(k):
        rows.append(np.eye(m + k)[m + i] - np.eye(m + k)[i])
        for angle in 2.0 * math.pi * np.arange(SIDES if cones.tangent[i, 0] >= 0 else 0) / SIDES:
            row = np.zeros(m + k)
            row[cones.tangent[i]] = math.cos(angle), math.sin(angle)
            row[i] = -cones.friction[i] * math.cos(math.pi / SIDES)
            rows.append(row)
    bounds: list[tuple[float | None, float | None]] = [(None, None)] * m
    for i in range(k):
        bounds[i] = (0.0, None if rests[i] else 0.0)
    found = linprog(
        np.concatenate([np.zeros(m), -np.ones(k)]),
        A_ub=np.array(rows),
        b_ub=np.zeros(len(rows)),
        A_eq=np.concatenate([left, np.zeros((m, k))], axis=1),
        b_eq=right,
        bounds=[*bounds, *((0.0, t / size) for t in share)],
    )
    if found.status != 0:
        return np.zeros(k, dtype=bool)
    pressing: np.ndarray = found.x[m:] > LEAST * share.max() / size
    return pressing & rests
