"""Takes steps of a given size by any scheme, and subdivides those that cannot be solved.

The solver ``newton`` is the compiled loop, ``root`` means ``scipy.optimize.root``, and ``auto``
starts with scipy; a step that the compiled loop does not solve is solved along a path from shorter
ones, else by scipy. A step that none solves is divided into two halves, each of these again where
needed, down to 2^-10 of it.
"""

import math
import time
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from msahl.jit.compiled import Call
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.outcome import EVALUATION, STEP_WORK, Outcome, Requests
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Advance, Chunk, Events, Stepper
from msahl.system import evaluate
from msahl.system.arrays import State

MAX_SUBDIVISIONS = 10
LARGEST_DENSE = 300
"""Largest number of unknowns for which ``auto`` calls scipy, whose algebra is dense: a step with
300 unknowns takes it tens of milliseconds, and the time grows with the third power."""
MAX_EVENTS = 64
"""Largest number of events within one step; with more the step counts as failed."""


class StepMethod(Protocol):
    """How one scheme solves its steps; ``FixedStepper`` decides which of these calls to make."""

    workspace: Workspace
    degree: int  # of the polynomials; 0 for the schemes of order 2

    @property
    def kind(self) -> str:
        """Name of the compiled code that the steps need."""

    @property
    def calls(self) -> list[Call]:
        """As ``Stepper.calls``, of the compiled loop."""

    @property
    def rare_calls(self) -> list[Call]:
        """As ``Stepper.calls``, of steps that the compiled loop does not solve."""

    @property
    def memory(self) -> Any:
        """As ``Stepper.memory``."""

    @property
    def counters(self) -> dict[str, Any]:
        """As ``Stepper.counters``."""

    def restore(self, counters: dict[str, Any]) -> None:
        """As ``Stepper.restore``."""

    def set_degree(self, degree: int) -> None:
        """Take the next steps by polynomials of this ``degree``."""

    def take_steps(self, h: float, first: int, last: int, schedule: OutputSchedule) -> int:
        """Take and record steps ``first``..``last - 1`` in compiled code; the number of the first
        that was not solved, ``last`` if all were.
        """

    def take_step(self, h: float, share: float) -> Outcome:
        """Take one step of size ``h``, a ``share`` of the requested one, in compiled code."""

    def take_step_by_scipy(
        self, h: float, share: float, count_work: Callable[[int], None]
    ) -> Outcome:
        """As ``take_step``, with scipy; ``count_work`` receives the work done."""

    def take_step_by_path(
        self, h: float, share: float, count_work: Callable[[int], None]
    ) -> Outcome:
        """As ``take_step_by_scipy``, along a path from shorter steps, if the scheme has that."""

    def record_step(self, h: float, step: int, schedule: OutputSchedule) -> None:
        """Write the monitor's row ``step`` and the rows of the tables that are due there."""

    def reset_prediction(self) -> None:
        """As ``Stepper.reset_prediction``."""


