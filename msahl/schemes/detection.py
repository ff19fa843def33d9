"""Detects the events of one subsystem for a stepper."""

from collections.abc import Callable
from typing import Any

import numpy as np

from msahl.events import margins
from msahl.events.margins import END, Margins
from msahl.events.search import Event
from msahl.jit.compiled import Call, compiled
from msahl.jit.storage import Storage
from msahl.schemes import step_events
from msahl.schemes.collocation.dense_output import DenseOutput
from msahl.schemes.common.accelerations import Instant
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.step_events import (
    AFTER,
    ARMED,
    GUESS,
    KNOWN,
    LEVEL,
    RATE,
    Detector,
    new_detector,
)

COMPILED: dict[Any, Any] = {
    kernel: compiled(kernel)
    for kernel in (step_events.begin_step, step_events.has_event, margins.set_values)
}


class Detection:
    """The ``Detector`` that a stepper passes to its compiled loop, and what it does itself where
    that loop has seen an event or could not solve a step.
    """

    def __init__(
        self,
        found: Margins,
        workspace: Workspace,
        output: DenseOutput,
        instant: Instant | None,
        storage: Storage,
    ) -> None:
        self.workspace, self.storage = workspace, storage
        fresh = new_detector(found, workspace.state, output, instant)
        self.detector: Detector = storage.place(("events", id(output)), fresh)
        self.splits = self.detector.divides

    @property
    def calls(self) -> list[Call]:
        """As ``Stepper.calls``: what divides steps."""
        if not self.splits:
            return []
        step, values = (self.detector, self.workspace), COMPILED[margins.set_values]
        taken = COMPILED[step_events.begin_step], COMPILED[step_events.has_event]
        return [*((kernel, step) for kernel in taken), (values, self._values)]

    def arm(self, time: float) -> None:
        """Let events after ``time`` [s] end the run, and know nothing of the steps before."""
        self.detector.figures[ARMED], self.detector.figures[KNOWN] = time, np.nan
        self.detector.event[0] = -1

    def begin(self) -> None:
        """Save the start of a step that Python takes."""
        self._call(step_events.begin_step, self.detector, self.workspace)

    def look(self) -> Event | None:
        """Return the first event in the step that Python has taken; then the state is as before."""
        self._call(step_events.has_event, self.detector, self.workspace)
        return self.event()

    def event(self) -> Event | None:
        """Return the event in the last step, or None."""
        k, figures = int(self.detector.event[0]), self.detector.figures
        if k < 0:
            return None
        ends_run = bool(self.detector.margins.action[k] == END)
        guess, after, level, rate = (float(figures[i]) for i in (GUESS, AFTER, LEVEL, RATE))
        return Event(k, ends_run, guess, after, level, rate)

    def value(self, k: int) -> float:
        """Return margin ``k`` of the present state."""
        self._call(margins.set_values, *self._values)
        return float(self.detector.probe[k])

    @property
    def _values(self) -> tuple[Any, ...]:
        system, start = self.workspace.system, self.workspace.start
        return self.detector.margins, system, start, self.detector.probe

    def _call(self, kernel: Callable[..., Any], *arguments: Any) -> None:
        """Call a ``kernel``, compiled if steps are divided; else only hard steps need it."""
        if self.splits:
            COMPILED[kernel](*arguments)
        else:
            self.storage.call(kernel, *arguments)
