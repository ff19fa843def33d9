"""Steps of the time elements of higher degree, as ``solve.newton`` and ``solve.step`` take those of
the lowest: Newton's method, acceptance, many steps of an island.

At the end of a step the velocities are made to keep the joints closed, by the smallest change by
mass, which is what the multiplier of the last node does. Friction at a Gauss node presses by the
reaction that follows from the accelerations there, found anew in every iteration.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.joints import along
from msahl.kernel import kernel
from msahl.schemes import gauss, preserving
from msahl.schemes.gauss import Stages, new_stages
from msahl.solve import dense, stagewise, station
from msahl.solve.newton import DIVERGED, MAX_ITERATIONS, SLOW, STUCK
from msahl.solve.outcome import TARGET, TOLERANCE
from msahl.solve.station import Station, new_station
from msahl.solve.step import Scene, show
from msahl.vector import add, at, matrix_at, put, scale, times, transpose


class High(NamedTuple):
    """An island on its way by steps of higher degree."""

    scene: Scene
    stages: Stages
    station: Station
    factor: np.ndarray  # (entries, s, s) sparse factors
    y: np.ndarray  # (f, s) right-hand side, in the order of elimination
    room: np.ndarray  # (2, s, s)


def new_high(scene: Scene, degree: int) -> High:
    """Room for steps of ``degree``."""
    lu = scene.unknowns.elimination
    return High(
        scene=scene,
        stages=new_stages(scene.system, scene.state, degree),
        station=new_station(scene.system),
        factor=np.zeros((int(lu.base[-1]), degree, degree)),
        y=np.zeros((lu.order.size, degree)),
        room=np.zeros((2, degree, degree)),
    )


def forget(high: High) -> None:
    """Let the next step be guessed from the accelerations of its start."""
    if high.stages.step[0] != 0.0:
        high.stages.step[0] = -1.0


@kernel
def evaluate(high: High, h: float) -> tuple[float, int, float]:
    """Set the rows; the largest relative to the step's length or to the loads in it, its index
    among the flat rows, and the step's length [m].
    """
    scene, stages = high.scene, high.stages
    system = scene.system
    _press(high, h)
    gauss.residual(system, scene.state, scene.start, stages, h)
    worst, largest = -1, 0.0
    step = max(dense.AT_REST, gauss.step_size(system, scene.start, stages, h))
    free = scene.unknowns.free
    for i in range(free.size):
        node = free[i] // 3
        relief = step / max(step, stages.pull[node])
        for j in range(stages.F.shape[0]):
            row = abs(stages.F[j, node, free[i] % 3]) * relief
            # Written so that a nan is the worst of all.
            if not row <= largest:
                worst, largest = free[i], row
    return largest / step, worst, step


@kernel
def _press(high: High, h: float) -> None:
    """Set the reactions at the Gauss nodes, if friction asks for them."""
    scene, stages = high.scene, high.stages
    if not along.has_friction(scene.system.along):
        return
    for i in range(stages.rule.weight.size):
        gauss.go_to_load(scene.system, scene.state, stages, h, i)
        _copy(stages.reaction[i], stages.state.reaction)
        station.accelerate(scene.system, stages.state, stages.start, high.station)
        _copy(stages.state.reaction, stages.reaction[i])


@kernel
def _copy(source: np.ndarray, target: np.ndarray) -> None:
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@kernel
def solve_step(high: High, h: float) -> tuple[float, int]:
    """Solve one step from the guess; its residual (relative) and worst row."""
    scene, stages = high.scene, high.stages
    lu = scene.unknowns.elimination
    residual, worst, guess = evaluate(high, h)
    step = guess
    smallest, slow, stuck = residual, True, False
    for _ in range(MAX_ITERATIONS):
        if residual <= TARGET or stuck or not residual <= DIVERGED * smallest:
            break
        if slow:
            gauss.jacobian(scene.system, scene.state, scene.start, stages, h)
            stagewise.factor(lu, stages.values, high.factor, high.room)
            scene.counts[1] += 1
        _gather(high, stages.F)
        stagewise.solve(lu, high.factor, high.y, high.room[0, 0])
        _take(high, stages.Z)
        scene.counts[0] += 1
        before = residual
        residual, worst, step = evaluate(high, h)
        slow = residual > SLOW * before
        stuck = residual > STUCK * before and residual <= TOLERANCE
        smallest = min(smallest, residual)
    if dense.is_astray(scene.system, guess, step):
        return math.inf, worst
    return residual, worst


@kernel
def _gather(high: High, F: np.ndarray) -> None:
    """Set ``y`` to the free entries of ``F`` (s, nodes, 3)."""
    order, y = high.scene.unknowns.elimination.order, high.y
    for k in range(order.size):
        for j in range(y.shape[1]):
            y[k, j] = F[j, order[k] // 3, order[k] % 3]


@kernel
def _take(high: High, Z: np.ndarray) -> None:
    """Take ``y`` from the free unknowns."""
    order, y = high.scene.unknowns.elimination.order, high.y
    for k in range(order.size):
        for j in range(y.shape[1]):
            Z[j, order[k] // 3, order[k] % 3] -= y[k, j]


@kernel
def drop_null(high: High) -> None:
    """As ``newton.drop_null``: take from the multipliers what the joints' redundancy leaves open."""
    scene, stages, y = high.scene, high.stages, high.y
    order = scene.unknowns.elimination.order
    first = 2 * scene.system.bodies.inverse_mass.size
    chi = stages.rule.chi
    s = y.shape[1]
    for k in range(y.shape[0]):
        node = order[k] // 3
        for j in range(s):
            y[k, j] = 0.0
            if node >= first:
                for i in range(s):
                    part = 2.0 * chi[j, i] * stages.Z[i, node, order[k] % 3]
                    y[k, j] += scene.system.relaxation * part
    stagewise.solve(scene.unknowns.elimination, high.factor, y, high.room[0, 0])
    for k in range(y.shape[0]):
        node = order[k] // 3
        if node >= first:
            for j in range(s):
                stages.Z[j, node, order[k] % 3] -= y[k, j]


