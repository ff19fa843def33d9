"""Ends a run where a condition of the motion begins to hold: ``<stop>`` and ``--stop-when``.

The margin of the conditions (``expressions.conditions``) is recorded at the end of every accepted
step. If it became positive within a chunk of steps, the run goes back to the start of the chunk and
takes the steps before that one again. From there the time is sought at which the margin is zero at
the end of a shorter step. So the last row is that of an ordinary step, as accurate as the others,
and a run that is given this time as its end has the same rows.

A condition that holds between the ends of two steps only is not seen.
"""

import math
from collections.abc import Callable, Sequence

from msahl.model import Model
from msahl.run.subsystem import SubsystemIntegrator
from msahl.system.diagnostics import STOP


class NoStep(Exception):  # noqa: N818 - an outcome of the search
    """A step to a time that was tried could not be solved."""


def first_fulfilled(integrators: Sequence[SubsystemIntegrator], steps: int) -> int | None:
    """Return the first of the ``steps`` of a chunk after which a condition holds, from 0."""
    found = [
        int(held.argmax())
        for held in (
            integrator.workspace.monitor.rows[:steps, STOP] > 0.0 for integrator in integrators
        )
        if held.any()
    ]
    return min(found, default=None)


def time_of_stop(margin: Callable[[float], float], begin: float, end: float) -> float:
    """Return the time [s] at which ``margin``, a function of the time, becomes zero: it is negative
    at ``begin`` and positive at ``end``, up to the error of a step of another size.
    """
    # Imported by runs that are stopped only: it takes a third of a second.
    from scipy.optimize import brentq

    last = margin(end)
    if not last > 0.0:
        return end

    def function(t: float) -> float:
        return margin(t) if begin < t < end else (last if t == end else -last)

    return float(brentq(function, begin, end, xtol=4e-16 * end, rtol=1e-15))


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
