"""Solves single steps of the schemes of order 2 for ``fixed_stepper.FixedStepper``."""

import math
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.events.margins import UNCHANGING, Changing, Span, build_margins
from msahl.jit.compiled import Call, compiled
from msahl.jit.storage import Storage
from msahl.schemes.common import accelerations, workspace
from msahl.schemes.common.accelerations import new_instant
from msahl.schemes.common.workspace import Workspace, kind_of
from msahl.schemes.midpoint import newton
from msahl.schemes.outcome import Outcome
from msahl.schemes.output_schedule import OutputSchedule

if TYPE_CHECKING:
    from msahl.schemes.detection import Detection

_take_steps = compiled(newton.take_steps)
_take_step = compiled(newton.take_step)
_record_step = compiled(workspace.record_step)
_write_reactions = compiled(accelerations.write_instantaneous_reactions)
_take_steps_instantaneous = compiled(newton.take_steps_instantaneous)


class MidpointMethod:
    """The ``StepMethod`` of the energy-preserving and the decaying scheme.

    ``instantaneous`` asks for reactions at the output times instead of means over the steps; these
    and accelerations need the index-1 problem of every output time.
    """

    degree = 0
    varies = False
    most_divisions = math.inf
    memory: None = None
    forms: None = None

    def __init__(
        self,
        workspace: Workspace,
        instantaneous: bool,
        span: Span,
        storage: Storage,
        changing: Changing = UNCHANGING,
    ) -> None:
        self.workspace = workspace
        self.instant = None
        if instantaneous or workspace.tables.accelerations.shape[1]:
            instant = new_instant(workspace.system, publishes_reactions=instantaneous)
            self.instant = storage.place("instant", instant)
        self.detection = _new_detection(workspace, span, storage, changing)

    def set_forms(self, forms: np.ndarray) -> None:
        """See ``StepMethod``; there is one form."""

    @property
    def kind(self) -> str:
        """See ``StepMethod``."""
        kind = kind_of(self.workspace.system)
        kind += "-exponential" if self.workspace.system.frames.exponential else ""
        kind += "-events" if self.detection else ""
        return kind if self.instant is None else f"{kind}-instantaneous"

    @property
    def calls(self) -> list[Call]:
        """See ``StepMethod``."""
        steps, rows = (0.0, 0, 0), np.zeros(0, dtype=np.int64)
        if self.detection:
            given = self.workspace, self.instant, self.detection.detector, *steps, rows
            return [(_steps_to_event(), given), *self.detection.calls]
        if self.instant is None:
            return [(_take_steps, (self.workspace, *steps, rows))]
        return [(_take_steps_instantaneous, (self.workspace, self.instant, *steps, rows))]

    @property
    def rare_calls(self) -> list[Call]:
        """See ``StepMethod``; scipy is slow to import."""
        from msahl.schemes.midpoint import scipy_root

        calls: list[Call] = [
            *scipy_root.calls(self.workspace),
            (_take_step, (self.workspace, 0.0, 0.0)),
            (_record_step, (self.workspace, 0.0, 0, 0)),
        ]
        if self.instant is not None:
            calls.append((_write_reactions, (self.workspace, self.instant, 0)))
        return calls

    @property
    def counters(self) -> dict[str, Any]:
        """See ``StepMethod``."""
        return {}

    def restore(self, counters: dict[str, Any]) -> None:
        """See ``StepMethod``."""

    def set_degree(self, degree: int) -> None:
        """See ``StepMethod``; there is but one."""

    def begin_again(self, other: "MidpointMethod") -> None:
        """See ``StepMethod``; all that a step depends on is in the state."""

    def take_steps(self, h: float, first: int, last: int, schedule: OutputSchedule) -> int:
        """See ``StepMethod``."""
        rows = schedule.ends()
        if self.detection:
            given = self.workspace, self.instant, self.detection.detector, h, first, last, rows
            return int(_steps_to_event()(*given))
        if self.instant is None:
            return int(_take_steps(self.workspace, h, first, last, rows))
        return int(_take_steps_instantaneous(self.workspace, self.instant, h, first, last, rows))

    def take_varied(self, sizes: np.ndarray, first: int, schedule: OutputSchedule) -> int:
        """See ``StepMethod``; no run of such steps chooses their sizes."""
        return first

    def take_step(self, h: float, share: float) -> Outcome:
        """See ``StepMethod``."""
        return Outcome(*_take_step(self.workspace, h, share))

    def take_step_by_scipy(
        self, h: float, share: float, count_work: Callable[[int], None]
    ) -> Outcome:
        """See ``StepMethod``; scipy is slow to import."""
        from msahl.schemes.midpoint import scipy_root

        return scipy_root.take_step(self.workspace, h, share, count_work)

    def take_step_by_path(
        self, h: float, share: float, count_work: Callable[[int], None]
    ) -> Outcome:
        """See ``StepMethod``; imported as scipy is."""
        from msahl.schemes.midpoint import continuation

        return continuation.take_step(self.workspace, h, share, count_work)

    def record_step(self, h: float, step: int, schedule: OutputSchedule) -> None:
        """See ``StepMethod``."""
        row = int(schedule.ends()[step])
        _record_step(self.workspace, h, step, row)
        if self.instant is not None and row >= 0:
            _write_reactions(self.workspace, self.instant, row)

    def reset_prediction(self) -> None:
        """See ``StepMethod``: where accelerations change fast, the change over the last step is a
        worse prediction than none.
        """
        state = self.workspace.state
        for trend in (state.a_trend, state.alpha_trend, state.force_trend):
            trend[:] = 0.0


def _new_detection(
    workspace: Workspace, span: Span, storage: Storage, changing: Changing
) -> "Detection | None":
    """What detects events, if there can be any. The code is only loaded where it is needed."""
    margins = build_margins(workspace.system, 2, span, *changing)
    if margins is None:
        return None
    from msahl.schemes.collocation.dense_output import new_dense_output
    from msahl.schemes.detection import Detection

    output = storage.place("dense output", new_dense_output(workspace, order=2, decays=False))
    return Detection(margins, workspace, output, None, storage, *changing)


@cache
def _steps_to_event() -> Any:
    from msahl.schemes.midpoint.steps_to_event import take_steps

    return compiled(take_steps)
