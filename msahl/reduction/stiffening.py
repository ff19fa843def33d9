"""Displacements of second order: what loads in a body change its stiffness by.

A point of the body is at x + sum_j phi_j q_j + sum_jk psi_jk q_j q_k. A bent rod becomes shorter,
so the work of an axial or centrifugal force on psi is that of geometric stiffening: no load cases
are needed, and the motion keeps its energy. Of psi the equations need to second order

    moment[a, b, j, k]       integral of x_a (psi_jk)_b dm, symmetric in a and b      [kg-m^2]
    interface[p, c, j, k]    translation and rotation of the nodes of the interface

A rigid displacement of second order changes the frame, not the motion; here psi has no momentum.
"""

from dataclasses import dataclass

import numpy as np

from msahl.reduction.invariants import Invariants
from msahl.reduction.rigid import EPSILON


@dataclass(frozen=True, eq=False, slots=True)
class Stiffening:
    """The arrays of the module's docstring, by amplitudes of unit modal mass; symmetric in j, k."""

    moment: np.ndarray  # (3, 3, q, q)
    interface: np.ndarray  # (p, 6, q, q)


def in_mean_axes(
    first: np.ndarray, second: np.ndarray, nodes: np.ndarray, places: np.ndarray, body: Invariants
) -> Stiffening:
    """Return the stiffening of displacements with the integrals ``first`` (3, q, q) of psi dm and
    ``second`` (3, 3, q, q) of x psi dm, without their rigid part; ``nodes`` (p, 6, q, q) at the
    ``places`` (p, 3)."""
    rotation = np.einsum("cab,abjk->cjk", EPSILON, second)
    rotation = np.einsum("cd,djk->cjk", np.linalg.inv(body.inertia), rotation)
    moved = first / body.mass
    squares = 0.5 * np.trace(body.inertia) * np.eye(3) - body.inertia  # of x dm
    second = second - np.einsum("ad,bcd,cjk->abjk", squares, EPSILON, rotation)
    nodes = nodes.copy()
    nodes[:, :3] -= moved + np.einsum("pd,bcd,cjk->pbjk", places, EPSILON, rotation)
    nodes[:, 3:] -= rotation
    return Stiffening(_symmetric(second), _symmetric(nodes))


def _symmetric(forms: np.ndarray) -> np.ndarray:
    result: np.ndarray = 0.5 * (forms + np.swapaxes(forms, -1, -2))
    return result
