"""Plans the chunks of a run: steps of a given size, or steps whose size follows from a tolerance.

A plan stores the progress of the run (``Progress``), gives the next ``Chunk``, and explains why
a chunk failed. The time loop is the same for both plans.
"""

from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from msahl.run.messages import step_failed, tolerance_not_met
from msahl.run.output import OutputTimes
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Advance, Chunk

ROUND_OFF = 1e-12
"""Fraction of a time within which it counts as reached."""


@dataclass(slots=True)
class Progress:
    """How far a run has come: ``steps``, written ``output_times``, ``time`` [s]."""

    steps: int = 0
    output_times: int = 0
    time: float = 0.0

    def numbers(self) -> dict[str, Any]:
        """All of it, for a snapshot."""
        return asdict(self)


class StepPlan(Protocol):
    """The order of a run's steps."""

    progress: Progress

    @property
    def ended(self) -> bool:
        """Whether all steps are taken."""

    def next_chunk(self, steps: int, stride: int) -> Chunk:
        """A chunk of about ``steps`` steps, a multiple of ``stride`` where that is possible."""

    def accept(self, advance: Advance) -> None:
        """Move on by the steps of ``advance``."""

    def failure(self, integrator: SubsystemIntegrator, advance: Advance) -> str | None:
        """Why the steps end the run, in words; None if they do not."""

    def kept_before(self, step: int) -> int:
        """How many steps of a chunk stay as they are if the run is to end within its ``step``,
        counted from 0.
        """

    def most_kept(self, steps: int) -> int:
        """How many of these ``steps`` to take in one chunk so that they are as they were."""

    def approach(self, integrator: SubsystemIntegrator, t: float) -> int:
        """Take the steps from the last accepted one up to ``t`` [s], with which a run that ends
        there ends; return the row of the last one in the monitor, -1 if one cannot be solved.
        """

    def end_at(self, t: float) -> None:
        """Let the run end at ``t`` [s]."""


class GivenSteps:
    """Steps of the size that the deck gives."""

    def __init__(self, output: OutputTimes) -> None:
        self.output, self.grid, self.progress = output, output.grid, Progress()

    @property
    def ended(self) -> bool:
        """See ``StepPlan``."""
        return self.progress.steps == self.grid.n

    def next_chunk(self, steps: int, stride: int) -> Chunk:
        """See ``StepPlan``."""
        first = self.progress.steps
        steps = min(max(stride, steps - steps % stride), self.grid.n - first)
        if first + steps == self.grid.n and not self.grid.uniform and steps > 1:
            steps -= 1  # the last step is shorter
        schedule, times = self.output.of_steps(first, steps)
        steps = schedule.steps
        return Chunk(
            last=steps,
            h=self.grid.step(first + steps),
            begin=self.grid.time(first),
            ends=self.grid.times(np.arange(first + 1, first + steps + 1)),
            schedule=schedule,
            times=times,
        )

    def accept(self, advance: Advance) -> None:
        """See ``StepPlan``."""
        self.progress.steps += advance.steps
        self.progress.time = self.grid.time(self.progress.steps)

    def failure(self, integrator: SubsystemIntegrator, advance: Advance) -> str | None:
        """See ``StepPlan``."""
        if advance.outcome.converged:
            return None
        step = self.progress.steps + advance.steps
        return step_failed(integrator, step + 1, self.grid.time(step), self.grid.h, advance.outcome)

    def kept_before(self, step: int) -> int:
        """See ``StepPlan``; one step more is open, so that the last one need not be very short."""
        return max(0, step - 1)

    def most_kept(self, steps: int) -> int:
        """See ``StepPlan``."""
        return steps

    def approach(self, integrator: SubsystemIntegrator, t: float) -> int:
        """See ``StepPlan``."""
        grid = self.grid.until(t, self.progress.steps + 1)
        for k in range(self.progress.steps + 1, grid.n + 1):
            ends, no_row = np.array([grid.time(k)]), OutputSchedule.at_ends(np.zeros(1, dtype=bool))
            chunk = Chunk(1, h=grid.step(k), begin=grid.time(k - 1), ends=ends, schedule=no_row)
            if not integrator.advance(chunk).steps:
                return -1
        return 0

    def end_at(self, t: float) -> None:
        """See ``StepPlan``."""
        self.output = self.output.until(t, self.progress.steps + 1)
        self.grid = self.output.grid


class ControlledSteps:
    """Steps whose size follows from a local ``tolerance`` [m]."""

    def __init__(self, output: OutputTimes, tolerance: float) -> None:
        self.output, self.tolerance, self.progress = output, tolerance, Progress()

    @property
    def ended(self) -> bool:
        """See ``StepPlan``."""
        return self.progress.output_times == self.output.total

    def next_chunk(self, steps: int, stride: int) -> Chunk:
        """See ``StepPlan``."""
        times = self.output.after(self.progress.output_times)
        return Chunk(steps, begin=self.progress.time, times=times)

    def accept(self, advance: Advance) -> None:
        """See ``StepPlan``."""
        self.progress.steps += advance.steps
        if advance.steps:
            end = float(advance.ends[advance.steps - 1])
            self.progress.time = min(end, self.output.grid.t_final)

    def failure(self, integrator: SubsystemIntegrator, advance: Advance) -> str | None:
        """See ``StepPlan``."""
        if advance.steps:
            return None
        begin, h = self.progress.time, self.output.grid.h
        return tolerance_not_met(integrator, begin, h, self.tolerance, advance.outcome)

    def kept_before(self, step: int) -> int:
        """See ``StepPlan``; steps come in pairs."""
        return step - step % 2

    def most_kept(self, steps: int) -> int:
        """See ``StepPlan``; a chunk of more than a pair may end after any of them."""
        return 2

    def approach(self, integrator: SubsystemIntegrator, t: float) -> int:
        """See ``StepPlan``."""
        begin, row = self.progress.time, -1
        while begin < t * (1.0 - ROUND_OFF):
            advance = integrator.advance(Chunk(2, begin=begin, times=np.array([t])))
            if not advance.steps:
                return -1
            begin, row = float(advance.ends[-1]), advance.steps - 1
        return row

    def end_at(self, t: float) -> None:
        """See ``StepPlan``."""
        self.output = self.output.until(t)
