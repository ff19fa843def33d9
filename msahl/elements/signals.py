"""Signals: scalars that laws of the motion are made of, auxiliary states, and their derivatives.

An expression u(y, s) has inputs y and auxiliary states s, which follow s_dot = f(y, s). Inputs are

    TIME         t                                                              [s]
    COORDINATE   coordinate of a joint: an angle or a displacement              [rad or m]
    RATE         its rate                                                       [rad/s or m/s]
    POSITION     of a marker: component of x + R r, inertial axes               [m]
    VELOCITY     its rate                                                       [m/s]
    QUATERNION   of a marker: component of its Euler parameters, q0 >= 0
    SPIN         of a marker: angular velocity along one of its own axes        [rad/s]
    REACTION     component of a joint's reaction in the accepted step before    [N or N m]

**At one configuration** the inputs are those of the configuration, the states those of the
``State``.

**Over a step h of the midpoint element** they are means over the step:

    value (y0 + y1)/2 ,  rate (y1 - y0)/h ,  spin axis . Q/h ,  t = t0 + h/2 ,  s_m = (s0 + s1)/2
    s_m = s0 + h/2 f(y, s_m) ,  s1 = s0 + h f(y, s_m)                                          (1)

(1) is solved here, by Newton's method to round-off, so the states are no unknowns of the step. The
derivative of a result contains them, by the implicit function theorem:

    du/dy = u_y + u_s (1 - h/2 f_s)^-1 h/2 f_y

**Over a collocation step** with force nodes c_i, A_il the integral from 0 to c_i of the Lagrange
polynomial of c_l, and b_i that from 0 to 1:

    S_i = s0 + h sum_l A_il f(y_l, S_l) ,   s1 = s0 + h sum_l b_l f(y_l, S_l)                  (2)
    du_i/dy_j = delta_ij u_y + u_s [(1 - h A f_s)^-1 h A f_y]_ij

All expressions of a system are one tape (``expressions.tape``): a model compiles nothing for them.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra import small_system
from msahl.algebra.rotation import rotation_change
from msahl.algebra.vector import (
    Vector,
    add,
    at,
    axpy,
    cross,
    dot,
    matrix_at,
    put,
    scale,
    times,
    transpose,
)
from msahl.elements.constraints import coordinates
from msahl.elements.constraints.coordinate_jacobians import rate_gradient
from msahl.elements.constraints.coordinate_kinds import ROUND_OFF_FACTOR, Derivatives
from msahl.elements.constraints.products import PARTS, Q_A, U_A
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace
from msahl.elements.frames import (
    Frames,
    FramesWorkspace,
    displacement,
    end_tangent,
    rotation_increment,
)
from msahl.expressions.tape import (
    Tape,
    Values,
    by_input,
    gradient,
    new_values,
    set_input,
    sweep,
)
from msahl.jit.kernel import apart, kernel, optional

TIME, COORDINATE, RATE, POSITION, VELOCITY, QUATERNION, SPIN, REACTION = range(8)
MOST_ITERATIONS = 30
"""Of Newton's method for the states; linear equations take one, and one that changes nothing."""
NO_CHANGE = 1e-15
"""Change of a state, relative to the terms of its equation, that is round-off."""
NEARLY_NO_CHANGE = 1e-8
"""Below it a change that does not fall to its half from one iteration to the next is round-off."""


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
    first_entry: np.ndarray  # (r + 1,)
    entry_input: np.ndarray  # (e,)
    entry_column: np.ndarray  # (e, 4) among the result's columns, of the input's parts; or -1
    first_column: np.ndarray  # (r + 1,)
    block: np.ndarray  # (c, 4) starts of the blocks: by columns, by the parts the result acts on
    acting: np.ndarray  # (r, 4) frames of these parts


class SignalsWorkspace(NamedTuple):
    """What the expressions need of a configuration, and their results."""

    values: Values
    time: np.ndarray  # (1,) [s]
    state: np.ndarray  # (n,) s at the configuration
    state_rate: np.ndarray  # (n,) f
    place: np.ndarray  # (p, 3) markers, inertial axes [m]
    arm: np.ndarray  # (p, 3) from the frames' origins [m]
    direction: np.ndarray  # (p, 3, 3) axes as rows, inertial axes
    euler: np.ndarray  # (p, 4) quaternions
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
    rate_by_input: np.ndarray  # (n, y) f_y
    matrix: np.ndarray  # (n, n) 1 - h/2 f_s, and its factors
    pivot: np.ndarray  # (n,)
    adjoint: np.ndarray  # (n,)


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
        state_rate=np.zeros(n),
        place=np.zeros((p, 3)),
        arm=np.zeros((p, 3)),
        direction=np.zeros((p, 3, 3)),
        euler=np.zeros((p, 4)),
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
        rate_by_input=np.zeros((n, y)),
        matrix=np.zeros((n, n)),
        pivot=np.zeros(n, dtype=np.int64),
        adjoint=np.zeros(n),
    )


