"""Why friction does not hold a model where its deck places it, in words."""

from dataclasses import replace

import numpy as np

from msahl.analysis.equilibria.static_equations import with_rates
from msahl.analysis.linearised.point import Point, settled
from msahl.start.velocities import StartError

MOST = 1e3
"""Times its friction that would be more than any surface has."""
DIGITS = 1e-4
"""Relative width of the interval in which the least friction is found."""


def none_found(start: Point, otherwise: str) -> str:
    """Return that no equilibrium was found from the ``start``, and why, or what to do
    ``otherwise``.
    """
    why = slipping(start)
    return f"no equilibrium was found: {why}" if why else f"no equilibrium was found {otherwise}"


def slipping(point: Point) -> str:
    """Return which contacts slide where a ``point`` is, at rest, and by how much their friction is
    too small; empty if none does.
    """
    names = _sliding(point, 1.0)
    if not names:
        return ""
    listed = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    if _sliding(point, MOST):
        return f"no friction holds the contacts {listed} where the deck has them"
    low, high = 1.0, MOST
    while high - low > DIGITS * low:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if _sliding(point, middle) else (low, middle)
    return (
        f"the contacts {listed} slide from where the deck has them: it takes {high:.4g} times "
        "their friction to hold them"
    )


def _sliding(point: Point, factor: float) -> list[str]:
    """Return the names of closed contacts that slide with ``factor`` times their friction."""
    group = point.system.forces.sliding
    if point.touching is None or group is None:
        return []
    more = point.system.forces._replace(sliding=group._replace(grip=factor * group.grip))
    state = with_rates(point.state)
    state = state._replace(reaction=state.reaction.copy())
    try:
        found = settled(replace(point, system=point.system._replace(forces=more)), state).touching
    except StartError:
        return []
    assert found is not None
    own = found.contacts.sliding
    slides = found.closed & (own >= 0) & ~np.isin(own, np.flatnonzero(found.sticks))
    return [found.names[k] for k in np.flatnonzero(slides).tolist()]
