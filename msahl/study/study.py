"""A study: runs over steps and schemes, judged by one reference; orders, and the fastest run."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from msahl.jit.compiled import working_clock
from msahl.model import resolve
from msahl.model.scheme import AUTO, COLLOCATION, TOLERANCE
from msahl.study.dynamics import Dynamics
from msahl.study.errors import MEASURES, Measure, measure_errors
from msahl.study.order import FLAT, Fit, fit_order
from msahl.study.plan import Plan, Point
from msahl.study.reference import Reference, choose_reference
from msahl.study.runs import Case, try_all
from msahl.study.search import Search

TIMES = 1001
"""Times at which a reference is compared with another."""
OF_REFERENCE = 0.35
"""Part of the budget that the reference may take."""
OF_CURVES, OF_RUNS = 0.75, 0.9
"""Parts of the time left for runs until which curves are drawn, and runs are made at all."""


@dataclass(frozen=True)
class Command:
    """A run by the command line: its ``words``, seconds from start to end and of its loop, and
    its largest error.
    """

    words: str
    whole: float
    loop: float
    error: float | None


@dataclass(frozen=True)
class Study:
    """What came out; of a study that was ``stopped``, from the runs it had made by then. ``own``
    is the case of the deck itself, ``commands`` are runs by the command line, of the file ``deck``
    to the end given in place of its own.
    """

    plan: Plan
    reference: Reference
    points: list[Point]
    own: Case | None
    stopped: bool = False
    fits: dict[tuple[str, str], Fit | None] = field(default_factory=dict)
    commands: dict[Case, Command] = field(default_factory=dict)
    deck: str = ""
    given_end: float | None = None

    @property
    def schemes(self) -> list[str]:
        """Schemes that were run, in the order of the plan."""
        ran = {point.trial.scheme for point in self.points}
        return [s for s in dict.fromkeys((*self.plan.studied, *sorted(ran))) if s in ran]

    def series(self, scheme: str, key: str) -> tuple[list[Point], np.ndarray]:
        """The points of a scheme that have such an error, by falling step or tolerance, and largest
        errors.
        """
        points = [p for p in self.points if p.trial.scheme == scheme and p.trial.completed]
        points = [p for p in points if p.largest(key) is not None]
        points.sort(key=lambda point: -point.trial.case.size)
        return points, np.array([point.largest(key) for point in points], dtype=float)

    @property
    def fastest(self) -> Point | None:
        """The completed run of least seconds that meets the target."""
        meeting = [p for p in self.points if p.keeps(self.plan.measure, self.plan.target)]
        return min(meeting, key=lambda point: point.trial.seconds, default=None)

    @property
    def of_deck(self) -> Point | None:
        """The run with the deck's own settings, if it was made."""
        return next((p for p in self.points if p.trial.case == self.own), None)


def own_case(plan: Plan) -> Case | None:
    """The case that the deck itself asks for; None if it chooses steps in a way not studied."""
    simulation = plan.model.simulation
    if simulation.scheme == AUTO and simulation.local_tolerance is None:
        return Case(AUTO, simulation.tolerance or TOLERANCE)
    if resolve(plan.model.simulation).adaptive:
        return None
    degree = simulation.degree if simulation.scheme in COLLOCATION else ""
    return Case(f"{simulation.scheme}{degree}", simulation.dt)


def study(
    plan: Plan,
    progress: Callable[[str], Any] = lambda words: None,
    stopped: Callable[[], bool] = lambda: False,
    reference: Reference | None = None,
    tell: Callable[[str], Any] = lambda line: None,
    until: float | None = None,
) -> Study:
    """Carry out the ``plan``, ``until`` a time of ``working_clock`` if steps are chosen (its
    budget from now if it is not given). ``progress`` is told of every run, ``tell`` of what a
    reader may want to know meanwhile. The ``reference`` is found if it is not given.

    Raises ``ResultError`` if there is no reference, ``StartError`` if there is no start.
    """
    until = working_clock() + plan.budget if until is None else until
    reference = reference or find_reference(plan)
    if plan.steps:
        return _listed(plan, reference, progress, stopped)
    return _searched(plan, reference, progress, stopped, tell, until)


def find_reference(plan: Plan) -> Reference:
    """True values for all runs of the ``plan``."""
    times = np.linspace(0.0, plan.model.simulation.t_final, TIMES)
    seconds = OF_REFERENCE * plan.budget
    return choose_reference(plan.reference, plan.model, times, plan.accuracy, seconds)


def _listed(
    plan: Plan,
    reference: Reference,
    progress: Callable[[str], Any],
    stopped: Callable[[], bool],
) -> Study:
    """Runs at the steps of the ``plan``."""
    dynamics = Dynamics(plan.model)
    schemes = [scheme for scheme in plan.studied if scheme != AUTO]
    cases = [Case(scheme, dt) for dt in plan.steps for scheme in schemes]
    trials = try_all(
        plan.model,
        cases,
        plan.repeats or 3,
        lambda case: progress(f"{case.scheme} {case.size:g}"),
        stopped,
    )
    points = [Point(trial, measure_errors(trial.run, reference, dynamics)) for trial in trials]
    return _fitted(Study(plan, reference, points, own_case(plan), stopped()))


def _searched(
    plan: Plan,
    reference: Reference,
    progress: Callable[[str], Any],
    stopped: Callable[[], bool],
    tell: Callable[[str], Any],
    until: float,
) -> Study:
    """Runs at steps found by a ``Search``."""
    search = Search(plan, reference, Dynamics(plan.model), until, stopped, tell, progress)
    own = own_case(plan)
    if own is not None:
        search.run(own)
    search.part = OF_CURVES
    search.explore()
    search.part = OF_RUNS
    search.refine()
    search.compare()
    result = Study(plan, reference, search.points, own, stopped())
    best = result.fastest
    search.estimate(best.trial.scheme if best else plan.studied[0])
    search.part = 1.0
    search.complete()
    return _fitted(result)


def _fitted(result: Study) -> Study:
    for scheme in result.schemes:
        for measure in MEASURES:
            result.fits[scheme, measure.key] = _fit(result, scheme, measure)
    return result


def _fit(result: Study, scheme: str, measure: Measure) -> Fit | None:
    points, errors = result.series(scheme, measure.key)
    if scheme == AUTO or not np.any(errors > FLAT):
        return None
    return fit_order([point.trial.dt for point in points], errors.tolist())
