"""Steps of the time elements of higher degree, as ``solve.newton`` and ``solve.step`` take those of
the lowest: Newton's method, acceptance, many steps of an island.

At the end of a step the velocities are made to keep the joints closed, by the smallest change by
mass, which is what the multiplier of the last node does. Friction presses by the reaction that
follows from the accelerations at its node, found anew in every iteration. What the energy balance
comes to lack by a decaying scheme is entered as that scheme's work; what it gains is left to tell.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import copy
from msahl.elements.constraints.scalar import clear_rate_violations
from msahl.elements.forces import ReactionForces, pressed_by_reactions
from msahl.elements.frames import first_multiplier
from msahl.jit.kernel import apart, kernel
from msahl.linalg import block_lu, dense
from msahl.model.scheme import COLLOCATION
from msahl.schemes import accelerations
from msahl.schemes.accelerations import Instant, new_instant
from msahl.schemes.collocation import dense_output, equations, predictor
from msahl.schemes.collocation.dense_output import DenseOutput, new_dense_output
from msahl.schemes.collocation.tableau import new_rule
from msahl.schemes.collocation.workspace import Stages, go, new_stages
from msahl.schemes.midpoint.newton import DIVERGED, MAX_ITERATIONS, STUCK
from msahl.schemes.midpoint.workspace import Workspace, show
from msahl.schemes.outcome import TOLERANCE
from msahl.system.arrays import State, System, SystemWorkspace
from msahl.system.diagnostics import Monitor, energy_balance
from msahl.system.ordering import Elimination

TARGET = 1e-14
"""As ``outcome.TARGET``: these steps are few and long, and what is left of each counts the less."""
WORTH = 5.0
"""Iterations that are better made with the derivative at hand: a new one with its factors costs
about three, and two more follow."""
NEAR = 0.03
"""First residual of a step up to which the next may go by one velocity more. Steps that follow less
than that of the motion are led astray by it."""
RECALLED = 0.01
"""Share of the gap from absolute positions that a step closes beside what the last one left over.
Gaps followed by increments wander by round-off as turns are composed: 1e-11 m in two million steps.
A share this small carries little of the round-off of positions into the velocities."""


class CollocationWorkspace(NamedTuple):
    """An island on its way by steps of higher degree."""

    workspace: Workspace
    pressed: ReactionForces | None  # forces that depend on reactions; None: no code for them
    stages: Stages
    instant: Instant
    factor: np.ndarray  # (entries, s, s) sparse factors, blocks transposed
    y: np.ndarray  # (f, s) right-hand side, in the order of elimination
    taken: np.ndarray  # (s,) room of the factors
    between: DenseOutput
    whole: np.ndarray  # (s + 1, nodes, 3) velocities of a step to be gone through again
    held: np.ndarray  # (s, nodes, 3) its solution
    outcome: np.ndarray  # (2,) residual and worst row of the last step


def new_collocation_workspace(
    workspace: Workspace, scheme: str, degree: int
) -> CollocationWorkspace:
    """Room for steps by the ``scheme`` of a ``degree`` from the scene's prepared state."""
    lu, higher = workspace.unknowns.elimination, COLLOCATION[scheme]
    stages = new_stages(
        workspace.system, workspace.unknowns, workspace.state, new_rule(scheme, degree)
    )
    violation, rate = workspace.monitor.violation, workspace.monitor.rate
    stages.level[0] = energy_balance(
        workspace.system, workspace.state, workspace.start, violation, rate
    )
    return CollocationWorkspace(
        workspace=workspace,
        pressed=pressed_by_reactions(workspace.system.forces),
        stages=stages,
        instant=new_instant(workspace.system, workspace.unknowns),
        factor=np.zeros((int(lu.base[-1]), degree, degree)),
        y=np.zeros((lu.order.size, degree)),
        taken=np.zeros(degree, dtype=np.int64),
        between=new_dense_output(workspace, higher.order(degree), higher.decays),
        whole=np.zeros_like(stages.before),
        held=np.zeros_like(stages.Z),
        outcome=np.zeros(2),
    )


@kernel
def forget(high: CollocationWorkspace) -> None:
    """Let the next step be guessed from the accelerations of its start."""
    high.stages.known[1] = 0.0


@kernel
def is_slow(residual: float, before: float) -> bool:
    """Whether a new derivative is worth its price, at the pace of the last iteration."""
    if not residual < before:
        return True
    return math.log(TARGET / residual) < WORTH * (math.log(residual) - math.log(before))


