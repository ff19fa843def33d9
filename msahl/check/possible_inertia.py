"""The possible inertia tensor that is nearest to a given one.

With the principal moments m_i and the second moments s_i = int x_i^2 dm about principal axes,

    m = M s ,    M = [[0, 1, 1], [1, 0, 1], [1, 1, 0]] ,    s_i >= 0 ,

so a tensor is possible if all s_i are positive; the triangle inequality says the same. The nearest
one in the norm |J| has the same principal axes and the s that minimises |M s - m|. Least squares on
each of the eight sets of s_i that are at their bound contain the solution.

Source: Wensing, Kim and Slotine, Linear matrix inequalities for physically consistent inertial
parameter identification, IEEE Robotics and Automation Letters 3 (2018), for the conditions on s.
"""

from itertools import product

import numpy as np

SECOND_TO_PRINCIPAL = np.ones((3, 3)) - np.eye(3)
"""M: principal moments of second moments."""
THIN = 1e-6
"""Least second moment of the nearest tensor, as a share of its largest entry."""
COMPACT = 1e-4
"""Radius of gyration [m] that a body without any moment of inertia gets: that of a point."""
ROUND_OFF = 1e-8
"""Radius of gyration [m] below which a tensor is what is left of zero by a program's round-off: an
atom has 1e-10 m, and tensors of 1e-35 kg m^2 are found in files of robots."""


def second_moments(J: np.ndarray) -> np.ndarray:
    """Return the second moments (3,) about the principal axes, in the order of ``eigvalsh``."""
    moments = np.linalg.eigvalsh(J)
    return np.asarray(0.5 * moments.sum() - moments)


def nearest_possible(J: np.ndarray, mass: float) -> np.ndarray:
    """Return the symmetric tensor (3, 3) of a body nearest to ``J``, with second moments of at
    least ``THIN`` of its largest entry, and of ``mass`` at the radius ``COMPACT`` if all entries
    are round-off.
    """
    moments, axes = np.linalg.eigh(0.5 * (J + J.T))
    largest = np.abs(moments).max()
    is_zero = largest <= mass * ROUND_OFF**2
    least = 0.5 * mass * COMPACT**2 if is_zero else THIN * largest
    found = SECOND_TO_PRINCIPAL @ _bounded(moments, least)
    nearest = axes @ np.diag(found) @ axes.T
    return np.asarray(0.5 * (nearest + nearest.T))


def _bounded(moments: np.ndarray, least: float) -> np.ndarray:
    """Return s (3,) of at least ``least`` that minimises |M s - m|."""
    best, smallest = np.full(3, least), np.inf
    for at_bound in product((False, True), repeat=3):
        free = ~np.array(at_bound)
        s = np.full(3, least)
        rest = moments - SECOND_TO_PRINCIPAL @ np.where(free, 0.0, s)
        if free.any():
            s[free] = np.linalg.lstsq(SECOND_TO_PRINCIPAL[:, free], rest, rcond=None)[0]
        s = np.where(np.abs(s - least) <= 1e-12 * np.abs(s).max(), least, s)
        distance = float(np.sum((SECOND_TO_PRINCIPAL @ s - moments) ** 2))
        if (s >= least).all() and distance < smallest:
            best, smallest = s, distance
    return best
