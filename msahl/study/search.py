"""Search for runs that show the error and time of each scheme, within a given time.

The runs of a scheme make a curve. Their step sizes (tolerances, if the scheme chooses its steps)
follow the series 1, 2, 5, 10, ... A curve starts at a step size that is large compared with the
fastest rotation. It is continued with larger steps until the error exceeds ``COARSE``, and with
smaller ones until the error is below ``FINE``, no longer falls, or a run would take too long. Of
all curves the fastest runs are made first.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from msahl.jit.compiled import STOPWATCH, working_clock
from msahl.model.scheme import AUTO, AUTO_FAMILY, COLLOCATION, DEGREE, order_of
from msahl.records import record
from msahl.results.read import Run
from msahl.run.report import Report
from msahl.study.dynamics import Dynamics
from msahl.study.errors import METRIC_OF, compute_errors, compute_state_errors
from msahl.study.plan import Plan, StudyRun
from msahl.study.reference import Reference
from msahl.study.rounding import MANTISSAS, next_round, round_down, series_index, series_value
from msahl.study.runs import (
    Case,
    Trial,
    estimated_error,
    run_in_memory,
    run_seconds,
    seconds_of,
    timing_options,
    warm_up,
    with_case,
)

COARSE, FINE = 1e-2, 1e-10
"""Largest and smallest error of a curve, where it can reach them, in the metric's SI unit."""
FEWEST = 4
"""Least number of steps of a run."""
MOST_ITERATIONS = 6.0
"""Mean number of iterations per step above which no larger step is tried, if the run is not short:
solvers differ in how many they take."""
LARGE_ROTATION = 1.0
"""Rotation per step [rad] at which a curve starts."""
FIRST_TOLERANCE = -4
"""Power of ten [m] at which the curve of a scheme that chooses its steps starts."""
FINEST_TOLERANCE = 1e-12
"""Tolerance [m] at which such a curve ends."""
FALLS = 0.7
"""Ratio of errors below which a smaller step reduces the error; at order 1 it is at most 1/2."""
SURE = 1e-5
"""If an error above this one [SI] does not fall, the step is too large: it is no rounding error."""
LONGEST = 0.1
"""Fraction of the budget that a single run may take once the target is met."""
SHORT = 0.02
"""Time loops of fewer seconds are repeated at once, because a short time is easily disturbed."""
PATIENCE = 0.5
"""A run is given up after these seconds and five times its expected time."""
OVERHEAD = 0.03
"""Seconds of a run beside its time loop: building the system, computing the errors."""
CANDIDATES, TRIES, ROUNDS = 3, 4, 5
"""Number of schemes that are refined near the target, of runs for each, and of timings of each in
the last comparison."""
MARGIN = 0.9
"""Fraction of the target at which an interpolated step size aims: interpolation is not exact."""


@dataclass
class Curve:
    """Runs of one scheme by their index in the series of step sizes."""

    scheme: str
    first: int
    runs: dict[int, StudyRun] = field(default_factory=dict)
    coarsest: bool = False
    ended: str = ""

    def case(self, k: int) -> Case:
        """Return the case of index ``k`` of the series."""
        return Case(self.scheme, float(f"1e{k}") if self.scheme == AUTO else series_value(k))


@record(slots=False)
class Observer:
    """Callbacks of a study: ``stopped`` returns whether the user has stopped it, ``report`` takes a
    line on a finished curve, ``progress`` the name of the last run.
    """

    stopped: Callable[[], bool]
    report: Callable[[str], Any]
    progress: Callable[[str], Any]