@kernel
def judge(free: np.ndarray, F: np.ndarray, pull: np.ndarray, length: float) -> tuple[float, int]:
    """As ``dense.judge``: the largest free row relative to the step's length or to the loads in it,
    and its index among the flat rows.
    """
    worst, largest = -1, 0.0
    for i in range(free.size):
        node = free[i] // 3
        relief = length / max(length, pull[node])
        for j in range(F.shape[0]):
            row = abs(F[j, node, free[i] % 3]) * relief
            # Written so that a nan is the worst of all.
            if not row <= largest:
                worst, largest = free[i], row
    return largest / length, worst


@apart
def press(
    pressed: ReactionForces | None,
    system: System,
    state: State,
    stages: Stages,
    room: Instant,
    h: float,
) -> None:
    """Set the reactions where forces act, if there is friction, which presses by them."""
    if pressed is None:
        return
    for n in range(stages.rule.acts.size):
        i = stages.rule.acts[n]
        if i < 0:
            continue
        go(system, state, stages, h, n)
        copy(stages.reaction[i], stages.state.reaction)
        accelerations.accelerate(system, stages.state, stages.start, room)
        copy(stages.state.reaction, stages.reaction[i])


@kernel
def drop_null(
    lu: Elimination,
    relaxation: float,
    chi: np.ndarray,
    Z: np.ndarray,
    factor: np.ndarray,
    y: np.ndarray,
    first: int,
) -> None:
    """As ``newton.drop_null``: take from multipliers what the joints' redundancy leaves open."""
    s = y.shape[1]
    for k in range(y.shape[0]):
        node, i = lu.order[k] // 3, lu.order[k] % 3
        for j in range(s):
            y[k, j] = 0.0
            if node >= first:
                for n in range(s):
                    y[k, j] += 2.0 * relaxation * chi[j, n] * Z[n, node, i]
    block_lu.solve(lu, factor, y)
    for k in range(y.shape[0]):
        node = lu.order[k] // 3
        if node >= first:
            for j in range(s):
                Z[j, node, lu.order[k] % 3] -= y[k, j]


@kernel
def drop_gap(high: CollocationWorkspace) -> None:
    """As ``newton.drop_gap``: take from the gaps handed to the next step what no motion can close,
    left over from this one or seen in absolute positions.
    """
    workspace, y, chi = high.workspace, high.y, high.stages.rule.chi
    system, lu, violation = (
        workspace.system,
        workspace.unknowns.elimination,
        workspace.state.violation,
    )
    s = y.shape[1]
    first = first_multiplier(system.frames)
    for k in range(y.shape[0]):
        node, i = lu.order[k] // 3, lu.order[k] % 3
        for j in range(s):
            y[k, j] = violation[node - first, i] if node >= first and j == s - 1 else 0.0
    block_lu.solve(lu, high.factor, y)
    for k in range(y.shape[0]):
        node, i = lu.order[k] // 3, lu.order[k] % 3
        if node >= first:
            for n in range(s):
                violation[node - first, i] -= 2.0 * system.relaxation * chi[s - 1, n] * y[k, n]
    clear_rate_violations(system.scalar, violation)


