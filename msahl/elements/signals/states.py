"""Auxiliary states over a step: equation (1) of the package, by Newton's method."""

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
    """Set the states of the configuration to those of the force node ``i``."""
    for k in range(group.rate.size):
        start.state[k] = stages.state[i, k]


@optional()
def save_start(group: Signals, start: SignalsWorkspace, stages: Stages) -> None:
    """Save the inputs as those at the start of the step."""
    first = group.tape.constant.size
    for j in range(group.kind.size):
        stages.begin[j] = start.values.value[first + j]


@optional()
def save_inputs(group: Signals, start: SignalsWorkspace, stages: Stages, i: int) -> None:
    """Save the inputs as those at the force node ``i``."""
    first = group.tape.constant.size
    for j in range(group.kind.size):
        stages.input[i, j] = start.values.value[first + j]


@optional()
def solve(
    group: Signals, start: SignalsWorkspace, stages: Stages, begin: np.ndarray, h: float
) -> None:
    """Solve for the states over a step ``h`` from ``begin`` (n,), by the inputs that were saved;
    nan if Newton's method does not converge.
    """
    n, nodes = group.rate.size, stages.stage.shape[0]
    for j in range(nodes):
        for k in range(n):
            stages.stage[j, k] = begin[k]
    changed, left, change = True, MOST_ITERATIONS, math.inf
    while changed and left > 0:
        for j in range(nodes):
            _set_rates(group, start, stages, j)
        _set_matrix(stages, n, h)
        last, change = change, _improve(stages, begin, n, h)
        changed, left = _is_change(change, last), left - 1
    if changed:
        for j in range(nodes):
            for k in range(n):
                stages.stage[j, k] = stages.rate[j, k] = math.nan
    for i in range(stages.state.shape[0]):
        for k in range(n):
            stages.state[i, k] = 0.0
            for j in range(nodes):
                stages.state[i, k] += stages.nodes.mean[i, j] * stages.stage[j, k]


@optional()
def refuse(group: Signals, stages: Stages, F: np.ndarray) -> None:
    """Set equations ``F`` (nodes, 3) of a step to nan if the auxiliary states have no solution:
    then the step has none, whether or not a force depends on them.
    """
    for j in range(stages.rate.shape[0]):
        for k in range(group.rate.size):
            if not math.isfinite(stages.rate[j, k]):
                for node in range(F.shape[0]):
                    put(F, node, (math.nan, math.nan, math.nan))


@kernel
def _set_rates(group: Signals, start: SignalsWorkspace, stages: Stages, j: int) -> None:
    """Set the states' rates at the Radau node ``j``, and their derivatives."""
    n, first = group.rate.size, group.kind.size
    for i in range(first):
        set_input(group.tape, start.values, i, node_input(stages, j, i))
    for k in range(n):
        set_input(group.tape, start.values, first + k, stages.stage[j, k])
    sweep(group.tape, start.values)
    for k in range(n):
        stages.rate[j, k] = start.values.value[group.rate[k]]
        gradient(group.tape, start.values, group.rate[k])
        for i in range(first):
            stages.rate_by_input[j, k, i] = by_input(group.tape, start.values, i)
        for m in range(n):
            stages.rate_by_state[j, k, m] = by_input(group.tape, start.values, first + m)


@kernel
def node_input(stages: Stages, j: int, i: int) -> float:
    """Return the input ``i`` at the Radau node ``j``: interpolated in time."""
    spread = stages.nodes.spread
    value: float = spread[j, 0] * stages.begin[i]
    for m in range(stages.input.shape[0]):
        value += spread[j, 1 + m] * stages.input[m, i]
    return value


@kernel
def _load_node(group: Signals, start: SignalsWorkspace, stages: Stages, i: int) -> None:
    """Compute the values of the tape at the force node ``i``."""
    for j in range(group.kind.size):
        set_input(group.tape, start.values, j, stages.input[i, j])
    for k in range(group.rate.size):
        set_input(group.tape, start.values, group.kind.size + k, stages.state[i, k])
    sweep(group.tape, start.values)


