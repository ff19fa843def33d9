"""Impact laws of contacts without friction, one or several at once.

With the rates v = dg/dt of the gaps and the impulses L of the contacts, W = G M^-1 G^T that of the
complete mechanism, joints included:

    newton      v+ = v- + W L >= -e v-,   L >= 0,   complementary
    poisson     v_c = v- + W L_c >= 0,    L_c >= 0, complementary       (compression)
                v+ = v_c + W L_e >= 0,    L_e >= e L_c, complementary   (expansion)

The energy that an impact takes is -sum L (v+ + v-)/2, exactly.
"""

import numpy as np

from msahl.contact.complementarity import solve
from msahl.model.contacts import NEWTON

ROUND_OFF = 1e-13
"""Impulse, relative to the largest one of the same impact, that is none."""


def impulses(law: str, W: np.ndarray, v: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Return the impulses (c,) of an impact at the rates ``v`` (c,) by the ``law``, with
    coefficients ``e`` of restitution. Raises ``complementarity.NoSolution``.
    """
    if law == NEWTON:
        return _clean(solve(W, v + e * np.minimum(v, 0.0)))
    compression = solve(W, v)
    expansion = e * compression
    more = solve(W, v + W @ (compression + expansion))
    return _clean(compression + expansion + more)


def _clean(impulse: np.ndarray) -> np.ndarray:
    """Return impulses without those that are round-off of the others."""
    return np.where(impulse > ROUND_OFF * impulse.max(initial=0.0), impulse, 0.0)
