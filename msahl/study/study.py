"""A study: runs over steps and schemes, judged by one reference; orders, and the cheapest run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import ceil
from typing import Any

import numpy as np

from msahl.model import Model
from msahl.run import Grid
from msahl.schemes import SCHEMES
from msahl.study.errors import MEASURES, Errors, Measure, measure_errors, sample_times
from msahl.study.order import FLAT, Fit, fit_order
from msahl.study.reference import Reference, choose_reference
from msahl.study.runs import Trial, try_all, with_step

STEPS = (0.1, 0.04, 0.01, 0.004, 0.002, 0.001, 0.0004)
"""Hainge's sample rates (2010, table 4.2) and two finer [s]."""
COARSE = 20
"""Fewer steps than this to the end show nothing."""
SHORT = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125)
"""Steps, in the deck's own, where the list above is too coarse for the scene."""
ACCURACY = 1e-6
"""Asked of the reference [m] where the target is not a position."""
MARGIN = 0.9
"""Part of the target the fitted step aims at: fits are not exact."""
WORTH = 0.7
"""A step from the fit is tried if its run should take no more than this part of the listed one's
steps, or if none of the list meets the target."""
MOST_STEPS = 500_000
"""Longest run that is tried of itself."""


@dataclass(frozen=True)
class Plan:
    """What to study; ``measure`` is what the ``target`` is of, in its unit, its largest value."""

    model: Model
    steps: tuple[float, ...] = ()
    schemes: tuple[str, ...] = ()
    reference: str = "auto"
    repeats: int = 3
    target: float = 1e-6
    measure: str = "position"

    @property
    def accuracy(self) -> float:
        """What the reference must be good for [m]."""
        return self.target if self.measure == "position" else ACCURACY


@dataclass(frozen=True)
class Point:
    """A trial and its errors; ``tried`` if its step comes from the fit, not from the list."""

    trial: Trial
    errors: Errors
    tried: bool = False

    def largest(self, key: str) -> float | None:
        """Largest error of a kind."""
        spread = self.errors.figures[key]
        return None if spread is None else spread.max


@dataclass(frozen=True)
class Study:
    """What came out; of a study that was ``stopped``, from the runs it had made by then."""

    plan: Plan
    reference: Reference
    points: list[Point]
    stopped: bool = False
    fits: dict[tuple[str, str], Fit | None] = field(default_factory=dict)

    @property
    def schemes(self) -> list[str]:
        """Schemes in the order of the plan."""
        return list(dict.fromkeys(point.trial.scheme for point in self.points))

    def series(self, scheme: str, key: str) -> tuple[list[Point], np.ndarray]:
        """The points of a scheme that have such an error, by falling step, and largest errors."""
        points = [p for p in self.points if p.trial.scheme == scheme and p.trial.completed]
        points = [p for p in points if p.largest(key) is not None]
        points.sort(key=lambda point: -point.trial.dt)
        return points, np.array([point.largest(key) for point in points], dtype=float)

    @property
    def cheapest(self) -> Point | None:
        """The completed run of least seconds that meets the target."""
        meeting = [p for p in self.points if p.trial.completed and self.meets(p)]
        return min(meeting, key=lambda point: point.trial.seconds, default=None)

    def meets(self, point: Point) -> bool:
        """Whether a run's largest error is within the target."""
        error = point.largest(self.plan.measure)
        return error is not None and error <= self.plan.target


def default_steps(model: Model) -> tuple[float, ...]:
    """The list, as far as it suits the scene."""
    t_final = model.simulation.t_final
    listed = tuple(dt for dt in STEPS if COARSE * dt <= t_final * (1.0 + 1e-9))
    if len(listed) >= 5:
        return listed
    return tuple(factor * model.simulation.dt for factor in SHORT)


def study(
    plan: Plan,
    progress: Callable[[int], Any] = lambda steps: None,
    stopped: Callable[[], bool] = lambda: False,
    reference: Reference | None = None,
) -> Study:
    """Run the ``plan``; ``progress`` is told of steps done since last time. The ``reference`` is
    found if it is not given.

    Raises ``ResultError`` if there is no reference, ``StartError`` if there is no start.
    """
    steps, schemes = plan.steps or default_steps(plan.model), plan.schemes or tuple(SCHEMES)
    reference = reference or find_reference(plan)
    cases = [(scheme, dt) for dt in steps for scheme in schemes]
    trials = try_all(plan.model, cases, plan.repeats, progress, stopped)
    points = [Point(trial, measure_errors(trial.run, reference)) for trial in trials]
    result = Study(plan, reference, points, stopped())
    for scheme in schemes:
        for measure in MEASURES:
            result.fits[scheme, measure.key] = _fit(result, scheme, measure)
    for scheme in schemes:
        if not stopped():
            points += _try_fitted(result, scheme, stopped)
    return result


def planned_steps(plan: Plan) -> int:
    """Steps that ``study`` will tell of, but for those it tries of itself."""
    schemes = plan.schemes or tuple(SCHEMES)
    steps = plan.steps or default_steps(plan.model)
    grids = (Grid.of(with_step(plan.model, dt).simulation) for dt in steps)
    return plan.repeats * len(schemes) * sum(grid.n for grid in grids)


def find_reference(plan: Plan) -> Reference:
    """True values for all runs of the ``plan``, but for those it tries of itself."""
    return _reference(plan, plan.steps or default_steps(plan.model))


def _reference(plan: Plan, steps: Sequence[float]) -> Reference:
    times = np.unique(np.concatenate([sample_times(with_step(plan.model, dt)) for dt in steps]))
    return choose_reference(plan.reference, plan.model, times, plan.accuracy)


def _fit(result: Study, scheme: str, measure: Measure) -> Fit | None:
    points, errors = result.series(scheme, measure.key)
    if not np.any(errors > FLAT):
        return None
    return fit_order([point.trial.dt for point in points], errors.tolist())


def _try_fitted(result: Study, scheme: str, stopped: Callable[[], bool]) -> list[Point]:
    """A run at the largest step that should meet the target, if that is worth the while."""
    plan = result.plan
    fit = result.fits[scheme, plan.measure]
    if fit is None:
        return []
    t_final = plan.model.simulation.t_final
    n = ceil(t_final / fit.step(MARGIN * plan.target))
    own = [p for p in result.points if p.trial.scheme == scheme and result.meets(p)]
    listed = min((Grid.of(p.trial.run.model.simulation).n for p in own), default=None)
    too_long = n > (MOST_STEPS if listed is None else WORTH * listed)
    if too_long or t_final / n > fit.coarsest:
        return []
    dt = t_final / n
    trials = try_all(plan.model, [(scheme, dt)], plan.repeats, stopped=stopped)
    reference = _reference(plan, [dt])
    return [Point(trial, measure_errors(trial.run, reference), tried=True) for trial in trials]
