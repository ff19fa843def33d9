"""Record figures of every accepted step: energy balance, violations, speeds, local errors.

The figures of a chunk of steps are kept in rows, and reduced to the extremes of the run between
chunks, whether or not a step is an output time. The energy balance is E - work of the loads; it is
constant for the exact motion. The local error is the estimated error of a body's position by one
step,

    h^2/12 |change of a| + l (h^2/12 |change of alpha| + (h W)^3/12)

that of the trapezoidal rule for displacement and rotation, and that of the rotation increment (2
tan(h W/2) for h W). Their sum estimates the error of a regular motion from above or near it; it
does not contain the growth of errors in a chaotic motion.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import at, dot, sub
from msahl.elements.beams import instant
from msahl.elements.constraints import scalar
from msahl.formulations.absolute.frames import moving_count
from msahl.jit.kernel import apart, kernel, unit
from msahl.ports import forces
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace

(
    BALANCE,
    KINETIC,
    VIOLATION,
    VIOLATION_RATE,
    CONSTRAINT_WORK,
    SPEED,
    ROTATION,
    DISTANCE,
    DISPLACEMENT,
    LOCAL,
    STOP,
) = range(11)


class Monitor(NamedTuple):
    """Figures of the steps of one chunk, and arrays for the constraint violations.

    A row is: balance, kinetic energy [J]; largest violation [m] and its rate [m/s]; work of the
    multipliers on the violations [J]; of the bodies the highest speed, of mass centre and of
    rotation at l [m/s], the largest rotation per step [rad], distance from the origin, displacement
    since t = 0, and local error [m]; the largest margin of the conditions that end the run.
    """

    rows: np.ndarray  # (steps, 11)
    began: np.ndarray  # (n+1, 3) mass centres at t = 0 [m]
    violation: np.ndarray  # (k, 3) by the multipliers' nodes
    rate: np.ndarray  # (k, 3)


def new_monitor(state: State, steps: int) -> Monitor:
    """Return a monitor for ``steps`` steps."""
    return Monitor(
        rows=np.zeros((steps, STOP + 1)),
        began=np.zeros_like(state.x),
        violation=np.zeros_like(state.violation),
        rate=np.zeros_like(state.violation),
    )


@unit
def record_figures(
    system: System, state: State, start: SystemWorkspace, h: float, monitor: Monitor, row: int
) -> None:
    """Fill a row with the figures of the accepted, prepared state after a step ``h``."""
    kinetic, potential = evaluate.observe(system, state, start, monitor.violation, monitor.rate)
    work = 0.0
    for k in range(state.force.shape[0]):
        for i in range(3):
            work += abs(state.force[k, i] * monitor.violation[k, i])
    scalar.in_metres(system.scalar, monitor.violation, monitor.rate)
    instant.in_metres(system.beams, monitor.violation, monitor.rate)
    monitor.rows[row, BALANCE] = balanced(kinetic + potential, state)
    monitor.rows[row, KINETIC] = kinetic
    monitor.rows[row, VIOLATION] = largest_length(monitor.violation)
    monitor.rows[row, VIOLATION_RATE] = largest_length(monitor.rate)
    monitor.rows[row, CONSTRAINT_WORK] = work
    monitor.rows[row, STOP] = forces.margin_of_stops(
        system.forces.signals, start.forces, system.scalar
    )
    record_bodies(system, state, start, h, monitor, row)


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
    """Return the energy balance [J] of the prepared state; sets ``violation`` and ``rate``."""
    kinetic, potential = evaluate.observe(system, state, start, violation, rate)
    return balanced(kinetic + potential, state)


@kernel
def record_bodies(
    system: System, state: State, start: SystemWorkspace, h: float, monitor: Monitor, row: int
) -> None:
    """Record speed, rotation per step, distance, displacement and local error, each the largest of
    all bodies.
    """
    speed, rotation, distance, displacement, local = 0.0, 0.0, 0.0, 0.0, 0.0
    for b in range(moving_count(system.frames)):
        v, W, x = at(start.frames.v, b), at(start.frames.W, b), at(state.x, b)
        a, alpha = at(state.a_trend[0], b), at(state.alpha_trend[0], b)
        length = system.frames.length[b]
        spin = math.sqrt(dot(W, W))
        angle = h * spin
        bend = math.sqrt(dot(a, a)) + length * math.sqrt(dot(alpha, alpha))
        speed = max(speed, math.sqrt(dot(v, v)) + length * spin)
        rotation = max(rotation, angle)
        distance = max(distance, dot(x, x))
        gone = sub(x, at(monitor.began, b))
        displacement = max(displacement, dot(gone, gone))
        local = max(local, h * h * bend + length * angle * angle * angle)
    monitor.rows[row, SPEED] = speed
    monitor.rows[row, ROTATION] = rotation
    monitor.rows[row, DISTANCE] = math.sqrt(distance)
    monitor.rows[row, DISPLACEMENT] = math.sqrt(displacement)
    monitor.rows[row, LOCAL] = local / 12.0


@kernel
def largest_length(vectors: np.ndarray) -> float:
    """Length of the longest of ``vectors`` (k, 3)."""
    square = 0.0
    for k in range(vectors.shape[0]):
        square = max(square, vectors[k, 0] ** 2 + vectors[k, 1] ** 2 + vectors[k, 2] ** 2)
    return math.sqrt(square)
