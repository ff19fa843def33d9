"""Signals of a system as arrays, what they need of a configuration, and questions at set-up."""

from typing import Any, NamedTuple

import numpy as np

from msahl.elements.constraints.products import PARTS
from msahl.elements.constraints.scalar import ScalarConstraints
from msahl.elements.signals.coupling import Coupling
from msahl.expressions.tape import Tape, Values, new_values
from msahl.jit.kernel import optional
from msahl.linalg.row_lu import Factors, new_factors

TIME, COORDINATE, RATE, POSITION, VELOCITY, QUATERNION, SPIN, REACTION = range(8)


class Signals(NamedTuple):
    """Inputs, states and results of all expressions of a system.

    Inputs of the tape are y (inputs), then s (states). A result enters the equations of motion; its
    *entries* are the inputs that it depends on, directly or by states, and its *columns* the nodes
    of the frames that these depend on.
    """

    tape: Tape
    kind: np.ndarray  # (y,)
    item: np.ndarray  # (y,) coordinate, marker or joint
    component: np.ndarray  # (y,) axis, or component of a quaternion or a reaction
    origin: np.ndarray  # (y,) added to a coordinate's value [m or rad]
    counted: np.ndarray  # coordinates whose angle begins with its own value, not with zero
    frame: np.ndarray  # (p,) of each marker
    s: np.ndarray  # (p, 3) from the frame's origin, its axes [m]
    axes: np.ndarray  # (p, 3, 3) the marker's axes as rows, axes of the frame
    quaternion: np.ndarray  # (p, 4) of these axes
    rate: np.ndarray  # (n,) places on the tape of the states' rates
    result: np.ndarray  # (r,) likewise of the results
    shown: np.ndarray  # (k,) likewise of the published values
    stop: np.ndarray  # (m,) likewise of the margins of conditions that end the run
    coupling: Coupling
    first_entry: np.ndarray  # (r + 1,)
    entry_input: np.ndarray  # (e,)
    entry_column: np.ndarray  # (e, 4) among the result's columns, of the input's parts; or -1
    first_column: np.ndarray  # (r + 1,)
    block: np.ndarray  # (c, 4) starts of the blocks: by columns, by the parts the result acts on
    acting: np.ndarray  # (r, 4) frames of these parts


class StateNodes(NamedTuple):
    """How auxiliary states are collocated at m Radau nodes of a step with s force nodes."""

    integral: np.ndarray  # (m, m) A_jl
    spread: np.ndarray  # (m, s + 1) from inputs at the start and at the c_i to those at the nodes
    mean: np.ndarray  # (s, m) from the states at the nodes to those at the c_i


MIDPOINT = StateNodes(
    np.array([[5.0 / 12.0, -1.0 / 12.0], [0.75, 0.25]]),
    np.array([[1.0 / 3.0, 2.0 / 3.0], [-1.0, 2.0]]),
    np.array([[0.75, 0.25]]),
)
"""Of a step of the midpoint element: nodes 1/3 and 1, inputs along the line through the start and
the means, which are those of the middle; states by their line there, which is their mean."""


class Stages(NamedTuple):
    """The auxiliary states of a step at m Radau nodes and s force nodes, and their derivatives."""

    nodes: StateNodes
    begin: np.ndarray  # (y,) inputs at the start of the step
    input: np.ndarray  # (s, y) at c_i
    state: np.ndarray  # (s, n) S_i there
    stage: np.ndarray  # (m, n) at the Radau nodes, the last of which is the end
    rate: np.ndarray  # (m, n) f there
    rate_slope: np.ndarray  # (m, i) derivatives of f by ``Coupling.inputs``
    factors: Factors  # of 1 - h A f_s, with m x m blocks
    weight: np.ndarray  # (m, n) derivatives of a result by f
    slope: np.ndarray  # (s, s, e) of the results at c_i by their entries at c_j
    by_place: np.ndarray  # (s, y, 4, 3) of the inputs, by the unknowns' values at the node
    by_rate: np.ndarray  # (s, y, 4, 3) and by their rates


