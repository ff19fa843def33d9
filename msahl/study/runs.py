"""Make and time the runs of a study, with results in memory.

Compilation is not part of a run's time: each scheme takes a few steps first. Nor is the time of
other programs. The time of a run is the least of its repeats, because all disturbances add to it.
Repeats of a list of cases are interleaved, so that a busy moment of the machine disturbs all of
them alike.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from msahl.jit.compiled import working_clock
from msahl.model import Model, Options, resolve
from msahl.model.scheme import AUTO, split
from msahl.model.settings import ESTIMATE, OFF
from msahl.records import record
from msahl.results.read import Run
from msahl.run.loop import Hooks, run
from msahl.run.report import Report
from msahl.run.tables import COLUMNS, REACTIONS, STATES, WORK, MemorySink
from msahl.study.rounding import round_down

WARM_STEPS = 5
"""Number of steps of the first run of a scheme, which compiles."""
COARSE_CLOCK = 100.0 * time.get_clock_info("thread_time").resolution
"""Seconds of which the clock of computing, coarse in some systems, shows a hundredth."""
AUTO_OUTPUTS = 100
"""Least number of output times of runs that choose their steps."""


class Case(NamedTuple):
    """A scheme and the ``size`` of its steps [s], or the tolerance [m] if it chooses its steps."""

    scheme: str
    size: float

    @property
    def chooses_steps(self) -> bool:
        """Return whether the step sizes follow from a tolerance."""
        return self.scheme == AUTO


@record(slots=False)
class Trial:
    """A run and its time: ``seconds`` of the time loop, the least of its repeats."""

    case: Case
    seconds: float
    report: Report
    run: Run

    @property
    def scheme(self) -> str:
        """Return the name of the scheme."""
        return self.case.scheme

    @property
    def dt(self) -> float:
        """Return the step size [s], or its mean if the run has chosen its steps."""
        if not self.case.chooses_steps:
            return self.case.size
        return self.report.time / max(1, self.report.steps)

    @property
    def completed(self) -> bool:
        """Return whether the run reached its end time."""
        return self.report.status == "completed"


def with_step(
    model: Model, dt: float, t_final: float | None = None, scheme: str | None = None
) -> Model:
    """Return ``model`` with another step size, end time and scheme (see ``model.scheme.choices``).

    All steps have this size: tolerances and output interval are removed.
    """
    given = model.simulation
    end = given.t_final if t_final is None else t_final
    name, degree = split(scheme) if scheme else (resolve(model.simulation).family, None)
    other = replace(given, dt=dt, t_final=end, scheme=name, degree=degree or given.degree)
    return replace(
        model, simulation=replace(other, tolerance=None, local_tolerance=None, output_interval=None)
    )


def with_case(model: Model, case: Case) -> Model:
    """Return ``model`` with the scheme and step size or tolerance of a ``case``."""
    if not case.chooses_steps:
        return with_step(model, case.size, scheme=case.scheme)
    interval = model.simulation.output_interval or round_down(
        model.simulation.t_final / AUTO_OUTPUTS
    )
    chosen = with_step(model, interval, scheme=case.scheme).simulation
    return replace(model, simulation=replace(chosen, tolerance=case.size, output_interval=interval))


def run_in_memory(
    model: Model, options: Options, stopped: Callable[[], bool] = lambda: False
) -> tuple[Report, Run]:
    """Run ``model``; return its report, and its results as if they were read from files."""
    sink = MemorySink()
    report = _timed_run(model, options, sink, stopped)
    states, reactions, work = (
        pd.DataFrame(sink.table(name), columns=COLUMNS[name](model))
        for name in (STATES, REACTIONS, WORK)
    )
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


def _timed_run(
    model: Model, options: Options, sink: MemorySink, stopped: Callable[[], bool]
) -> Report:
    """Run ``model``; return its report, whose seconds are those that it computed: without the time
    in which other programs had the processor.
    """
    began, computed = time.perf_counter(), working_clock()
    report = run(model, options, sink, Hooks(stopped=stopped), checked=True)
    elapsed, computed = time.perf_counter() - began, working_clock() - computed
    if elapsed > COARSE_CLOCK:
        share = min(1.0, computed / elapsed)
        report.seconds = {phase: share * seconds for phase, seconds in report.seconds.items()}
    return report


def seconds_of(case: Case, report: Report) -> float:
    """Return the seconds of the time loop. For a scheme that chooses its steps they include those
    of the companion runs, which its error estimate needs.
    """
    companion = report.seconds.get("companion", 0.0) if case.chooses_steps else 0.0
    return report.seconds["loop"] + companion


def timing_options(case: Case) -> Options:
    """Return the options of a run that is timed: without an error estimate if it needs none."""
    return Options() if case.chooses_steps else Options(error=OFF)


def run_seconds(model: Model, case: Case, stopped: Callable[[], bool]) -> float | None:
    """Run a ``case`` and return its seconds; None if it was stopped."""
    other, sink = with_case(model, case), MemorySink(only=())
    report = _timed_run(other, timing_options(case), sink, stopped)
    return None if report.status == "interrupted" else seconds_of(case, report)


def estimated_error(model: Model, case: Case) -> float | None:
    """Run a ``case`` and return the position error [m] that it estimates; None if it cannot."""
    report = run(with_case(model, case), Options(error=ESTIMATE), MemorySink(only=()), checked=True)
    if report.error is None or not report.error["complete"]:
        return None
    return float(report.error["position"])


def warm_up(model: Model, case: Case) -> None:
    """Take a few steps, so that no later run compiles kernels or loads compiled ones."""
    first = with_case(model, case)
    few = WARM_STEPS * first.simulation.dt
    end = min(few, model.simulation.t_final)
    ended = replace(first, simulation=replace(first.simulation, t_final=end))
    run(ended, timing_options(case), MemorySink(only=()), checked=True)


def run_trials(
    model: Model,
    cases: Sequence[tuple[str, float]],
    repeats: int,
    progress: Callable[[Case], Any] = lambda case: None,
    stopped: Callable[[], bool] = lambda: False,
) -> list[Trial]:
    """Run every case (scheme, dt) ``repeats`` times; ``progress`` is called after each run.

    If the study is ``stopped``, return the trials that ran at least once.
    """
    wanted = [Case(*case) for case in cases]
    for scheme in sorted({case.scheme for case in wanted}):
        warm_up(model, next(case for case in wanted if case.scheme == scheme))
    seconds: dict[Case, float] = {}
    kept: dict[Case, tuple[Report, Run]] = {}
    for repeat, case in product(range(repeats), wanted):
        if stopped():  # a short run does not ask this
            break
        if repeat == 0:
            report, results = run_in_memory(with_case(model, case), timing_options(case), stopped)
            if report.status == "interrupted":
                break
            kept[case], seconds[case] = (report, results), seconds_of(case, report)
        else:
            again = run_seconds(model, case, stopped)
            if again is None:
                break
            seconds[case] = min(seconds[case], again)
        progress(case)
    return [Trial(case, seconds[case], *kept[case]) for case in wanted if case in kept]
