"""The search for runs that show what the schemes can do within a time: a curve of each scheme.

A curve is a list of runs whose steps (of a scheme that chooses them, the tolerances) follow the
numbers 1, 2, 5, 10, ... It begins at a step that the fastest rotation lets expect to be coarse, is
continued with larger steps until the error exceeds ``COARSE``, and with smaller ones until it is
below ``FINE``, no longer falls, or takes too long. Quick runs come first, of whichever curve.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from msahl.jit.compiled import STOPWATCH, working_clock
from msahl.model.scheme import AUTO, AUTO_FAMILY, COLLOCATION, DEGREE, split
from msahl.results.read import Run
from msahl.run.loop import Report
from msahl.study.dynamics import Dynamics
from msahl.study.errors import measure_errors, state_figures
from msahl.study.plan import Plan, Point
from msahl.study.reference import Reference
from msahl.study.rounding import MANTISSAS, next_round, round_down, rung, rung_below
from msahl.study.runs import (
    Case,
    Trial,
    estimated_error,
    run_in_memory,
    run_seconds,
    seconds_of,
    timing,
    variant,
    warm_up,
)

COARSE, FINE = 1e-2, 1e-10
"""Errors that a curve spans where it can, in the measure's SI unit."""
FEWEST = 4
"""Steps to the end that a run takes at least."""
MOST_ITERATIONS = 6.0
"""Iterations of a step above which no larger step is tried."""
LARGE_TURN = 1.0
"""Rotation in a step [rad] with which a curve begins."""
FIRST_TOLERANCE = -4
"""Power of ten [m] with which the curve of a scheme that chooses its steps begins."""
FINEST_TOLERANCE = 1e-12
"""Tolerance [m] at which such a curve ends."""
FALLS = 0.7
"""Part of an error to which a smaller step must reduce it: of order 1 it is a half or less."""
SURE = 1e-5
"""Error [SI] above which one that does not fall is of a step still too large, not round-off."""
LONGEST = 0.1
"""Part of the budget that a single run may take once the target is met."""
SHORT = 0.02
"""Loops of fewer seconds are repeated at once, as a short time is easily disturbed."""
PATIENCE = 0.5
"""Seconds after which a run, and five times what it was expected to take, is not waited for."""
OVERHEAD = 0.03
"""Seconds beside the loop: building the system, its errors."""
CANDIDATES, TRIES, TURNS = 3, 4, 5
"""Schemes that are refined around the target, runs of each, and turns of the last comparison."""
MARGIN = 0.9
"""Part of the target at which a step between two runs aims: interpolation is not exact."""


@dataclass
class Curve:
    """Runs of one scheme: by number of the series of sizes."""

    scheme: str
    first: int
    points: dict[int, Point] = field(default_factory=dict)
    coarsest: bool = False
    ended: str = ""

    def case(self, k: int) -> Case:
        """The case of a number of the series."""
        return Case(self.scheme, float(f"1e{k}") if self.scheme == AUTO else rung(k))


