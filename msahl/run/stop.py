"""Ends a run where a condition of the motion begins to hold: ``<stop>`` and ``--stop-when``.

The margin of the conditions (``expressions.conditions``) is an event of the steps (``events``). If
it is seen in a chunk of steps, the run goes back to the start of the chunk and takes the steps
before that one again. From there the time is sought at which the margin is zero at the end of a
shorter step. So the last row is that of an ordinary step, as accurate as the others, and a run that
is given this time as its end has the same rows.
"""

import math
from collections.abc import Callable, Sequence

from msahl.events.search import Event, NoStep, time_of_zero
from msahl.model import Model
from msahl.run.subsystem import SubsystemIntegrator
from msahl.system.diagnostics import STOP


def fulfilled_at_start(integrators: Sequence[SubsystemIntegrator]) -> bool:
    """Whether a condition holds in the first row of the monitors."""
    return any(of.workspace.monitor.rows[0, STOP] > 0.0 for of in integrators)


def time_of_stop(margin: Callable[[float], float], event: Event, begin: float) -> float | None:
    """Return the time [s] at which ``margin``, a function of the time, becomes zero after
    ``begin``; None if it is not positive where the dense output says that it is.
    """
    if margin(event.after) <= 0.0:
        return None
    return time_of_zero(margin, event.guess, event.rate, begin, event.after)


def margin_after(
    integrators: Sequence[SubsystemIntegrator],
    approach: Callable[[SubsystemIntegrator, float], int],
    t: float,
) -> float:
    """Return the largest margin after the steps up to ``t`` [s]; raise ``NoStep`` if one of them
    cannot be solved. ``approach`` takes these steps and returns the row of the last, or -1.
    """
    largest = -math.inf
    for integrator in integrators:
        if integrator.model.stops:
            row = approach(integrator, t)
            if row < 0:
                raise NoStep
            largest = max(largest, float(integrator.workspace.monitor.rows[row, STOP]))
    return largest


def words_of(model: Model) -> str:
    """Return the conditions of a model, as the user wrote them."""
    return " or ".join(stop.condition for stop in model.stops)
