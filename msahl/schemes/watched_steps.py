"""Takes many steps of a system that has margins, up to the first event in them."""

import numpy as np

from msahl.jit.kernel import kernel, optional
from msahl.schemes import accelerations
from msahl.schemes.accelerations import Instant
from msahl.schemes.collocation import newton as collocation
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.schemes.midpoint import newton as midpoint
from msahl.schemes.midpoint.workspace import Workspace, record_step
from msahl.schemes.outcome import TOLERANCE
from msahl.schemes.step_events import Watch, begin_step, has_event


@kernel
def take_midpoint_steps(
    workspace: Workspace,
    instant: Instant | None,
    watch: Watch,
    h: float,
    first: int,
    last: int,
    rows: np.ndarray,
) -> int:
    """As ``midpoint.newton.take_steps``, or with an ``instant`` ``accelerations.take_steps``; also
    return at a step with an event, which is not taken.
    """
    for k in range(first, last):
        begin_step(watch, workspace)
        residual, _ = midpoint.take_step(workspace, h, 1.0)
        if not residual <= TOLERANCE or has_event(watch, workspace):
            return k
        record_step(workspace, h, k, rows[k])
        if rows[k] >= 0:
            _write_reactions(instant, workspace, rows[k])
    return last


@optional()
def _write_reactions(instant: Instant, workspace: Workspace, row: int) -> None:
    accelerations.write_instantaneous_reactions(workspace, instant, row)


@kernel
def take_collocation_steps(
    subsystem: CollocationWorkspace,
    watch: Watch,
    h: float,
    first: int,
    last: int,
    due: np.ndarray,
    share: np.ndarray,
) -> int:
    """As ``collocation.newton.take_steps``; also return at a step with an event, which is not
    taken.
    """
    for step in range(first, last):
        begin_step(watch, subsystem.workspace)
        if not collocation.take_step(subsystem, h):
            return step
        if has_event(watch, subsystem.workspace):
            collocation.reset_prediction(subsystem)
            return step
        collocation.record_step(subsystem, h, step, due, share)
    return last
