"""Runs kept in memory, and what they took.

Compiling belongs to nobody's run: each scheme takes a few steps first. What a run takes is the
least of its repeats, as all that disturbs it only adds. Repeats of a list of cases are interleaved,
so that a busy moment of the machine falls on all of them alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from msahl.model import Model, resolve
from msahl.model.scheme import AUTO, split
from msahl.results.read import Run
from msahl.run.loop import ESTIMATE, OFF, Options, Report, run
from msahl.study.rounding import round_down
from msahl.system.names import reaction_columns, state_columns, work_columns

WARM_STEPS = 5
AUTO_ROWS = 100
"""Rows, at least, of runs that choose their steps."""
COLUMNS = (state_columns, reaction_columns, work_columns)


class Memory:
    """A sink that keeps the rows."""

    def __init__(self) -> None:
        self.parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def write(
        self, states: np.ndarray, reactions: np.ndarray, work: np.ndarray, errors: np.ndarray
    ) -> None:
        """Append rows."""
        self.parts.append((states, reactions, work))

    def restart(self) -> None:
        """Drop all rows."""
        self.parts.clear()

    def tables(self) -> list[np.ndarray]:
        """States, reactions and work, the time in the first column of each."""
        return [np.concatenate(part) for part in zip(*self.parts, strict=True)]


class Nowhere:
    """A sink for runs of which only the time counts."""

    def write(
        self, states: np.ndarray, reactions: np.ndarray, work: np.ndarray, errors: np.ndarray
    ) -> None:
        """Drop rows."""

    def restart(self) -> None:
        """There are none."""


class Case(NamedTuple):
    """A scheme and the ``size`` of its steps [s], or their tolerance [m] if it chooses them."""

    scheme: str
    size: float

    @property
    def chooses(self) -> bool:
        """Whether the steps follow from a tolerance."""
        return self.scheme == AUTO


@dataclass(frozen=True)
class Trial:
    """A run and what it took: ``seconds`` of the loop, the least of its repeats."""

    case: Case
    seconds: float
    report: Report
    run: Run

    @property
    def scheme(self) -> str:
        """Name of the scheme."""
        return self.case.scheme

    @property
    def dt(self) -> float:
        """Size of the steps [s], or their mean if the run has chosen them."""
        if not self.case.chooses:
            return self.case.size
        return self.report.time / max(1, self.report.steps)

    @property
    def completed(self) -> bool:
        """Whether it came to the end."""
        return self.report.status == "completed"


def with_step(
    model: Model, dt: float, t_final: float | None = None, scheme: str | None = None
) -> Model:
    """``model`` with another step, end and scheme (one of ``schemes.choices``), all steps of this
    size.
    """
    given = model.simulation
    end = given.t_final if t_final is None else t_final
    name, degree = split(scheme) if scheme else (resolve(model.simulation).family, None)
    other = replace(given, dt=dt, t_final=end, scheme=name, degree=degree or given.degree)
    return replace(
        model, simulation=replace(other, tolerance=None, local_tolerance=None, output_interval=None)
    )


def variant(model: Model, case: Case) -> Model:
    """``model`` as a ``case`` runs it."""
    if not case.chooses:
        return with_step(model, case.size, scheme=case.scheme)
    interval = model.simulation.output_interval or round_down(model.simulation.t_final / AUTO_ROWS)
    chosen = with_step(model, interval, scheme=case.scheme).simulation
    return replace(model, simulation=replace(chosen, tolerance=case.size, output_interval=interval))


def run_in_memory(
    model: Model, options: Options, stopped: Callable[[], bool] = lambda: False
) -> tuple[Report, Run]:
    """Run ``model``; what happened, and its rows as they would be read back."""
    memory = Memory()
    report = run(model, options, memory, stopped=stopped)
    frames = [
        pd.DataFrame(table, columns=columns(model))
        for table, columns in zip(memory.tables(), COLUMNS, strict=True)
    ]
    states, reactions, work = frames
    kept = Run(
        folder=Path(),
        model=model,
        info={"options": {"every": options.every}, "status": report.status},
        states=states,
        reactions=reactions if len(reactions.columns) > 1 else None,
        work=work if len(work.columns) > 1 else None,
        partial=report.status != "completed",
    )
    return report, kept


def seconds_of(case: Case, report: Report) -> float:
    """Seconds of the loop; of a scheme that chooses its steps with those of the companion runs by
    which it judges them.
    """
    return report.seconds["loop"] + (report.seconds.get("companion", 0.0) if case.chooses else 0.0)


def timing(case: Case) -> Options:
    """The options of a run of which the time counts: no estimate where none is needed."""
    return Options() if case.chooses else Options(error=OFF)


def run_seconds(model: Model, case: Case, stopped: Callable[[], bool]) -> float | None:
    """What one more run of a ``case`` takes [s]; None if it was stopped."""
    report = run(variant(model, case), timing(case), Nowhere(), stopped=stopped)
    return None if report.status == "interrupted" else seconds_of(case, report)


def estimated_error(model: Model, case: Case) -> float | None:
    """The error in position [m] that a run of a ``case`` estimates of itself."""
    report = run(variant(model, case), Options(error=ESTIMATE), Nowhere())
    if report.error is None or not report.error["complete"]:
        return None
    return float(report.error["position"])


def warm_up(model: Model, case: Case) -> None:
    """Take a few steps, so that no later run compiles or loads what has been compiled."""
    first = variant(model, case)
    few = WARM_STEPS * first.simulation.dt
    end = min(few, model.simulation.t_final)
    ended = replace(first, simulation=replace(first.simulation, t_final=end))
    run(ended, timing(case), Nowhere())


def try_all(
    model: Model,
    cases: Sequence[tuple[str, float]],
    repeats: int,
    progress: Callable[[Case], Any] = lambda case: None,
    stopped: Callable[[], bool] = lambda: False,
) -> list[Trial]:
    """A trial of every case (scheme, dt); ``progress`` is told of each run that has ended.

    Once ``stopped``, those that had run, however often, are the trials.
    """
    wanted = [Case(*case) for case in cases]
    for scheme in sorted({case.scheme for case in wanted}):
        warm_up(model, next(case for case in wanted if case.scheme == scheme))
    seconds: dict[Case, float] = {}
    kept: dict[Case, tuple[Report, Run]] = {}
    for repeat, case in product(range(repeats), wanted):
        if stopped():  # a short run does not ask
            break
        if repeat == 0:
            report, rows = run_in_memory(variant(model, case), timing(case), stopped)
            if report.status == "interrupted":
                break
            kept[case], seconds[case] = (report, rows), seconds_of(case, report)
        else:
            again = run_seconds(model, case, stopped)
            if again is None:
                break
            seconds[case] = min(seconds[case], again)
        progress(case)
    return [Trial(case, seconds[case], *kept[case]) for case in wanted if case in kept]
