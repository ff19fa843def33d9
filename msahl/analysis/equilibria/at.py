"""The configuration at which a model is linearised: a time, or an equilibrium."""

import numpy as np

from msahl.analysis.equilibria.begin import NoEquilibriumError, started
from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.search import find
from msahl.analysis.linearised.point import Point, at_time
from msahl.model import Model
from msahl.model.settings import EQUILIBRIUM


def point_at(model: Model, at: float | str) -> Point:
    """Return the model at the time ``at`` [s] of its run, or at rest at the ``EQUILIBRIUM``; raises
    ``StartError``, which is ``NoEquilibriumError`` where a search fails.
    """
    if at != EQUILIBRIUM:
        return at_time(started(model), float(at))
    found = find(search_start(model), np.zeros(3))
    if found is None:
        raise NoEquilibriumError(
            "no equilibrium was found from where the deck starts; search with msahl equilibrium"
        )
    return found.place.point
