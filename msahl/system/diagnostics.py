"""What is known of a run over all its steps, thinned in the output or not.

Every accepted step leaves a row of figures; chunk by chunk they are folded into the extremes of the
run. The energy balance is E - work of the loads: it stays what it was, exactly, for the exact
motion. The local error is what one step adds to a body's place,

    h^2/12 |change of a| + l (h^2/12 |change of alpha| + (h W)^3/12)

the trapezoidal rule's for the way and for the turn, and the discrete turn's own (2 tan(h W/2) is
taken for h W). Their sum is an estimate of a regular motion's error, from above or near it; what
chaos makes of it, only a second run can tell.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import at, dot, sub
from msahl.elements.constraints import scalar
from msahl.elements.frames import moving_count
from msahl.jit.kernel import apart, kernel
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace

BALANCE, KINETIC, GAP, GAP_RATE, GAP_WORK, SPEED, TURN, DISTANCE, WAY, LOCAL = range(10)


class Monitor(NamedTuple):
    """Rows of one chunk, and room for the joints' gaps.

    A row is: balance, kinetic energy [J]; largest gap [m] and gap rate [m/s]; work that the joints'
    forces have in their gaps [J]; of the bodies the highest speed [m/s], of the mass centre and the
    turning at l, the fastest turn a step [rad], the farthest from the origin and from where they
    began, and the largest local error [m].
    """

    rows: np.ndarray  # (steps, 10)
    began: np.ndarray  # (n+1, 3) mass centres at t = 0 [m]
    violation: np.ndarray  # (k, 3) by the multipliers' nodes
    rate: np.ndarray  # (k, 3)


def new_monitor(state: State, steps: int) -> Monitor:
    """Room for ``steps`` rows."""
    return Monitor(
        rows=np.zeros((steps, LOCAL + 1)),
        began=state.x.copy(),
        violation=np.zeros_like(state.violation),
        rate=np.zeros_like(state.violation),
    )


@kernel
def look(
    system: System, state: State, start: SystemWorkspace, h: float, monitor: Monitor, row: int
) -> None:
    """Fill a row with the figures of the accepted, prepared state after a step ``h``."""
    kinetic, potential = evaluate.observe(system, state, start, monitor.violation, monitor.rate)
    work = 0.0
    for k in range(state.force.shape[0]):
        for i in range(3):
            work += abs(state.force[k, i] * monitor.violation[k, i])
    scalar.in_metres(system.scalar, monitor.violation, monitor.rate)
    monitor.rows[row, BALANCE] = balanced(kinetic + potential, state)
    monitor.rows[row, KINETIC] = kinetic
    monitor.rows[row, GAP] = largest_length(monitor.violation)
    monitor.rows[row, GAP_RATE] = largest_length(monitor.rate)
    monitor.rows[row, GAP_WORK] = work
    look_at_bodies(system, state, start, h, monitor, row)


@kernel
def balanced(energy: float, state: State) -> float:
    """``energy`` less all work [J]."""
    for k in range(state.work.size):
        energy -= state.work[k]
    return energy


@apart
def energy_balance(
    system: System, state: State, start: SystemWorkspace, violation: np.ndarray, rate: np.ndarray
) -> float:
    """Energy balance [J] of the prepared state; ``gap`` and ``rate`` (k, 3) are room."""
    kinetic, potential = evaluate.observe(system, state, start, violation, rate)
    return balanced(kinetic + potential, state)


@kernel
def look_at_bodies(
    system: System, state: State, start: SystemWorkspace, h: float, monitor: Monitor, row: int
) -> None:
    """Fill in speed, turn, distance, way and local error, each of the body where it is largest."""
    speed, turn, distance, way, local = 0.0, 0.0, 0.0, 0.0, 0.0
    for b in range(moving_count(system.frames)):
        v, W, x = at(start.frames.v, b), at(start.frames.W, b), at(state.x, b)
        a, alpha = at(state.a_trend[0], b), at(state.alpha_trend[0], b)
        length = system.frames.length[b]
        spin = math.sqrt(dot(W, W))
        angle = h * spin
        bend = math.sqrt(dot(a, a)) + length * math.sqrt(dot(alpha, alpha))
        speed = max(speed, math.sqrt(dot(v, v)) + length * spin)
        turn = max(turn, angle)
        distance = max(distance, dot(x, x))
        gone = sub(x, at(monitor.began, b))
        way = max(way, dot(gone, gone))
        local = max(local, h * h * bend + length * angle * angle * angle)
    monitor.rows[row, SPEED] = speed
    monitor.rows[row, TURN] = turn
    monitor.rows[row, DISTANCE] = math.sqrt(distance)
    monitor.rows[row, WAY] = math.sqrt(way)
    monitor.rows[row, LOCAL] = local / 12.0


@kernel
def largest_length(vectors: np.ndarray) -> float:
    """Length of the longest of ``vectors`` (k, 3)."""
    square = 0.0
    for k in range(vectors.shape[0]):
        square = max(square, vectors[k, 0] ** 2 + vectors[k, 1] ** 2 + vectors[k, 2] ** 2)
    return math.sqrt(square)
