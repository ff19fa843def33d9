"""Carry out a study: runs over step sizes and schemes, their errors, orders and the fastest run."""

import math
from collections.abc import Callable
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from msahl.analysis.no_contacts import without_contacts
from msahl.jit.compiled import working_clock
from msahl.model import resolve
from msahl.model.scheme import AUTO, COLLOCATION, TOLERANCE
from msahl.records import record
from msahl.results.read import ResultError
from msahl.study.command import Command, command_arguments
from msahl.study.dynamics import Dynamics
from msahl.study.errors import METRICS, ErrorMetric, compute_errors
from msahl.study.independent import TooSlowError, independent
from msahl.study.order import FLAT, Fit, fit_order
from msahl.study.plan import Plan, StudyRun
from msahl.study.reference import Reference, stored
from msahl.study.refined_runs import refined_reference
from msahl.study.runs import Case, run_trials
from msahl.study.search import Observer, Search

TIMES = 1001
"""Number of times at which a reference is compared with another."""
NOT_INDEPENDENT = (
    "the independent integrator has neither contacts nor events: use --reference auto, which is "
    "msahl itself at small steps, or a stored run"
)
OF_REFERENCE = 0.35
"""Fraction of the budget that the reference may take."""
OF_CURVES, OF_RUNS = 0.75, 0.9
"""Fractions of the time for runs after which no curve is continued, and no run is made."""


@record(slots=False)
class Study:
    """The results of a study; if it was ``stopped``, of the runs made until then.

    ``deck_case`` is the case of the deck's own settings. ``commands`` are runs by the command line,
    of the file ``deck`` to the end time ``given_end`` if that is not the deck's, with the changes
    ``settings`` of its numbers.
    """

    plan: Plan
    reference: Reference
    runs: list[StudyRun]
    deck_case: Case | None
    stopped: bool = False
    fits: dict[tuple[str, str], Fit | None] = field(default_factory=dict)
    commands: dict[Case, Command] = field(default_factory=dict)
    deck: str = ""
    given_end: float | None = None
    settings: tuple[str, ...] = ()

    def command(self, case: Case) -> list[str]:
        """Return the arguments of ``msahl`` for the run of a case."""
        deck = self.deck or "DECK"
        return command_arguments(case, self.plan, deck, self.given_end, self.settings)

    @property
    def schemes(self) -> list[str]:
        """Return the schemes that were run, in the order of the plan."""
        ran = {run.trial.scheme for run in self.runs}
        return [s for s in dict.fromkeys((*self.plan.studied, *sorted(ran))) if s in ran]

    def series(self, scheme: str, key: str) -> tuple[list[StudyRun], np.ndarray]:
        """Return the completed runs of a scheme whose error ``key`` is known, by falling step size
        or tolerance, and their largest errors.
        """
        runs = [r for r in self.runs if r.trial.scheme == scheme and r.trial.completed]
        runs = [r for r in runs if r.largest(key) is not None]
        runs.sort(key=lambda run: -run.trial.case.size)
        return runs, np.array([run.largest(key) for run in runs], dtype=float)

    @property
    def fastest(self) -> StudyRun | None:
        """Return the fastest completed run that meets the target."""
        meeting = [r for r in self.runs if r.meets(self.plan.metric, self.plan.target)]
        return min(meeting, key=lambda run: run.trial.seconds, default=None)

    @property
    def deck_run(self) -> StudyRun | None:
        """Return the run with the deck's own settings, if it was made."""
        return next((r for r in self.runs if r.trial.case == self.deck_case), None)


