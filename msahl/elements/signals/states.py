"""Auxiliary states over a step: equations (1) and (2) of the package, by Newton's method.

A step of the midpoint element is a step with one stage, A = 1/2 and b = 1.
"""

import math

import numpy as np

from msahl.algebra import small_system
from msahl.algebra.vector import at, put
from msahl.elements.constraints.products import PARTS
from msahl.elements.signals.group import Signals, SignalsWorkspace, Stages
from msahl.expressions.tape import by_input, gradient, set_input, sweep
from msahl.jit.kernel import kernel, optional

MOST_ITERATIONS = 30
"""Of Newton's method for the states; linear equations take one, and one that changes nothing."""
NO_CHANGE = 1e-15
"""Change of a state, relative to the terms of its equation, that is round-off."""
NEARLY_NO_CHANGE = 1e-8
"""Below it a change that does not fall to its half from one iteration to the next is round-off."""


@optional()
def set_state(group: Signals, start: SignalsWorkspace, stages: Stages, i: int) -> None:
    """Set the states of the configuration to those of stage ``i``."""
    for k in range(group.rate.size):
        start.state[k] = stages.state[i, k]


@optional()
def save_inputs(group: Signals, start: SignalsWorkspace, stages: Stages, i: int) -> None:
    """Save the inputs as those at stage ``i``."""
    first = group.tape.constant.size
    for j in range(group.kind.size):
        stages.input[i, j] = start.values.value[first + j]


@optional()
def solve(
    group: Signals, start: SignalsWorkspace, stages: Stages, begin: np.ndarray, h: float
) -> None:
    """Solve for the states at all stages of a step ``h`` from ``begin`` (n,), by the inputs that
    were saved; nan if Newton's method does not converge.
    """
    n, s = group.rate.size, stages.weight.size
    for i in range(s):
        for k in range(n):
            stages.state[i, k] = begin[k]
    changed, left, change = True, MOST_ITERATIONS, math.inf
    while changed and left > 0:
        for i in range(s):
            _set_rates(group, start, stages, i)
        _set_matrix(stages, n, h)
        last, change = change, _improve(stages, begin, n, h)
        changed, left = _is_change(change, last), left - 1
    if changed:
        for i in range(s):
            for k in range(n):
                stages.state[i, k] = stages.rate[i, k] = math.nan


@optional()
def refuse(group: Signals, stages: Stages, F: np.ndarray) -> None:
    """Set equations ``F`` (nodes, 3) of a step to nan if the auxiliary states have no solution:
    then the step has none, whether or not a force depends on them.
    """
    for i in range(stages.weight.size):
        for k in range(group.rate.size):
            if not math.isfinite(stages.rate[i, k]):
                for node in range(F.shape[0]):
                    put(F, node, (math.nan, math.nan, math.nan))


@kernel
def _set_rates(group: Signals, start: SignalsWorkspace, stages: Stages, i: int) -> None:
    """Set the states' rates at stage ``i``, and their derivatives."""
    n, first = group.rate.size, group.kind.size
    _load_stage(group, start, stages, i)
    for k in range(n):
        stages.rate[i, k] = start.values.value[group.rate[k]]
        gradient(group.tape, start.values, group.rate[k])
        for j in range(first):
            stages.rate_by_input[i, k, j] = by_input(group.tape, start.values, j)
        for m in range(n):
            stages.rate_by_state[i, k, m] = by_input(group.tape, start.values, first + m)


@kernel
def _load_stage(group: Signals, start: SignalsWorkspace, stages: Stages, i: int) -> None:
    """Compute the values of the tape at stage ``i``."""
    for j in range(group.kind.size):
        set_input(group.tape, start.values, j, stages.input[i, j])
    for k in range(group.rate.size):
        set_input(group.tape, start.values, group.kind.size + k, stages.state[i, k])
    sweep(group.tape, start.values)


@kernel
def _set_matrix(stages: Stages, n: int, h: float) -> None:
    """Set the factors of 1 - h A f_s."""
    s = stages.weight.size
    for i in range(s):
        for k in range(n):
            for j in range(s):
                for m in range(n):
                    unit = 1.0 if i == j and k == m else 0.0
                    slope = h * stages.integral[i, j] * stages.rate_by_state[j, k, m]
                    stages.matrix[n * i + k, n * j + m] = unit - slope
    small_system.factor(stages.matrix, stages.pivot)


