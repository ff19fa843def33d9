"""Companion runs: more accurate runs beside a run, with which its results are compared.

A companion either takes every step in two halves, or uses a scheme of higher order at a multiple of
the step size, or repeats the rows of an earlier, more accurate run.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from msahl.model import Model, RunSettings
from msahl.model.scheme import COLLOCATION
from msahl.run.subsystem import CompanionIntegrator, Shared, SubsystemIntegrator
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import UNDIVIDED, Chunk, Parts

SAFETY = 1.5
"""Factor of all error estimates, as the terms of higher order are unknown."""
SECONDS_PER_UNKNOWN = 1.2e-7
"""Time of the loop for one unknown and one step of order 2. It is a fixed number and not measured
in the run, so that the same deck has the same companion on every machine."""
CHEAP = 1.0
"""Seconds that a companion may always take."""
DEGREE_COST = {0: 1.0, 1: 2.5, 2: 4.3, 3: 6.5, 4: 9.5, 5: 13.0}
"""Time of a step by its degree, relative to order 2 (see ``benchmarks/results/speed.md``)."""


class CoarserScheme(NamedTuple):
    """A scheme of higher order, one step of which replaces ``stride`` steps of the run."""

    scheme: str
    degree: int
    stride: int


COARSER = {
    ("preserving", 0): CoarserScheme("gauss", 3, 8),
    ("decaying", 0): CoarserScheme("radau", 3, 8),
    ("gauss", 1): CoarserScheme("gauss", 3, 4),
    ("gauss", 2): CoarserScheme("gauss", 4, 3),
    ("gauss", 3): CoarserScheme("gauss", 5, 3),
    ("gauss", 4): CoarserScheme("gauss", 5, 2),
    ("rk4", 2): CoarserScheme("gauss", 4, 3),
    ("rk8", 4): CoarserScheme("gauss", 5, 2),
    ("radau", 1): CoarserScheme("radau", 3, 4),
    ("radau", 2): CoarserScheme("radau", 3, 2),
}
"""Companions that cost less than the run, by the run's scheme and degree. A vibration that the run
damps is damped by its companion as well."""


class Rows(NamedTuple):
    """Rows of one subsystem's tables: states (m, 12 n), reactions (m, ...), signals (m, ...)."""

    states: np.ndarray
    reactions: np.ndarray
    signals: np.ndarray


class Steps(NamedTuple):
    """Steps that a run has taken, from ``begin`` [s]."""

    begin: float
    sizes: np.ndarray  # (m,) [s]
    ends: np.ndarray  # (m,) [s], by the run's own grid and not by sums of sizes
    parts: Parts = UNDIVIDED  # of those that events divided


class Companion(Protocol):
    """A run beside the run."""

    name: str
    factor: float  # from the difference of the results to the error estimate
    stride: int  # steps of the run in one step of the companion
    integrators: list[SubsystemIntegrator]  # those that advance beside the run's

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> list[Rows] | None:
        """Advance over the same time as the run's ``steps``. Returns the rows of the ``schedule``,
        at ``times``, for each subsystem, or None if a step did not converge.
        """


class HalfStepCompanion:
    """Takes every step of the run in two halves, by the same scheme."""

    name, stride = "half the step", 1

    def __init__(
        self, integrators: Sequence[SubsystemIntegrator], settings: RunSettings, chunk: int
    ) -> None:
        self.means = settings.degree == 0 and not settings.instantaneous
        # Mean reactions need a row for either half of a step.
        kind = SubsystemIntegrator if settings.adaptive else CompanionIntegrator
        self.integrators: list[SubsystemIntegrator] = [
            kind(
                with_given_steps(integrator.model, settings, integrator.stepper.method.degree),
                integrator.solver,
                settings.full,
                2 * chunk,
                settings.instantaneous,
                shared=Shared(integrator.storages, integrator),
            )
            for integrator in integrators
        ]
        for integrator in self.integrators:
            integrator.stepper.halves_parts = True
            integrator.stepper.vary_sizes(settings.adaptive)
        self.factor = SAFETY / (1.0 - 0.5**settings.order)

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> list[Rows] | None:
        """See ``Companion``."""
        halves, rows = schedule.both_halves() if self.means else schedule.halves(), []
        for integrator, companion_integrator in zip(integrators, self.integrators, strict=True):
            companion_integrator.stepper.follow(integrator.stepper, len(steps.sizes), 2)
            if not advance(companion_integrator, np.repeat(0.5 * steps.sizes, 2), halves):
                return None
            if self.means:
                both = first_rows(companion_integrator, 2 * len(times))
                mean = 0.5 * (both.reactions[::2] + both.reactions[1::2])
                rows.append(Rows(both.states[1::2], mean, both.signals[1::2]))
            else:
                rows.append(first_rows(companion_integrator, len(times)))
        return rows


