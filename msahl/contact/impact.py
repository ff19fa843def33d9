"""Impact laws of contacts, one or several at once.

With the rates v = dg/dt of the gaps and the impulses L of the contacts, W = G M^-1 G^T that of the
complete mechanism, joints included:

    newton      v+ = v- + W L >= -e v-,   L >= 0,   complementary
    poisson     v_c = v- + W L_c >= 0,    L_c >= 0, complementary       (compression)
                v+ = v_c + W L_e >= 0,    L_e >= e L_c, complementary   (expansion)

With friction the impulses of each phase are in Coulomb's cone by the slip at its end
(``contact.friction``), and v, W and L have the slips behind the gaps. Where poisson would gain
energy so, or its expansion have no solution, e is reduced to where it gains none.

    stronge     of one contact, integrated in its normal impulse: while the slip s does not vanish,
                ds/dL = (W_t n - mu W_t t s/|s|), then it sticks if mu allows, or slips on where it
                is driven; the work of expansion is e^2 times that of compression

The energy that an impact takes is -sum L (v+ + v-)/2, exactly; its sum over the phases is that of
the impulse's mean.
"""

import numpy as np

from msahl.contact import friction
from msahl.contact.complementarity import NoSolution, solve
from msahl.contact.friction import Cones
from msahl.contact.stronge import impulse as of_one
from msahl.model.contacts import NEWTON, STRONGE

ROUND_OFF = 1e-13
"""Impulse, relative to the largest one of the same impact, that is none; likewise of energy."""
BISECTIONS = 40
"""Steps to the coefficients of restitution by which an impact gains no energy."""


def impulses(
    law: str, W: np.ndarray, v: np.ndarray, e: np.ndarray, cones: Cones | None = None
) -> np.ndarray:
    """Return the impulses (m,) of an impact at the rates ``v`` (m,) by the ``law``, with
    coefficients ``e`` (k,) of restitution. ``cones`` are those of friction, None without. Raises
    ``complementarity.NoSolution``.
    """
    if cones is not None:
        return _clean(_with_friction(law, W, v, e, cones))
    if law == STRONGE and np.count_nonzero(v < 0.0) > 1 and (e > 0.0).any():
        raise SeveralAtOnce
    if law == NEWTON:
        return _clean(solve(W, v + e * np.minimum(v, 0.0)))
    compression = solve(W, v)
    expansion = e * compression
    more = solve(W, v + W @ (compression + expansion))
    return _clean(compression + expansion + more)


class SeveralAtOnce(NoSolution):
    """Stronge's law is not defined for several contacts at once."""


def _with_friction(
    law: str, W: np.ndarray, v: np.ndarray, e: np.ndarray, cones: Cones
) -> np.ndarray:
    """Return what ``impulses`` does, with friction."""
    n, right = cones.normal, v.copy()
    if not (v[n] < 0.0).any():
        return np.zeros(v.size)
    if law == STRONGE:
        (k,) = hit if (hit := np.flatnonzero(v[n] < 0.0)).size == 1 and n.size == 1 else (-1,)
        if k < 0:
            raise SeveralAtOnce
        return of_one(W, v, float(e[k]), float(cones.friction[k]))
    if law == NEWTON:
        right[n] += e * np.minimum(v[n], 0.0)
        return friction.solve(W, right, cones)
    return _poisson(W, v, e, cones)


def _poisson(W: np.ndarray, v: np.ndarray, e: np.ndarray, cones: Cones) -> np.ndarray:
    """Return the impulses (m,) by Poisson's law. Where friction would make it gain energy, or its
    expansion have no solution, all coefficients of restitution are reduced to those by which it
    gains none.
    """
    compression, share = friction.solve(W, v, cones), np.array([0.0, 1.0])
    after, least = v + W @ compression, e * compression[cones.normal]

    def impulse(part: float, gained: float) -> np.ndarray | None:
        """The impulse by a ``part`` of e; None if there is none, or it gains more than that."""
        try:
            total = compression + friction.solve(W, after, cones._replace(least=part * least))
        except NoSolution:
            return None
        return total if _gain(W, v, total) <= gained * float(np.abs(total * v).sum()) else None

    best = impulse(1.0, ROUND_OFF)
    if best is not None:
        return best
    best = compression
    for _ in range(BISECTIONS):
        middle = float(share.mean())
        found = impulse(middle, 0.0)
        share[int(found is None)] = middle
        best = best if found is None else found
    return best


def _gain(W: np.ndarray, v: np.ndarray, impulse: np.ndarray) -> float:
    """Return the kinetic energy that an impulse (m,) adds at the rates ``v`` (m,)."""
    return float(impulse @ (v + 0.5 * (W @ impulse)))


def _clean(impulse: np.ndarray) -> np.ndarray:
    """Return impulses without those that are round-off of the others."""
    size = np.abs(impulse)
    return np.where(size > ROUND_OFF * size.max(initial=0.0), impulse, 0.0)