class SignalsWorkspace(NamedTuple):
    """What the expressions need of a configuration, and their results."""

    values: Values
    time: np.ndarray  # (1,) [s]
    state: np.ndarray  # (n,) s at the configuration
    place: np.ndarray  # (p, 3) markers, inertial axes [m]
    arm: np.ndarray  # (p, 3) from the frames' origins [m]
    direction: np.ndarray  # (p, 3, 3) axes as rows, inertial axes
    euler: np.ndarray  # (p, 4) quaternions
    change: np.ndarray  # (p, 3) of the markers' places over a step [m]; in a configuration, by time
    rotation: np.ndarray  # (p, 3) Q of their frames [rad]; in a configuration W
    reaction: np.ndarray  # (j, 6) of the accepted step before [N, N m]
    size: np.ndarray  # (y,) of which an input carries the round-off
    result: np.ndarray  # (r,)
    result_size: np.ndarray  # (r,) what a result counts as among the terms of its equations
    by_input: np.ndarray  # (e,) derivative of the results by their entries
    by_place: np.ndarray  # (y, 4, 3) of the inputs by the unknowns of their parts, or by places
    by_rate: np.ndarray  # (y, 4, 3) by the rates of these
    gradient: np.ndarray  # (most columns, 3) of one result
    gradient_rate: np.ndarray  # (most columns, 3)
    row: np.ndarray  # (4, 3) what a unit of the result adds to the rows of its parts
    step: Stages  # of the midpoint element


def new_workspace(group: Signals | None, joints: int) -> Any:
    """Return the work arrays, None where there are no signals; ``joints`` is their number."""
    if group is None:
        return None
    y, n, p, r = group.kind.size, group.rate.size, group.frame.size, group.result.size
    most = int(np.diff(group.first_column).max(initial=0))
    return SignalsWorkspace(
        values=new_values(group.tape),
        time=np.zeros(1),
        state=np.zeros(n),
        place=np.zeros((p, 3)),
        arm=np.zeros((p, 3)),
        direction=np.zeros((p, 3, 3)),
        euler=np.zeros((p, 4)),
        change=np.zeros((p, 3)),
        rotation=np.zeros((p, 3)),
        reaction=np.zeros((joints, 6)),
        size=np.zeros(y),
        result=np.zeros(r),
        result_size=np.zeros(r),
        by_input=np.zeros(group.entry_input.size),
        by_place=np.zeros((y, PARTS, 3)),
        by_rate=np.zeros((y, PARTS, 3)),
        gradient=np.zeros((most, 3)),
        gradient_rate=np.zeros((most, 3)),
        row=np.zeros((PARTS, 3)),
        step=new_stages(group, MIDPOINT),
    )


def new_stages(group: Signals | None, nodes: StateNodes) -> Any:
    """Return the arrays for these ``nodes``; None without group."""
    if group is None:
        return None
    (s, m), y, n = nodes.mean.shape, group.kind.size, group.rate.size
    return Stages(
        nodes=nodes,
        begin=np.zeros(y),
        input=np.zeros((s, y)),
        state=np.zeros((s, n)),
        stage=np.zeros((m, n)),
        rate=np.zeros((m, n)),
        rate_slope=np.zeros((m, group.coupling.inputs.items.size)),
        factors=new_factors(group.coupling.plan, m),
        weight=np.zeros((m, n)),
        slope=np.zeros((s, s, group.entry_input.size)),
        by_place=np.zeros((s, y, PARTS, 3)),
        by_rate=np.zeros((s, y, PARTS, 3)),
    )


@optional(False)
def use_reactions(group: Signals) -> bool:
    """Return whether an expression depends on joints' reactions."""
    found = False
    for j in range(group.kind.size):
        found = found or group.kind[j] == REACTION
    return found


def coordinates_of(group: Signals | None) -> np.ndarray:
    """Return the numbers of the coordinates on which expressions depend."""
    if group is None:
        return np.zeros(0, dtype=np.int64)
    return group.item[np.isin(group.kind, (COORDINATE, RATE))]


def renumbered(group: Signals | None, number: np.ndarray) -> Signals | None:
    """Return the signals with coordinate q as number[q]."""
    if group is None:
        return None
    of_coordinates = np.isin(group.kind, (COORDINATE, RATE))
    item = group.item.copy()
    item[of_coordinates] = number[item[of_coordinates]]
    return group._replace(item=item, counted=number[group.counted])


def begin_angles(
    group: Signals | None, scalar: ScalarConstraints | None, place: Any, angle: np.ndarray
) -> bool:
    """Set the counted ``angle`` (q,) of angles that begin with their own value to these in the
    prepared state; return whether there are any. ``place`` is a ``ScalarWorkspace``.
    """
    if group is None or scalar is None or not group.counted.size:
        return False
    m, first = place.coordinates.products.value, scalar.coordinates.first[group.counted]
    angle[group.counted] = np.arctan2(m[first], m[first + 1])
    return True