class Search:
    """The search of one study: it has made the ``runs`` so far. Until it is changed, all of the
    time left may be used; ``fraction`` limits it.
    """

    def __init__(
        self,
        plan: Plan,
        reference: Reference,
        dynamics: Dynamics,
        until: float,
        observer: Observer,
    ) -> None:
        self.plan, self.reference, self.dynamics = plan, reference, dynamics
        self.until, self.observer = until, observer
        self.fraction, self.began = 1.0, working_clock()
        self.runs: list[StudyRun] = []
        self.warm: set[str] = set()
        first = series_index(self._first_step())
        self.curves = [
            Curve(scheme, FIRST_TOLERANCE if scheme == AUTO else first) for scheme in plan.studied
        ]

    @property
    def left(self) -> float:
        """Return the seconds left of the present fraction of the time."""
        return self.began + self.fraction * (self.until - self.began) - working_clock()

    def _out(self) -> bool:
        return self.observer.stopped() or self.left <= 0.0

    def _first_step(self) -> float:
        """Return a step size [s] in which the fastest body rotates by ``LARGE_ROTATION``."""
        end = self.plan.model.simulation.t_final
        times = np.linspace(0.0, min(end, self.reference.horizon), 200)
        spins = self.reference.states(times).reshape(len(times), -1, 4, 3)[:, :, 3]
        fastest = float(np.nan_to_num(np.sqrt((spins**2).sum(axis=2))).max(initial=0.0))
        return min(end / 10.0, LARGE_ROTATION / fastest if fastest > 0.0 else math.inf)

    def explore(self) -> None:
        """Make the runs of all curves, as far as the time allows."""
        while not self._out():
            next_of = [(curve, self._next(curve)) for curve in self.curves]
            waiting = [(self._seconds(c, k), c, k) for c, k in next_of if k is not None]
            if not waiting:
                break
            seconds, curve, k = min(waiting, key=lambda entry: _urgency(entry[0], entry[1].scheme))
            if seconds > self._allowed():
                self._end(curve, "a finer run would take too long")
                continue
            run = self.run(curve.case(k), PATIENCE + 5.0 * seconds)
            if run is None:
                self._give_up(curve, k)
            else:
                curve.runs[k] = run
        for curve in self.curves:
            if not curve.ended:
                self._end(curve, "the time of the study was used up")

    def _give_up(self, curve: Curve, k: int) -> None:
        """Continue the search after a run that has taken too long. Where it was the first of its
        curve, steps are too large for it, and no other curve begins at so large ones.
        """
        if curve.runs and k < min(curve.runs):
            self._end(curve, "a finer run would take too long")
        elif curve.runs:
            curve.coarsest = True
        else:
            curve.first, curve.coarsest = k - 1, True
            if curve.scheme != AUTO:
                for other in (c for c in self.curves if not c.runs and c.scheme != AUTO):
                    other.first = min(other.first, k - 1)

    def _allowed(self) -> float:
        """Return the seconds that one run may take."""
        met = any(run.meets(self.plan.metric, self.plan.target) for run in self.runs)
        return min(self.left, LONGEST * self.plan.budget) if met else self.left

    def _next(self, curve: Curve) -> int | None:
        """Return the index of the run that would continue a curve; None at its end."""
        if curve.ended:
            return None
        if not curve.runs:
            return curve.first
        errors = {k: self._error(run) for k, run in curve.runs.items()}
        top, bottom = max(errors), min(errors)
        if not curve.coarsest:
            if errors[top] < COARSE and self._may_grow(curve.runs[top], curve.case(top + 1)):
                return top + 1
            curve.coarsest = True
        floor = max(FINE, 3.0 * self.reference.error)
        chooses = curve.scheme == AUTO
        if errors[bottom] <= floor or (chooses and curve.case(bottom).size <= FINEST_TOLERANCE):
            self._end(curve, "")
        # Neighbouring tolerances may lead to the same steps.
        elif not chooses and self._is_flat(errors[bottom], errors.get(bottom + 1, math.inf)):
            self._end(curve, "rounding error")
        return None if curve.ended else bottom - 1

    def _error(self, run: StudyRun) -> float:
        """Return the error of a run, infinite if it was not completed."""
        error = run.largest(self.plan.metric)
        return error if run.trial.completed and error is not None else math.inf

    @staticmethod
    def _is_flat(fine: float, coarse: float) -> bool:
        return FALLS * coarse < fine < SURE

    def _may_grow(self, run: StudyRun, larger: Case) -> bool:
        """Return whether a run at larger steps than those of ``run`` is worth its time."""
        if larger.chooses_steps:
            return larger.size <= 1.0
        if FEWEST * larger.size > self.plan.model.simulation.t_final:
            return False
        # If steps converge badly, a run at larger ones takes many seconds, unless it is short.
        report = run.trial.report
        quick = run.trial.seconds < SHORT or report.iterations <= MOST_ITERATIONS * report.steps
        return quick and not report.subdivisions

    def _end(self, curve: Curve, why: str) -> None:
        """End a curve and report it."""
        curve.ended = why or "complete"
        errors = [e for run in curve.runs.values() if (e := self._error(run)) < math.inf]
        metric = METRIC_OF[self.plan.metric]
        unit = "" if metric.unit == "1" else f" {metric.unit}"
        extent = (
            f"{metric.name} errors {max(errors):.1e} to {min(errors):.1e}{unit}"
            if errors
            else "no run completed"
        )
        runs = f"{len(curve.runs)} runs" if len(curve.runs) != 1 else "1 run"
        self.observer.report(f"{curve.scheme}: {runs}, {extent}" + (f" ({why})" if why else ""))

    def _seconds(self, curve: Curve, k: int) -> float:
        """Return the expected seconds of a run."""
        if not curve.runs:
            return OVERHEAD
        near = k + 1 if k + 1 in curve.runs else k - 1
        growth = 1.5 if curve.scheme == AUTO else curve.case(near).size / curve.case(k).size
        return OVERHEAD + growth * curve.runs[near].trial.seconds

    def run(self, case: Case, patience: float = math.inf) -> StudyRun | None:
        """Run a ``case`` and compute its errors, unless it was run before. Return None if the run
        was stopped before its end, because the time is used up or it takes more than ``patience``
        [s].
        """
        known = next((run for run in self.runs if run.trial.case == case), None)
        if known is not None:
            return known
        if case.scheme not in self.warm:
            warm_up(self.plan.model, case)
            self.warm.add(case.scheme)
        report, results = self._results(case, patience)
        if report.status == "interrupted":
            return None
        seconds = seconds_of(case, report)
        repeats = self.plan.repeats or (2 if seconds < SHORT else 1)
        for _ in range(repeats - 1):
            again = run_seconds(self.plan.model, case, self._out)
            seconds = seconds if again is None else min(seconds, again)
        complete = not self.plan.needs_only_states
        run = self._with_errors(Trial(case, seconds, report, results), complete)
        self.runs.append(run)
        self.observer.progress(f"{case.scheme} {case.size:g}")
        return run

    def _results(self, case: Case, patience: float) -> tuple[Report, Run]:
        """Run a ``case``; again if kernels were compiled, which is not part of the run's time."""
        compiled, given_up = STOPWATCH.seconds, working_clock() + patience
        report, results = run_in_memory(
            with_case(self.plan.model, case),
            timing_options(case),
            lambda: self._out() or working_clock() > given_up,
        )
        if STOPWATCH.seconds > compiled:  # kernels that only hard steps need
            return self._results(case, patience)
        return report, results

    def _with_errors(self, trial: Trial, complete: bool) -> StudyRun:
        if complete:
            errors = compute_errors(trial.run, self.reference, self.dynamics)
        else:
            errors = compute_state_errors(trial.run, self.reference)
        return StudyRun(trial, errors, complete)

    def refine(self) -> None:
        """Find the largest round step size that meets the target, for the schemes that are expected
        to meet it in the least time.
        """
        expected = [(self._seconds_to_target(curve), curve) for curve in self.curves]
        known = [(seconds, curve) for seconds, curve in expected if seconds is not None]
        known.sort(key=lambda entry: entry[0])
        for _, curve in known[:CANDIDATES]:
            if curve.scheme != AUTO:
                self._refine(curve)

    def _bracket(self, curve: Curve) -> tuple[StudyRun | None, StudyRun | None]:
        """Return the next coarser run and the run of the largest size that meets the target."""
        by_size = [curve.runs[k] for k in sorted(curve.runs, reverse=True)]
        for worse, run in zip([None, *by_size], by_size, strict=False):
            if run.meets(self.plan.metric, self.plan.target):
                return worse, run
        return None, None

    def _seconds_to_target(self, curve: Curve) -> float | None:
        """Return the expected seconds of a run that just meets the target; None if none does."""
        worse, good = self._bracket(curve)
        if good is None:
            return None
        part = self._part(worse, good)
        if worse is None or part is None:
            return good.trial.seconds
        between = worse.trial.seconds**part * good.trial.seconds ** (1.0 - part)
        return min(good.trial.seconds, between)

    def _part(self, worse: StudyRun | None, good: StudyRun) -> float | None:
        """Return the position of the target between ``good`` (0) and ``worse`` (1), logarithmic."""
        low = good.largest(self.plan.metric)
        high = worse.largest(self.plan.metric) if worse and worse.trial.completed else None
        if not low or not high or high <= low:
            return None
        return math.log(max(MARGIN * self.plan.target, low) / low) / math.log(high / low)

    def _refine(self, curve: Curve) -> None:
        worse, good = self._bracket(curve)
        if good is None or worse is None:
            return
        low, high = good.trial.case.size, worse.trial.case.size
        part = self._part(worse, good)
        size = round_down(high**part * low ** (1.0 - part) if part is not None else high)
        tried: dict[float, bool] = {low: True, high: False}
        for _ in range(TRIES):
            if size in tried or self.left < 0.5:
                return
            run = self.run(Case(curve.scheme, size))
            if run is None:
                return
            tried[size] = run.meets(self.plan.metric, self.plan.target)
            size = next_round(size) if tried[size] else _round_below(size)

    def compare(self) -> None:
        """Time the fastest runs that meet the target again, one after the other."""
        good = [run for run in self.runs if run.meets(self.plan.metric, self.plan.target)]
        good.sort(key=lambda run: run.trial.seconds)
        for trial in [run.trial for _ in range(ROUNDS) for run in good[:CANDIDATES]]:
            if self.left < OVERHEAD + trial.seconds:
                return
            seconds = run_seconds(self.plan.model, trial.case, self._out)
            if seconds is not None:
                self.replace(trial.case, seconds)

    def replace(self, case: Case, seconds: float) -> None:
        """Record that a run of ``case`` took ``seconds``, if that is less than before."""
        for i, run in enumerate(self.runs):
            if run.trial.case == case and seconds < run.trial.seconds:
                self.runs[i] = replace(run, trial=replace(run.trial, seconds=seconds))

    def estimate(self, scheme: str) -> None:
        """Run the cases of a ``scheme`` again with an estimate of their position error."""
        for i, run in enumerate(self.runs):
            trial = run.trial
            if trial.scheme != scheme or not trial.completed:
                continue
            if self.left > 4.0 * trial.seconds + 2.0 * OVERHEAD and not self.observer.stopped():
                estimate = estimated_error(self.plan.model, trial.case)
                self.runs[i] = replace(run, estimate=estimate)

    def complete(self) -> None:
        """Compute the errors that are missing, of short runs first, as long as there is time."""
        order = sorted(range(len(self.runs)), key=lambda i: len(self.runs[i].trial.run.time))
        for i in order:
            run = self.runs[i]
            if not run.complete and not self._out():
                found = self._with_errors(run.trial, True)
                self.runs[i] = replace(found, estimate=run.estimate)


def _urgency(seconds: float, scheme: str) -> tuple[int, int]:
    """Return the sort key of waiting runs: fast runs first, and of about equally fast ones those of
    high order, because a few of their runs cover the range of errors.
    """
    order = COLLOCATION[AUTO_FAMILY].order(DEGREE) if scheme == AUTO else order_of(scheme)
    return math.floor(2.0 * math.log10(seconds)), -order


def _round_below(x: float) -> float:
    """Return the largest round number below ``x``."""
    return round_down(x * (1.0 - 1e-6), MANTISSAS)
