"""Work arrays that the functions of a consistent start share, and how they call kernels."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from msahl.elements.beams import instant
from msahl.elements.constraints import coordinates
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.jit.by_size import LARGE, by_size, compiled_once
from msahl.jit.storage import Storage
from msahl.system import evaluate
from msahl.system.arrays import (
    State,
    System,
    SystemWorkspace,
    coordinate_count,
    new_system_workspace,
    node_count,
    product_count,
)

PLAIN_CALLS = 100
"""Calls of kernels that stay plain Python: those of four events. To load their code takes a tenth
of a second, which plain Python needs for some ten events of one body, or for one of ten bodies."""
PRODUCTS = 64
"""Scalar products that make a call of plain Python take twice as long: a pair of boxes has 700."""


class WorkArrays(NamedTuple):
    """Work arrays for one state, whose numbers may change; every function prepares what it uses."""

    start: SystemWorkspace  # of the state, and of the state at rest
    rest: State  # the state with velocities that are zero
    call: Callable[..., Any]  # calls a kernel with its arguments


def size_of(system: System) -> int:
    """Return the bodies of a system, or its coordinates where they are more: one between each two
    bodies of a set of contacts.
    """
    return max(moving_count(system.frames), coordinate_count(system))


class PlainFirst:
    """Calls kernels as plain Python at first, as it takes longer to load their code, unless the
    ``system`` is large. Both give the same digits.
    """

    def __init__(self, system: System) -> None:
        self.size, self.calls = size_of(system), 0
        self.weight = 1 + product_count(system) // PRODUCTS

    def __call__(self, kernel: Callable[..., Any], *given: Any) -> Any:
        """Return what the ``kernel`` returns of what is ``given``."""
        self.calls += self.weight
        fast = self.size >= LARGE or self.calls > PLAIN_CALLS
        return (compiled_once(kernel) if fast else kernel)(*given)


def energy(system: System, state: State, work_arrays: WorkArrays) -> float:
    """Return the kinetic and potential energy of a ``state`` [J]."""
    violations = np.zeros((2, *state.violation.shape))
    work_arrays.call(evaluate.prepare, system, state, work_arrays.start)
    observed = work_arrays.call(evaluate.observe, system, state, work_arrays.start, *violations)
    return float(observed[0] + observed[1])


def new_work_arrays(system: System, state: State, storage: Storage | None = None) -> WorkArrays:
    """Return the work arrays for a ``state``, from ``storage`` if that is given."""
    start = new_system_workspace(system, state)
    rest = state._replace(v=np.zeros_like(state.v), w=np.zeros_like(state.w))
    size = size_of(system)
    if storage is not None:
        start, rest = storage.place("start", start), storage.place("rest", rest)
    return WorkArrays(start, rest, caller(size, storage))


def caller(size: int, storage: Storage | None) -> Callable[..., Any]:
    """Return what calls kernels that a run of so many bodies needs once or twice: with groups of
    the ``storage`` if there is one, but for a large system.
    """
    if storage is not None and size < LARGE:
        return storage.call
    return lambda kernel, *given: by_size(kernel, size)(*given)


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


def rigid_at_rest(system: System, state: State, work_arrays: WorkArrays) -> np.ndarray:
    """Return what ``jacobian_at_rest`` does with joints that are not relaxed where they are
    redundant: impulses tell directions along which bodies hardly move from those along which they
    cannot.
    """
    values = jacobian_at_rest(system, state, work_arrays)
    if not system.relaxation:
        return values
    row, column = system.blocks.T
    own = np.flatnonzero((row == column) & (row >= first_multiplier(system.frames)))
    exact = values.copy()
    for i in range(3):
        exact[9 * own + 4 * i] += system.relaxation
    return exact