@kernel
def gather(lu: Elimination, F: np.ndarray, y: np.ndarray) -> None:
    """Set ``y`` (f, s) to the free rows ``F`` (s, nodes, 3) in the order of elimination."""
    for k in range(y.shape[0]):
        for j in range(y.shape[1]):
            y[k, j] = F[j, lu.order[k] // 3, lu.order[k] % 3]


@kernel
def advance(
    system: System,
    state: State,
    start: SystemWorkspace,
    stages: Stages,
    monitor: Monitor,
    room: Instant,
    h: float,
) -> None:
    """Take over the solved step."""
    equations.accept(system, state, start, stages, h)
    accelerations.keep_closed(system, state, start, monitor.violation, monitor.rate, room)
    for k in range(state.violation.shape[0]):
        for i in range(3):
            state.violation[k, i] += RECALLED * (monitor.violation[k, i] - state.violation[k, i])
    if stages.rule.decays:
        lost = stages.level[0] - energy_balance(
            system, state, start, monitor.violation, monitor.rate
        )
        state.work[state.work.size - 1] -= max(0.0, lost)


@kernel
def march(
    high: CollocationWorkspace, h: float, first: int, last: int, due: np.ndarray, share: np.ndarray
) -> int:
    """As ``newton.march``, with rows as in ``solve.plan``, their reactions those of their own
    times; without rows where ``due`` is empty.
    """
    for step in range(first, last):
        if due.size > 0:
            dense_output.mark(high.between.begin, high.workspace)
        if not take(high, h):
            return step
        if due.size > 0:
            publish(high, h, step, due, share)
    return last


@kernel
def publish(
    high: CollocationWorkspace, h: float, step: int, due: np.ndarray, share: np.ndarray
) -> None:
    """Enter the accepted state in row ``step`` of the watch, and the rows of the tables that are
    due; the step's begin is marked.
    """
    workspace, room = high.workspace, high.instant
    first, last = due[step], due[step + 1]
    end = -1
    if last > first and share[last - 1] == 1.0:
        end, last = last - 1, last - 1
    show(workspace, h, step, end)
    if end >= 0:
        accelerations.publish(workspace, room, end)
    if last > first:
        dense_output.mark(high.between.end, workspace)
        dense_output.trace(high.between, room)
        for row in range(first, last):
            dense_output.publish(high.between, room, share[row], row)


@apart
def take(high: CollocationWorkspace, h: float) -> bool:
    """Take a step of size ``h``, if it converges; ``high.outcome`` says how it went."""
    workspace, stages, station_room = high.workspace, high.stages, high.instant
    system, state, start, unknowns = (
        workspace.system,
        workspace.state,
        workspace.start,
        workspace.unknowns,
    )
    lu, factor, y = unknowns.elimination, high.factor, high.y
    multipliers, relaxation = first_multiplier(system.frames), system.relaxation
    before, smallest, way, length, first = math.inf, math.inf, 0.0, 0.0, math.inf
    iteration, fresh, relaxed = 0, True, relaxation > 0.0
    predictor.predict(system, state, start, stages, h)
    while True:
        press(high.pressed, system, state, stages, station_room, h)
        length = equations.evaluate(system, state, start, stages, h, fresh)
        length = max(length, dense.AT_REST)
        residual, worst = judge(unknowns.free, stages.F, stages.pull, length)
        if iteration == 0:
            way, first = length, residual
        smallest = min(smallest, residual)
        if residual <= TARGET or (residual > STUCK * before and residual <= TOLERANCE):
            if not relaxed:
                break
            if not fresh:
                fresh = True
                continue
            block_lu.factor(lu, stages.source, stages.values, factor, high.taken)
            drop_null(lu, relaxation, stages.rule.chi, stages.Z, factor, y, multipliers)
            relaxed, fresh, before, smallest = False, False, math.inf, math.inf
            continue
        if iteration == MAX_ITERATIONS or not residual <= DIVERGED * smallest:
            break
        if not fresh and is_slow(residual, before):
            fresh = True
            continue
        if fresh:
            block_lu.factor(lu, stages.source, stages.values, factor, high.taken)
            workspace.counts[1] += 1
        correct(lu, factor, stages.F, stages.Z, y)
        workspace.counts[0] += 1
        iteration += 1
        before, fresh = residual, False
    if dense.is_astray(system, way, length):
        residual = math.inf
    high.outcome[0], high.outcome[1] = residual, worst
    if not residual <= TOLERANCE:
        return False
    stages.near[0] = 1.0 if first <= NEAR else 0.0
    advance(system, state, start, stages, workspace.monitor, station_room, h)
    if relaxation > 0.0:
        drop_gap(high)
    return True


@kernel
def correct(
    lu: Elimination,
    factor: np.ndarray,
    F: np.ndarray,
    Z: np.ndarray,
    y: np.ndarray,
) -> None:
    """Take from the free unknowns ``Z`` what the factors say of the rows ``F``."""
    gather(lu, F, y)
    block_lu.solve(lu, factor, y)
    for k in range(y.shape[0]):
        for j in range(y.shape[1]):
            Z[j, lu.order[k] // 3, lu.order[k] % 3] -= y[k, j]


@kernel
def probe(
    high: CollocationWorkspace, h: float, z: np.ndarray, f: np.ndarray, fresh: bool
) -> tuple[float, int, float]:
    """Set the free rows ``f`` (f, s) at the free unknowns ``z``, and where ``fresh`` their
    derivative; what ``judge`` says of them, and the step's length [m].
    """
    workspace, stages, free = high.workspace, high.stages, high.workspace.unknowns.free
    system, state = workspace.system, workspace.state
    for i in range(free.size):
        for j in range(z.shape[1]):
            stages.Z[j, free[i] // 3, free[i] % 3] = z[i, j]
    press(high.pressed, system, state, stages, high.instant, h)
    length = equations.evaluate(system, state, workspace.start, stages, h, fresh)
    length = max(length, dense.AT_REST)
    for i in range(free.size):
        for j in range(f.shape[1]):
            f[i, j] = stages.F[j, free[i] // 3, free[i] % 3]
    residual, worst = judge(free, stages.F, stages.pull, length)
    return residual, worst, length
