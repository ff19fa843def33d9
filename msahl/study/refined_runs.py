"""Compute a reference from msahl's own runs, where an independent one would take too long."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from msahl.jit.compiled import working_clock
from msahl.model import Model, Options
from msahl.model.settings import OFF
from msahl.results.read import ResultError
from msahl.study.dynamics import Dynamics
from msahl.study.independent import Solution
from msahl.study.reference import TableReference, position_differences
from msahl.study.rounding import series_index, series_value
from msahl.study.runs import run_in_memory, with_step

SCHEME = "gauss5"
FIRST_STEPS = 50
"""Number of steps of the first run, about."""
PATIENCE = 0.1
"""Fraction of the time after which a run is given up, until one has completed."""
ENOUGH = 1e-5
"""Two runs agree if they differ by less than this fraction of the accuracy asked for."""


def refined_reference(
    model: Model, accuracy: float, seconds: float, checked: Solution | None = None
) -> TableReference:
    """Run ``SCHEME`` at ever smaller steps until two runs agree or the ``seconds`` are used up, and
    compare the last run with the available part ``checked`` of an independent solution; None:
    there is no such solution of the model, which has contacts or events.

    Raises ``ResultError`` if there are no two runs to compare.
    """
    dynamics = Dynamics(model)
    pair: list[TableReference] = []
    for found in _refined(model, dynamics, working_clock() + seconds):
        pair = [*pair[-1:], found]
        if len(pair) == 2 and _differences(*pair).max() <= ENOUGH * accuracy:
            break
    if len(pair) < 2:
        raise ResultError(
            "no reference was found within the time of the study: allow more time with --budget, "
            "or compare with a run at a small step: --reference DIR"
        )
    coarse, fine = pair
    difference = np.maximum.accumulate(_differences(coarse, fine))
    good = difference <= accuracy
    horizon = float(
        fine.times[-1] if good.all() else coarse.times[max(int(np.argmin(good)) - 1, 0)]
    )
    error = float(difference[good].max(initial=0.0))
    reason = "would take longer than the study may" if checked else "has no contacts and events"
    description = (
        f"The reference is msahl itself, because the independent integrator {reason}. It is a run "
        f"by {fine.description}. A run by {coarse.description} differs from it by up to "
        f"{error:.1e} m in position{_check(fine, checked, horizon)}"
    )
    description += "." if good.all() else f"; after t = {horizon:.4g} s they differ by more."
    return replace(fine, description=description, horizon=horizon, error=error)


def _refined(model: Model, dynamics: Dynamics, deadline: float) -> Iterator[TableReference]:
    """Yield completed runs at ever smaller steps, as long as there is time for the next one. Until
    one has completed, each is given up soon: steps that are too large converge slowly or not.
    """
    k, taken = series_index(model.simulation.t_final / FIRST_STEPS), 0.0
    patience = PATIENCE * (deadline - working_clock())
    while working_clock() + 2.5 * taken < deadline:
        dt, began = series_value(k), working_clock()
        end = min(deadline, began + patience)
        report, run = run_in_memory(
            with_step(model, dt, scheme=SCHEME),
            Options(error=OFF),
            lambda end=end: working_clock() > end,  # type: ignore[misc]
        )
        k -= 1
        if report.status == "completed":
            taken, patience = working_clock() - began, math.inf
            yield TableReference.of_run(run, f"{SCHEME} at a step size of {dt:g} s", dynamics)


def _differences(coarse: TableReference, fine: TableReference) -> np.ndarray:
    """Return the largest difference of positions [m] (m,) at the times of the coarse run; 0 at
    times that the fine run does not have.
    """
    return np.nan_to_num(position_differences(coarse.table, fine.states(coarse.times)))


def _check(fine: TableReference, checked: Solution | None, horizon: float) -> str:
    """Describe the difference from the available part of the independent solution."""
    if checked is None:
        return ""
    rows = fine.times <= min(horizon, float(checked.ends[-1]))
    if not len(checked.values) or rows.sum() < 2:
        return ""
    true = fine.dynamics.publish(checked(fine.times[rows]))
    difference = float(position_differences(fine.table[rows], true).max())
    return (
        f", and an independent solution, up to t = {fine.times[rows][-1]:.3g} s, by "
        f"{difference:.1e} m"
    )
