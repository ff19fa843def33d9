"""Whether an equilibrium is stable: by eigenvalues, of large models by counting.

At rest, with a symmetric stiffness -K, the matrix

    [ -K + s^2 M   G^T ]
    [  G            0  ]             of c constraint equations

has c negative eigenvalues, and one more for each motion that grows faster than s without damping;
damping slows such a motion, but does not stop it. Signs of the pivots of a symmetric factorisation
count them (Sylvester). Rotating models, and loads that follow bodies, have other matrices.
"""

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from msahl.analysis.equilibria.static_equations import Statics
from msahl.analysis.equilibria.static_matrix import SYMMETRIC, stiffness
from msahl.analysis.linearised.coefficients import Coefficients, coefficients, holonomic
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.steady import stiffest
from msahl.analysis.modes.solution import DENSE, is_large, modes

if TYPE_CHECKING:
    from scipy.sparse import csr_array

SLOW = (1e-3, 1e-2, 1e-1)
"""Growth over sqrt(g/L) of a large model below which a motion counts as one that does not grow; the
least at which round-off does not hide whether light bodies grow.
"""
REDUNDANT = 1e-6
"""On the diagonal of the multipliers, over the largest compliance."""
STIFF = 1e-12
"""Least stiffness, over that of the springs for constraints, that is not round-off."""
PENALTY = 10.0
"""Stiffness of these springs, over the largest one of the model."""
UNDAMPED = "stable, without damping of all motions"
FOUND = 1e-7
"""Relative width of the interval in which the fastest growth is found."""


def stability(point: Point, is_flat: bool = False) -> str:
    """Return whether an equilibrium is stable, by the real parts of its eigenvalues or, of a large
    model, by the number of motions that grow; ``is_flat`` if some directions have no stiffness.
    """
    if is_large(point):
        return _by_counting(point)
    if point.model.beams and is_stiff(point):
        return UNDAMPED
    found = modes(point, method=DENSE)
    if not found.degrees_of_freedom:
        return "stable, nothing can move"
    growth = found.value.real
    unstable = growth > np.maximum(found.error, 1e-9 * np.abs(found.value).max(initial=0.0))
    if unstable.any():
        return f"unstable, fastest growth {growth.max():.6g} 1/s"
    damped = found.value[found.zeros :]
    if damped.size and np.all(damped.real < -found.error[found.zeros :]):
        if is_flat or found.zeros:
            return "stable, all motions but those without stiffness are damped"
        return "stable, all motions are damped"
    return UNDAMPED if damped.size else "neither stable nor unstable"


@lru_cache(maxsize=8)
def is_stiff(point: Point) -> bool:
    """Return whether a model at rest, without damping and forces that follow bodies, has a positive
    stiffness in all directions that its constraints leave: no eigenvalues are needed to know that
    it is stable.
    """
    statics = Statics(point.system, point.state)
    now = statics.balance(point.state)
    if point.state.v.any() or point.state.auxiliary.size or statics.is_damped():
        return False
    if not holonomic(point.system).all():
        return False
    K, G = stiffness(now, statics.system)
    largest = float(np.abs(K).max(initial=0.0))
    if not np.abs(K - K.T).max(initial=0.0) <= SYMMETRIC * largest:
        return False
    # With the constraints as springs it is at most as stiff as without motions that violate them.
    G = G / np.maximum(np.sqrt((G * G).sum(axis=1, keepdims=True)), np.finfo(float).tiny)
    K = K / (PENALTY * largest) + G.T @ G - STIFF * np.eye(len(K))
    try:
        np.linalg.cholesky(0.5 * (K + K.T))
    except np.linalg.LinAlgError:
        return False
    return True


def is_stable(point: Point) -> bool:
    """Return whether an equilibrium is known to be stable, by counting where that is possible."""
    if point.model.beams and not is_large(point) and is_stiff(point):
        return True
    found = coefficients(point.system, point.state)
    _, number = _slowest(point, found)
    return stability(point).startswith("stable") if number is None else number == 0


def _by_counting(point: Point) -> str:
    found = coefficients(point.system, point.state)
    slow, number = _slowest(point, found)
    if number is None:
        return "stability not examined (more than 100 bodies; motions that grow cannot be counted)"
    if number == 0:
        return f"stable, no motion grows faster than {slow:.2g} 1/s"
    low, high = slow, 2.0 * slow
    while growing(found, high):
        low, high = high, 2.0 * high
    while high - low > FOUND * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if growing(found, middle) else (low, middle)
    many = "direction" if number == 1 else "directions"
    return f"unstable in {number} {many}, fastest growth without damping {high:.6g} 1/s"


def _slowest(point: Point, found: Coefficients) -> tuple[float, int | None]:
    """The least growth [1/s] at which motions that grow faster can be counted, and their number."""
    rate, number = 0.0, None
    for slow in SLOW:
        rate = slow * _swing_rate(point, found)
        number = growing(found, rate)
        if number is not None:
            break
    return rate, number


def _swing_rate(point: Point, found: Coefficients) -> float:
    """sqrt(g/L) [1/s], or what comes nearest to it without gravity."""
    x = point.state.x
    size = max(float(np.linalg.norm(np.ptp(x, axis=0))), float(found.length.max()))
    g = float(np.linalg.norm(point.model.gravity))
    mass = float(np.mean(found.mass.diagonal()[~found.rotational]))
    return float(np.sqrt((g or stiffest(found) / mass) / size))


def growing(found: Coefficients, rate: float) -> int | None:
    """Return the number of motions that grow faster than ``rate`` [1/s] without damping; None if
    that cannot be counted.
    """
    from scipy.sparse import block_array, diags_array
    from scipy.sparse.linalg import splu

    inverse = diags_array(1.0 / found.length)
    K = inverse @ found.by_place @ inverse
    G = found.constraint @ inverse
    asymmetry = abs(K - K.T).max() if K.nnz else 0.0
    if found.velocity.any() or asymmetry > SYMMETRIC * abs(K).max():
        return None
    if found.state_rate.size or not found.holonomic.all():
        return None
    S = rate**2 * (inverse @ found.mass @ inverse) - 0.5 * (K + K.T)
    c = G.shape[0]
    G = _unit_rows(G)
    scale = float(abs(S).max())
    blocks = [[S / scale, G.T], [G, -REDUNDANT * diags_array(np.ones(c))]] if c else [[S / scale]]
    factors = splu(
        block_array(blocks).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    if not np.array_equal(factors.perm_r, factors.perm_c):
        return None
    number = int(np.count_nonzero(factors.U.diagonal() < 0.0)) - c
    return number if number >= 0 else None


def _unit_rows(G: "csr_array") -> "csr_array":
    from scipy.sparse import diags_array

    size = np.sqrt(np.asarray((G * G).sum(axis=1)).reshape(-1))
    size[size == 0.0] = 1.0
    return (diags_array(1.0 / size) @ G).tocsr()
