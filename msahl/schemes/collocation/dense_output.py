"""Rows at times within a step of higher degree, as accurate as its ends.

The polynomials of a step are of order s + 1 between its ends, and of order 2s at them. So rows
between are taken from other polynomials, of what is known at the ends: place, velocity and, from
the index-1 problem, acceleration. That of degree 5 has an error of h^6 in places, h^5 in
velocities; accelerations of the places it says at 2 l times within the step, entered beside the
others, give one of degree 5 + 2 l with h^(6 + 2l) and h^(5 + 2l), and so on from l to l + 1.

Displacements and turns are from the start of the step, turns by the parameters of
``schemes.chart``. A row's places and velocities are put back on the joints by the least change by
mass, which is of the size of the error, its reactions follow from its accelerations, its work from
powers at Gauss nodes between the start and the row.
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre, polynomial

from msahl.algebra.rotation import compose, from_step_turn, inverse, matrix
from msahl.algebra.vector import (
    ZERO,
    Vector,
    add,
    at,
    axpy,
    copy,
    put,
    scale,
    sub,
    times,
    transpose,
)
from msahl.elements import forces
from msahl.elements.constraints import scalar
from msahl.elements.frames import displacement_node, first_multiplier, moving_count, rotation_node
from msahl.jit.kernel import apart, kernel
from msahl.schemes import accelerations
from msahl.schemes.accelerations import Instant
from msahl.schemes.collocation import local_rotation
from msahl.schemes.midpoint import equations
from msahl.schemes.midpoint.workspace import Workspace
from msahl.system import evaluate
from msahl.system.arrays import State, new_system_workspace

ENDS = 6
"""Conditions at the ends of a step: place, velocity, acceleration at either."""
CLOSINGS = 2
"""Of a row's places: its gaps are those of the interpolation, and closing them is quadratic."""


INWARDS, ROUND_OFF = 1e-12, 2e-15
"""How far from the ends of a step laws are asked: parts of the step, and of the time."""


class Point(NamedTuple):
    """What is known of the motion at one end of a step."""

    time: np.ndarray  # (1,)
    x: np.ndarray  # (n+1, 3)
    p: np.ndarray  # (n+1, 3)
    v: np.ndarray  # (n+1, 3)
    W: np.ndarray  # (n+1, 3) inertial axes
    angle: np.ndarray  # (q,) the quantities' values
    work: np.ndarray  # (w,)


class DenseOutput(NamedTuple):
    """Room for rows within a step."""

    workspace: Workspace  # the rows' own, with a state of its own
    begin: Point
    end: Point
    curve: np.ndarray  # (c, 2 (n+1), 3) u and c: values, rates, second rates by t/h; c = ENDS + 2 l
    bent: np.ndarray  # (2 l or 2, 2 (n+1), 3) second rates at nodes within, before they are entered
    basis: np.ndarray  # (l + 1, c, c) coefficients of each condition's polynomial, by level
    nodes: np.ndarray  # (l + 1, 2 l) times of a level's accelerations, in parts of the step
    value: np.ndarray  # (c,) weights of the conditions in a value, and in a rate
    rate: np.ndarray  # (c,)
    gauss: np.ndarray  # (s,) nodes and weights of the work's quadrature
    weight: np.ndarray  # (s,)
    own: int  # column of a decaying scheme's own work, or -1


