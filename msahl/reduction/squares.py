"""Displacements of second order of the bodies of an elastic one, by squares of sums of amplitudes.

    sum_jk Y_jk a_j a_k = sum_j (Y_jj - sum_k Y_jk) a_j^2 + sum_(j<k) Y_jk (a_j + a_k)^2    k not j

so few squares s, of amplitudes and of sums of two, give all forms of a body's ``Stiffening``: a
body is at x + phi a + psi s. Nodes of the interface have their own psi. That of particles is linear
in their places, psi = W (1, x): the equations need no more of it to second order than the integrals
of psi dm and of x psi dm, from which W follows. Pairs without any Y are omitted.
"""

from typing import NamedTuple

import numpy as np

from msahl.reduction.body import ReducedBody
from msahl.reduction.particles import Masses, Particles
from msahl.reduction.stiffening import Stiffening

NEGLIGIBLE = 1e-4
"""Change of stiffness by that of both amplitudes, in units of the largest one, of pairs that are
omitted: loads in the body that change the lowest frequency by a tenth change others by 1e-5 by
these."""
FLAT = 1e-9
"""Second moment of mass by the largest, below which a body has no extent in a direction."""


THIN = 1e-6
"""The same, below which its inertia of second order is not corrected."""


class Squares(NamedTuple):
    """Amplitudes (l, 2) whose sum is squared, twice the same for its own square; those of one come
    first, in order. ``sums`` (m, q) are the sums of two, which others carry."""

    pairs: np.ndarray
    sums: np.ndarray

    @property
    def arguments(self) -> tuple[int, ...]:
        """The number of each square's argument: an amplitude, or behind these a sum of two."""
        q = self.sums.shape[1]
        return (*range(q), *range(q, q + len(self.sums)))


def no_squares(q: int) -> Squares:
    """Return the squares of a body without stiffening."""
    return Squares(np.zeros((0, 2), dtype=np.int64), np.zeros((0, q)))


def squares_of(given: Stiffening, body: ReducedBody) -> Squares:
    """Return the squares that the stiffening needs."""
    size = np.sqrt(np.trace(body.invariants.inertia) / body.invariants.mass)
    forms = [
        given.moment.reshape(9, *given.moment.shape[2:]) / (body.invariants.mass * size),
        *(given.interface[:, :3], size * given.interface[:, 3:]),
    ]
    q = body.eigenvalues.size
    largest = np.max([np.abs(one.reshape(-1, q, q)).max(axis=0, initial=0.0) for one in forms], 0)
    omega = np.sqrt(body.eigenvalues)
    largest = largest / np.outer(omega, omega)
    j, k = np.nonzero(np.triu(largest > NEGLIGIBLE * largest.max(initial=0.0), 1))
    own = np.arange(q)
    return Squares(
        np.concatenate([np.column_stack([own, own]), np.column_stack([j, k])]),
        np.eye(q)[j] + np.eye(q)[k],
    )


def by_squares(forms: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return forms (..., q, q) as weights (..., l) of squares."""
    j, k = pairs.T
    weights: np.ndarray = forms[..., j, k]
    for a, b in pairs[forms.shape[-1] :]:
        weights[..., [a, b]] -= forms[..., a, b, None]
    return weights


class SecondOrder(NamedTuple):
    """Displacements psi of the nodes (p, 3, l) and their rotations (p, 3, l), and those of the
    particles (b, 3, l), by squares times ``factor`` (l,) [1/m]: these are displacements [m] of
    which the largest psi is 1."""

    nodes: np.ndarray
    rotations: np.ndarray
    points: np.ndarray
    factor: np.ndarray


def second_order(
    given: Stiffening, curve: np.ndarray, found: Particles, pairs: np.ndarray
) -> SecondOrder:
    """Return the displacements of second order of all bodies of a reduced one."""
    units = np.outer(found.scale, found.scale)
    moment, nodes = (by_squares(one * units, pairs) for one in (given.moment, given.interface))
    rows = _rows(found.points)
    G = np.einsum("b,bi,bj->ij", found.points.mass, rows, rows)
    moment += by_squares(_compensation(curve * units, found, G[1:, 1:]), pairs)
    wanted = np.concatenate([np.zeros((1, *moment.shape[1:])), moment])
    wanted -= np.einsum("b,bi,bjl->ijl", found.nodes.mass, _rows(found.nodes), nodes[:, :3])
    units = np.sqrt(np.r_[G[0, 0], np.full(3, np.trace(G[1:, 1:]))])
    inverse = np.linalg.pinv(G / np.outer(units, units), FLAT, hermitian=True)
    W = np.einsum("ij,jal->ial", inverse / np.outer(units, units), wanted)
    points = np.einsum("bi,ial->bal", rows, W)
    size = units[1] / units[0]  # radius of gyration [m]
    largest = np.max(
        [np.abs(one).max(axis=(0, 1)) for one in (nodes[:, :3], size * nodes[:, 3:], points)], 0
    )
    factor = np.where(largest > 0.0, largest, 1.0 / size)
    parts = (one / factor for one in (nodes[:, :3], nodes[:, 3:], points))
    displacement, rotation, own = parts
    return SecondOrder(displacement, rotation, own, factor)


def _compensation(curve: np.ndarray, found: Particles, G: np.ndarray) -> np.ndarray:
    """Return the integrals (3, 3, q, q) of x psi dm by which the inertia of second order is that of
    the body, whose ``curve`` (3, 3, q, q) differs from the particles'; ``G`` (3, 3) is that of x x
    dm."""
    groups = (found.frame, found.amplitudes, found.sums, found.nodes, found.points)
    P = sum(np.einsum("b,baj,bck->acjk", one.mass, one.shape, one.shape) for one in groups)
    lack = 0.5 * np.einsum("iijk,ac->acjk", curve, np.eye(3)) - curve - P
    lack = 0.5 * (lack + lack.transpose(1, 0, 2, 3))
    lack = 0.5 * (lack + lack.transpose(0, 1, 3, 2))
    g, V = np.linalg.eigh(G)
    g = np.maximum(g, 0.0)
    sums = g[:, None] + g
    with np.errstate(divide="ignore"):
        B = np.where(sums > THIN * g.max(), 1.0 / sums, 0.0)
    own = np.einsum("ai,acjk,cl->iljk", V, lack, V)
    result: np.ndarray = np.einsum(
        "ai,iljk,cl->acjk", V, g[:, None, None, None] * B[..., None, None] * own, V
    )
    return result


def _rows(bodies: Masses) -> np.ndarray:
    """Return (1, x) of bodies (b, 4)."""
    return np.hstack([np.ones((len(bodies.place), 1)), bodies.place])
