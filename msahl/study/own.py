"""msahl's own runs as the reference, where an independent solution would take too long."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from msahl.jit.compiled import working_clock
from msahl.model import Model
from msahl.results.read import ResultError
from msahl.run.loop import OFF, Options
from msahl.study.dynamics import Dynamics
from msahl.study.independent import Solution
from msahl.study.reference import TableReference
from msahl.study.rounding import rung, rung_below
from msahl.study.runs import run_in_memory, with_step

SCHEME = "gauss5"
FIRST_STEPS = 50
ENOUGH = 1e-5
"""Part of the accuracy asked for at which two runs need not differ by less."""


def own_reference(
    model: Model, accuracy: float, seconds: float, checked: Solution
) -> TableReference:
    """Runs of ``SCHEME``, each at a smaller step than the one before, until two agree or the
    ``seconds`` are used up; compared with what there is of an independent solution.

    Raises ``ResultError`` if there are no two runs to compare.
    """
    dynamics = Dynamics(model)
    pair: list[TableReference] = []
    for found in _refined(model, dynamics, working_clock() + seconds):
        pair = [*pair[-1:], found]
        if len(pair) == 2 and _apart(*pair).max() <= ENOUGH * accuracy:
            break
    if len(pair) < 2:
        raise ResultError(
            "no reference within the time of the study: allow more with --budget, or compare with "
            "a run at a small step: --reference DIR"
        )
    coarse, fine = pair
    apart = np.maximum.accumulate(_apart(coarse, fine))
    good = apart <= accuracy
    horizon = float(
        fine.times[-1] if good.all() else coarse.times[max(int(np.argmin(good)) - 1, 0)]
    )
    error = float(apart[good].max(initial=0.0))
    words = (
        "The reference is msahl itself: the independent integrator would take longer than the "
        f"study may. It is a run by {fine.words}, from which a run by {coarse.words} differs by up "
        f"to {error:.1e} m in position{_check(fine, checked, horizon)}"
    )
    words += "." if good.all() else f"; after t = {horizon:.4g} s they differ by more."
    return replace(fine, words=words, horizon=horizon, error=error)


def _refined(model: Model, dynamics: Dynamics, deadline: float) -> Iterator[TableReference]:
    """Completed runs at ever smaller steps, as long as there is time for the next."""
    k, took = rung_below(model.simulation.t_final / FIRST_STEPS), 0.0
    while working_clock() + 2.5 * took < deadline:
        dt, began = rung(k), working_clock()
        report, run = run_in_memory(
            with_step(model, dt, scheme=SCHEME),
            Options(error=OFF),
            lambda: working_clock() > deadline,
        )
        took, k = working_clock() - began, k - 1
        if report.status == "completed":
            table = run.states.to_numpy()[:, 1:]
            words = f"{SCHEME} at a step of {dt:g} s"
            yield TableReference(words, run.time, table, float(run.time[-1]), 0.0, dynamics)


def _apart(coarse: TableReference, fine: TableReference) -> np.ndarray:
    """(m,) largest difference of the positions at the times of the coarse run [m]; 0 at those that
    the other does not have.
    """
    return _distance(coarse.table, fine.states(coarse.times))


def _distance(table: np.ndarray, other: np.ndarray) -> np.ndarray:
    difference = (table - other).reshape(len(table), -1, 12)[:, :, :3]
    return np.nan_to_num(np.sqrt((difference**2).sum(axis=2)).max(axis=1))


def _check(fine: TableReference, checked: Solution, horizon: float) -> str:
    """What is to be said of the independent solution as far as it came."""
    rows = fine.times <= min(horizon, float(checked.ends[-1]))
    if not len(checked.values) or rows.sum() < 2:
        return ""
    true = fine.dynamics.publish(checked(fine.times[rows]))
    apart = float(_distance(fine.table[rows], true).max())
    return (
        f", and from an independent solution, up to t = {fine.times[rows][-1]:.3g} s, by "
        f"{apart:.1e} m"
    )
