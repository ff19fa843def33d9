"""Takes steps of the explicit Runge-Kutta schemes, of a given size."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from msahl.events.margins import Span, build_margins
from msahl.formulations.tree.table import Tree
from msahl.jit.compiled import Call, compiled
from msahl.jit.storage import Storage
from msahl.model.scheme import EXPLICIT
from msahl.schemes.collocation import dense_output
from msahl.schemes.collocation.newton import record_step
from msahl.schemes.common.workspace import Workspace, kind_of
from msahl.schemes.detection import Detection
from msahl.schemes.explicit import steps
from msahl.schemes.explicit.step import new_explicit_workspace
from msahl.schemes.outcome import Outcome
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import NO_TIMES
from msahl.system.cut import Cut

_take_steps = compiled(steps.take_steps)
_take_steps_to_event = compiled(steps.take_steps_to_event)
_record_step = compiled(record_step)

NO_ROWS = np.zeros(0, dtype=np.int64)
MOST_DIVISIONS = 64
"""Most divisions of one step and its parts: all of it to steps of a 64th, or a place in it to the
shortest ones. A step that needs more is unstable, and so are those after it, of which each would be
divided a thousand times until the motion leaves the range of the shortest."""


class ExplicitMethod:
    """The ``StepMethod`` of an explicit ``scheme`` in the coordinates of a ``tree``. A step depends
    on the state alone, so nothing is remembered of earlier ones.
    """

    varies = False
    most_divisions: float = MOST_DIVISIONS
    memory: tuple[Any, ...] = ()
    forms: np.ndarray | None = None
    rare_calls: list[Call] = []  # noqa: RUF012 - a step that is not taken has no other solution

    def __init__(
        self,
        workspace: Workspace,
        scheme: str,
        tree: tuple[Tree, Cut | None],
        span: Span,
        storage: Storage,
    ) -> None:
        self.workspace, self.scheme, self.degree = workspace, scheme, EXPLICIT[scheme] // 2
        order = EXPLICIT[scheme]
        fresh = new_explicit_workspace(workspace, scheme, order, tree)
        self.subsystem = storage.place(scheme, fresh)
        self.detection: Detection | None = None
        margins = build_margins(workspace.system, order, span)
        if margins is not None:
            output, instant = self.subsystem.dense_output, self.subsystem.instant
            self.detection = Detection(margins, workspace, output, instant, storage)

    @property
    def kind(self) -> str:
        """See ``StepMethod``."""
        loops = "-tree" if self.subsystem.tree.loops is None else "-loops"
        events = "-events" if self.detection else ""
        return f"{kind_of(self.workspace.system)}{loops}-explicit{events}"

    @property
    def calls(self) -> list[Call]:
        """See ``StepMethod``."""
        plain = _take_steps, (self.subsystem, 0.0, 0, 0, NO_ROWS, NO_TIMES)
        detection = self.detection
        if not detection:
            return [plain]
        recorded = _record_step, (self.subsystem, 0.0, 0, NO_ROWS, NO_TIMES)
        given = self.subsystem, detection.detector, 0.0, 0, 0, NO_ROWS, NO_TIMES
        parts = [plain, recorded] if detection.splits else []
        return [(_take_steps_to_event, given), *parts, *detection.calls]

    @property
    def counters(self) -> dict[str, Any]:
        """See ``StepMethod``."""
        return {"degree": self.degree}

    def restore(self, counters: dict[str, Any]) -> None:
        """See ``StepMethod``."""

    def set_degree(self, degree: int) -> None:
        """See ``StepMethod``; each scheme has one."""

    def set_forms(self, forms: np.ndarray) -> None:
        """See ``StepMethod``; there is one form."""

    def begin_again(self, other: "ExplicitMethod") -> None:
        """See ``StepMethod``."""

    def take_steps(self, h: float, first: int, last: int, schedule: OutputSchedule) -> int:
        """See ``StepMethod``."""
        rest = h, first, last, schedule.due, schedule.share
        if self.detection:
            return int(_take_steps_to_event(self.subsystem, self.detection.detector, *rest))
        return int(_take_steps(self.subsystem, *rest))

    def take_varied(self, sizes: np.ndarray, first: int, schedule: OutputSchedule) -> int:
        """See ``StepMethod``; no run of such steps chooses their sizes."""
        return first

    def take_step(self, h: float, share: float) -> Outcome:
        """See ``StepMethod``; nothing here depends on the ``share``."""
        _take_steps(self.subsystem, h, 0, 1, NO_ROWS, NO_TIMES)
        residual, worst = self.subsystem.outcome
        return Outcome(float(residual), int(worst))

    def take_step_by_scipy(
        self, h: float, share: float, count_work: Callable[[int], None]
    ) -> Outcome:
        """See ``StepMethod``; there is nothing to solve."""
        return Outcome(math.inf, -1)

    take_step_by_path = take_step_by_scipy

    def record_step(self, h: float, step: int, schedule: OutputSchedule) -> None:
        """See ``StepMethod``."""
        _record_step(self.subsystem, h, step, schedule.due, schedule.share)

    def reset_prediction(self) -> None:
        """See ``StepMethod``; the start of the dense output is saved."""
        dense_output.save_end(self.subsystem.dense_output.begin, self.workspace)