@kernel
def take(high: High, h: float) -> tuple[float, int]:
    """Take a step of size ``h`` if it converges: residual, row."""
    guess(high, h)
    residual, worst = solve_step(high, h)
    if high.scene.system.relaxation > 0.0 and residual <= TOLERANCE:
        drop_null(high)
        residual, worst = solve_step(high, h)
    if residual <= TOLERANCE:
        accept(high, h)
    return residual, worst


@kernel
def guess(high: High, h: float) -> None:
    """Set the first guess; where no step of this size went before, from the accelerations."""
    scene, stages = high.scene, high.stages
    state = scene.state
    if stages.step[0] != h and stages.step[0] != 0.0:
        station.accelerate(scene.system, state, scene.start, high.station)
        solution = high.station.solution
        for b in range(scene.system.bodies.inverse_mass.size - 1):
            for i in range(3):
                state.a[b, i] = solution[2 * b, i]
                state.alpha[b, i] = solution[2 * b + 1, i] / scene.system.bodies.length[b]
    gauss.predict(scene.system, state, scene.start, stages, h)


@kernel
def accept(high: High, h: float) -> None:
    """Take over the solved step, close the joints' velocities and prepare the next."""
    scene = high.scene
    gauss.accept(scene.system, scene.state, scene.start, high.stages, h)
    rounds = 3 if scene.system.relaxation > 0.0 else 1
    for _ in range(rounds):
        _keep_closed(high, h)


@kernel
def _keep_closed(high: High, h: float) -> None:
    """Change the velocities, least by mass, so that no joint opens."""
    scene, room, rule = high.scene, high.station, high.stages.rule
    system, state, start = scene.system, scene.state, scene.start
    bodies, watch = system.bodies, scene.watch
    first = 2 * bodies.inverse_mass.size
    station.free(system, state, start, room)
    preserving.observe(system, state, start, watch.gap, watch.rate)
    along.in_metres(system.along, watch.gap, watch.rate)
    for node in range(room.rows.shape[0]):
        for i in range(3):
            room.rows[node, i] = 0.0 if node < first else -watch.rate[node - first, i]
    station.solve(room)
    for b in range(bodies.inverse_mass.size - 1):
        R = matrix_at(start.bodies.R, b)
        dW = scale(1.0 / bodies.length[b], at(room.solution, 2 * b + 1))
        put(state.v, b, add(at(state.v, b), at(room.solution, 2 * b)))
        put(state.w, b, add(at(state.w, b), times(transpose(R), dW)))
    if state.work.size > 0:
        weight = rule.node_weight[rule.weight.size]
        gauss.drive(system, state, room.solution, 1.0 / (h * weight), h, 0.0, weight)
    preserving.prepare(system, state, start)


@kernel
def march(high: High, h: float, first: int, last: int, plan: np.ndarray) -> int:
    """As ``newton.march``, with the reactions of every published row at its own time."""
    for k in range(first, last):
        residual, _ = take(high, h)
        if not residual <= TOLERANCE:
            return k
        publish(high, h, k, plan[k])
    return last


@kernel
def publish(high: High, h: float, step: int, row: int) -> None:
    """Enter the accepted state in row ``step`` of the watch, and in ``row`` of the tables unless
    that is negative.
    """
    show(high.scene, h, step, row)
    if row >= 0:
        station.publish(high.scene, high.station, row)