@kernel
def _set_matrix(stages: Stages, n: int, h: float) -> None:
    """Set the factors of 1 - h A f_s."""
    nodes = stages.stage.shape[0]
    for i in range(nodes):
        for k in range(n):
            for j in range(nodes):
                for m in range(n):
                    unit = 1.0 if i == j and k == m else 0.0
                    slope = h * stages.nodes.integral[i, j] * stages.rate_by_state[j, k, m]
                    stages.matrix[n * i + k, n * j + m] = unit - slope
    small_system.factor(stages.matrix, stages.pivot)


@kernel
def _improve(stages: Stages, begin: np.ndarray, n: int, h: float) -> float:
    """Take one step of Newton's method for the states; return the largest change, relative to the
    terms of its equation.
    """
    nodes, y, largest = stages.stage.shape[0], stages.begin.size, 0.0
    for i in range(nodes):
        for k in range(n):
            change = 0.0
            for j in range(nodes):
                change += h * stages.nodes.integral[i, j] * stages.rate[j, k]
            stages.right[n * i + k] = stages.stage[i, k] - begin[k] - change
    small_system.solve(stages.matrix, stages.pivot, stages.right)
    for i in range(nodes):
        for k in range(n):
            # The terms of a rate may be large and cancel each other, as voltages of a motor do.
            size = abs(begin[k])
            for j in range(nodes):
                terms = abs(stages.rate[j, k])
                for m in range(y):
                    terms += abs(stages.rate_by_input[j, k, m] * node_input(stages, j, m))
                size += abs(h * stages.nodes.integral[i, j]) * terms
            stages.stage[i, k] -= stages.right[n * i + k]
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
    """Set the derivatives of the results at every c_i by the inputs at all c_j, after ``solve``."""
    n, nodes, s = group.rate.size, stages.stage.shape[0], stages.state.shape[0]
    for i in range(s):
        _load_node(group, start, stages, i)
        for r in range(group.result.size):
            gradient(group.tape, start.values, group.result[r])
            for j in range(nodes):
                for k in range(n):
                    slope = by_input(group.tape, start.values, group.kind.size + k)
                    stages.right[n * j + k] = stages.nodes.mean[i, j] * slope
            small_system.solve_transposed(stages.matrix, stages.pivot, stages.right)
            for e in range(group.first_entry[r], group.first_entry[r + 1]):
                own = by_input(group.tape, start.values, group.entry_input[e])
                for m in range(s):
                    stages.slope[i, m, e] = own if m == i else 0.0
                _add_by_states(stages, group.entry_input[e], (i, e), h)


@kernel
def _add_by_states(stages: Stages, y: int, place: tuple[int, int], h: float) -> None:
    """Add to the slope of a result at c_i in entry e, the ``place`` (i, e), what depends on the
    input ``y`` by way of the states.
    """
    i, e = place
    (nodes, n), s = stages.stage.shape, stages.state.shape[0]
    for j in range(nodes):
        slope = 0.0
        for k in range(n):
            weight = 0.0
            for other in range(nodes):
                weight += stages.nodes.integral[other, j] * stages.right[n * other + k]
            slope += h * weight * stages.rate_by_input[j, k, y]
        for m in range(s):
            stages.slope[i, m, e] += stages.nodes.spread[j, 1 + m] * slope


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
def accept(group: Signals, stages: Stages, state: np.ndarray) -> None:
    """Advance the auxiliary ``state`` (n,) by a solved step, to the last node."""
    for k in range(group.rate.size):
        state[k] = stages.stage[stages.stage.shape[0] - 1, k]


@optional()
def set_rates(group: Signals, start: SignalsWorkspace, rate: np.ndarray, first: int) -> None:
    """Set the entries of ``rate`` from number ``first`` on to the states' rates, after
    ``evaluate``.
    """
    for k in range(group.rate.size):
        rate[first + k] = start.values.value[group.rate[k]]