def levels(order: int) -> int:
    """How often accelerations within must be entered for velocities of this ``order``."""
    return max(0, (order - 4) // 2)


def new_dense_output(workspace: Workspace, order: int, decays: bool) -> DenseOutput:
    """Room for the rows between of steps whose ends are of this ``order``; what a scheme that
    ``decays`` takes is shared out evenly over its step.
    """
    state, of_frames = workspace.state, first_multiplier(workspace.system.frames)
    own = State(*(array.copy() for array in state))
    most = levels(order)
    conditions = ENDS + 2 * most
    basis = np.zeros((most + 1, conditions, conditions))
    nodes = np.zeros((most + 1, max(2 * most, 1)))
    for level in range(most + 1):
        count = ENDS + 2 * level
        nodes[level, : 2 * level] = (np.arange(2 * level) + 1.0) / (2 * level + 1.0)
        basis[level, :count, :count] = _basis(nodes[level, : 2 * level])
    x, b = legendre.leggauss((order + 1) // 2)
    return DenseOutput(
        workspace=workspace._replace(state=own, start=new_system_workspace(workspace.system, own)),
        begin=new_point(state),
        end=new_point(state),
        curve=np.zeros((conditions, of_frames, 3)),
        bent=np.zeros((max(2 * most, 2), of_frames, 3)),
        basis=basis,
        nodes=nodes,
        value=np.zeros(conditions),
        rate=np.zeros(conditions),
        gauss=0.5 * (x + 1.0),
        weight=0.5 * b,
        own=state.work.size - 1 if decays else -1,
    )


def new_point(state: State) -> Point:
    """Room for a point of scenes like that of ``state``."""
    vectors = state.x.shape
    return Point(
        time=np.zeros(1),
        x=np.zeros(vectors),
        p=np.zeros(vectors),
        v=np.zeros(vectors),
        W=np.zeros(vectors),
        angle=np.zeros_like(state.angle),
        work=np.zeros_like(state.work),
    )


def _basis(nodes: np.ndarray) -> np.ndarray:
    """(c, c) by condition, coefficients of powers of 2 t - 1: value, rate and second rate at 0, and
    at 1, then second rates at the ``nodes``.
    """
    count = ENDS + len(nodes)
    powers = np.eye(count)
    rows = [
        2.0**k * polynomial.polyval(2.0 * t - 1.0, polynomial.polyder(powers, k))
        for t in (0.0, 1.0)
        for k in range(3)
    ]
    rows += [4.0 * polynomial.polyval(2.0 * t - 1.0, polynomial.polyder(powers, 2)) for t in nodes]
    return np.ascontiguousarray(np.linalg.inv(np.array(rows)).T)


@kernel
def mark(point: Point, workspace: Workspace) -> None:
    """Note the scene's accepted state as an end of the step."""
    state, start = workspace.state, workspace.start
    point.time[0] = state.time[0]
    copy(state.x, point.x)
    copy(state.p, point.p)
    copy(state.v, point.v)
    copy(start.frames.W, point.W)
    for q in range(state.angle.size):
        point.angle[q] = state.angle[q]
    for w in range(state.work.size):
        point.work[w] = state.work[w]


@kernel
def copy_point(point: Point, other: Point) -> None:
    """Make ``other`` the same as ``point``."""
    other.time[0] = point.time[0]
    copy(point.x, other.x)
    copy(point.p, other.p)
    copy(point.v, other.v)
    copy(point.W, other.W)
    for q in range(point.angle.size):
        other.angle[q] = point.angle[q]
    for w in range(point.work.size):
        other.work[w] = point.work[w]


@kernel
def trace(between: DenseOutput, room: Instant) -> None:
    """Set the curves from ``begin`` to ``end``."""
    begin, end, curve = between.begin, between.end, between.curve
    frames = between.workspace.system.frames
    h = end.time[0] - begin.time[0]
    for b in range(moving_count(frames)):
        c = compose(at(end.p, b), inverse(at(begin.p, b)))
        u_node, turn_node = displacement_node(frames, b), rotation_node(frames, b)
        put(curve[0], u_node, ZERO)
        put(curve[0], turn_node, ZERO)
        put(curve[1], u_node, scale(h, at(begin.v, b)))
        put(curve[1], turn_node, scale(h, at(begin.W, b)))
        put(curve[3], u_node, sub(at(end.x, b), at(begin.x, b)))
        put(curve[3], turn_node, c)
        put(curve[4], u_node, scale(h, at(end.v, b)))
        put(curve[4], turn_node, scale(h, local_rotation.parameter_rate(c, at(end.W, b))))
    for level in range(between.basis.shape[0]):
        count = 2 if level == 0 else 2 * level
        for m in range(count):
            if level == 0:
                _stand(between, begin if m == 0 else end)
            else:
                weigh(between, level - 1, between.nodes[level, m])
                move(between, h, between.nodes[level, m])
            accelerate(between, room, h, m)
        for m in range(count):
            entry = ENDS + m
            if level == 0:
                entry = 2 + 3 * m
            for node in range(curve.shape[1]):
                put(curve[entry], node, at(between.bent[m], node))


@kernel
def _stand(between: DenseOutput, point: Point) -> None:
    """Bring the rows' state to an end of the step."""
    state, begin, end = between.workspace.state, between.begin, between.end
    # A law that has a kink there is asked on this step's side of it.
    inwards = INWARDS * (end.time[0] - begin.time[0]) + ROUND_OFF * abs(end.time[0])
    state.time[0] = point.time[0] + (inwards if point.time[0] < end.time[0] else -inwards)
    for b in range(point.x.shape[0] - 1):
        put(state.x, b, at(point.x, b))
        put(state.p, b, at(point.p, b))
        put(state.v, b, at(point.v, b))
        put(state.w, b, times(transpose(matrix(at(point.p, b))), at(point.W, b)))
    _prepare(between, begin.angle)


@apart
def _prepare(between: DenseOutput, angle: np.ndarray) -> None:
    """Prepare the rows' state; angles are counted from those given."""
    workspace = between.workspace
    for q in range(angle.size):
        workspace.state.angle[q] = angle[q]
    evaluate.prepare(workspace.system, workspace.state, workspace.start)
    scalar.count_rotations(workspace.system.scalar, workspace.start.scalar, workspace.state.angle)


@kernel
def weigh(between: DenseOutput, level: int, tau: float) -> None:
    """Set the weights of the conditions at ``tau``, in parts of the step."""
    count, x = ENDS + 2 * level, 2.0 * tau - 1.0
    for i in range(between.value.size):
        value, rate = 0.0, 0.0
        if i < count:
            for k in range(count - 1, -1, -1):
                rate = rate * x + value
                value = value * x + between.basis[level, i, k]
        between.value[i], between.rate[i] = value, 2.0 * rate


@kernel
def _sum(curve: np.ndarray, weights: np.ndarray, node: int) -> Vector:
    """What the ``weights`` make of the conditions of a node."""
    total = ZERO
    for i in range(weights.size):
        total = axpy(weights[i], at(curve[i], node), total)
    return total


@apart
def move(between: DenseOutput, h: float, tau: float) -> None:
    """Bring the rows' state to ``tau``, by the weights there."""
    state, begin, curve = between.workspace.state, between.begin, between.curve
    frames = between.workspace.system.frames
    state.time[0] = begin.time[0] + h * tau
    for b in range(moving_count(frames)):
        c = _sum(curve, between.value, rotation_node(frames, b))
        c_dot = scale(1.0 / h, _sum(curve, between.rate, rotation_node(frames, b)))
        p = compose(c, at(begin.p, b))
        u_node = displacement_node(frames, b)
        put(state.x, b, add(at(begin.x, b), _sum(curve, between.value, u_node)))
        put(state.p, b, p)
        put(state.v, b, scale(1.0 / h, _sum(curve, between.rate, u_node)))
        put(state.w, b, times(transpose(matrix(p)), local_rotation.momentum(c, c_dot)))
    _prepare(between, begin.angle)


@apart
def accelerate(between: DenseOutput, room: Instant, h: float, m: int) -> None:
    """Set ``bent`` of node ``m`` to the accelerations of the rows' state."""
    workspace, begin = between.workspace, between.begin
    frames, state, start = workspace.system.frames, workspace.state, workspace.start
    accelerations.accelerate(workspace.system, state, start, room)
    gravity = workspace.system.bodies.gravity
    for b in range(moving_count(frames)):
        a = at(room.solution, displacement_node(frames, b))
        if frames.ballistic[b]:
            a = (gravity[0], gravity[1], gravity[2])
        alpha = scale(1.0 / frames.length[b], at(room.solution, rotation_node(frames, b)))
        # W = H c_dot by t; no turn from the start has a rate of W itself.
        c = compose(at(state.p, b), inverse(at(begin.p, b)))
        c_dot = local_rotation.parameter_rate(c, at(start.frames.W, b))
        alpha = sub(alpha, times(local_rotation.momentum_slope(c, c_dot), c_dot))
        put(between.bent[m], displacement_node(frames, b), scale(h * h, a))
        c_ddot = local_rotation.parameter_rate(c, alpha)
        put(between.bent[m], rotation_node(frames, b), scale(h * h, c_ddot))


@apart
def publish(between: DenseOutput, room: Instant, tau: float, row: int) -> None:
    """Enter the state at ``tau`` of the traced step in a ``row`` of the tables."""
    workspace, begin, end = between.workspace, between.begin, between.end
    h, last = end.time[0] - begin.time[0], between.basis.shape[0] - 1
    for w in range(begin.work.size):
        workspace.state.work[w] = begin.work[w]
    if begin.work.size > 0:
        for i in range(between.gauss.size):
            weigh(between, last, tau * between.gauss[i])
            move(between, h, tau * between.gauss[i])
            accelerations.accelerate(workspace.system, workspace.state, workspace.start, room)
            _add_work(between, room, h * tau * between.weight[i])
    if between.own >= 0:
        taken = end.work[between.own] - begin.work[between.own]
        workspace.state.work[between.own] += tau * taken
    weigh(between, last, tau)
    move(between, h, tau)
    for _ in range(max(CLOSINGS, accelerations.rounds(workspace.system))):
        _close(between, room)
        _prepare(between, begin.angle)
    accelerations.keep_closed(
        workspace.system,
        workspace.state,
        workspace.start,
        workspace.monitor.violation,
        workspace.monitor.rate,
        room,
    )
    equations.publish(
        workspace.system,
        workspace.state,
        workspace.start,
        0.0,
        workspace.mean_reaction,
        workspace.mean_force,
        workspace.tables,
        row,
    )
    accelerations.publish(workspace, room, row)


@kernel
def _add_work(between: DenseOutput, room: Instant, dt: float) -> None:
    """Add to the rows' work what loads and drives do over a time ``dt``."""
    system, state, start = (
        between.workspace.system,
        between.workspace.state,
        between.workspace.start,
    )
    frames = system.frames
    forces.add_power(
        system.forces,
        start.forces,
        system.scalar,
        start.scalar,
        start.frames,
        state.reaction,
        dt,
        state.work,
    )
    scalar.motion_work(system.scalar, frames, state.time[0], dt, room.solution, state.work)


@kernel
def _close(between: DenseOutput, room: Instant) -> None:
    """Move the rows' state onto the joints, by the least change by mass."""
    workspace = between.workspace
    system, state, start, monitor = (
        workspace.system,
        workspace.state,
        workspace.start,
        workspace.monitor,
    )
    frames = system.frames
    evaluate.observe(system, state, start, monitor.violation, monitor.rate)
    scalar.in_metres(system.scalar, monitor.violation, monitor.rate)
    accelerations.undo(system, state, start, monitor.violation, room)
    for b in range(moving_count(frames)):
        turn = scale(1.0 / frames.length[b], at(room.solution, rotation_node(frames, b)))
        put(state.x, b, add(at(state.x, b), at(room.solution, displacement_node(frames, b))))
        put(state.p, b, compose(from_step_turn(turn), at(state.p, b)))
