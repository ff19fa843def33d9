"""Work arrays that the functions of a consistent start share, and how they call kernels."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from msahl.elements.beams import instant
from msahl.elements.constraints import coordinates
from msahl.formulations.absolute.frames import moving_count
from msahl.jit.by_size import by_size
from msahl.jit.storage import Storage
from msahl.system import evaluate
from msahl.system.arrays import (
    State,
    System,
    SystemWorkspace,
    new_system_workspace,
    node_count,
    set_numbers,
)


class WorkArrays(NamedTuple):
    """Work arrays for one state, whose numbers may change; every function prepares what it uses."""

    start: SystemWorkspace  # of the state, and of the state at rest
    rest: State  # the state with velocities that are zero
    call: Callable[..., Any]  # calls a kernel with its arguments


def new_work_arrays(system: System, state: State, storage: Storage | None = None) -> WorkArrays:
    """Return the work arrays for a ``state``, from ``storage`` if that is given."""
    if storage is None:
        size = moving_count(system.frames)
        made = _start_and_rest(system, state)
        return WorkArrays(*made, lambda kernel, *given: by_size(kernel, size)(*given))
    made = storage.again("start", (system, state), lambda: _start_and_rest(system, state))
    set_numbers(system, made[0])
    return WorkArrays(*made, storage.call)


def _start_and_rest(system: System, state: State) -> tuple[SystemWorkspace, State]:
    """Return ``start`` and ``rest`` of work arrays."""
    rest = state._replace(v=np.zeros_like(state.v), w=np.zeros_like(state.w))
    return new_system_workspace(system, state), rest


def jacobian_at_rest(
    system: System, state: State, work_arrays: WorkArrays | None = None
) -> np.ndarray:
    """Return what ``evaluate.jacobian_at_rest`` returns, with the work arrays of the ``state``'s
    ``work_arrays``, if there is one.
    """
    if work_arrays is None:
        return evaluate.jacobian_at_rest(system, state)
    start, rest, call = work_arrays
    call(evaluate.prepare, system, rest, start)
    values, Z = np.zeros_like(system.constant), np.zeros((node_count(system), 3))
    if system.scalar:
        of_system, of_start = system.scalar.coordinates, start.scalar.coordinates
        call(coordinates.evaluate, of_system, of_start, system.frames, Z)
    call(evaluate.joint_jacobian, system, start, math.sqrt(2.0), Z, values)
    instant.determine_resultants(system.beams, values)
    return values
