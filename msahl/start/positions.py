"""Find consistent positions: close joints that are given approximately, by Newton's method.

    G (u, Q) = -g ,   smallest by mass              repeated until the violations g are round-off

The change of every body is reported. Rotations are rotation increments: exact for any size.

Joints of a deck in decimal numbers are open by the digits that these omit, some 1e-12 m. That is
closed in silence: the first step would close it by speeds and works that grow as the step becomes
shorter, and where nothing else moves these are all there is.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, from_increment
from msahl.algebra.vector import at
from msahl.elements.beams import instant
from msahl.elements.constraints import scalar
from msahl.formulations.absolute.frames import (
    first_multiplier,
    frame_count,
    moving_count,
    rotation_increment,
)
from msahl.jit.by_size import by_size
from msahl.start.velocities import StartError, solve_at_rest
from msahl.system import evaluate
from msahl.system.arrays import State, System, new_system_workspace, node_count
from msahl.system.reductions import all_unknowns
from msahl.system.state import set_strains
from msahl.system.unknowns import choose
from msahl.system.work_arrays import size_of

MAX_ITERATIONS = 50
CLOSED = 1e-13
"""Constraint violation, relative to the largest length, that counts as closed."""
ROUNDED = 1e-9
"""Constraint violation, likewise, that is that of the digits that a deck omits."""


class Assembled(NamedTuple):
    """Largest violation as given [m], displacement [m] and rotation [rad] of every body."""

    violation: float
    displacements: np.ndarray  # (n,)
    rotations: np.ndarray  # (n,)


def assemble(system: System, state: State) -> Assembled:
    """Change ``state.x`` and ``state.p`` until all constraints are satisfied, or raise
    ``StartError``.
    """
    frames = system.frames
    n = moving_count(frames)
    unknowns = choose(system, all_unknowns(system))
    x0, p0 = state.x.copy(), state.p.copy()
    length = _length(system, state)
    given = violation = _largest_violation(system, state)
    for _ in range(MAX_ITERATIONS):
        if violation <= CLOSED * length:
            break
        rows = np.zeros((node_count(system), 3))
        rows[first_multiplier(frames) :] = -_violations(system, state)
        step = solve_at_rest(system, state, rows, unknowns)
        state.x[:] += step[frames.displacement]
        for b in range(frame_count(frames)):
            Q = rotation_increment(frames, step, b)
            state.p[b] = compose(from_increment(Q), at(state.p, b))
        violation = _largest_violation(system, state)
    if not violation <= 1e3 * CLOSED * length:
        raise StartError(
            f"the joints cannot be closed: {violation:.3g} m of {given:.3g} m remain; give "
            "positions nearer to closed joints, or check lengths and axes"
        )
    set_strains(system, state)
    rotations = [_rotation(at(p0, b), at(state.p, b)) for b in range(n)]
    return Assembled(given, np.linalg.norm(state.x - x0, axis=1)[:n], np.array(rotations))


def close_rounded(system: System, state: State) -> None:
    """Close joints that are open by rounded numbers alone; others, and those that cannot be closed,
    stay as they are.
    """
    given, length = _largest_violation(system, state), _length(system, state)
    if not CLOSED * length < given <= ROUNDED * length:
        return
    x, p = state.x.copy(), state.p.copy()
    try:
        assemble(system, state)
    except StartError:
        state.x[:], state.p[:] = x, p
        set_strains(system, state)


def _length(system: System, state: State) -> float:
    """Largest length of the model [m]."""
    return max(float(system.frames.length.max()), float(np.abs(state.x).max()))


def _violations(system: System, state: State) -> np.ndarray:
    """(k, 3) constraint violations [m], those in radians times a length."""
    start, size = new_system_workspace(system, state), size_of(system)
    by_size(evaluate.prepare, size)(system, state, start)
    violation, rate = np.zeros_like(state.violation), np.zeros_like(state.violation)
    by_size(evaluate.observe, size)(system, state, start, violation, rate)
    scalar.in_metres(system.scalar, violation, rate)
    instant.in_metres(system.beams, violation, rate)
    return violation


def _largest_violation(system: System, state: State) -> float:
    return float(np.linalg.norm(_violations(system, state), axis=1).max(initial=0.0))


def _rotation(p0: tuple[float, float, float], p1: tuple[float, float, float]) -> float:
    """Angle [rad] between two orientations."""
    c = compose((-p0[0], -p0[1], -p0[2]), p1)
    return float(4.0 * np.arctan(0.25 * np.linalg.norm(c)))
