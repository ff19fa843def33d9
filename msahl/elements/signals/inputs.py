"""Inputs of the expressions of a system: values and derivatives by the motion."""

import math

import numpy as np

from msahl.algebra.rotation import rotation_change
from msahl.algebra.vector import (
    ZERO,
    Vector,
    add,
    at,
    axpy,
    cross,
    dot,
    put,
    scale,
    times,
    transpose,
)
from msahl.elements.constraints import coordinates
from msahl.elements.constraints.coordinate_jacobians import rate_gradient
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.elements.constraints.products import PARTS, Q_A, U_A
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace
from msahl.elements.signals.group import (
    COORDINATE,
    POSITION,
    QUATERNION,
    RATE,
    REACTION,
    SPIN,
    VELOCITY,
    Signals,
    SignalsWorkspace,
)
from msahl.expressions.tape import set_input
from msahl.formulations.absolute.frames import (
    Frames,
    FramesWorkspace,
    direction,
    displacement,
    end_tangent,
    point_arm,
    point_velocity,
    rotation_increment,
)
from msahl.jit.kernel import kernel, optional


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
        r = point_arm(motion.R, f, at(group.s, m))
        put(start.arm, m, r)
        put(start.place, m, add(at(x, f), r))
        for axis in range(3):
            put(start.direction[m], axis, direction(motion.R, f, at(group.axes[m], axis)))
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
    start.time[:] = time
    for k in range(state.size):
        start.state[k] = state[k]
    save_reactions(group, start, reaction)


@optional()
def save_reactions(group: Signals, start: SignalsWorkspace, reaction: np.ndarray) -> None:
    """Save the joints' ``reaction`` (j, 6) of the accepted step before."""
    for j in range(start.reaction.shape[0]):
        for i in range(6):
            start.reaction[j, i] = reaction[j, i]


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
def set_inputs(
    group: Signals,
    start: SignalsWorkspace,
    motion: FramesWorkspace,
    scalar: ScalarConstraints | None,
    place: ScalarWorkspace,
) -> None:
    """Set the inputs to those of the configuration, after ``scalar.rates``."""
    for m in range(group.frame.size):
        f = group.frame[m]
        v = point_velocity(motion, f, at(start.arm, m))
        put(start.change, m, v)
        put(start.rotation, m, at(motion.W, f))
    _set_values(group, start, 0.0, 1.0)
    _set_coordinates(scalar, group, start, place, 0.0, 1.0)


@optional()
def set_inputs_over_step(
    group: Signals,
    start: SignalsWorkspace,
    frames: Frames,
    scalar: ScalarConstraints | None,
    place: ScalarWorkspace,
    h: float,
    Z: np.ndarray,
) -> None:
    """Set the inputs to their means over a step ``h``, after ``coordinates.evaluate``."""
    for m in range(group.frame.size):
        f = group.frame[m]
        Q = rotation_increment(frames, Z, f)
        put(start.change, m, add(displacement(frames, Z, f), rotation_change(Q, at(start.arm, m))))
        put(start.rotation, m, Q)
    _set_values(group, start, 0.5, h)
    _set_coordinates(scalar, group, start, place, 0.5, h)


@kernel
def _set_values(group: Signals, start: SignalsWorkspace, share: float, h: float) -> None:
    """Set the inputs, other than coordinates: values after a ``share`` of the change in a step
    ``h``, and the changes divided by ``h`` as rates.
    """
    for j in range(group.kind.size):
        kind, m, axis = group.kind[j], group.item[j], group.component[j]
        if kind in (COORDINATE, RATE):
            continue
        value, size = start.time[0] + share * h, 0.0
        if kind == REACTION:
            value = start.reaction[m, axis]
        elif kind == POSITION:
            value = start.place[m, axis] + share * start.change[m, axis]
            for i in range(3):
                size = max(size, abs(start.place[m, i]), abs(start.arm[m, i]))
        elif kind == QUATERNION:
            value, size = _quaternion(start, m, axis, share), 1.0
        elif kind == VELOCITY:
            value = start.change[m, axis] / h
        elif kind == SPIN:
            value = dot(at(start.direction[m], axis), at(start.rotation, m)) / h
        start.size[j] = size
        set_input(group.tape, start.values, j, value)


@kernel
def _quaternion(start: SignalsWorkspace, m: int, axis: int, share: float) -> float:
    """Return a component of a marker's quaternion: its mean over a step, or with ``share`` zero
    that of the configuration.
    """
    value: float = start.euler[m, axis]
    if share == 0.0:
        return value
    Q = at(start.rotation, m)
    alpha, beta = _quaternion_weights(start, m, axis)
    root = 1.0 / math.sqrt(1.0 + 0.25 * dot(Q, Q))
    return share * (value + root * (alpha + 0.5 * dot(Q, beta)))