def deck_case(plan: Plan) -> Case | None:
    """Return the case of the deck's own settings; None if it chooses steps in a way not studied."""
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
    report: Callable[[str], Any] = lambda line: None,
    until: float | None = None,
) -> Study:
    """Carry out the ``plan``.

    ``progress`` is called with a name of every run, ``report`` with a line on every curve that was
    finished. The ``reference`` is found if it is not given. If the study chooses the steps, it ends
    at the time ``until`` of ``working_clock`` (default: the plan's budget from now).

    Raises ``ResultError`` if there is no reference, ``StartError`` if there are no consistent
    initial conditions.
    """
    until = working_clock() + plan.budget if until is None else until
    reference = reference or find_reference(plan)
    observer = Observer(stopped, report, progress)
    if plan.steps:
        return _at_given_steps(plan, reference, observer)
    return _searched(plan, reference, observer, until)


def find_reference(plan: Plan) -> Reference:
    """Return the reference that the ``plan`` names: "independent", a run's folder, or "auto", which
    is independent or, where that takes too long or the model has contacts or events, from msahl's
    own runs at small steps.

    Raises ``ResultError`` if there is none.
    """
    wanted, model, accuracy = plan.reference, plan.model, plan.accuracy
    times = np.linspace(0.0, model.simulation.t_final, TIMES)
    if wanted not in ("auto", "independent"):
        return stored(Path(wanted), model)
    seconds = OF_REFERENCE * plan.budget if wanted == "auto" else math.inf
    end = working_clock() + seconds
    if without_contacts(model):
        if wanted == "independent":
            raise ResultError(NOT_INDEPENDENT)
        return refined_reference(model, accuracy, seconds)
    try:
        return independent(model, times, accuracy, seconds)
    except TooSlowError as error:
        return refined_reference(model, accuracy, end - working_clock(), error.solution)


def default_metric(plan: Plan, reference: Reference) -> str:
    """Return the metric that shows which runs of a ``plan`` are accurate: that of positions, or of
    orientations where the ``reference`` has bodies that rotate in place, whose positions are right
    by any step.
    """
    states = reference.states(np.linspace(0.0, plan.model.simulation.t_final, TIMES))
    places = states.reshape(len(states), -1, 12)[:, :, :3]
    moved = np.nanmax(np.abs(places - places[0]))
    return "orientation" if moved <= FLAT else "position"


def _at_given_steps(plan: Plan, reference: Reference, observer: Observer) -> Study:
    """Make runs at the step sizes of the ``plan``."""
    dynamics = Dynamics(plan.model)
    schemes = [scheme for scheme in plan.studied if scheme != AUTO]
    cases = [Case(scheme, dt) for dt in plan.steps for scheme in schemes]
    trials = run_trials(
        plan.model,
        cases,
        plan.repeats or 3,
        lambda case: observer.progress(f"{case.scheme} {case.size:g}"),
        observer.stopped,
    )
    runs = [StudyRun(trial, compute_errors(trial.run, reference, dynamics)) for trial in trials]
    return _fitted(Study(plan, reference, runs, deck_case(plan), observer.stopped()))


def _searched(plan: Plan, reference: Reference, observer: Observer, until: float) -> Study:
    """Make runs at step sizes found by a ``Search``."""
    search = Search(plan, reference, Dynamics(plan.model), until, observer)
    deck_case_of_plan = deck_case(plan)
    if deck_case_of_plan is not None:
        search.run(deck_case_of_plan)
    search.fraction = OF_CURVES
    search.explore()
    search.fraction = OF_RUNS
    search.refine()
    search.compare()
    result = Study(plan, reference, search.runs, deck_case_of_plan, observer.stopped())
    best = result.fastest
    search.estimate(best.trial.scheme if best else plan.studied[0])
    search.fraction = 1.0
    search.complete()
    return _fitted(result)


def _fitted(result: Study) -> Study:
    for scheme in result.schemes:
        for metric in METRICS:
            result.fits[scheme, metric.key] = _fit(result, scheme, metric)
    return result


def _fit(result: Study, scheme: str, metric: ErrorMetric) -> Fit | None:
    runs, errors = result.series(scheme, metric.key)
    if scheme == AUTO or not np.any(errors > FLAT):
        return None
    return fit_order([run.trial.dt for run in runs], errors.tolist())