@optional()
def prepare(
    group: Signals,
    start: SignalsWorkspace,
    motion: FramesWorkspace,
    x: np.ndarray,
    p: np.ndarray,
) -> None:
    """Carry the markers into inertial axes, with the frames' places ``x`` (f, 3) and orientations
    ``p`` (f, 3).
    """
    for m in range(group.frame.size):
        f = group.frame[m]
        R = matrix_at(motion.R, f)
        r = times(R, at(group.s, m))
        put(start.arm, m, r)
        put(start.place, m, add(at(x, f), r))
        for axis in range(3):
            put(start.direction[m], axis, times(R, at(group.axes[m], axis)))
        _set_quaternion(group, start, at(p, f), m)


@optional()
def save_state(
    group: Signals,
    start: SignalsWorkspace,
    time: float,
    state: np.ndarray,
    reaction: np.ndarray,
) -> None:
    """Save the time, the auxiliary ``state`` (n,) and the joints' ``reaction`` (j, 6) of a
    configuration.
    """
    start.time[0] = time
    for k in range(state.size):
        start.state[k] = state[k]
    save_reactions(group, start, reaction)


@kernel
def _set_quaternion(group: Signals, start: SignalsWorkspace, p: Vector, m: int) -> None:
    """Set the quaternion of marker ``m`` on a frame of the orientation ``p``, its scalar >= 0."""
    square = dot(p, p) / 16.0
    e0, e = (1.0 - square) / (1.0 + square), scale(0.5 / (1.0 + square), p)
    q0 = group.quaternion[m, 0]
    q = (group.quaternion[m, 1], group.quaternion[m, 2], group.quaternion[m, 3])
    scalar_part = e0 * q0 - dot(e, q)
    vector = add(axpy(e0, q, scale(q0, e)), cross(e, q))
    sign = 1.0 if scalar_part >= 0.0 else -1.0
    start.euler[m, 0] = sign * scalar_part
    for i in range(3):
        start.euler[m, 1 + i] = sign * vector[i]


@optional()
def set_inputs_over_step(
    group: Signals,
    start: SignalsWorkspace,
    frames: Frames,
    h: float,
    Z: np.ndarray,
) -> None:
    """Set the inputs, other than coordinates, to their means over a step ``h``."""
    for j in range(group.kind.size):
        kind, m, axis = group.kind[j], group.item[j], group.component[j]
        if kind in (COORDINATE, RATE):
            continue
        value, size = 0.0, 0.0
        if kind == TIME:
            value = start.time[0] + 0.5 * h
        elif kind == REACTION:
            value = start.reaction[m, axis]
        else:
            value, size = _marker_over_step(group, start, frames, h, Z, j)
        start.size[j] = size
        set_input(group.tape, start.values, j, value)


@kernel
def _marker_over_step(
    group: Signals,
    start: SignalsWorkspace,
    frames: Frames,
    h: float,
    Z: np.ndarray,
    j: int,
) -> tuple[float, float]:
    """Return the mean of a marker's value over a step, and of what size its round-off is."""
    kind, m, axis = group.kind[j], group.item[j], group.component[j]
    f, size = group.frame[m], 0.0
    Q = rotation_increment(frames, Z, f)
    if kind == SPIN:
        return dot(at(start.direction[m], axis), Q) / h, size
    if kind == QUATERNION:
        alpha, beta = _quaternion_weights(start, m, axis)
        root = 1.0 / math.sqrt(1.0 + 0.25 * dot(Q, Q))
        return 0.5 * (start.euler[m, axis] + root * (alpha + 0.5 * dot(Q, beta))), 1.0
    moved = displacement(frames, Z, f)[axis] + rotation_change(Q, at(start.arm, m))[axis]
    if kind == VELOCITY:
        return moved / h, size
    for i in range(3):
        size = max(size, abs(start.place[m, i]), abs(start.arm[m, i]))
    return start.place[m, axis] + 0.5 * moved, size


@kernel
def _unit(axis: int) -> Vector:
    """Return the unit vector along an axis."""
    return (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)


