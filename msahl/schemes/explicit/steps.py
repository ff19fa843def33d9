"""Takes many steps of the explicit schemes, up to the first event where there are margins."""

import numpy as np

from msahl.jit.kernel import kernel
from msahl.schemes.collocation import dense_output
from msahl.schemes.collocation.newton import record_step
from msahl.schemes.explicit.step import ExplicitWorkspace, take_step
from msahl.schemes.step_events import Detector, begin_step, has_event, has_known_time


@kernel
def take_steps(
    subsystem: ExplicitWorkspace,
    h: float,
    first: int,
    last: int,
    due: np.ndarray,
    share: np.ndarray,
) -> int:
    """As ``collocation.newton.take_steps``."""
    for step in range(first, last):
        if due.size > 0:
            dense_output.save_end(subsystem.dense_output.begin, subsystem.workspace)
        if not take_step(subsystem, h):
            return step
        if due.size > 0:
            record_step(subsystem, h, step, due, share)
    return last


@kernel
def take_steps_to_event(
    subsystem: ExplicitWorkspace,
    detector: Detector,
    h: float,
    first: int,
    last: int,
    due: np.ndarray,
    share: np.ndarray,
) -> int:
    """As ``collocation.steps_to_event.take_steps``."""
    for step in range(first, last):
        if has_known_time(detector, subsystem.workspace.state.time[0], h):
            return step
        begin_step(detector, subsystem.workspace)
        if not take_step(subsystem, h) or has_event(detector, subsystem.workspace):
            return step
        record_step(subsystem, h, step, due, share)
    return last
