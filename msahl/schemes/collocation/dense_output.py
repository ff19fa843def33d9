"""Interpolates a collocation step: states at output times within it, as accurate as at its ends.

The polynomials of the scheme are of order s + 1 within a step and of order 2 s at its ends. So
output times within a step get other polynomials, fitted to what is known at the ends: position,
velocity and, from the index-1 problem (``accelerations``), acceleration. The one of degree 5 has an
error of h^6 in positions and h^5 in velocities. Accelerations at 2 l times within the step, taken
at its positions, are added to the conditions and give a polynomial of degree 5 + 2 l with errors of
h^(6 + 2 l) and h^(5 + 2 l), and so on from level l to l + 1. Each level multiplies what is wrong
with the one before, its round-off at least, by about (h/T)^2, T the shortest period or time
constant of the model: where steps are much longer than that, accelerations differ more from those
of the polynomial from level to level, and the last level at which they do not is used.

Displacements and rotations are from the start of the step; rotations are expressed by the
parameters of ``local_rotation``. The interpolated positions and velocities are projected onto the
constraints by the least change weighted by mass, which is of the size of the interpolation error.
Reactions follow from the accelerations, and works from the powers at Gauss nodes between the start
of the step and the output time. Auxiliary states are integrated from the start of the step to that
time, by one Radau step along the interpolated motion.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre, polynomial

from msahl.algebra.rotation import compose, from_increment, inverse, matrix
from msahl.algebra.vector import (
    ZERO,
    Vector,
    add,
    at,
    axpy,
    copy,
    dot,
    put,
    scale,
    sub,
    times,
    transpose,
)
from msahl.elements.beams import instant as beams
from msahl.elements.constraints import scalar
from msahl.elements.signals import inputs, states
from msahl.elements.signals.group import Signals, Stages, new_stages
from msahl.formulations.absolute import local_rotation
from msahl.formulations.absolute.frames import (
    displacement_node,
    first_multiplier,
    moving_count,
    rotation_increment,
    rotation_node,
)
from msahl.jit.kernel import apart, kernel, optional, unit
from msahl.ports import forces, sliding
from msahl.schemes.collocation.tableau import at_radau_nodes, radau_nodes
from msahl.schemes.common import accelerations
from msahl.schemes.common.accelerations import Instant
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.common.workspace import write_row as write_state
from msahl.system import evaluate
from msahl.system.arrays import State, new_system_workspace

ENDS = 6
"""Conditions at the ends of a step: position, velocity and acceleration at both."""
COARSE = -1
"""Level without accelerations, for which ``fit_ends`` is enough: cubic polynomials."""
DIVERGES, BLUR, EVERY = 4.0, 1e-13, 1e300
"""Growth from level to level of the difference of accelerations above which a level is not used,
the difference, over the size of the model, below which it is round-off that does no harm, and a
growth that no level has."""
PROJECTIONS = 2
"""Projections of interpolated positions onto the constraints; convergence is quadratic."""
INWARDS, ROUND_OFF = 1e-12, 2e-15
"""Distance from the ends of a step at which laws are evaluated: fractions of the step and of the
time."""


class StepEnd(NamedTuple):
    """The motion at one end of a step."""

    time: np.ndarray  # (1,)
    x: np.ndarray  # (n+1, 3)
    p: np.ndarray  # (n+1, 3)
    v: np.ndarray  # (n+1, 3)
    W: np.ndarray  # (n+1, 3) inertial axes
    angle: np.ndarray  # (q,) values of the coordinates
    work: np.ndarray  # (w,)
    auxiliary: np.ndarray  # (n,) auxiliary states
    reaction: np.ndarray  # (j, 6) of the joints, on which expressions depend in the next step


class DenseOutput(NamedTuple):
    """Conditions, polynomials and work arrays of the interpolation within a step."""

    workspace: Workspace  # with a state of its own, that of the output time
    begin: StepEnd
    end: StepEnd
    curve: (
        np.ndarray
    )  # (c, 2 (n+1), 3) conditions on u and c: values, rates and second rates by t/h
    inner: (
        np.ndarray
    )  # (2 l or 2, 2 (n+1), 3) second rates at times within, before they are entered
    basis: np.ndarray  # (l + 2, c, c) by level, coefficients of each condition's polynomial
    nodes: np.ndarray  # (l + 1, 2 l) by level, times of accelerations as fractions of the step
    level: np.ndarray  # (1,) of the fitted polynomials
    value: np.ndarray  # (c,) basis polynomials at the output time, and their rates
    rate: np.ndarray  # (c,)
    gauss: np.ndarray  # (s,) nodes and weights of the work's quadrature; of systems with states
    weight: np.ndarray  # (s,) those of Radau
    signals: Stages  # auxiliary states at these nodes; None where the system has none
    scheme_work: int  # column of the energy that a decaying scheme takes, or -1


def levels(order: int) -> int:
    """Number of times that accelerations within must be added for velocities of this ``order``."""
    return max(0, (order - 4) // 2)


def new_dense_output(workspace: Workspace, order: int, decays: bool) -> DenseOutput:
    """Return the interpolation of steps whose ends are of this ``order``; the energy that a scheme
    that ``decays`` takes is spread evenly over its step.
    """
    state, of_frames = workspace.state, first_multiplier(workspace.system.frames)
    own = State(*(array.copy() for array in state))
    most = levels(order)
    conditions = ENDS + 2 * most
    basis, nodes = _polynomials(most)
    group = workspace.system.forces.signals
    has_states = group is not None and group.rate.size > 0
    of_states = at_radau_nodes(order // 2 + 1)
    gauss, weight = _gauss((order + 1) // 2)
    if has_states:
        gauss, weight = radau_nodes(order // 2 + 1), of_states.integral[-1].copy()
    return DenseOutput(
        workspace=workspace._replace(state=own, start=new_system_workspace(workspace.system, own)),
        begin=new_step_end(state),
        end=new_step_end(state),
        curve=np.zeros((conditions, of_frames, 3)),
        inner=np.zeros((max(2 * most, 2), of_frames, 3)),
        basis=basis,
        nodes=nodes,
        level=np.full(1, COARSE),
        value=np.zeros(conditions),
        rate=np.zeros(conditions),
        gauss=gauss,
        weight=weight,
        signals=new_stages(group, of_states),
        scheme_work=state.work.size - 1 if decays else -1,
    )


def new_step_end(state: State) -> StepEnd:
    """Return an empty end of a step of systems like that of ``state``."""
    vectors = state.x.shape
    return StepEnd(
        time=np.zeros(1),
        x=np.zeros(vectors),
        p=np.zeros(vectors),
        v=np.zeros(vectors),
        W=np.zeros(vectors),
        angle=np.zeros_like(state.angle),
        work=np.zeros_like(state.work),
        auxiliary=np.zeros_like(state.auxiliary),
        reaction=np.zeros_like(state.reaction),
    )


@cache
def _polynomials(most: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of the polynomials and the times within the step, by level up to
    ``most``; all interpolations share them.
    """
    conditions = ENDS + 2 * most
    basis = np.zeros((most + 2, conditions, conditions))
    nodes = np.zeros((most + 1, max(2 * most, 1)))
    for level in range(most + 1):
        count = ENDS + 2 * level
        nodes[level, : 2 * level] = (np.arange(2 * level) + 1.0) / (2 * level + 1.0)
        basis[level, :count, :count] = _basis(nodes[level, : 2 * level])
    basis[COARSE, :ENDS, :ENDS] = _coarse_basis()
    return basis, nodes