@kernel
def _improve(stages: Stages, begin: np.ndarray, n: int, h: float) -> float:
    """Take one step of Newton's method for the states; return the largest change, relative to the
    terms of its equation.
    """
    s, y, largest = stages.weight.size, stages.input.shape[1], 0.0
    for i in range(s):
        for k in range(n):
            change = 0.0
            for j in range(s):
                change += h * stages.integral[i, j] * stages.rate[j, k]
            stages.right[n * i + k] = stages.state[i, k] - begin[k] - change
    small_system.solve(stages.matrix, stages.pivot, stages.right)
    for i in range(s):
        for k in range(n):
            # The terms of a rate may be large and cancel each other, as voltages of a motor do.
            size = abs(begin[k])
            for j in range(s):
                terms = abs(stages.rate[j, k])
                for m in range(y):
                    terms += abs(stages.rate_by_input[j, k, m] * stages.input[j, m])
                size += abs(h * stages.integral[i, j]) * terms
            stages.state[i, k] -= stages.right[n * i + k]
            change = abs(stages.right[n * i + k])
            if change > 0.0:
                largest = max(largest, change / size if size > 0.0 else math.inf)
    return largest


@kernel
def _is_change(change: float, last: float) -> bool:
    """Return whether an iteration's relative ``change`` of the states, after the ``last`` one, is
    more than round-off. A nan is none: it ends the iteration.
    """
    if change < NEARLY_NO_CHANGE and change > 0.5 * last:
        return False
    return change > NO_CHANGE


@optional()
def set_slopes(group: Signals, start: SignalsWorkspace, stages: Stages, h: float) -> None:
    """Set the derivatives of the results at every stage by the inputs at every stage, after
    ``solve``.
    """
    n, s = group.rate.size, stages.weight.size
    for i in range(s):
        _load_stage(group, start, stages, i)
        for r in range(group.result.size):
            gradient(group.tape, start.values, group.result[r])
            for k in range(n * s):
                stages.right[k] = 0.0
            for k in range(n):
                stages.right[n * i + k] = by_input(group.tape, start.values, group.kind.size + k)
            small_system.solve_transposed(stages.matrix, stages.pivot, stages.right)
            for e in range(group.first_entry[r], group.first_entry[r + 1]):
                j = group.entry_input[e]
                for m in range(s):
                    slope = by_input(group.tape, start.values, j) if m == i else 0.0
                    for k in range(n):
                        weight = 0.0
                        for other in range(s):
                            weight += stages.integral[other, m] * stages.right[n * other + k]
                        slope += h * weight * stages.rate_by_input[m, k, j]
                    stages.slope[i, m, e] = slope


@optional()
def take_slopes(group: Signals, start: SignalsWorkspace, stages: Stages, i: int, m: int) -> None:
    """Set the derivatives of the results by the inputs, and those of the inputs, to the ones of
    stage ``i`` by stage ``m``; for ``m`` = ``i`` those of the results alone. Without states there
    is nothing to do.
    """
    if group.rate.size == 0:
        return
    for e in range(group.entry_input.size):
        start.by_input[e] = stages.slope[i, m, e]
    for j in range(group.kind.size if m != i else 0):
        for part in range(PARTS):
            put(start.by_place[j], part, at(stages.by_place[m, j], part))
            put(start.by_rate[j], part, at(stages.by_rate[m, j], part))


@optional()
def accept(group: Signals, stages: Stages, h: float, state: np.ndarray) -> None:
    """Advance the auxiliary ``state`` (n,) by a solved step."""
    for k in range(group.rate.size):
        for i in range(stages.weight.size):
            state[k] += h * stages.weight[i] * stages.rate[i, k]


@optional()
def set_rates(group: Signals, start: SignalsWorkspace, rate: np.ndarray, first: int) -> None:
    """Set the entries of ``rate`` from number ``first`` on to the states' rates, after
    ``evaluate``.
    """
    for k in range(group.rate.size):
        rate[first + k] = start.values.value[group.rate[k]]
