"""Takes many collocation steps of a system that has margins, up to the first event in them."""

import numpy as np

from msahl.jit.kernel import kernel
from msahl.schemes.collocation import newton
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.schemes.collocation.tree import stages as tree_stages
from msahl.schemes.step_events import Detector, begin_step, has_event, has_known_time


@kernel
def take_steps(
    subsystem: CollocationWorkspace,
    detector: Detector,
    h: float,
    first: int,
    last: int,
    due: np.ndarray,
    share: np.ndarray,
) -> int:
    """As ``newton.take_steps``; also return at a step with an event or a known time in it, which
    is not taken.
    """
    for step in range(first, last):
        if has_known_time(detector, subsystem.workspace.state.time[0], h):
            return step
        begin_step(detector, subsystem.workspace)
        tree_stages.choose_form(subsystem.tree, step)
        if not newton.take_step(subsystem, h):
            return step
        if has_event(detector, subsystem.workspace):
            newton.reset_prediction(subsystem)
            return step
        newton.record_step(subsystem, h, step, due, share)
    return last
