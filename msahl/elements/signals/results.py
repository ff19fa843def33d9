"""Results of the expressions of a system: values, derivatives, what they add to the equations."""

import math

import numpy as np

from msahl.algebra.vector import ZERO, at, axpy, put
from msahl.elements.constraints.coordinate_kinds import ROUND_OFF_FACTOR
from msahl.elements.constraints.products import PARTS
from msahl.elements.signals import states
from msahl.elements.signals.group import Signals, SignalsWorkspace
from msahl.expressions.tape import by_input, set_input, sweep
from msahl.jit.kernel import apart, kernel, optional


@optional()
def evaluate(group: Signals, start: SignalsWorkspace) -> None:
    """Set the results and their derivatives by the inputs at one configuration, with its states."""
    for k in range(group.rate.size):
        set_input(group.tape, start.values, group.kind.size + k, start.state[k])
    sweep(group.tape, start.values)
    _set_results(group, start, False)


@optional()
def evaluate_over_step(group: Signals, start: SignalsWorkspace, h: float) -> None:
    """Solve for the states' means over a step ``h`` from the inputs, and set the results with their
    derivatives by the inputs.
    """
    n = group.rate.size
    if n == 0:
        sweep(group.tape, start.values)
    else:
        states.save_inputs(group, start, start.step, 0)
        states.solve(group, start, start.step, start.state, h)
        states.set_slopes(group, start, start.step, h)
    _set_results(group, start, n > 0)


@apart
def _set_results(group: Signals, start: SignalsWorkspace, over_step: bool) -> None:
    """Set the results, their sizes, and their derivatives by the inputs, on which the states depend
    ``over_step``.
    """
    for r in range(group.result.size):
        start.result[r] = start.values.value[group.result[r]]
        if not over_step:
            states.differentiate_result(group, start, r)
        size = abs(start.result[r])
        for e in range(group.first_entry[r], group.first_entry[r + 1]):
            j = group.entry_input[e]
            slope = start.step.slope[0, 0, e]
            if not over_step:
                slope = by_input(group.tape, start.values, j)
            start.by_input[e] = slope
            size += ROUND_OFF_FACTOR * abs(slope) * start.size[j]
        start.result_size[r] = size


@optional()
def refuse_over_step(group: Signals, start: SignalsWorkspace, F: np.ndarray) -> None:
    """Set the equations ``F`` (nodes, 3) of a step to nan if the auxiliary states have no
    solution."""
    states.refuse(group, start.step, F)


@optional()
def accept(group: Signals, start: SignalsWorkspace, state: np.ndarray) -> None:
    """Advance the auxiliary ``state`` (n,) by the solved step of the midpoint element."""
    states.accept(group, start.step, state)


@optional()
def set_gradient(group: Signals, start: SignalsWorkspace, r: int) -> None:
    """Set ``gradient`` and ``gradient_rate`` to the derivatives of a result by the unknowns or
    places, and by the rates, of its columns.
    """
    for c in range(group.first_column[r + 1] - group.first_column[r]):
        put(start.gradient, c, ZERO)
        put(start.gradient_rate, c, ZERO)
    for e in range(group.first_entry[r], group.first_entry[r + 1]):
        slope, j = start.by_input[e], group.entry_input[e]
        if slope == 0.0:
            continue
        for part in range(PARTS):
            c = group.entry_column[e, part]
            if c >= 0:
                a = axpy(slope, at(start.by_place[j], part), at(start.gradient, c))
                put(start.gradient, c, a)
                a = axpy(slope, at(start.by_rate[j], part), at(start.gradient_rate, c))
                put(start.gradient_rate, c, a)


@optional()
def add_rows(
    group: Signals, row: np.ndarray, r: int, gradient: np.ndarray, values: np.ndarray
) -> None:
    """Add the ``row`` (4, 3) of a result, what it adds to the equations of the parts it acts on,
    times its ``gradient`` by the columns.
    """
    first = group.first_column[r]
    for c in range(group.first_column[r + 1] - first):
        for part in range(PARTS):
            block = group.block[first + c, part]
            if block > 0:
                for i in range(3):
                    for j in range(3):
                        values[block + 3 * i + j] += row[part, i] * gradient[c, j]


@optional()
def publish(group: Signals, start: SignalsWorkspace, table: np.ndarray, row: int) -> None:
    """Write the published values to a ``row`` of the table, after ``evaluate``."""
    for k in range(group.shown.size):
        table[row, k] = start.values.value[group.shown[k]]


@kernel
def largest_margin(group: Signals, start: SignalsWorkspace) -> float:
    """Return the largest margin of the conditions that end the run, after ``evaluate``."""
    largest = -math.inf
    for k in range(group.stop.size):
        margin = start.values.value[group.stop[k]]
        # Written so that a nan, at which a run cannot go on either, counts as fulfilled.
        if not margin <= largest:
            largest = margin
        if math.isnan(margin):
            break
    return largest