@kernel
def _quaternion_weights(start: SignalsWorkspace, m: int, axis: int) -> tuple[float, Vector]:
    """Return alpha and beta: a rotation with Euler parameters e0, e from the configuration gives
    the component e0 alpha + e . beta.
    """
    q0 = start.euler[m, 0]
    q = (start.euler[m, 1], start.euler[m, 2], start.euler[m, 3])
    if axis == 0:
        return q0, scale(-1.0, q)
    unit = _unit(axis - 1)
    return dot(q, unit), axpy(q0, unit, cross(q, unit))


@optional()
def set_coordinates_over_step(
    scalar: ScalarConstraints,
    group: Signals,
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    h: float,
) -> None:
    """Set the inputs that are coordinates to their means over a step ``h``, after
    ``coordinates.evaluate``.
    """
    q = place.coordinates
    for j in range(group.kind.size):
        kind, c = group.kind[j], group.item[j]
        if kind == COORDINATE:
            value = q.value[c] + group.origin[j] + 0.5 * q.change[c]
            start.size[j] = coordinates.extent(scalar.coordinates, q, c)
            set_input(group.tape, start.values, j, value)
        elif kind == RATE:
            start.size[j] = 0.0
            set_input(group.tape, start.values, j, q.change[c] / h)


@optional()
def differentiate_over_step(
    group: Signals,
    start: SignalsWorkspace,
    frames: Frames,
    h: float,
    Z: np.ndarray,
) -> None:
    """Set the derivatives of the inputs, other than coordinates, by the unknowns of a step."""
    for j in range(group.kind.size):
        if POSITION <= group.kind[j] <= SPIN:
            by_u, by_Q = _marker_gradient_over_step(group, start, frames, h, Z, j)
            put(start.by_place[j], U_A, by_u)
            put(start.by_place[j], Q_A, by_Q)


@kernel
def _marker_gradient_over_step(
    group: Signals,
    start: SignalsWorkspace,
    frames: Frames,
    h: float,
    Z: np.ndarray,
    j: int,
) -> tuple[Vector, Vector]:
    """Return the derivative of a marker's mean value by u and by l Q."""
    kind, m, axis = group.kind[j], group.item[j], group.component[j]
    f = group.frame[m]
    Q, length = rotation_increment(frames, Z, f), frames.length[f]
    none = (0.0, 0.0, 0.0)
    if kind == SPIN:
        return none, scale(1.0 / (h * length), at(start.direction[m], axis))
    if kind == QUATERNION:
        alpha, beta = _quaternion_weights(start, m, axis)
        root = 1.0 / math.sqrt(1.0 + 0.25 * dot(Q, Q))
        cube = root * root * root
        along = -0.25 * cube * (alpha + 0.5 * dot(Q, beta))
        return none, scale(0.5 / length, axpy(along, Q, scale(0.5 * root, beta)))
    c = 1.0 / h if kind == VELOCITY else 0.5
    unit = _unit(axis)
    T = end_tangent(frames, Z, f, at(start.arm, m))
    return scale(c, unit), scale(-c, times(transpose(T), unit))


@optional()
def differentiate_coordinates_over_step(
    scalar: ScalarConstraints,
    group: Signals,
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    h: float,
) -> None:
    """Set the derivatives of the inputs that are coordinates by the unknowns of a step, after
    ``coordinates.differentiate``.
    """
    q = place.coordinates
    for j in range(group.kind.size):
        kind = group.kind[j]
        if kind in (COORDINATE, RATE):
            c = 0.5 if kind == COORDINATE else 1.0 / h
            for part in range(PARTS):
                put(start.by_place[j], part, scale(c, at(q.slope[group.item[j]], part)))


@optional()
def set_inputs(group: Signals, start: SignalsWorkspace, motion: FramesWorkspace) -> None:
    """Set the inputs, other than coordinates, to those of the configuration."""
    for j in range(group.kind.size):
        kind, m, axis = group.kind[j], group.item[j], group.component[j]
        if kind in (COORDINATE, RATE):
            continue
        value, size = start.time[0], 0.0
        if kind == REACTION:
            value = start.reaction[m, axis]
        elif kind == POSITION:
            value = start.place[m, axis]
            for i in range(3):
                size = max(size, abs(start.place[m, i]), abs(start.arm[m, i]))
        elif kind == QUATERNION:
            value, size = start.euler[m, axis], 1.0
        elif kind == VELOCITY:
            f = group.frame[m]
            value = add(at(motion.v, f), cross(at(motion.W, f), at(start.arm, m)))[axis]
        elif kind == SPIN:
            value = dot(at(start.direction[m], axis), at(motion.W, group.frame[m]))
        start.size[j] = size
        set_input(group.tape, start.values, j, value)


