"""The configuration at which a model is linearised: a time, or an equilibrium."""

import numpy as np

from msahl.analysis.equilibrium import solve
from msahl.analysis.point import Point, at_start, at_time
from msahl.model import Model
from msahl.start.velocities import StartError

EQUILIBRIUM = "equilibrium"
"""The word for the equilibrium that is found from where the deck starts the model."""


def point_at(model: Model, at: float | str) -> Point:
    """Return the model at the time ``at`` [s], or at the ``EQUILIBRIUM``; raises ``StartError``."""
    if at != EQUILIBRIUM:
        return at_time(model, float(at))
    point = at_start(model)
    for stable in (True, False):
        try:
            found = solve(point, np.zeros(3), stable)
        except (StartError, np.linalg.LinAlgError):
            continue
        if found.converged:
            return found.place.point
    raise StartError(
        "no equilibrium was found from where the deck starts; search with msahl equilibrium"
    )
