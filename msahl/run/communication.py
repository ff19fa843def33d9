"""Plans of the steps of a run that goes from one communication point to the next.

Steps are those of ``msahl run``, whatever the communication points are: one that passes a point is
not shortened, and the rows at the points within it come from its dense output. Only a point at
which something has changed, or is about to (``exact``), ends a step.
"""

import math

import numpy as np

from msahl.run.output import OutputTimes
from msahl.run.step_plan import ROUND_OFF, ControlledSteps, GivenSteps
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Advance, Chunk

MOST_AHEAD = 256
"""Most communication points for which rows are written ahead, within one step."""
SAME_TIME = 1e-9
"""Difference of times, as a fraction of an interval of a grid, that is round-off of a caller."""


def on_grids(times: np.ndarray, output: OutputTimes) -> np.ndarray:
    """Return the ``times`` (m,) [s], replaced by output times or ends of steps that they are but
    for round-off: those of a caller are sums.
    """
    found = times
    for grid in (output.grid, output.shown):
        k = np.minimum(np.rint(times / grid.h), grid.n)
        own = grid.times(k)
        found = np.where(np.abs(own - times) <= SAME_TIME * grid.h, own, found)
    return found


class Aim:
    """Communication points: the next one at ``target`` [s], the others expected ``interval`` [s]
    apart, ``most`` of them at once. If ``exact``, a step ends at the target.
    """

    def __init__(self, output: OutputTimes) -> None:
        self.output, self.most = output, max(1, min(MOST_AHEAD, output.chunk - 1))
        self.target, self.interval, self.exact = 0.0, math.inf, False

    def points(self, after: float, until: float) -> np.ndarray:
        """Return the points behind ``after`` and up to ``until`` [s]."""
        if not math.isfinite(self.interval) or self.exact:
            points = np.array([self.target])
        else:
            points = self.target + self.interval * np.arange(self.most)
            points = on_grids(points, self.output)
        slack = SAME_TIME * (until - after)
        return points[(points > after) & (points <= until + slack)]


class GridSteps(GivenSteps):
    """Steps on the grid of a run, and parts of these between points that are exact."""

    def __init__(self, output: OutputTimes) -> None:
        super().__init__(output)
        self.aim, self.given = Aim(output), output

    def next_chunk(self, steps: int, stride: int) -> Chunk:
        """See ``StepPlan``: steps up to the target, or one more step that passes it."""
        grid, first = self.grid, self.progress.steps
        last = min(self._passed(self.aim.target), first + steps)
        if not self._on_grid or last == first:
            return self._next_step()
        if last == grid.n and not grid.uniform and last > first + 1:
            last -= 1  # the last step is shorter
        ends = grid.times(np.arange(first + 1, last + 1))
        return self._chunk(ends, grid.step(last))

    @property
    def passes(self) -> bool:
        """Whether the next chunk is a step that may pass the target."""
        reaches = self._on_grid and self._passed(self.aim.target) > self.progress.steps
        return not (self.aim.exact or reaches)

    @property
    def _on_grid(self) -> bool:
        """Whether the last step ended where one of the run ends."""
        return self.progress.time == self.grid.time(self.progress.steps)

    def _passed(self, t: float) -> int:
        """Number of intervals of the grid that end at or before ``t`` [s], up to round-off."""
        k = min(int(t / self.grid.h) + 1, self.grid.n)
        while self.grid.time(k) > t + SAME_TIME * self.grid.h:
            k -= 1
        return k

    def _next_step(self) -> Chunk:
        """Return the step up to the next end on the grid, or to an exact target before it."""
        end, h = self.grid.time(self.progress.steps + 1), self.grid.step(self.progress.steps + 1)
        part = min(end, self.aim.target) if self.aim.exact else end
        complete = self._on_grid and part == end
        return self._chunk(np.array([part]), h if complete else part - self.progress.time)

    def _chunk(self, ends: np.ndarray, h: float) -> Chunk:
        begin = self.progress.time
        times = self.aim.points(begin, float(ends[-1]))
        return Chunk(
            last=len(ends),
            h=h,
            begin=begin,
            ends=ends,
            schedule=OutputSchedule.passed(times, begin, ends),
            times=times,
        )

    def accept(self, advance: Advance) -> None:
        """See ``StepPlan``."""
        if advance.steps:
            self.progress.time = float(advance.ends[advance.steps - 1])
            self.progress.steps = self._passed(self.progress.time)

    def approach(self, integrator: SubsystemIntegrator, t: float) -> int:
        """See ``StepPlan``."""
        grid, first = self.grid.until(t, self.progress.steps + 1), self.progress.steps
        if self.progress.time == grid.time(first):
            return super().approach(integrator, t)
        begin = self.progress.time
        for k in range(first + 1, grid.n + 1):
            ends, no_row = np.array([grid.time(k)]), OutputSchedule.at_ends(np.zeros(1, dtype=bool))
            chunk = Chunk(1, h=grid.time(k) - begin, begin=begin, ends=ends, schedule=no_row)
            if not integrator.advance(chunk).steps:
                return -1
            begin = grid.time(k)
        return 0

    def begin_again(self) -> None:
        """Undo ``end_at``."""
        self.output, self.grid = self.given, self.given.grid


class FreeSteps(ControlledSteps):
    """Steps whose size follows from a tolerance: those of a run, a pair at a time."""

    def __init__(self, output: OutputTimes, tolerance: float) -> None:
        super().__init__(output, tolerance)
        self.aim, self.given = Aim(output), output

    @property
    def ended(self) -> bool:
        """See ``StepPlan``."""
        return self.progress.time >= self.output.grid.t_final * (1.0 - ROUND_OFF)

    @property
    def passes(self) -> bool:
        """Whether the next chunk is a pair of steps that may pass the target."""
        return not self.aim.exact

    def next_chunk(self, steps: int, stride: int) -> Chunk:
        """See ``StepPlan``; no pair goes beyond where one of the run's chunks ends."""
        begin, shown, every = self.progress.time, self.output.shown, self.output.every
        end = self.output.after(1 + shown.count(begin) // every)[-1]
        if self.aim.exact:
            end = min(end, self.aim.target)
        times = self.aim.points(begin, end)
        if not times.size or times[-1] < end * (1.0 - ROUND_OFF):
            times = np.append(times, end)
        return Chunk(2, begin=begin, times=times)

    def begin_again(self) -> None:
        """Undo ``end_at``."""
        self.output = self.given
