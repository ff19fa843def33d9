"""Auxiliary states over a step: equation (1) of the package, by Newton's method."""

import math

import numpy as np

from msahl.algebra.vector import at, put
from msahl.elements.constraints.products import PARTS
from msahl.elements.signals.group import Signals, SignalsWorkspace, Stages
from msahl.expressions.tape import by_input, gradient_along, set_input, sweep
from msahl.jit.kernel import kernel, optional
from msahl.linalg import row_lu

NOTHING = 1e-290
"""Change of a state that does not count: near the smallest numbers there are, those of states far
from anything that acts, rounding errors are not relative to a state."""
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
        _set_matrix(group, stages, h)
        last, change = change, _improve(group, stages, begin, h)
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
        _differentiate(group, start, k, group.rate[k])
        own = group.coupling.inputs
        for e in range(own.first[k], own.first[k + 1]):
            stages.rate_slope[j, e] = by_input(group.tape, start.values, own.items[e])


@kernel
def differentiate_result(group: Signals, start: SignalsWorkspace, r: int) -> None:
    """Set the adjoints of the tape's inputs to the derivatives of a result."""
    _differentiate(group, start, group.rate.size + r, group.result[r])


@kernel
def _differentiate(group: Signals, start: SignalsWorkspace, number: int, place: int) -> None:
    """Set the adjoints to the derivatives of a rate or a result, by its ``number`` and place."""
    own = group.coupling.operations
    first, last = own.first[number], own.first[number + 1]
    gradient_along(group.tape, start.values, place, own.items, first, last)


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
def _set_matrix(group: Signals, stages: Stages, h: float) -> None:
    """Set the factors of 1 - h A f_s."""
    plan, own, inputs = group.coupling.plan, stages.factors, group.coupling.inputs
    m, first = stages.stage.shape[0], group.kind.size
    for place in range(plan.order.size):
        row_lu.clear_row(plan, own, place)
        for i in range(m):
            own.row[place, i, i] = 1.0
        k = plan.order[place]
        for e in range(inputs.first[k], inputs.first[k + 1]):
            if inputs.items[e] >= first:
                column = plan.position[inputs.items[e] - first]
                for i in range(m):
                    for j in range(m):
                        slope = h * stages.nodes.integral[i, j] * stages.rate_slope[j, e]
                        own.row[column, i, j] -= slope
        row_lu.eliminate_row(plan, own, place)


@kernel
def _improve(group: Signals, stages: Stages, begin: np.ndarray, h: float) -> float:
    """Take one step of Newton's method for the states; return the largest change, relative to the
    terms of its equation.
    """
    plan, right, largest = group.coupling.plan, stages.factors.right, 0.0
    nodes, n = stages.stage.shape
    for k in range(n):
        for i in range(nodes):
            change = 0.0
            for j in range(nodes):
                change += h * stages.nodes.integral[i, j] * stages.rate[j, k]
            right[plan.position[k], i] = stages.stage[i, k] - begin[k] - change
    row_lu.solve(plan, stages.factors)
    for k in range(n):
        for j in range(nodes):
            stages.weight[j, k] = _rate_terms(group, stages, j, k)
        for i in range(nodes):
            size, step = abs(begin[k]), right[plan.position[k], i]
            for j in range(nodes):
                size += abs(h * stages.nodes.integral[i, j]) * stages.weight[j, k]
            stages.stage[i, k] -= step
            if abs(step) > NOTHING:
                largest = max(largest, abs(step) / size if size > 0.0 else math.inf)
    return largest


@kernel
def _rate_terms(group: Signals, stages: Stages, j: int, k: int) -> float:
    """Return the size of what the rate of state k consists of at the Radau node ``j``: its terms
    may be large and cancel each other, as voltages of a motor do.
    """
    terms, inputs, first = abs(stages.rate[j, k]), group.coupling.inputs, group.kind.size
    for e in range(inputs.first[k], inputs.first[k + 1]):
        y = inputs.items[e]
        value = node_input(stages, j, y) if y < first else stages.stage[j, y - first]
        terms += abs(stages.rate_slope[j, e] * value)
    return terms


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
    s = stages.state.shape[0]
    for i in range(s):
        _load_node(group, start, stages, i)
        for r in range(group.result.size):
            differentiate_result(group, start, r)
            _set_weights(group, start, stages, i, h)
            for e in range(group.first_entry[r], group.first_entry[r + 1]):
                own = by_input(group.tape, start.values, group.entry_input[e])
                for m in range(s):
                    stages.slope[i, m, e] = own if m == i else 0.0
                _add_by_states(group, stages, (i, e))


@kernel
def _set_weights(group: Signals, start: SignalsWorkspace, stages: Stages, i: int, h: float) -> None:
    """Set the derivatives of a result at c_i, by way of the states, by the rates at all nodes."""
    plan, right = group.coupling.plan, stages.factors.right
    nodes, n = stages.stage.shape
    for k in range(n):
        slope = by_input(group.tape, start.values, group.kind.size + k)
        for j in range(nodes):
            right[plan.position[k], j] = stages.nodes.mean[i, j] * slope
    row_lu.solve_transposed(plan, stages.factors)
    for k in range(n):
        for j in range(nodes):
            weight = 0.0
            for other in range(nodes):
                weight += stages.nodes.integral[other, j] * right[plan.position[k], other]
            stages.weight[j, k] = h * weight


@kernel
def _add_by_states(group: Signals, stages: Stages, place: tuple[int, int]) -> None:
    """Add to the slope of a result at c_i in entry e, the ``place`` (i, e), what depends on its
    input by way of the states.
    """
    i, e = place
    users, y = group.coupling.users, group.entry_input[e]
    for j in range(stages.stage.shape[0]):
        slope = 0.0
        for u in range(users.first[y], users.first[y + 1]):
            slope += (
                stages.weight[j, users.items[u]] * stages.rate_slope[j, group.coupling.entry[u]]
            )
        for m in range(stages.state.shape[0]):
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
