"""Impact laws of contacts, one or several at once.

With the rates v = dg/dt of the gaps and the impulses L of the contacts, W = G M^-1 G^T that of the
complete mechanism, joints included:

    newton      v+ = v- + W L >= -e v-,   L >= 0,   complementary
    poisson     v_c = v- + W L_c >= 0,    L_c >= 0, complementary       (compression)
                v+ = v_c + W L_e >= 0,    L_e >= e L_c, complementary   (expansion)

With friction the impulses of each phase are in Coulomb's cone by the slip at its end
(``contact.friction``), and v, W and L have the slips behind the gaps. Where poisson would gain
energy so, or its expansion have no solution, e is reduced to where it gains none.

    stronge     of one contact that is hit, integrated in its normal impulse: while the slip s does
                not vanish, ds/dL = (W_t n - mu W_t t s/|s|), then it sticks if mu allows, or slips
                on where it is driven; the work of expansion is e^2 times that of compression

Contacts that do not act on each other have impacts of their own (``independent``).

The energy that an impact takes is -sum L (v+ + v-)/2, exactly; its sum over the phases is that of
the impulse's mean.
"""

from collections.abc import Callable

import numpy as np

from msahl.contact import friction
from msahl.contact.complementarity import NoSolution, solve
from msahl.contact.cones import Cones, of_contacts, smooth
from msahl.contact.independent import groups
from msahl.contact.stronge import impulse as of_one
from msahl.model.contacts import NEWTON, STRONGE

ROUND_OFF = 1e-13
"""Impulse, relative to the largest one of the same impact, that is none; likewise of energy."""
Solve = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Returns impulses (m,) for a matrix and rates."""
BISECTIONS = 40
"""Steps to the coefficients of restitution by which an impact gains no energy."""


def impulses(
    law: str, W: np.ndarray, v: np.ndarray, e: np.ndarray, cones: Cones | None = None
) -> np.ndarray:
    """Return the impulses (m,) of an impact at the rates ``v`` (m,) by the ``law``, with
    coefficients ``e`` (k,) of restitution. ``cones`` are those of friction, None without. Raises
    ``complementarity.NoSolution``.
    """
    count, impulse = e.size, np.zeros(v.size)
    given = smooth(count) if cones is None else cones
    for k in groups(W, given.normal, given.tangent):
        used, own = of_contacts(given, k)
        part = W[np.ix_(used, used)], v[used], e[k]
        if (v[k] < 0.0).any():
            found = _smooth(law, *part) if cones is None else _with_friction(law, *part, own)
            impulse[used] = _clean(found)
    return impulse


def _smooth(law: str, W: np.ndarray, v: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Return the impulses (k,) of contacts without friction that all act on each other."""
    if law == STRONGE and e.size > 1 and (e > 0.0).any():
        return _of_the_one_hit(W, v, e, smooth(e.size))
    if law == NEWTON:
        return _by_newton(W, v, e, smooth(e.size), solve)
    compression = solve(W, v)
    expansion = e * compression
    return compression + expansion + solve(W, v + W @ (compression + expansion))


def _of_the_one_hit(W: np.ndarray, v: np.ndarray, e: np.ndarray, cones: Cones) -> np.ndarray:
    """Return the impulses (m,) by Stronge's law where one contact is hit, and none of those that
    touch besides is closed by it, neither up to the end of the compression nor of the expansion.
    """
    n = cones.normal
    hit = np.flatnonzero(v[n] < 0.0)
    if hit.size == 1:
        used, own = of_contacts(cones, hit)
        given = W[np.ix_(used, used)], v[used]
        impulse = np.zeros(v.size)
        for restitution in (0.0, float(e[hit[0]])):
            impulse[used] = _of_one(*given, restitution, float(own.friction[0]))
            after, others = v + W @ impulse, np.delete(n, hit)
            if (after[others] < -ROUND_OFF * float(np.abs(v).max())).any():
                raise SeveralAtOnce
        return impulse
    raise SeveralAtOnce


def _of_one(W: np.ndarray, v: np.ndarray, e: float, mu: float) -> np.ndarray:
    """Return the impulse of one contact by Stronge's law, which is that of all without friction."""
    return np.array([-(1.0 + e) * v[0] / W[0, 0]]) if v.size == 1 else of_one(W, v, e, mu)


class Contradictory(NoSolution):
    """Newton's law asks for speeds that contacts of the same bodies cannot all have."""


class SeveralAtOnce(NoSolution):
    """Stronge's law is not defined for several contacts at once."""


def _with_friction(
    law: str, W: np.ndarray, v: np.ndarray, e: np.ndarray, cones: Cones
) -> np.ndarray:
    """Return the impulses (m,) of contacts with friction that all act on each other."""
    if law == STRONGE:
        return _of_the_one_hit(W, v, e, cones)
    if law == NEWTON:
        return _by_newton(W, v, e, cones, lambda W, q: friction.solve(W, q, cones))
    return _poisson(W, v, e, cones)


def _by_newton(
    W: np.ndarray, v: np.ndarray, e: np.ndarray, cones: Cones, solve_with: Solve
) -> np.ndarray:
    """Return the impulses (m,) by Newton's law. Raises ``Contradictory``."""
    right = v.copy()
    right[cones.normal] += e * np.minimum(v[cones.normal], 0.0)
    try:
        return solve_with(W, right)
    except NoSolution as error:
        raise Contradictory from error


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