class Search:
    """One study's search. ``stopped`` tells that the user wants no more, ``tell`` is for lines,
    ``progress`` for what was run last.
    """

    def __init__(
        self,
        plan: Plan,
        reference: Reference,
        dynamics: Dynamics,
        until: float,
        stopped: Callable[[], bool],
        tell: Callable[[str], Any],
        progress: Callable[[str], Any],
    ) -> None:
        self.plan, self.reference, self.dynamics = plan, reference, dynamics
        self.until, self.stopped, self.tell, self.progress = until, stopped, tell, progress
        self.part, self.began = 1.0, working_clock()
        self.points: list[Point] = []
        self.warm: set[str] = set()
        first = rung_below(self._first_step())
        self.curves = [
            Curve(scheme, FIRST_TOLERANCE if scheme == AUTO else first) for scheme in plan.studied
        ]

    @property
    def left(self) -> float:
        """Seconds left of the present part of the time."""
        return self.began + self.part * (self.until - self.began) - working_clock()

    def _out(self) -> bool:
        return self.stopped() or self.left <= 0.0

    def _first_step(self) -> float:
        """A step [s] in which the fastest body rotates by much."""
        end = self.plan.model.simulation.t_final
        times = np.linspace(0.0, min(end, self.reference.horizon), 200)
        spins = self.reference.states(times).reshape(len(times), -1, 4, 3)[:, :, 3]
        fastest = float(np.nan_to_num(np.sqrt((spins**2).sum(axis=2))).max(initial=0.0))
        return min(end / 10.0, LARGE_TURN / fastest if fastest > 0.0 else math.inf)

    def explore(self) -> None:
        """Draw all curves, as far as the time goes."""
        while not self._out():
            waiting = [(self._seconds(c, k), c, k) for c in self.curves if (k := self._next(c))
                       is not None]  # fmt: skip
            if not waiting:
                break
            seconds, curve, k = min(waiting, key=lambda entry: _urgency(entry[0], entry[1].scheme))
            if seconds > self._allowed():
                self._end(curve, "a finer run would take too long")
                continue
            point = self.run(curve.case(k), PATIENCE + 5.0 * seconds)
            if point is None:
                self._give_up(curve, k)
            else:
                curve.points[k] = point
        for curve in self.curves:
            if not curve.ended:
                self._end(curve, "the time of the study was used up")

    def _give_up(self, curve: Curve, k: int) -> None:
        """Go on after a run that has taken too long."""
        if curve.points and k < min(curve.points):
            self._end(curve, "a finer run would take too long")
        elif curve.points:
            curve.coarsest = True
        else:
            curve.first, curve.coarsest = k - 1, True

    def _allowed(self) -> float:
        """Seconds that one run may take."""
        met = any(point.keeps(self.plan.measure, self.plan.target) for point in self.points)
        return min(self.left, LONGEST * self.plan.budget) if met else self.left

    def _next(self, curve: Curve) -> int | None:
        """Number of the run that would continue a curve; None at its end."""
        if curve.ended:
            return None
        if not curve.points:
            return curve.first
        errors = {k: self._error(point) for k, point in curve.points.items()}
        top, bottom = max(errors), min(errors)
        if not curve.coarsest:
            if errors[top] < COARSE and self._may_grow(curve.points[top], curve.case(top + 1)):
                return top + 1
            curve.coarsest = True
        floor = max(FINE, 3.0 * self.reference.error)
        chooses = curve.scheme == AUTO
        if errors[bottom] <= floor or (chooses and curve.case(bottom).size <= FINEST_TOLERANCE):
            self._end(curve, "")
        # Steps that are chosen are the same for some neighbouring tolerances.
        elif not chooses and self._is_flat(errors[bottom], errors.get(bottom + 1, math.inf)):
            self._end(curve, "round-off")
        return None if curve.ended else bottom - 1

    def _error(self, point: Point) -> float:
        """The error of a run, infinite if it did not come to its end."""
        error = point.largest(self.plan.measure)
        return error if point.trial.completed and error is not None else math.inf

    @staticmethod
    def _is_flat(fine: float, coarse: float) -> bool:
        return FALLS * coarse < fine < SURE

    def _may_grow(self, point: Point, larger: Case) -> bool:
        """Whether steps larger than those of a run are worth a run."""
        if larger.chooses:
            return larger.size <= 1.0
        # Steps that converge badly become a run of many seconds if they are any larger.
        report = point.trial.report
        eased = report.iterations <= MOST_ITERATIONS * report.steps and not report.subdivisions
        return eased and FEWEST * larger.size <= self.plan.model.simulation.t_final

    def _end(self, curve: Curve, why: str) -> None:
        """End a curve, and tell of it."""
        curve.ended = why or "complete"
        errors = [e for p in curve.points.values() if (e := self._error(p)) < math.inf]
        span = f"errors {max(errors):.1e} to {min(errors):.1e}" if errors else "no run completed"
        runs = f"{len(curve.points)} runs" if len(curve.points) != 1 else "1 run"
        self.tell(f"{curve.scheme}: {runs}, {span}" + (f" ({why})" if why else ""))

    def _seconds(self, curve: Curve, k: int) -> float:
        """What a run is expected to take."""
        if not curve.points:
            return OVERHEAD
        near = k + 1 if k + 1 in curve.points else k - 1
        growth = 1.5 if curve.scheme == AUTO else curve.case(near).size / curve.case(k).size
        return OVERHEAD + growth * curve.points[near].trial.seconds

    def run(self, case: Case, patience: float = math.inf) -> Point | None:
        """Run a ``case`` and measure its errors, unless it was run before; None if it was stopped
        before its end, as the time is used up or it takes more than ``patience`` [s].
        """
        known = next((point for point in self.points if point.trial.case == case), None)
        if known is not None:
            return known
        if case.scheme not in self.warm:
            warm_up(self.plan.model, case)
            self.warm.add(case.scheme)
        report, run = self._rows(case, patience)
        if report.status == "interrupted":
            return None
        seconds = seconds_of(case, report)
        repeats = self.plan.repeats or (2 if seconds < SHORT else 1)
        for _ in range(repeats - 1):
            again = run_seconds(self.plan.model, case, self._out)
            seconds = seconds if again is None else min(seconds, again)
        point = self._measured(Trial(case, seconds, report, run), not self.plan.of_states)
        self.points.append(point)
        self.progress(f"{case.scheme} {case.size:g}")
        return point

    def _rows(self, case: Case, patience: float) -> tuple[Report, Run]:
        """A run of a ``case``."""
        compiled, given_up = STOPWATCH.seconds, working_clock() + patience
        report, run = run_in_memory(
            variant(self.plan.model, case),
            timing(case),
            lambda: self._out() or working_clock() > given_up,
        )
        if STOPWATCH.seconds > compiled:  # what only hard steps need: not of this run
            return self._rows(case, patience)
        return report, run

    def _measured(self, trial: Trial, complete: bool) -> Point:
        if complete:
            errors = measure_errors(trial.run, self.reference, self.dynamics)
        else:
            errors = state_figures(trial.run, self.reference)
        return Point(trial, errors, complete)

    def refine(self) -> None:
        """Try round steps between those of the curves: the largest that meets the target, of the
        schemes that promise the least time.
        """
        promises = [(seconds, curve) for curve in self.curves
                    if (seconds := self._promise(curve)) is not None]  # fmt: skip
        promises.sort(key=lambda entry: entry[0])
        for _, curve in promises[:CANDIDATES]:
            if curve.scheme != AUTO:
                self._refine(curve)

    def _bracket(self, curve: Curve) -> tuple[Point | None, Point | None]:
        """The run of the largest size that meets the target, and the one before it."""
        by_size = [curve.points[k] for k in sorted(curve.points, reverse=True)]
        for worse, point in zip([None, *by_size], by_size, strict=False):
            if point.keeps(self.plan.measure, self.plan.target):
                return worse, point
        return None, None

    def _promise(self, curve: Curve) -> float | None:
        """Seconds that the scheme should take to the target; None if it does not reach it."""
        worse, good = self._bracket(curve)
        if good is None:
            return None
        part = self._part(worse, good)
        if worse is None or part is None:
            return good.trial.seconds
        between = worse.trial.seconds**part * good.trial.seconds ** (1.0 - part)
        return min(good.trial.seconds, between)

    def _part(self, worse: Point | None, good: Point) -> float | None:
        """How much of the way from ``good`` to ``worse``, in logarithms, the target allows."""
        low = good.largest(self.plan.measure)
        high = worse.largest(self.plan.measure) if worse and worse.trial.completed else None
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
            point = self.run(Case(curve.scheme, size))
            if point is None:
                return
            tried[size] = point.keeps(self.plan.measure, self.plan.target)
            size = next_round(size) if tried[size] else _round_below(size)

    def compare(self) -> None:
        """Time the fastest runs that meet the target again, in turns."""
        good = [p for p in self.points if p.keeps(self.plan.measure, self.plan.target)]
        good.sort(key=lambda point: point.trial.seconds)
        for point in [p for _ in range(TURNS) for p in good[:CANDIDATES]]:
            if self.left < OVERHEAD + point.trial.seconds:
                return
            seconds = run_seconds(self.plan.model, point.trial.case, self._out)
            if seconds is not None:
                self.replace(point.trial.case, seconds)

    def replace(self, case: Case, seconds: float) -> None:
        """Take in that a ``case`` took so many ``seconds``, too."""
        for i, point in enumerate(self.points):
            if point.trial.case == case and seconds < point.trial.seconds:
                self.points[i] = replace(point, trial=replace(point.trial, seconds=seconds))

    def estimate(self, scheme: str) -> None:
        """Have the runs of a ``scheme`` estimate their own errors in position."""
        for i, point in enumerate(self.points):
            trial = point.trial
            if trial.scheme != scheme or not trial.completed:
                continue
            if self.left > 4.0 * trial.seconds + 2.0 * OVERHEAD and not self.stopped():
                told = estimated_error(self.plan.model, trial.case)
                self.points[i] = replace(point, estimate=told)

    def complete(self) -> None:
        """Measure the other errors, of quick runs first, as long as there is time."""
        order = sorted(range(len(self.points)), key=lambda i: len(self.points[i].trial.run.time))
        for i in order:
            point = self.points[i]
            if not point.complete and not self._out():
                measured = self._measured(point.trial, True)
                self.points[i] = replace(measured, estimate=point.estimate)


def _urgency(seconds: float, scheme: str) -> tuple[int, int]:
    """What comes first: quick runs, and among those about as quick the schemes of high order, of
    which few runs show all.
    """
    higher = COLLOCATION.get(split(scheme)[0])
    order = higher.order(split(scheme)[1] or higher.highest) if higher else 2
    if scheme == AUTO:
        order = COLLOCATION[AUTO_FAMILY].order(DEGREE)
    return math.floor(2.0 * math.log10(seconds)), -order


def _round_below(x: float) -> float:
    """The next round number below ``x``."""
    return round_down(x * (1.0 - 1e-6), MANTISSAS)