@cache
def _gauss(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Gauss nodes (count,) and weights on [0, 1]."""
    x, b = legendre.leggauss(count)
    return 0.5 * (x + 1.0), 0.5 * b


def _basis(nodes: np.ndarray) -> np.ndarray:
    """(c, c) for each condition, the coefficients of its polynomial in powers of 2 t - 1. The
    conditions are value, rate and second rate at 0 and at 1, then second rates at the ``nodes``.
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


def _coarse_basis() -> np.ndarray:
    """(6, 6) as ``_basis``, with positions and velocities alone: cubic polynomials."""
    found = np.zeros((ENDS, ENDS))
    found[0, :4], found[3, :4] = (0.5, -0.75, 0.0, 0.25), (0.5, 0.75, 0.0, -0.25)
    found[1, :4], found[4, :4] = (0.125, -0.125, -0.125, 0.125), (-0.125, -0.125, 0.125, 0.125)
    return found


@kernel
def save_end(point: StepEnd, workspace: Workspace) -> None:
    """Save the accepted state as an end of the step."""
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
    for k in range(state.auxiliary.size):
        point.auxiliary[k] = state.auxiliary[k]
    copy(state.reaction, point.reaction)


@kernel
def copy_end(point: StepEnd, other: StepEnd) -> None:
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
    for k in range(point.auxiliary.size):
        other.auxiliary[k] = point.auxiliary[k]
    copy(point.reaction, other.reaction)


@kernel
def fit_ends(output: DenseOutput) -> None:
    """Fit the cubic polynomials of the level ``COARSE`` between ``begin`` and ``end``."""
    begin, end, curve = output.begin, output.end, output.curve
    frames = output.workspace.system.frames
    h = end.time[0] - begin.time[0]
    for b in range(moving_count(frames)):
        c = compose(at(end.p, b), inverse(at(begin.p, b)))
        u_node, Q_node = displacement_node(frames, b), rotation_node(frames, b)
        put(curve[0], u_node, ZERO)
        put(curve[0], Q_node, ZERO)
        put(curve[1], u_node, scale(h, at(begin.v, b)))
        put(curve[1], Q_node, scale(h, at(begin.W, b)))
        put(curve[3], u_node, sub(at(end.x, b), at(begin.x, b)))
        put(curve[3], Q_node, c)
        put(curve[4], u_node, scale(h, at(end.v, b)))
        put(curve[4], Q_node, scale(h, local_rotation.parameter_rate(c, at(end.W, b))))


@unit
def fit(output: DenseOutput, instant: Instant, growth: float) -> None:
    """Fit the polynomials between ``begin`` and ``end``, up to the level at which accelerations
    differ from those of the level before by ``growth`` times as much as there: ``DIVERGES`` for
    what is reported, ``EVERY`` where a step may have passed an event, at which they jump. Where
    contacts slide it is ``DIVERGES`` always: what is wrong with a slip that has just begun rotates
    friction, and it would seem to end.
    """
    signal_group = output.workspace.system.forces.signals
    h, before = output.end.time[0] - output.begin.time[0], 0.0
    slides = sliding.any_slides(output.workspace.system.forces.sliding)
    fit_ends(output)
    output.level[0] = COARSE
    for level in range(output.nodes.shape[0]):
        count = 2 if level == 0 else 2 * level
        for m in range(count):
            if level == 0:
                _set_to_end(output, output.begin if m == 0 else output.end)
            else:
                set_auxiliary(signal_group, output, level - 1, h, output.nodes[level, m])
                set_basis_weights(output, level - 1, output.nodes[level, m])
                interpolate(output, h, output.nodes[level, m])
            save_accelerations(output, instant, h, m)
        off, second = _largest_defect(output, level, count)
        if off == math.inf:
            return  # auxiliary states may have no solution where they switch
        if growth < EVERY or slides:
            diverges = off > min(growth, DIVERGES) * (second if level == 0 else before)
            if diverges and (growth == EVERY or off > BLUR * _size(output)):
                return
            before = off
        _enter_accelerations(output, level, count)


@kernel
def _largest_defect(output: DenseOutput, level: int, count: int) -> tuple[float, float]:
    """Largest difference between the ``inner`` accelerations and those of the polynomials of the
    level before, and the largest of these [m]; of rotations times the length of their frame.
    """
    curve, frames = output.curve, output.workspace.system.frames
    off, largest = 0.0, 0.0
    for m in range(count):
        _set_second_weights(output, level - 1, float(m) if level == 0 else output.nodes[level, m])
        for b in range(moving_count(frames)):
            for rotational in range(2):
                node, lever = displacement_node(frames, b), 1.0
                if rotational:
                    node, lever = rotation_node(frames, b), frames.length[b]
                second = scale(lever, _sum(curve, output.value, node))
                other = sub(scale(lever, at(output.inner[m], node)), second)
                size = math.sqrt(dot(other, other))
                # Written so that a nan counts: see ``fit``.
                off = max(off, size) if size < math.inf else math.inf
                largest = max(largest, math.sqrt(dot(second, second)))
    return off, largest


@kernel
def _set_second_weights(output: DenseOutput, level: int, tau: float) -> None:
    """Set the values of the basis polynomials to their second rates at the fraction ``tau``."""
    count, x = ENDS + 2 * max(level, 0), 2.0 * tau - 1.0
    for i in range(output.value.size):
        second = 0.0
        if i < count:
            for k in range(count - 1, 1, -1):
                second = second * x + 4.0 * k * (k - 1) * output.basis[level, i, k]
        output.value[i] = second


@kernel
def _size(output: DenseOutput) -> float:
    """Size of the model [m]: its largest coordinate at the start of the step and longest frame."""
    frames, x, size = output.workspace.system.frames, output.begin.x, 0.0
    for b in range(moving_count(frames)):
        size = max(size, frames.length[b] + math.sqrt(dot(at(x, b), at(x, b))))
    return size


@kernel
def _enter_accelerations(output: DenseOutput, level: int, count: int) -> None:
    """Make the ``inner`` accelerations conditions on the polynomials, now of this ``level``."""
    for m in range(count):
        entry = 2 + 3 * m if level == 0 else ENDS + m
        for node in range(output.curve.shape[1]):
            put(output.curve[entry], node, at(output.inner[m], node))
    output.level[0] = level


@kernel
def _set_to_end(output: DenseOutput, point: StepEnd) -> None:
    """Set the interpolated state to an end of the step."""
    state, begin, end = output.workspace.state, output.begin, output.end
    # A law with a breakpoint there is evaluated on this step's side of it.
    inwards = INWARDS * (end.time[0] - begin.time[0]) + ROUND_OFF * abs(end.time[0])
    state.time[0] = point.time[0] + (inwards if point.time[0] < end.time[0] else -inwards)
    for b in range(point.x.shape[0] - 1):
        put(state.x, b, at(point.x, b))
        put(state.p, b, at(point.p, b))
        put(state.v, b, at(point.v, b))
        put(state.w, b, times(transpose(matrix(at(point.p, b))), at(point.W, b)))
    for k in range(point.auxiliary.size):
        state.auxiliary[k] = point.auxiliary[k]
    _prepare(output, begin.angle)


@optional()
def set_auxiliary(group: Signals, output: DenseOutput, level: int, h: float, tau: float) -> None:
    """Set the auxiliary states to those at the fraction ``tau`` of the step, by the motion of this
    ``level``; ``output.signals`` receives those at the Gauss nodes before.
    """
    workspace, begin = output.workspace, output.begin
    if group.rate.size == 0:
        return
    own = workspace.start.forces
    for i in range(output.gauss.size):
        set_basis_weights(output, level, tau * output.gauss[i])
        interpolate(output, h, tau * output.gauss[i])
        forces.set_prepared_inputs(group, own, workspace.system.scalar)
        states.save_inputs(group, own.signals, output.signals, i)
    for k in range(begin.auxiliary.size):
        workspace.state.auxiliary[k] = begin.auxiliary[k]
    states.solve(group, own.signals, output.signals, begin.auxiliary, tau * h)
    states.accept(group, output.signals, workspace.state.auxiliary)
    if tau >= 1.0:
        for k in range(begin.auxiliary.size):
            workspace.state.auxiliary[k] = output.end.auxiliary[k]


@apart
def _prepare(output: DenseOutput, angle: np.ndarray) -> None:
    """Prepare the interpolated state; full revolutions are counted from the angles given."""
    workspace = output.workspace
    for q in range(angle.size):
        workspace.state.angle[q] = angle[q]
    evaluate.prepare(workspace.system, workspace.state, workspace.start)
    beams.set_strains(workspace.system.beams, workspace.start.beams)
    group, own = workspace.system.forces.signals, workspace.start.forces.signals
    inputs.save_reactions(group, own, output.begin.reaction)
    scalar.count_rotations(workspace.system.scalar, workspace.start.scalar, workspace.state.angle)


@kernel
def set_basis_weights(output: DenseOutput, level: int, tau: float) -> None:
    """Evaluate the basis polynomials and their rates at the fraction ``tau`` of the step."""
    count, x = ENDS + 2 * max(level, 0), 2.0 * tau - 1.0
    for i in range(output.value.size):
        value, rate = 0.0, 0.0
        if i < count:
            for k in range(count - 1, -1, -1):
                rate = rate * x + value
                value = value * x + output.basis[level, i, k]
        output.value[i], output.rate[i] = value, 2.0 * rate


@kernel
def _sum(curve: np.ndarray, weights: np.ndarray, node: int) -> Vector:
    """Sum of the conditions of a node, times the ``weights``. Conditions without one may be what a
    step that could not be solved has left, nan."""
    total = ZERO
    for i in range(weights.size):
        if weights[i] != 0.0:
            total = axpy(weights[i], at(curve[i], node), total)
    return total


@apart
def interpolate(output: DenseOutput, h: float, tau: float) -> None:
    """Set the state to that at the fraction ``tau`` of the step, where the basis was evaluated."""
    state, begin, curve = output.workspace.state, output.begin, output.curve
    frames = output.workspace.system.frames
    state.time[0] = begin.time[0] + h * tau
    for b in range(moving_count(frames)):
        c = _sum(curve, output.value, rotation_node(frames, b))
        c_dot = scale(1.0 / h, _sum(curve, output.rate, rotation_node(frames, b)))
        p = compose(c, at(begin.p, b))
        u_node = displacement_node(frames, b)
        put(state.x, b, add(at(begin.x, b), _sum(curve, output.value, u_node)))
        put(state.p, b, p)
        put(state.v, b, scale(1.0 / h, _sum(curve, output.rate, u_node)))
        put(state.w, b, times(transpose(matrix(p)), local_rotation.momentum(c, c_dot)))
    _prepare(output, begin.angle)


@unit
def save_accelerations(output: DenseOutput, instant: Instant, h: float, m: int) -> None:
    """Set the ``inner`` condition ``m`` to the accelerations of the interpolated state."""
    workspace, begin = output.workspace, output.begin
    frames, state, start = workspace.system.frames, workspace.state, workspace.start
    accelerations.accelerate(workspace.system, state, start, instant)
    gravity = workspace.system.bodies.gravity
    for b in range(moving_count(frames)):
        a = at(instant.solution, displacement_node(frames, b))
        if frames.ballistic[b]:
            a = (gravity[0], gravity[1], gravity[2])
        alpha = rotation_increment(frames, instant.solution, b)
        # Derivative of W = H c_dot by time.
        c = compose(at(state.p, b), inverse(at(begin.p, b)))
        c_dot = local_rotation.parameter_rate(c, at(start.frames.W, b))
        alpha = sub(alpha, times(local_rotation.momentum_slope(c, c_dot), c_dot))
        put(output.inner[m], displacement_node(frames, b), scale(h * h, a))
        c_ddot = local_rotation.parameter_rate(c, alpha)
        put(output.inner[m], rotation_node(frames, b), scale(h * h, c_ddot))


@unit
def write_row(output: DenseOutput, instant: Instant, tau: float, row: int) -> None:
    """Write the state at the fraction ``tau`` of the fitted step into a ``row`` of the tables."""
    workspace, begin, end = output.workspace, output.begin, output.end
    h, last = end.time[0] - begin.time[0], output.level[0]
    for w in range(begin.work.size):
        workspace.state.work[w] = begin.work[w]
    group, own = workspace.system.forces.signals, workspace.start.forces.signals
    set_auxiliary(group, output, last, h, tau)
    if begin.work.size > 0:
        for i in range(output.gauss.size):
            set_basis_weights(output, last, tau * output.gauss[i])
            interpolate(output, h, tau * output.gauss[i])
            states.set_state(group, own, output.signals, i)
            accelerations.accelerate(workspace.system, workspace.state, workspace.start, instant)
            _add_work(output, instant, h * tau * output.weight[i])
    if output.scheme_work >= 0:
        taken = end.work[output.scheme_work] - begin.work[output.scheme_work]
        workspace.state.work[output.scheme_work] += tau * taken
    set_basis_weights(output, last, tau)
    interpolate(output, h, tau)
    for _ in range(max(PROJECTIONS, accelerations.projection_rounds(workspace.system))):
        _project(output, instant)
        _prepare(output, begin.angle)
    accelerations.project_velocities(
        workspace.system,
        workspace.state,
        workspace.start,
        workspace.monitor.violation,
        workspace.monitor.rate,
        instant,
    )
    write_state(workspace, 0.0, row)
    accelerations.write_instantaneous_reactions(workspace, instant, row)


@kernel
def _add_work(output: DenseOutput, instant: Instant, dt: float) -> None:
    """Add the work of loads and prescribed motions over a time ``dt`` [s]."""
    system, state, start = (
        output.workspace.system,
        output.workspace.state,
        output.workspace.start,
    )
    frames = system.frames
    forces.add_power(system.forces, start.forces, system.scalar, state.reaction, dt, state.work)
    scalar.motion_work(system.scalar, frames, state.time[0], dt, instant.solution, state.work)
    beams.add_power(system.beams, start.beams, start.frames, dt, state.work)


@kernel
def _project(output: DenseOutput, instant: Instant) -> None:
    """Project the positions onto the constraints, by the least change weighted by mass."""
    workspace = output.workspace
    system, state, start, monitor = (
        workspace.system,
        workspace.state,
        workspace.start,
        workspace.monitor,
    )
    frames = system.frames
    evaluate.observe(system, state, start, monitor.violation, monitor.rate)
    scalar.in_metres(system.scalar, monitor.violation, monitor.rate)
    beams.in_metres(system.beams, monitor.violation, monitor.rate)
    accelerations.solve_projection(system, state, start, monitor.violation, instant)
    for b in range(moving_count(frames)):
        Q = rotation_increment(frames, instant.solution, b)
        put(state.x, b, add(at(state.x, b), at(instant.solution, displacement_node(frames, b))))
        put(state.p, b, compose(from_increment(Q), at(state.p, b)))