class FixedStepper:
    """A ``Stepper`` with steps of a given size.

    ``may_compile`` says whether ``auto`` may use the compiled loop, ``large`` whether the subsystem
    is too large for scipy.
    """

    def __init__(self, method: StepMethod, solver: str) -> None:
        self.method, self.solver, self.workspace = method, solver, method.workspace
        self.requests = Requests()
        self.events: Events | None = None
        self.scipy_steps = self.path_steps = self.subdivisions = 0
        unknowns = self.workspace.unknowns.free.size
        self.large = bool(unknowns * max(method.degree, 1) > LARGEST_DENSE)
        # scipy takes the first step of the schemes of order 2. It would have to be compiled for
        # the others as well, so there it is called only where the compiled loop fails.
        self.may_compile = method.degree > 0

    @property
    def kind(self) -> str:
        """See ``Stepper``."""
        return self.method.kind

    @property
    def calls(self) -> list[Call]:
        """See ``Stepper``."""
        if self.solver == "root":
            return self.method.rare_calls
        by_scipy = self.solver == "auto" and not self.may_compile and not self.large
        return [*self.method.calls, *(self.method.rare_calls if by_scipy else ())]

    @property
    def memory(self) -> Any:
        """See ``Stepper``."""
        return self.method.memory

    @property
    def counters(self) -> dict[str, Any]:
        """See ``Stepper``."""
        return {"may_compile": self.may_compile, **self.method.counters}

    def restore(self, counters: dict[str, Any]) -> None:
        """See ``Stepper``."""
        self.may_compile = counters["may_compile"]
        self.method.restore(counters)

    def reset_prediction(self) -> None:
        """See ``Stepper``."""
        self.method.reset_prediction()

    def follow_degree(self, other: Stepper) -> None:
        """See ``Stepper``."""
        degree = other.counters.get("degree", 0)
        if degree != self.method.degree:
            self.method.set_degree(degree)

    def smallest_tried(self, h: float) -> float:
        """See ``Stepper``."""
        return h / 2**MAX_SUBDIVISIONS

    def as_json(self) -> tuple[dict[str, Any] | None, dict[str, float]]:
        """See ``Stepper``."""
        return None, {}

    def advance(self, chunk: Chunk, patience: float = math.inf) -> Advance:
        """See ``Stepper``."""
        k, outcome = chunk.first, Outcome(0.0, -1)
        began = time.perf_counter()
        while k < chunk.last:
            if self._uses_compiled_loop():
                k = self.method.take_steps(chunk.h, k, chunk.last, chunk.schedule)
            if k < chunk.last:
                outcome = self._solve_hard_step(chunk.h)
                if not outcome.converged:
                    break
                self.method.record_step(chunk.h, k, chunk.schedule)
                k += 1
                self.may_compile = True
                if time.perf_counter() - began > patience:
                    break
        taken = max(0, k - chunk.first)
        ends = chunk.ends[:taken]
        return Advance(k, outcome, chunk.schedule, np.full(taken, chunk.h), ends)

    def _uses_compiled_loop(self) -> bool:
        if self.events is not None:
            return False
        return self.solver == "newton" or (
            self.solver == "auto" and (self.may_compile or self.large)
        )

    def _solve_hard_step(self, h: float) -> Outcome:
        """Take one step, or all of it in substeps; on failure the state is as before."""
        before = self._saved()
        if self.events is None:
            self.reset_prediction()
            outcome = self._subdivide(h, 1.0)
        else:
            outcome = self._solve_to_events(self.events, h)
        if not outcome.converged:
            self.reset_prediction()
            self._go_back(before)
        return outcome

    def _subdivide(self, h: float, share: float, depth: int = MAX_SUBDIVISIONS) -> Outcome:
        """Take a step ``h``, a ``share`` of the requested one, or its two halves if it fails."""
        # The compiled loop has tried the complete step, unless it has to end at events.
        tried = depth == MAX_SUBDIVISIONS and self.events is None
        outcome = self._solve_once(h, share, tried)
        if outcome.converged or depth == 0:
            return outcome
        self.subdivisions += 1
        outcome = self._subdivide(0.5 * h, 0.5 * share, depth - 1)
        return self._subdivide(0.5 * h, 0.5 * share, depth - 1) if outcome.converged else outcome

    def _solve_once(self, h: float, share: float, tried: bool) -> Outcome:
        """Take a step by one solver after the other; ``tried``: the compiled one has failed."""
        if self.solver == "newton" or (self.solver == "auto" and self.large):
            self.requests.after(EVALUATION + STEP_WORK * self.workspace.unknowns.free.size)
            return self.method.take_step(h, share)
        if self.solver == "root" or not self.may_compile:
            return self._solve_by_scipy(h, share)
        outcome = Outcome(math.inf, -1)
        if not tried:
            outcome = self.method.take_step(h, share)
        if not outcome.converged:
            self.reset_prediction()
            outcome = self.method.take_step_by_path(h, share, self.requests.after)
            self.path_steps += int(outcome.converged)
        return outcome if outcome.converged else self._solve_by_scipy(h, share)

    def _solve_by_scipy(self, h: float, share: float) -> Outcome:
        self.scipy_steps += 1
        return self.method.take_step_by_scipy(h, share, self.requests.after)

    def _solve_to_events(self, events: Events, h: float) -> Outcome:
        """Take a step ``h`` in substeps that end at its events, each of which is applied."""
        workspace, left = self.workspace, 1.0  # fraction of the step that is still to be taken
        for _ in range(MAX_EVENTS):
            before, saved = State(*(array.copy() for array in workspace.state)), self._saved()
            outcome = self._subdivide(left * h, left)
            if not outcome.converged:
                return outcome
            part = events.first(workspace, before, left * h)
            if part > 1.0:
                return outcome
            if part < 1.0:
                self._go_back(saved)
                self.reset_prediction()
                outcome = self._subdivide(part * left * h, part * left)
                if not outcome.converged:
                    return outcome
            events.apply(workspace)
            evaluate.prepare(workspace.system, workspace.state, workspace.start)
            self.reset_prediction()
            left -= part * left
            if left <= 0.0:
                return outcome
        return Outcome(math.inf, -1)

    def _saved(self) -> list[np.ndarray]:
        """Copies of what a step changes."""
        return [array.copy() for array in self._changing()]

    def _go_back(self, saved: list[np.ndarray]) -> None:
        """Bring the workspace back to what was saved."""
        for array, value in zip(self._changing(), saved, strict=True):
            array[:] = value
        evaluate.prepare(self.workspace.system, self.workspace.state, self.workspace.start)

    def _changing(self) -> list[np.ndarray]:
        workspace = self.workspace
        return [*workspace.state, workspace.mean_force, workspace.mean_reaction]