@optional()
def set_coordinates(
    scalar: ScalarConstraints, group: Signals, start: SignalsWorkspace, place: ScalarWorkspace
) -> None:
    """Set the inputs that are coordinates to those of the configuration, after ``scalar.rates``."""
    for j in range(group.kind.size):
        kind, c = group.kind[j], group.item[j]
        if kind == COORDINATE:
            q = place.coordinates
            start.size[j] = coordinates.extent(scalar.coordinates, q, c)
            set_input(group.tape, start.values, j, q.value[c] + group.origin[j])
        elif kind == RATE:
            start.size[j] = 0.0
            set_input(group.tape, start.values, j, place.rate[c])


@optional()
def differentiate(
    group: Signals, start: SignalsWorkspace, frames: Frames, motion: FramesWorkspace
) -> None:
    """Set the derivatives of the inputs, other than coordinates, by places and by rates."""
    none = (0.0, 0.0, 0.0)
    for j in range(group.kind.size):
        kind, m, axis = group.kind[j], group.item[j], group.component[j]
        if not POSITION <= kind <= SPIN:
            continue
        f = group.frame[m]
        c, r, W = 1.0 / frames.length[f], at(start.arm, m), at(motion.W, f)
        unit = _unit(axis)
        by_u, by_Q, by_v, by_W = none, none, none, none
        if kind == POSITION:
            by_u, by_Q = unit, scale(c, cross(r, unit))
        elif kind == VELOCITY:
            by_v, by_W = unit, scale(c, cross(r, unit))
            by_Q = scale(c, cross(r, cross(unit, W)))
        elif kind == QUATERNION:
            _, beta = _quaternion_weights(start, m, axis)
            by_Q = scale(0.5 * c, beta)
        else:
            axis_direction = at(start.direction[m], axis)
            by_W, by_Q = scale(c, axis_direction), scale(c, cross(axis_direction, W))
        put(start.by_place[j], U_A, by_u)
        put(start.by_place[j], Q_A, by_Q)
        put(start.by_rate[j], U_A, by_v)
        put(start.by_rate[j], Q_A, by_W)


