"""The configuration at which a model is linearised: a time, or an equilibrium."""

import numpy as np

from msahl.analysis.equilibria.begin import started
from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.search import find
from msahl.analysis.linearised.point import Point, at_time
from msahl.model import Model
from msahl.model.settings import EQUILIBRIUM
from msahl.run.options import OptionError
from msahl.start.velocities import StartError


class NoEquilibriumError(StartError):
    """No equilibrium was found."""


def _time(at: float | str) -> float:
    """Return a time at which a model can be [s]; raises ``OptionError``."""
    if isinstance(at, str) or not 0.0 <= at < np.inf:
        raise OptionError([f"at {at}: give a time in seconds, zero or more, or '{EQUILIBRIUM}'"])
    return float(at)


def point_at(model: Model, at: float | str) -> Point:
    """Return the model at the time ``at`` [s] of its run, or at rest at the ``EQUILIBRIUM``; raises
    ``StartError``, which is ``NoEquilibriumError`` where a search fails.
    """
    if at != EQUILIBRIUM:
        return at_time(started(model), _time(at))
    found = find(search_start(model), np.zeros(3))
    if found is None:
        raise NoEquilibriumError(
            "no equilibrium was found from where the deck starts; search with msahl equilibrium"
        )
    return found.place.point