@optional()
def _set_coordinates(
    scalar: ScalarConstraints,
    group: Signals,
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    share: float,
    h: float,
) -> None:
    """Set the inputs that are coordinates, as ``_set_values`` sets the others."""
    q = place.coordinates
    for j in range(group.kind.size):
        kind, c = group.kind[j], group.item[j]
        if kind not in (COORDINATE, RATE):
            continue
        change, size = q.change[c] if share > 0.0 else place.rate[c], 0.0
        value = change / h
        if kind == COORDINATE:
            value = q.value[c] + group.origin[j] + share * change
            size = coordinates.extent(scalar.coordinates, q, c)
        start.size[j] = size
        set_input(group.tape, start.values, j, value)


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
def differentiate(
    group: Signals,
    start: SignalsWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    scalar: ScalarConstraints | None,
    place: ScalarWorkspace,
    out: Derivatives,
) -> None:
    """Set the derivatives of the inputs by places and by rates, after ``scalar.differentiate``."""
    for j in range(group.kind.size):
        kind, m, axis = group.kind[j], group.item[j], group.component[j]
        if not POSITION <= kind <= SPIN:
            continue
        f = group.frame[m]
        c, r, W = 1.0 / frames.length[f], at(start.arm, m), at(motion.W, f)
        unit = _unit(axis)
        by_u, by_Q, by_v, by_W = ZERO, ZERO, ZERO, ZERO
        if kind == POSITION:
            by_u, by_Q = unit, scale(c, cross(r, unit))
        elif kind == VELOCITY:
            by_v, by_W = unit, scale(c, cross(r, unit))
            by_Q = scale(c, cross(r, cross(unit, W)))
        elif kind == QUATERNION:
            _, beta = _quaternion_weights(start, m, axis)
            by_Q = scale(0.5 * c, beta)
        else:
            own = at(start.direction[m], axis)
            by_W, by_Q = scale(c, own), scale(c, cross(own, W))
        put(start.by_place[j], U_A, by_u)
        put(start.by_place[j], Q_A, by_Q)
        put(start.by_rate[j], U_A, by_v)
        put(start.by_rate[j], Q_A, by_W)
    _differentiate_coordinates(scalar, group, start, place, frames, motion, out)


@optional()
def differentiate_over_step(
    group: Signals,
    start: SignalsWorkspace,
    frames: Frames,
    scalar: ScalarConstraints | None,
    place: ScalarWorkspace,
    h: float,
    Z: np.ndarray,
) -> None:
    """Set the derivatives of the inputs by the unknowns of a step, after
    ``coordinates.differentiate``.
    """
    for j in range(group.kind.size):
        if POSITION <= group.kind[j] <= SPIN:
            by_u, by_Q = _marker_gradient_over_step(group, start, frames, h, Z, j)
            put(start.by_place[j], U_A, by_u)
            put(start.by_place[j], Q_A, by_Q)
    _differentiate_coordinates_over_step(scalar, group, start, place, h)


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
    if kind == SPIN:
        return ZERO, scale(1.0 / (h * length), at(start.direction[m], axis))
    if kind == QUATERNION:
        alpha, beta = _quaternion_weights(start, m, axis)
        root = 1.0 / math.sqrt(1.0 + 0.25 * dot(Q, Q))
        cube = root * root * root
        along = -0.25 * cube * (alpha + 0.5 * dot(Q, beta))
        return ZERO, scale(0.5 / length, axpy(along, Q, scale(0.5 * root, beta)))
    c = 1.0 / h if kind == VELOCITY else 0.5
    unit = _unit(axis)
    T = end_tangent(frames, Z, f, at(start.arm, m))
    return scale(c, unit), scale(-c, times(transpose(T), unit))


@optional()
def _differentiate_coordinates(
    scalar: ScalarConstraints,
    group: Signals,
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Set the derivatives of the inputs that are coordinates by places and by rates."""
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


@optional()
def _differentiate_coordinates_over_step(
    scalar: ScalarConstraints,
    group: Signals,
    start: SignalsWorkspace,
    place: ScalarWorkspace,
    h: float,
) -> None:
    """Set the derivatives of the inputs that are coordinates by the unknowns of a step."""
    q = place.coordinates
    for j in range(group.kind.size):
        kind = group.kind[j]
        if kind in (COORDINATE, RATE):
            c = 0.5 if kind == COORDINATE else 1.0 / h
            for part in range(PARTS):
                put(start.by_place[j], part, scale(c, at(q.slope[group.item[j]], part)))


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
