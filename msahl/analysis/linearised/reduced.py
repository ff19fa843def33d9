"""The linearised equations in as many states as there are degrees of freedom: y' = A y + f.

With M = L L^T, coordinates q~ = L^T dq, v~ = L^T dv and orthonormal bases N_h of the null space of
G_h and N of that of G (both in these coordinates, so N^T M^-1-weighted G^T = 0)

    q~ = N_h eta                      eta   of the constraints between places
    v~ = N zeta - G^+ B dq            zeta  of all constraints; G^+ the pseudoinverse
    eta'  = N_h^T (v~ + T~ q~)
    zeta' = N^T (K~ q~ + D~ v~ + S~ ds - [w]~ v~)
    y = (eta, zeta, ds)

Multipliers drop out, since N^T G^T = 0, and redundant constraints do no harm. Coordinates are seen
in axes that rotate with the angular velocity w, in which a steady motion has constant coefficients:
T is then W x - w x.
"""

from typing import NamedTuple

import numpy as np

from msahl.analysis.linearised.coefficients import Coefficients, skews
from msahl.start.redundancy import INDEPENDENT


class LinearSystem(NamedTuple):
    """y' = A y, and what the states y mean; n coordinates, m states."""

    A: np.ndarray  # (m, m)
    places: np.ndarray  # (n, m) dq = places y [m, rad]
    rates: np.ndarray  # (n, m) dv = rates y [m/s, rad/s]
    states: np.ndarray  # (s, m) auxiliary states ds
    into: np.ndarray  # (m, 2 n + s) y of (dq, dv, ds) that satisfy the constraints
    forced: np.ndarray  # (m, n) rate of y by forces and moments [N, N m]
    degrees_of_freedom: int  # of places
    rate_degrees_of_freedom: int  # of rates
    redundant: int  # constraint equations that follow from others


def null_space(G: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, d) orthonormal basis of the null space of ``G`` (c, n), and (n, c) its pseudoinverse."""
    if not len(G):
        return np.eye(G.shape[1]), np.zeros((G.shape[1], 0))
    size = np.linalg.norm(G, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    left, values, right = np.linalg.svd(G / size)
    rank = int(np.count_nonzero(values > INDEPENDENT * max(values.max(initial=0.0), 1e-300)))
    inverse = (right[:rank].T / values[:rank]) @ left[:, :rank].T
    return right[rank:].T, inverse / size.T


def linear_system(
    found: Coefficients, rate_by_place: np.ndarray, axes: np.ndarray | None = None
) -> LinearSystem:
    """Return the linearised system in minimal states; ``rate_by_place`` (c, n) is B of all
    constraints, ``axes`` (3,) the angular velocity of the axes in which it is seen [rad/s].
    """
    n, s = found.coordinate.size, found.state_rate.size
    L = np.linalg.cholesky(found.mass.toarray())
    back = np.linalg.inv(L).T  # dq = back q~
    rotation = np.kron(np.eye(n // 3), skews(np.zeros((1, 3)) if axes is None else axes[None])[0])
    G = found.constraint.toarray() @ back
    N, inverse = null_space(G)
    N_h = N if found.holonomic.all() else null_space(G[found.holonomic])[0]
    B = rate_by_place @ back
    drift = L.T @ (found.drift.toarray() - rotation) @ back
    K, D, S = (
        back.T @ found.by_place.toarray() @ back,
        back.T @ (found.by_rate.toarray()) @ back - L.T @ rotation @ back,
        back.T @ found.by_state,
    )
    d, r = N_h.shape[1], N.shape[1]
    m = d + r + s
    q, v, w = np.zeros((n, m)), np.zeros((n, m)), np.zeros((s, m))
    q[:, :d] = N_h
    v[:, :d], v[:, d : d + r] = -inverse @ (B @ N_h), N
    w[:, d + r :] = np.eye(s)
    places, rates = back @ q, back @ v
    A = np.concatenate(
        [
            N_h.T @ (v + drift @ q),
            N.T @ (K @ q + D @ v + S @ w),
            found.state_by_place @ places + found.state_by_rate @ rates + found.state_by_state @ w,
        ]
    )
    into = np.zeros((m, 2 * n + s))
    into[:d, :n], into[d : d + r, n : 2 * n] = N_h.T @ L.T, N.T @ L.T
    into[d + r :, 2 * n :] = np.eye(s)
    forced = np.zeros((m, n))
    forced[d : d + r] = N.T @ back.T
    redundant = len(G) - (n - r)
    return LinearSystem(A, places, rates, w, into, forced, d, r, redundant)


def stiffness_weight(
    found: Coefficients, system: LinearSystem, pressing: float = 0.0
) -> np.ndarray:
    """(n, d) matrix W: the stiffness along eta is a sum of terms of the size |W eta|^2.

    They may cancel each other completely, as those of a door's two hinges under its weight do. The
    forces of contacts, of which ``pressing`` is the largest [N], do so before they are in K.
    """
    rows = abs(found.by_place) @ (1.0 / found.length) / found.length
    if pressing:
        rows += pressing / float(found.length[found.rotational].max())
    of_body = np.repeat(rows.reshape(-1, 6).max(axis=1), 6)
    W: np.ndarray = (found.length * np.sqrt(of_body))[:, None] * system.places[
        :, : system.degrees_of_freedom
    ]
    return W