@optional()
def differentiate_coordinates(
    scalar: ScalarConstraints,
    group: Signals,
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Set the derivatives of the inputs that are coordinates by places and by rates, after
    ``scalar.differentiate``.
    """
    q = place.coordinates
    for j in range(group.kind.size):
        kind, c = group.kind[j], group.item[j]
        if kind == COORDINATE:
            for part in range(PARTS):
                put(start.by_place[j], part, at(q.slope[c], part))
        elif kind == RATE:
            half = rate_gradient(scalar.coordinates, q, frames, motion, c, out)
            for part in range(PARTS):
                put(start.by_rate[j], part, at(q.slope[c], part))
                put(start.by_place[j], part, scale(2.0, half[part]))


@kernel
def frame_of_part(group: Signals, scalar: ScalarConstraints | None, j: int, part: int) -> int:
    """Return the frame of a part of an input, -1 if there is none."""
    kind = group.kind[j]
    if kind in (COORDINATE, RATE):
        return coordinate_frame(scalar, group.item[j], part)
    frame: int = group.frame[group.item[j]] if POSITION <= kind <= SPIN and part <= Q_A else -1
    return frame


@optional(-1)
def coordinate_frame(scalar: ScalarConstraints, q: int, part: int) -> int:
    """Return the frame of a part of a coordinate."""
    return coordinates.part_frame(scalar.coordinates, q, part)


@optional()
def evaluate_over_step(group: Signals, start: SignalsWorkspace, h: float) -> None:
    """Solve for the states' means over a step ``h`` from the inputs, and set the results with their
    derivatives by the inputs.
    """
    share, n = 0.5 * h, group.rate.size
    first = group.kind.size
    for k in range(n):
        set_input(group.tape, start.values, first + k, start.state[k])
    sweep(group.tape, start.values)
    changed, left, change = n > 0, MOST_ITERATIONS, math.inf
    while changed and left > 0:
        _set_rates(group, start, share)
        last, change = change, _improve(group, start, share)
        changed, left = _is_change(change, last), left - 1
        sweep(group.tape, start.values)
    for k in range(n):
        start.state_rate[k] = start.values.value[group.rate[k]]
    _set_results(group, start, share)
    if changed:
        for k in range(n):
            start.state_rate[k] = math.nan


@kernel
def _set_rates(group: Signals, start: SignalsWorkspace, share: float) -> None:
    """Set the states' rates, their derivatives, and the factors of 1 - ``share`` f_s."""
    n, first = group.rate.size, group.kind.size
    for k in range(n):
        start.state_rate[k] = start.values.value[group.rate[k]]
        gradient(group.tape, start.values, group.rate[k])
        for j in range(first):
            start.rate_by_input[k, j] = by_input(group.tape, start.values, j)
        for m in range(n):
            slope = by_input(group.tape, start.values, first + m)
            start.matrix[k, m] = (1.0 if k == m else 0.0) - share * slope
    small_system.factor(start.matrix, start.pivot)


@kernel
def _is_change(change: float, last: float) -> bool:
    """Return whether an iteration's relative ``change`` of the states, after the ``last`` one, is
    more than round-off. A nan is none: it ends the iteration.
    """
    if change < NEARLY_NO_CHANGE and change > 0.5 * last:
        return False
    return change > NO_CHANGE


@kernel
def _improve(group: Signals, start: SignalsWorkspace, share: float) -> float:
    """Take one step of Newton's method for the states' means, which are inputs of the tape; return
    the largest change, relative to the terms of its equation.
    """
    y, n, constants = group.kind.size, group.rate.size, group.tape.constant.size
    first = constants + y
    value, largest = start.values.value, 0.0
    for k in range(n):
        change = share * start.state_rate[k]
        start.adjoint[k] = value[first + k] - start.state[k] - change
    small_system.solve(start.matrix, start.pivot, start.adjoint)
    for k in range(n):
        # The terms of a rate may be large and cancel each other, as voltages of a motor do.
        size = abs(start.state[k]) + abs(share * start.state_rate[k])
        for j in range(y):
            size += abs(share * start.rate_by_input[k, j] * value[constants + j])
        value[first + k] -= start.adjoint[k]
        change = abs(start.adjoint[k])
        if change > 0.0:
            largest = max(largest, change / size if size > 0.0 else math.inf)
    return largest


@optional()
def refuse_over_step(group: Signals, start: SignalsWorkspace, F: np.ndarray) -> None:
    """Set the equations ``F`` (nodes, 3) of a step to nan if the auxiliary states have no solution:
    then the step has none, whether or not a force depends on them.
    """
    for k in range(group.rate.size):
        if not math.isfinite(start.state_rate[k]):
            for node in range(F.shape[0]):
                put(F, node, (math.nan, math.nan, math.nan))


@optional()
def evaluate(group: Signals, start: SignalsWorkspace) -> None:
    """Set the results and their derivatives by the inputs at one configuration, with its states."""
    for k in range(group.rate.size):
        set_input(group.tape, start.values, group.kind.size + k, start.state[k])
    sweep(group.tape, start.values)
    _set_results(group, start, 0.0)


@apart
def _set_results(group: Signals, start: SignalsWorkspace, share: float) -> None:
    """Set the results, their sizes, and their derivatives by the inputs; the states follow from the
    inputs by the factors of 1 - ``share`` f_s, or are given where ``share`` is 0.
    """
    n, first = group.rate.size, group.kind.size
    for r in range(group.result.size):
        start.result[r] = start.values.value[group.result[r]]
        gradient(group.tape, start.values, group.result[r])
        for k in range(n):
            start.adjoint[k] = by_input(group.tape, start.values, first + k)
        if share != 0.0:
            small_system.solve_transposed(start.matrix, start.pivot, start.adjoint)
        size = abs(start.result[r])
        for e in range(group.first_entry[r], group.first_entry[r + 1]):
            j = group.entry_input[e]
            slope = by_input(group.tape, start.values, j)
            if share != 0.0:
                for k in range(n):
                    slope += share * start.adjoint[k] * start.rate_by_input[k, j]
            start.by_input[e] = slope
            size += ROUND_OFF_FACTOR * abs(slope) * start.size[j]
        start.result_size[r] = size


@optional()
def set_gradient(group: Signals, start: SignalsWorkspace, r: int) -> None:
    """Set ``gradient`` and ``gradient_rate`` to the derivatives of a result by the unknowns or
    places, and by the rates, of its columns.
    """
    for c in range(group.first_column[r + 1] - group.first_column[r]):
        put(start.gradient, c, (0.0, 0.0, 0.0))
        put(start.gradient_rate, c, (0.0, 0.0, 0.0))
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
def accept(group: Signals, start: SignalsWorkspace, h: float, state: np.ndarray) -> None:
    """Advance the auxiliary ``state`` (n,) by the solved step of the midpoint element."""
    for k in range(state.size):
        state[k] = start.state[k] + h * start.state_rate[k]


class Stages(NamedTuple):
    """The auxiliary states at the s force nodes of a collocation step, and their derivatives."""

    integral: np.ndarray  # (s, s) A_il
    weight: np.ndarray  # (s,) b_i
    input: np.ndarray  # (s, y)
    state: np.ndarray  # (s, n) S_i
    rate: np.ndarray  # (s, n) f there
    rate_by_input: np.ndarray  # (s, n, y)
    rate_by_state: np.ndarray  # (s, n, n)
    matrix: np.ndarray  # (s n, s n) 1 - h A f_s, and its factors
    pivot: np.ndarray  # (s n,)
    right: np.ndarray  # (s n,)
    slope: np.ndarray  # (s, s, e) of the results at c_i by their entries at c_j
    by_place: np.ndarray  # (s, y, 4, 3) of the inputs, by the unknowns' values at the node
    by_rate: np.ndarray  # (s, y, 4, 3) and by their rates


def new_stages(group: Signals | None, integral: np.ndarray, weight: np.ndarray) -> Any:
    """Return the arrays for the nodes with this ``integral`` and ``weight``; None without group."""
    if group is None:
        return None
    s, y, n = weight.size, group.kind.size, group.rate.size
    return Stages(
        integral=integral,
        weight=weight,
        input=np.zeros((s, y)),
        state=np.zeros((s, n)),
        rate=np.zeros((s, n)),
        rate_by_input=np.zeros((s, n, y)),
        rate_by_state=np.zeros((s, n, n)),
        matrix=np.zeros((s * n, s * n)),
        pivot=np.zeros(s * n, dtype=np.int64),
        right=np.zeros(s * n),
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


@optional()
def save_reactions(group: Signals, start: SignalsWorkspace, reaction: np.ndarray) -> None:
    """Save the joints' ``reaction`` (j, 6) of the accepted step before."""
    for j in range(reaction.shape[0]):
        for i in range(6):
            start.reaction[j, i] = reaction[j, i]


@optional()
def save_inputs(group: Signals, start: SignalsWorkspace, stages: Stages, i: int) -> None:
    """Save the inputs as those at stage ``i``."""
    first = group.tape.constant.size
    for j in range(group.kind.size):
        stages.input[i, j] = start.values.value[first + j]


@optional()
def set_state(group: Signals, start: SignalsWorkspace, stages: Stages, i: int) -> None:
    """Set the states of the configuration to those of stage ``i``."""
    for k in range(group.rate.size):
        start.state[k] = stages.state[i, k]


@optional()
def solve_stages(
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
            _set_stage_rates(group, start, stages, i)
        _set_stage_matrix(stages, n, h)
        last, change = change, _improve_stages(stages, begin, n, h)
        changed, left = _is_change(change, last), left - 1
    if changed:
        for i in range(s):
            for k in range(n):
                stages.state[i, k] = stages.rate[i, k] = math.nan


@optional()
def refuse_stages(group: Signals, stages: Stages, F: np.ndarray) -> None:
    """Set the equations ``F`` (s, nodes, 3) of a collocation step to nan if the auxiliary states
    have no solution.
    """
    for i in range(stages.weight.size):
        for k in range(group.rate.size):
            if not math.isfinite(stages.rate[i, k]):
                for node in range(F.shape[1]):
                    put(F[0], node, (math.nan, math.nan, math.nan))


@kernel
def _set_stage_rates(group: Signals, start: SignalsWorkspace, stages: Stages, i: int) -> None:
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
def _set_stage_matrix(stages: Stages, n: int, h: float) -> None:
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
def _improve_stages(stages: Stages, begin: np.ndarray, n: int, h: float) -> float:
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


@optional()
def set_stage_slopes(group: Signals, start: SignalsWorkspace, stages: Stages, h: float) -> None:
    """Set the derivatives of the results at every stage by the inputs at every stage, after
    ``solve_stages``.
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
def accept_stages(group: Signals, stages: Stages, h: float, state: np.ndarray) -> None:
    """Advance the auxiliary ``state`` (n,) by a solved collocation step."""
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


# What a system's set-up asks of the signals, in plain Python.


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