class HigherOrderCompanion:
    """Uses a scheme of higher order at a multiple of the run's step size."""

    factor = SAFETY

    def __init__(
        self,
        integrators: Sequence[SubsystemIntegrator],
        settings: RunSettings,
        chunk: int,
        coarser: CoarserScheme,
    ) -> None:
        self.stride = coarser.stride
        self.name = f"{coarser.scheme}{coarser.degree} with {coarser.stride} times the step size"
        self.integrators: list[SubsystemIntegrator] = [
            CompanionIntegrator(
                _with_scheme(integrator.model, coarser),
                integrator.solver,
                settings.full,
                chunk,
                shared=Shared(integrator.storages),
            )
            for integrator in integrators
        ]

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> list[Rows] | None:
        """See ``Companion``."""
        first = range(0, len(steps.sizes), self.stride)
        groups = [steps.sizes[k : k + self.stride].sum() for k in first]
        ends = [steps.ends[min(k + self.stride, len(steps.ends)) - 1] for k in first]
        schedule = OutputSchedule.passed(times, steps.begin, np.array(ends))
        rows = []
        for companion_integrator in self.integrators:
            if not advance(companion_integrator, np.array(groups), schedule):
                return None
            rows.append(first_rows(companion_integrator, len(times)))
        return rows


class EarlierRun:
    """Repeats the rows of a more accurate run that was made before."""

    name, stride, factor = "an earlier run of higher accuracy", 1, SAFETY

    def __init__(self, rows: list[Rows], used: int = 0) -> None:
        self.rows, self.used = rows, used  # all rows, and how many were compared already
        self.integrators: list[SubsystemIntegrator] = []

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> list[Rows] | None:
        """See ``Companion``."""
        return self.next_rows(len(times))

    def next_rows(self, count: int) -> list[Rows]:
        """The next ``count`` rows of each subsystem."""
        span = slice(self.used, self.used + count)
        self.used += count
        return [Rows(*(table[span] for table in rows)) for rows in self.rows]


def choose_companion(
    integrators: Sequence[SubsystemIntegrator],
    settings: RunSettings,
    chunk: int,
    steps: int,
    required: bool,
) -> Companion | None:
    """The companion of a run of so many ``steps``; None where it would take more than ``CHEAP``
    seconds and longer than the run itself, unless it is ``required``.
    """
    degree = settings.degree
    unknowns = sum(integrator.workspace.unknowns.free.size for integrator in integrators)
    seconds = steps * unknowns * SECONDS_PER_UNKNOWN * DEGREE_COST[degree]
    if required or settings.adaptive or 2.0 * seconds <= CHEAP:
        return HalfStepCompanion(integrators, settings, chunk)
    coarser = COARSER.get((settings.family, degree))
    if coarser is None:
        return None
    cost = DEGREE_COST[coarser.degree] / (DEGREE_COST[degree] * coarser.stride)
    return HigherOrderCompanion(integrators, settings, chunk, coarser) if cost < 1.0 else None


def first_rows(integrator: SubsystemIntegrator, count: int) -> Rows:
    """The first rows of the present chunk."""
    tables = integrator.workspace.tables
    return Rows(tables.states[:count], tables.reactions[:count], tables.signals[:count])


def with_given_steps(model: Model, settings: RunSettings, degree: int = 0) -> Model:
    """The same model without step-size control, of the ``degree`` that steps begin with, or of its
    own.
    """
    simulation = replace(
        model.simulation,
        scheme=settings.family,
        degree=degree if degree and settings.family in COLLOCATION else model.simulation.degree,
        tolerance=None,
        local_tolerance=None,
    )
    return replace(model, simulation=simulation)


def _with_scheme(model: Model, coarser: CoarserScheme) -> Model:
    """The same model with the scheme and the step size of a companion."""
    simulation = replace(
        model.simulation,
        scheme=coarser.scheme,
        degree=coarser.degree,
        dt=coarser.stride * model.simulation.dt,
        output_interval=None,
    )
    return replace(model, simulation=simulation)


def advance(integrator: SubsystemIntegrator, sizes: np.ndarray, schedule: OutputSchedule) -> bool:
    """Take steps of these ``sizes``; whether all were solved."""
    ends = [*(np.flatnonzero(np.diff(sizes)) + 1).tolist(), len(sizes)]
    first = integrator.stepper.take_varied(sizes, 0, schedule)
    while first < len(sizes):
        last = ends[bisect_right(ends, first)]
        chunk = Chunk(last, first, float(sizes[first]), schedule=schedule)
        if integrator.advance(chunk).steps < last:
            return False
        first = integrator.stepper.take_varied(sizes, last, schedule)
    return True
