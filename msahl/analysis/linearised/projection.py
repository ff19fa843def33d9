"""Makes a changed state satisfy all constraints: places by Newton's method, then velocities.

The same equations as at the start of a run (``start``); counted angles follow the places, by less
than half a revolution.
"""

import numpy as np

from msahl.algebra.rotation import compose, from_increment, matrix
from msahl.algebra.vector import at
from msahl.analysis.linearised.plain_units import evaluation_size
from msahl.elements.beams import instant
from msahl.elements.constraints import scalar
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.jit.by_size import by_size
from msahl.start.velocities import StartError, solve_at_rest
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace, node_count
from msahl.system.state import set_strains
from msahl.system.unknowns import Unknowns

MOST_ITERATIONS = 30
CLOSED = 1e-13
"""Constraint violation, relative to the largest length, that counts as none."""
ACCEPTED = 1e-10
"""Likewise, of what may remain where round-off prevents less."""


def prepared(system: System, state: State) -> SystemWorkspace:
    """Return what the elements need of a state, with angles counted in ``state.angle``."""
    start = new_system_workspace(system, state)
    by_size(evaluate.prepare, evaluation_size(system))(system, state, start)
    scalar.count_rotations(system.scalar, start.scalar, state.angle)
    return start


def move(system: System, state: State, dq: np.ndarray) -> State:
    """Return the state displaced and rotated by ``dq`` (nodes, 3) [m, rad], rotation vectors to
    second order; velocities along inertial axes stay.
    """
    frames, x, p, w = system.frames, state.x.copy(), state.p.copy(), state.w.copy()
    for f in range(moving_count(frames)):
        W = np.array(matrix(at(p, f))) @ w[f]
        x[f] += dq[frames.displacement[f]]
        p[f] = compose(from_increment(at(dq, int(frames.rotation[f]))), at(p, f))
        w[f] = np.array(matrix(at(p, f))).T @ W
    moved = state._replace(x=x, p=p, w=w, angle=state.angle.copy(), strain=state.strain.copy())
    set_strains(system, moved)
    return moved


def close(system: System, state: State, unknowns: Unknowns, closed: float = CLOSED) -> State:
    """Return the nearest state, by mass, whose places satisfy all constraints to ``closed`` times
    the largest length, or to round-off; or raise ``StartError``.
    """
    first = first_multiplier(system.frames)
    length = max(float(system.frames.length.max()), float(np.abs(state.x).max()))
    last = np.inf
    for _ in range(MOST_ITERATIONS):
        violation = _violations(system, state)
        largest = float(np.abs(violation).max(initial=0.0))
        if largest <= closed * length or (largest <= ACCEPTED * length and largest >= 0.5 * last):
            return state
        last = largest
        rows = np.zeros((node_count(system), 3))
        rows[first:] = -violation
        step = solve_at_rest(system, state, rows, unknowns)
        step[system.frames.rotation] /= system.frames.length[:, None]
        state = move(system, state, step)
    raise StartError(f"the joints cannot be closed: {last:.3g} m remain")


def _violations(system: System, state: State) -> np.ndarray:
    """(k, 3) constraint violations [m], those in radians times a length."""
    start = prepared(system, state)
    violation, rate = np.zeros_like(state.violation), np.zeros_like(state.violation)
    by_size(evaluate.observe, evaluation_size(system))(system, state, start, violation, rate)
    scalar.in_metres(system.scalar, violation, rate)
    instant.in_metres(system.beams, violation, rate)
    return violation
