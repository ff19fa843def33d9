"""Takes many steps of order 2 of a system that has margins, up to the first event in them."""

import numpy as np

from msahl.jit.kernel import kernel, optional
from msahl.schemes.common import accelerations
from msahl.schemes.common.accelerations import Instant
from msahl.schemes.common.workspace import Workspace, record_step
from msahl.schemes.midpoint import newton
from msahl.schemes.outcome import TOLERANCE
from msahl.schemes.step_events import Detector, begin_step, has_event, has_known_time


@kernel
def take_steps(
    workspace: Workspace,
    instant: Instant | None,
    detector: Detector,
    h: float,
    first: int,
    last: int,
    rows: np.ndarray,
) -> int:
    """As ``newton.take_steps``, or with an ``instant`` ``accelerations.take_steps``; also
    return at a step with an event or a known time in it, which is not taken.
    """
    for k in range(first, last):
        if has_known_time(detector, workspace.state.time[0], h):
            return k
        begin_step(detector, workspace)
        residual, _ = newton.take_step(workspace, h, 1.0)
        if not residual <= TOLERANCE or has_event(detector, workspace):
            return k
        record_step(workspace, h, k, rows[k])
        if rows[k] >= 0:
            _write_reactions(instant, workspace, rows[k])
    return last


@optional()
def _write_reactions(instant: Instant, workspace: Workspace, row: int) -> None:
    accelerations.write_instantaneous_reactions(workspace, instant, row)
