"""Copies of a subsystem's arrays whose numbers, states and rows each stand in one block of memory.

So a compiled function can shift all of them by one loop; see ``schemes.common.tangents``.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from msahl.jit.storage import arrays_in, doubles_in
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.common.tangents import (
    FIRST_MEAN,
    FIRST_P,
    FIRST_V,
    FIRST_W,
    FIRST_X,
    FRAMES,
    LAST_MEAN,
)
from msahl.schemes.common.workspace import Workspace
from msahl.system.arrays import State

ONLY_PREDICTED = ("prediction", "mean_v", "mean_w", "a_trend", "alpha_trend", "force_trend")
"""Fields of the state that serve the prediction of a step only; its solution is without them."""


class Blocks(NamedTuple):
    """Numbers that never change, the state, and rows of results.

    Of each array of numbers only the ``first`` ones may be constant: the values on the tape of
    expressions begin with its constants.
    """

    numbers: list[np.ndarray]
    first: list[int]
    state: list[np.ndarray]
    rows: list[np.ndarray]


def blocks_of(integrator: SubsystemIntegrator) -> Blocks:
    """Return the arrays of the three blocks of a subsystem, each array once."""
    workspace = integrator.workspace
    numbers: list[Any] = [workspace.system]
    starts = [workspace.start]
    for subsystem in degrees_of(integrator).values():
        stages = subsystem.stages
        numbers += [stages.inverse_inertia, stages.linear, stages.first_energy]
        starts += [stages.start, subsystem.dense_output.workspace.start]
    arrays = _each_once(doubles_in(tuple(numbers)))
    first, signals = [array.size for array in arrays], workspace.system.forces.signals
    if signals is not None:
        values = _each_once([start.forces.signals.values.value for start in starts])
        arrays, first = arrays + values, first + [signals.tape.constant.size] * len(values)
    return Blocks(
        numbers=arrays,
        first=first,
        state=state_arrays(workspace),
        rows=[*workspace.tables, workspace.monitor.rows],
    )


def degrees_of(integrator: SubsystemIntegrator) -> dict[int, Any]:
    """Return the workspaces of a collocation scheme by degree; none of the schemes of order 2."""
    method: Any = getattr(integrator.stepper, "method")  # noqa: B009 - of both steppers
    return dict(getattr(method, "by_degree", {}))


def state_arrays(workspace: Workspace) -> list[np.ndarray]:
    """Return the arrays that a step hands to the next, and the mean forces over a step."""
    fields = [name for name in State._fields if name not in ONLY_PREDICTED]
    of_state = [getattr(workspace.state, name) for name in fields]
    return [*of_state, workspace.mean_force, workspace.mean_reaction]


def places_in_state(workspace: Workspace) -> np.ndarray:
    """Return ``Tangents.places``."""
    arrays = state_arrays(workspace)
    first = np.cumsum([0, *(array.size for array in arrays)])
    of = {id(array): int(k) for array, k in zip(arrays, first, strict=False)}
    state, places = workspace.state, np.zeros(7, dtype=np.int64)
    for place, array in (
        (FIRST_X, state.x),
        (FIRST_P, state.p),
        (FIRST_V, state.v),
        (FIRST_W, state.w),
        (FIRST_MEAN, workspace.mean_force),
    ):
        places[place] = of[id(array)]
    places[FRAMES], places[LAST_MEAN] = len(state.x), first[-1]
    return places


def constants(blocks: Blocks) -> np.ndarray:
    """Return all numbers of the first block, 0 where they are not constant."""
    numbers, begin = flat(blocks.numbers), 0
    for array, first in zip(blocks.numbers, blocks.first, strict=True):
        numbers[begin + first : begin + array.size] = 0.0
        begin += array.size
    return numbers


def flat(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Return all numbers of some arrays, one array after the other."""
    return np.concatenate([np.zeros(0), *(array.ravel(order="K") for array in arrays)])


class Copy:
    """A copy of nested groups, with the arrays of the three blocks in one block of memory each."""

    def __init__(self, groups: Any, blocks: Blocks) -> None:
        self._memory: dict[int, np.ndarray] = {}
        self._kept = [*arrays_in(groups)]  # identities stay those of living arrays
        self.numbers, self.state, self.rows = (
            self._block(part) for part in (blocks.numbers, blocks.state, blocks.rows)
        )
        self.groups = self._copied(groups)

    def _block(self, arrays: Sequence[np.ndarray]) -> np.ndarray:
        """Return one block with all numbers of some arrays, and make their copies parts of it."""
        block, first = flat(arrays), 0
        for array in arrays:
            part = block[first : first + array.size]
            rows_first = array.flags.c_contiguous
            shape = array.shape if rows_first else array.shape[::-1]
            self._memory[id(array)] = part.reshape(shape) if rows_first else part.reshape(shape).T
            first += array.size
        return block

    def _copied(self, value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return self._memory.setdefault(id(value), value.copy(order="K"))
        if isinstance(value, tuple):
            parts = [self._copied(part) for part in value]
            return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
        return value


def _each_once(arrays: Sequence[np.ndarray]) -> list[np.ndarray]:
    return list({id(array): array for array in arrays}.values())
